"""Tables that nobody has tried: the entries for EDEM and Rocky, programs with windows.

The names of the fields are from memory: no manual was at hand, and neither program was run.
"""

from repose.dem.constants import SURFACE_ENERGY
from repose.export.job import Job
from repose.export.surface import stl
from repose.export.template import filled, numbers


def edem(job: Job) -> dict[str, str]:
    """Write the entries for EDEM by file name: edem.md, spheres.csv, funnel.stl."""
    # of JKR, the work of adhesion, with a pull-off force of 3/2 pi R* times it
    values = {
        f"energy_{name}": 2.0 * pair.constants.get(SURFACE_ENERGY.name, 0.0)
        for name, pair in job.pairs.items()
    }
    spheres = "x,y,z,radius\n" + "".join(
        f"{numbers(sphere, ',')}\n" for sphere in job.particle.spheres_m
    )
    return {
        "edem.md": filled("edem.md.txt", job, **values),
        "spheres.csv": spheres,
        "funnel.stl": stl(job.surfaces),
    }


def rocky(job: Job) -> dict[str, str]:
    """Write the entries for Rocky by file name: rocky.md, funnel.stl."""
    values = {
        "diameter_mm": 2e3 * job.mean_radius_m,
        "mass_g": 1e3 * job.particle.mass_kg,
    }
    return {
        "rocky.md": filled("rocky.md.txt", job, **values),
        "funnel.stl": stl(job.surfaces),
    }
