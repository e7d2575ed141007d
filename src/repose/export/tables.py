"""Tables of the entries for EDEM and Rocky, programs with windows.

The names of the fields are from memory: no manual was at hand, and neither program was run.
"""

from collections.abc import Iterable

from repose.dem.constants import SURFACE_ENERGY
from repose.export.job import Job
from repose.export.surface import stl

Row = tuple[str, str, str]


def edem(job: Job) -> dict[str, str]:
    """The entries for EDEM by file name: edem.md, spheres.csv, funnel.stl."""
    rolling = "Creator > Physics > Particle to Particle, and Particle to Geometry"
    rows: list[Row] = [
        *_materials(job, "Creator > Bulk Material", "Creator > Equipment Material"),
        *_pairs(job, "Creator > Interactions", "Coefficient of Rolling Friction"),
        (rolling, "base model", "Hertz-Mindlin with JKR" if job.contact_law == "jkr" else "Hertz-Mindlin (no slip)"),
        *_adhesion(job, "Creator > Interactions"),
        (rolling, "rolling friction model", "Standard Rolling Friction (Type A)"),
        ("Creator > Bulk Material > Particle", "spheres", "import spheres.csv: x, y, z, radius in m"),
        *_body(job, "Creator > Bulk Material > Particle > Properties, not calculated from the spheres"),
        *_scene(job, "Creator > Geometries", "Creator > Geometries > Factory (dynamic)"),
        ("Creator > Environment", "gravity", f"0, 0, -{job.gravity_m_s2:.9g} m/s2"),
        (
            "Simulator > Time Step",
            "fixed time step",
            f"{job.time_step_s:g} s, {100 * job.time_step_s / job.rayleigh_s:.1f} % of the Rayleigh time of its "
            "smallest sphere",
        ),
    ]
    notes = [
        "its rolling friction has the lever from the contact to the centre of mass, as the study's: the coefficients "
        "are typed as they are",
        *(
            []
            if job.tension == "keep"
            else [
                "its damped force may pull at the end of an impact; in the study it never pulls, and is damped so that "
                "the restitution is as set"
            ]
        ),
        *([] if job.is_sphere else ["each pair of spheres is damped by itself"]),
        *job.notes,
    ]
    spheres = "x,y,z,radius\n" + "".join(",".join(f"{v:.9g}" for v in sphere) + "\n" for sphere in job.spheres_m)
    return {"edem.md": _page("EDEM", job, rows, notes), "spheres.csv": spheres, "funnel.stl": stl(job.funnel)}


def rocky(job: Job) -> dict[str, str]:
    """The entries for Rocky by file name: rocky.md, funnel.stl."""
    rows: list[Row] = [
        *_materials(job, "Materials > the grain's", "Materials > the wall's"),
        *_pairs(job, "Materials Interactions", None),
        ("Physics > Momentum", "Normal Force", "Hertzian Spring Dashpot"),
        ("Physics > Momentum", "Tangential Force", "Mindlin-Deresiewicz"),
        ("Physics > Momentum", "Rolling Resistance Model", "Type 1: Constant Moment"),
        ("Particles > Movement", "Rolling Resistance", f"{job.grains.rolling_friction:.6g}"),
        (
            ("Particles > Shape", "Sphere", f"diameter {2e3 * job.mean_radius_m:.6g} mm")
            if job.is_sphere
            else ("Particles > Shape", "Custom Polyhedron", "import the study's berry/berry.stl, in mm")
        ),
        ("Particles > Size", "mass of a grain, to compare", f"{1e3 * job.mass_kg:.6g} g"),
        *_scene(job, "Geometries", "Inputs > Particle Inlet"),
        ("Physics > Gravity", "Z", f"-{job.gravity_m_s2:.9g} m/s2"),
        ("Solver > Time", "time step, largest", f"{job.time_step_s:g} s"),
    ]
    notes = [
        *(
            []
            if job.is_sphere
            else ["it has polyhedra in place of clumps: take the scan or the mesh of the study, not spheres"]
        ),
        "its rolling resistance belongs to the particle: one number for grain and wall (in the study "
        f"{job.grains.rolling_friction:.4g} between grains, {job.on_wall.rolling_friction:.4g} on the wall)",
        *job.notes,
    ]
    return {"rocky.md": _page("Rocky", job, rows, notes), "funnel.stl": stl(job.funnel)}


def _materials(job: Job, grain: str, wall: str) -> Iterable[Row]:
    """Moduli and density."""
    yield grain, "Solids Density", f"{job.density_kg_m3:.6g} kg/m3"
    for where, material in ((grain, job.grain), (wall, job.wall)):
        yield where, "Poisson's Ratio", f"{material.poisson_ratio:.6g}"
        yield where, "Young's Modulus", f"{material.elastic_modulus_pa:.6g} Pa"
        yield where, "or Shear Modulus", f"{material.shear_modulus_pa:.6g} Pa"


def _pairs(job: Job, where: str, rolling: str | None) -> Iterable[Row]:
    """Coefficients of the two pairs."""
    for name, pair in (("grain : grain", job.grains), ("grain : wall", job.on_wall)):
        place = f"{where} > {name}"
        yield place, "Coefficient of Restitution", f"{pair.restitution:.6g}"
        yield place, "Coefficient of Static Friction, and of dynamic if asked", f"{pair.static_friction:.6g}"
        if rolling:
            yield place, rolling, f"{pair.rolling_friction:.6g}"


def _adhesion(job: Job, where: str) -> Iterable[Row]:
    """Surface energy of EDEM's JKR: the work of adhesion, with a pull-off force of 3/2 pi R* times it."""
    if job.contact_law == "jkr":
        for name, pair in (("grain : grain", job.grains), ("grain : wall", job.on_wall)):
            energy = 2.0 * pair.constants[SURFACE_ENERGY.name]
            yield f"{where} > {name}", "Surface Energy (w, twice the study's gamma)", f"{energy:.6g} J/m2"


def _body(job: Job, where: str) -> Iterable[Row]:
    """Mass and inertia."""
    yield where, "Mass", f"{job.mass_kg:.6g} kg"
    yield where, "Volume", f"{job.volume_m3:.6g} m3"
    for axis, value in zip("XYZ", job.inertia_kg_m2, strict=True):
        yield where, f"Moment of Inertia {axis}", f"{value:.6g} kg m2"


def _scene(job: Job, geometry: str, factory: str) -> Iterable[Row]:
    """Funnel, plate, factory."""
    yield geometry, "funnel", "import funnel.stl, in m"
    yield geometry, "plate", f"plane z = 0, radius {job.plate_radius_m:g} m"
    yield factory, "place", f"disc of radius {job.factory_radius_m:.4g} m at z = {job.factory_height_m:.4g} m"
    yield (factory, "number, rate", f"{job.count} grains, {job.rate_per_s:g} a second, at rest, turned at random")


def _page(program: str, job: Job, rows: Iterable[Row], notes: Iterable[str]) -> str:
    """The page of a program."""
    head = f"# `{job.label}` in {program}: a table that nobody has tried there"
    lines = [head, "", "| where | field | value |", "|---|---|---|"]
    lines += [f"| {where} | {field} | {value} |" for where, field, value in rows]
    lines += ["", "Not as in the study:", ""]
    return "\n".join([*lines, *(f"- {note}" for note in notes), ""])
