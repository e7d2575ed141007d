"""The deck of LIGGGHTS-PUBLIC 3.8: spheres or multispheres among a mesh and a plane."""

import math

from repose.dem.constants import COHESION_ENERGY_DENSITY
from repose.dem.laws.epsd import ETA
from repose.export.job import Job
from repose.export.laws import equivalent_restitution, rolling_coefficient, unlike_the_study
from repose.export.surface import AROUND, stl
from repose.export.template import filled, head, numbers

# LIGGGHTS refuses a coefficient of restitution of 0.05 and less.
LEAST_RESTITUTION = 0.0501
ROLLING_MODELS = {"budget": "epsd2", "constant_torque": "cdt", "epsd": "epsd", "epsd2": "epsd2"}


def deck(job: Job) -> dict[str, str]:
    """Write the files of a LIGGGHTS run by name: in.pour, funnel.stl, and clump.txt of a clump."""
    simulation, spheres = job.simulation, job.particle.spheres_m
    values = {f"e_{name}": equivalent_restitution(pair, LEAST_RESTITUTION) for name, pair in job.pairs.items()}
    values |= {f"mur_{name}": rolling_coefficient(job, pair) for name, pair in job.pairs.items()}
    words = {
        "head": head(job, "# ", _differences(job)),
        "cohesion": _cohesion(job),
        "model": ("cohesion sjkr " if simulation.contact_law == "sjkr" else "")
        + f"rolling_friction {ROLLING_MODELS[simulation.rolling_law]}",
        "limit_force": "off" if simulation.tension == "keep" else "on",
    }
    whole = {"seed": prime(job.seed), "spheres": len(spheres)}
    text = filled("liggghts.in", job, fold=1.1 * 360.0 / AROUND, **values, **words, **whole)
    files = {"in.pour": text, "funnel.stl": stl(job.surfaces)}
    if not job.is_sphere:
        files["clump.txt"] = "".join(f"{numbers(sphere)}\n" for sphere in spheres)
    return files


def _cohesion(job: Job) -> str:
    """Write the properties for the laws of cohesion."""
    lines = []
    if job.simulation.contact_law == "sjkr":
        gg, gp = (pair.constants[COHESION_ENERGY_DENSITY.name] for pair in job.pairs.values())
        values = f"{gg:.8g} {gp:.8g} {gp:.8g} {gp:.8g}"
        lines.append(f"fix             cohesion all property/global cohesionEnergyDensity peratomtypepair 2 {values}")
    if job.simulation.rolling_law == "epsd":
        damping = "fix             rolling_damping all property/global coefficientRollingViscousDamping"
        lines.append(f"{damping} peratomtypepair 2 {' '.join(4 * [f'{ETA:g}'])}")
    return "".join(line + "\n" for line in lines)


def prime(seed: int) -> int:
    """Find a prime above 10000, as LIGGGHTS needs for its random numbers; different for each seed (0 or more)."""
    number = 20001 + 200 * seed
    while any(number % k == 0 for k in range(3, math.isqrt(number) + 1, 2)):
        number += 2
    return number


def _differences(job: Job) -> list[str]:
    """List the differences between LIGGGHTS and this engine."""
    lines = unlike_the_study(job)
    if job.simulation.tension == "release":
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
