"""The driver of MercuryDPM: spheres or rigid clumps among triangles and a plane.

It follows the interfaces of MercuryDPM's clump drivers, and has neither been compiled nor run here.
"""

from repose.export.job import Job
from repose.export.laws import equivalent_restitution, rolling_coefficient
from repose.export.surface import stl
from repose.export.template import filled, head, numbers

# Its rolling lever is twice the effective radius, its tangential stiffness two thirds of 8 G* sqrt(R* delta).
LEVER = 2.0
TANGENTIAL = 2.0 / 3.0


def deck(job: Job) -> dict[str, str]:
    """Write the files of a MercuryDPM driver by name: Pour.cpp, funnel.stl."""
    spheres = "".join(
        f"    {{{numbers(sphere, ', ')}}},\n" for sphere in job.particle.spheres_m
    )
    values: dict[str, object] = {
        "spheres": spheres,
        "head": head(job, "// ", "mercurydpm"),
    }
    for name, pair in job.pairs.items():
        values |= {
            f"young_{name}": pair.effective_young_pa,
            f"shear_{name}": pair.effective_shear_pa / TANGENTIAL,
            f"e_{name}": equivalent_restitution(pair, 1e-6),
            f"mur_{name}": rolling_coefficient(job, pair) / LEVER,
            f"stiffness_{name}": pair.tangential_stiffness_n_m / LEVER**2,
        }
    return {
        "Pour.cpp": filled("mercurydpm.cpp.txt", job, **values),
        "funnel.stl": stl(job.surfaces),
    }
