"""Write a table of values for a user to enter in EDEM, where it has not been tested.

EDEM has no input file that we could write. We know the names of its models from memory.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from repose import dem
from repose.bench.funnel import FunnelSettings
from repose.bench.parameters import PAIRS
from repose.bench.settings import SimulationSettings
from repose.dem.constants import SURFACE_ENERGY
from repose.export.decks import format_number, join_numbers
from repose.export.job import Job
from repose.export.surface import write_stl

if TYPE_CHECKING:
    from repose.grain.particle import Particle

ROLLING_MODEL = "Standard Rolling Friction (Type A)"
CONTACT_MODELS = {"jkr": "Hertz-Mindlin with JKR"}
DEFAULT_CONTACT_MODEL = "Hertz-Mindlin (no slip)"


class Row(NamedTuple):
    """A row of the table: a value to enter, its name and its unit."""

    name: str
    value: float
    unit: str = ""


def list_table_rows(
    materials: Mapping[str, dem.Material],
    parameters: Mapping[str, float],
    particle: "Particle",
    simulation: SimulationSettings,
    funnel: FunnelSettings,
    time_step_s: float,
) -> list[Row]:
    """List the values that EDEM needs for a grain and its pour.

    Parameters
    ----------
    materials : mapping
        The materials ``berry`` and ``wall``, from `repose.bench.scene.materials_of`.
    parameters : mapping
        Contact parameters by name.
    particle : Particle
        The grain.
    simulation : SimulationSettings
        Gravity and contact law.
    funnel : FunnelSettings
        The pour.
    time_step_s : float
        The time step.

    Returns
    -------
    list of Row
        The rows of the table.
    """
    return [
        *_list_materials(materials, particle),
        *_list_contacts(parameters, simulation),
        *_list_grain(particle),
        *_list_pour(funnel, particle),
        Row("Gravity, along -z", simulation.gravity_m_s2, "m/s2"),
        Row("Fixed time step", time_step_s, "s"),
    ]


def _list_materials(
    materials: Mapping[str, dem.Material], particle: "Particle"
) -> list[Row]:
    """List the density of the grain, and the elastic constants of grain and wall.

    Parameters
    ----------
    materials : mapping
        The materials ``berry`` and ``wall``.
    particle : Particle
        The grain.
    """
    table = [Row("Solids density, grain", particle.density_kg_m3, "kg/m3")]
    for key, name in (("berry", "grain"), ("wall", "wall")):
        material = materials[key]
        table += [
            Row(f"Poisson's ratio, {name}", material.poisson_ratio),
            Row(f"Young's modulus, {name}", material.elastic_modulus_pa, "Pa"),
            Row(f"Shear modulus, {name}", material.shear_modulus_pa, "Pa"),
        ]
    return table


def _list_contacts(
    parameters: Mapping[str, float], simulation: SimulationSettings
) -> list[Row]:
    """List the coefficients of contacts between grains, and between grain and wall.

    Parameters
    ----------
    parameters : mapping
        Coefficients by name. A name ends with its pair: `e_gg` is the restitution
        between two grains, `e_gp` that between grain and wall.
    simulation : SimulationSettings
        The contact law, which may need a surface energy.

    Returns
    -------
    list of Row
        The rows of both kinds of contact.
    """
    rows = []
    for pair, name in PAIRS.items():
        rows += [
            Row(f"Coefficient of restitution, {name}", parameters[f"e_{pair}"]),
            Row(f"Coefficient of static friction, {name}", parameters[f"mus_{pair}"]),
            Row(f"Coefficient of rolling friction, {name}", parameters[f"mur_{pair}"]),
        ]
        if simulation.contact_law == "jkr":
            # The parameter of the study is the energy of each of the two surfaces. That
            # of EDEM is the work of adhesion, the energy of both surfaces together: its
            # pull-off force is 3/2 pi R* times this work.
            work_of_adhesion = 2.0 * parameters[f"{SURFACE_ENERGY.short}_{pair}"]
            unit = SURFACE_ENERGY.unit
            rows.append(Row(f"Surface energy, {name}", work_of_adhesion, unit))
    return rows


def _list_grain(particle: "Particle") -> list[Row]:
    """List the mass, the volume and the moments of inertia of the grain.

    EDEM cannot compute them correctly, because the grain's spheres overlap.
    """
    table = [
        Row("Mass of a grain", particle.mass_kg, "kg"),
        Row("Volume of a grain", particle.volume_m3, "m3"),
    ]
    for axis, moment in zip("XYZ", particle.inertia_kg_m2.tolist(), strict=True):
        table.append(Row(f"Moment of inertia {axis}", moment, "kg m2"))
    return table


def _list_pour(funnel: FunnelSettings, particle: "Particle") -> list[Row]:
    """List the size of the plate, and where, how often and how many grains appear."""
    # The settings are in mm, and the table is in m. The centres of the grains appear in
    # a disc that is smaller than the factory, so that whole grains are inside the
    # factory.
    factory_radius = 0.5e-3 * funnel.factory_diameter_mm - particle.bounding_radius_m
    factory_height = funnel.funnel.inlet_height_m + 1e-3 * funnel.factory_height_mm
    return [
        Row("Radius of the plate, at z = 0", 0.5e-3 * funnel.plate_diameter_mm, "m"),
        Row("Radius of the factory, a disc", factory_radius, "m"),
        Row("Height of the factory", factory_height, "m"),
        Row("Number of grains", funnel.berries),
        Row("Grains per second", funnel.rate_per_s, "1/s"),
    ]


def make_deck(job: Job) -> dict[str, str]:
    """Make the contents of edem.md, spheres.csv and funnel.stl, by name of the file."""
    materials = {"berry": job.grain, "wall": job.wall}
    table = list_table_rows(
        materials=materials,
        parameters=job.parameters,
        particle=job.particle,
        simulation=job.simulation,
        funnel=job.funnel,
        time_step_s=job.time_step_s,
    )
    spheres = ["x,y,z,radius"]
    spheres += [join_numbers(sphere, ",") for sphere in job.particle.spheres_m]
    return {
        "edem.md": _format_page(job, table),
        "spheres.csv": "".join(f"{line}\n" for line in spheres),
        "funnel.stl": write_stl(job.surfaces),
    }


def _format_page(job: Job, table: list[Row]) -> str:
    """Write the page edem.md as Markdown.

    The page names the models to choose and the files to import. It also contains the
    table of values and a list of the differences from the study. The values have six
    digits, not four as texts for readers, because they are the input of a simulation.
    """
    law = job.simulation.contact_law
    contact_model = CONTACT_MODELS.get(law, DEFAULT_CONTACT_MODEL)
    percent_of_rayleigh = 100 * job.time_step_s / job.rayleigh_s
    lines = [
        f"# `{job.label}` in EDEM: a table that nobody has tried there",
        "",
        f"Contact model: {contact_model}. Rolling friction model: {ROLLING_MODEL}. The "
        "spheres of a grain are in spheres.csv, the funnel is in funnel.stl, both in m. "
        "Grains appear at rest, in random orientations. The time step is "
        f"{percent_of_rayleigh:.0f} % of the Rayleigh time of the smallest sphere.",
        "",
        "| name | value | unit |",
        "|---|---|---|",
        *(
            f"| {row.name} | {format_number(row.value, 6)} | {row.unit} |"
            for row in table
        ),
        "",
        "Differences from the study:",
        "",
        *(f"- {note}" for note in (*_list_differences(job), *job.notes)),
    ]
    return "\n".join([*lines, ""])


def _list_differences(job: Job) -> list[str]:
    """List the differences between EDEM and the study."""
    differences = [
        "the lever arm of the rolling friction is the same as in the study, from the "
        "contact to the centre of mass: the coefficients are entered as they are"
    ]
    if job.simulation.tension == "release":
        differences.append(
            "the damped normal force may pull at the end of an impact; in the study it "
            "never pulls, and is damped so that the restitution is as set"
        )
    if not job.is_sphere:
        differences.append("each pair of spheres is damped by itself")
    return differences
