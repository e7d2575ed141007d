"""The deck of LIGGGHTS-PUBLIC 3.8: spheres or multispheres among a mesh and a plane."""

import math

from repose.dem.constants import COHESION_ENERGY_DENSITY
from repose.dem.laws.epsd import ETA
from repose.export.job import Job
from repose.export.laws import (
    damped_alone,
    equivalent_restitution,
    limited_friction,
    rolled,
    rolling_coefficient,
    undamped_tangent,
)
from repose.export.surface import AROUND, stl
from repose.export.template import filled

# LIGGGHTS refuses a coefficient of restitution of 0.05 and less.
LEAST_RESTITUTION = 0.0501
ROLLING_MODELS = {"budget": "epsd2", "constant_torque": "cdt", "epsd": "epsd", "epsd2": "epsd2"}


def deck(job: Job) -> dict[str, str]:
    """The files of a LIGGGHTS run by name: in.pour, funnel.stl, and clump.txt of a clump."""
    text = filled(
        "liggghts.in",
        job,
        "# ",
        _differences(job),
        seed=prime(job.seed),
        e_gg=equivalent_restitution(job.grains, LEAST_RESTITUTION),
        e_gp=equivalent_restitution(job.on_wall, LEAST_RESTITUTION),
        mur_gg=rolling_coefficient(job, job.grains),
        mur_gp=rolling_coefficient(job, job.on_wall),
        cohesion=_cohesion(job),
        model=("cohesion sjkr " if job.contact_law == "sjkr" else "")
        + f"rolling_friction {ROLLING_MODELS[job.rolling_law]}",
        fold=1.1 * 360.0 / AROUND,
        limit_force="off" if job.tension == "keep" else "on",
        spheres=len(job.spheres_m),
        rate=float(job.rate_per_s),
    )
    files = {"in.pour": text, "funnel.stl": stl(job.funnel)}
    if not job.is_sphere:
        rows = (" ".join(f"{value:.9g}" for value in sphere) for sphere in job.spheres_m)
        files["clump.txt"] = "".join(row + "\n" for row in rows)
    return files


def _cohesion(job: Job) -> str:
    """Write the properties for the laws of cohesion."""
    lines = []
    if job.contact_law == "sjkr":
        gg, gp = (pair.constants[COHESION_ENERGY_DENSITY.name] for pair in (job.grains, job.on_wall))
        values = f"{gg:.8g} {gp:.8g} {gp:.8g} {gp:.8g}"
        lines.append(f"fix             cohesion all property/global cohesionEnergyDensity peratomtypepair 2 {values}")
    if job.rolling_law == "epsd":
        damping = "fix             rolling_damping all property/global coefficientRollingViscousDamping"
        lines.append(f"{damping} peratomtypepair 2 {' '.join(4 * [f'{ETA:g}'])}")
    return "".join(line + "\n" for line in lines)


def prime(seed: int) -> int:
    """A prime above 10000, as LIGGGHTS needs for its random numbers; different for each seed (0 or more)."""
    number = 20001 + 200 * seed
    while any(number % k == 0 for k in range(3, math.isqrt(number) + 1, 2)):
        number += 2
    return number


def _differences(job: Job) -> list[str]:
    """List the differences between LIGGGHTS and this engine."""
    lines = [rolled(job), *damped_alone(job), undamped_tangent(), *limited_friction(job)]
    if job.tension == "release":
        lines.append(
            "coefficientRestitution is the number that gives the study's damping; with limitForce an impact then "
            "ends with the restitution calibrated"
        )
    for name, pair in (("grains", job.grains), ("grain and wall", job.on_wall)):
        if equivalent_restitution(pair, LEAST_RESTITUTION) == LEAST_RESTITUTION:
            lines.append(
                f"{name}: the study's damping is stronger than coefficientRestitution {LEAST_RESTITUTION:g} gives, "
                "the least that LIGGGHTS takes"
            )
    return lines
