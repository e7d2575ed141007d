"""The driver of MercuryDPM: spheres or rigid clumps among triangles and a plane.

It follows the interfaces of MercuryDPM's clump drivers, and has neither been compiled nor run here.
"""

from repose.export.job import Job
from repose.export.laws import (
    damped_alone,
    equivalent_restitution,
    limited_friction,
    rolled,
    rolling_coefficient,
    undamped_tangent,
)
from repose.export.surface import stl
from repose.export.template import filled

# Its rolling lever is twice the effective radius, its tangential stiffness two thirds of 8 G* sqrt(R* delta).
LEVER = 2.0
TANGENTIAL = 2.0 / 3.0


def deck(job: Job) -> dict[str, str]:
    """The files of a MercuryDPM driver by name: Pour.cpp, funnel.stl."""
    pairs = {"gg": job.grains, "gp": job.on_wall}
    numbers: dict[str, float] = {}
    for name, pair in pairs.items():
        numbers |= {
            f"young_{name}": pair.effective_young_pa,
            f"shear_{name}": pair.effective_shear_pa / TANGENTIAL,
            f"e_{name}": equivalent_restitution(pair, 1e-6),
            f"mur_{name}": rolling_coefficient(job, pair) / LEVER,
            f"stiffness_{name}": pair.tangential_stiffness_n_m / LEVER**2,
        }
    text = filled(
        "mercurydpm.cpp.txt",
        job,
        "// ",
        _differences(job),
        spheres="".join("    {" + ", ".join(f"{value:.9g}" for value in sphere) + "},\n" for sphere in job.spheres_m),
        duration=float(job.duration_s),
        seed=job.seed,
        **numbers,
    )
    return {"Pour.cpp": text, "funnel.stl": stl(job.funnel)}


def _differences(job: Job) -> list[str]:
    """List the differences between MercuryDPM and this engine, and features that were not tried."""
    lines = [
        "this driver was neither compiled nor run by those who wrote it",
        rolled(job),
        *damped_alone(job),
        undamped_tangent(),
        *limited_friction(job),
    ]
    if not job.is_sphere:
        lines.append("grains turn by three random angles, so not all orientations are alike")
    if job.tension != "keep":
        lines.append("the damped force may pull at the end of an impact; the damping is that of the study")
    return lines
