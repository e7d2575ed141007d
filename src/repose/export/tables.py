"""Tables that nobody has tried: the entries for EDEM and Rocky, programs with windows.

The names of the fields are from memory: no manual was at hand, and neither program was run.
"""

from repose.dem.constants import SURFACE_ENERGY
from repose.export.job import Job
from repose.export.surface import stl
from repose.export.template import filled, numbers


def edem(job: Job) -> dict[str, str]:
    """Write the entries for EDEM by file name: edem.md, spheres.csv, funnel.stl."""
    notes = [
        "its rolling friction has the lever from the contact to the centre of mass, as the study's: the coefficients "
        "are typed as they are"
    ]
    if job.simulation.tension != "keep":
        notes.append(
            "its damped force may pull at the end of an impact; in the study it never pulls, and is damped so that "
            "the restitution is as set"
        )
    if not job.is_sphere:
        notes.append("each pair of spheres is damped by itself")
    cohesive = job.simulation.contact_law == "jkr"
    values: dict[str, object] = {"rayleigh_percent": 100 * job.time_step_s / job.rayleigh_s}
    values["model"] = "Hertz-Mindlin with JKR" if cohesive else "Hertz-Mindlin (no slip)"
    if cohesive:  # the work of adhesion, with a pull-off force of 3/2 pi R* times it
        values |= {f"energy_{name}": 2.0 * pair.constants[SURFACE_ENERGY.name] for name, pair in job.pairs.items()}
    page = filled("edem.md.txt", job, notes=_notes(job, notes), **values)
    spheres = "x,y,z,radius\n" + "".join(f"{numbers(sphere, ',')}\n" for sphere in job.particle.spheres_m)
    return {"edem.md": page, "spheres.csv": spheres, "funnel.stl": stl(job.surfaces)}


def rocky(job: Job) -> dict[str, str]:
    """Write the entries for Rocky by file name: rocky.md, funnel.stl."""
    notes = [
        "its rolling resistance belongs to the particle: one number for grain and wall (in the study "
        f"{job.grains.rolling_friction:.4g} between grains, {job.on_wall.rolling_friction:.4g} on the wall)"
    ]
    if not job.is_sphere:
        notes.insert(0, "it has polyhedra in place of clumps: take the scan or the mesh of the study, not spheres")
    values = {"diameter_mm": 2e3 * job.mean_radius_m, "mass_g": 1e3 * job.particle.mass_kg}
    page = filled("rocky.md.txt", job, notes=_notes(job, notes), **values)
    return {"rocky.md": page, "funnel.stl": stl(job.surfaces)}


def _notes(job: Job, notes: list[str]) -> str:
    """List the differences from the study."""
    return "\n".join(f"- {note}" for note in (*notes, *job.notes))
