"""The deck of LIGGGHTS-PUBLIC 3.8: spheres or multispheres among a mesh and a plane."""

import math

from repose.dem.constants import COHESION_ENERGY_DENSITY
from repose.dem.laws.epsd import ETA
from repose.export.job import Job
from repose.export.laws import equivalent_restitution, rolling_coefficient
from repose.export.surface import AROUND, stl
from repose.export.template import filled, head, numbers

# LIGGGHTS refuses a coefficient of restitution of 0.05 and less.
LEAST_RESTITUTION = 0.0501
ROLLING_MODELS = {
    "budget": "epsd2",
    "constant_torque": "cdt",
    "epsd": "epsd",
    "epsd2": "epsd2",
}


def deck(job: Job) -> dict[str, str]:
    """Write the files of a LIGGGHTS run by name: in.pour, funnel.stl, and clump.txt of a clump."""
    simulation, spheres = job.simulation, job.particle.spheres_m
    values = {
        f"e_{name}": equivalent_restitution(pair, LEAST_RESTITUTION)
        for name, pair in job.pairs.items()
    }
    strong = (
        f"strong_{name}"
        for name in job.pairs
        if values[f"e_{name}"] == LEAST_RESTITUTION
    )
    words: dict[str, object] = {
        "head": head(job, "# ", "liggghts", *strong, least=LEAST_RESTITUTION)
    }
    cohesion = "cohesion sjkr " if simulation.contact_law == "sjkr" else ""
    words["model"] = (
        f"{cohesion}rolling_friction {ROLLING_MODELS[simulation.rolling_law]}"
    )
    words["limit_force"] = "off" if simulation.tension == "keep" else "on"
    for name, pair in job.pairs.items():
        values[f"mur_{name}"] = rolling_coefficient(job, pair)
        values[f"k_{name}"] = pair.constants.get(COHESION_ENERGY_DENSITY.name, math.nan)
    whole = {"seed": prime(job.seed), "spheres": len(spheres)}
    text = filled(
        "liggghts.in",
        job,
        fold=1.1 * 360.0 / AROUND,
        eta=ETA,
        **values,
        **words,
        **whole,
    )
    files = {"in.pour": text, "funnel.stl": stl(job.surfaces)}
    if not job.is_sphere:
        files["clump.txt"] = "".join(f"{numbers(sphere)}\n" for sphere in spheres)
    return files


def prime(seed: int) -> int:
    """Find a prime above 10000, as LIGGGHTS needs for its random numbers; different for each seed (0 or more)."""
    number = 20001 + 200 * seed
    while any(number % k == 0 for k in range(3, math.isqrt(number) + 1, 2)):
        number += 2
    return number
