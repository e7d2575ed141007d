"""Write the deck of LIGGGHTS-PUBLIC 3.8: spheres or multispheres in a mesh."""

import math

from repose.dem.constants import COHESION_ENERGY_DENSITY
from repose.dem.laws.epsd import ETA
from repose.export.decks import fill_template, head, numbers
from repose.export.job import Job
from repose.export.laws import equivalent_restitution, rolling_coefficient
from repose.export.surface import AROUND, stl

# LIGGGHTS refuses a coefficient of restitution of 0.05 and less.
LEAST_RESTITUTION = 0.0501
# Its models of the rolling laws that it does not have by the same name.
ROLLING_MODELS = {"budget": "epsd2", "constant_torque": "cdt"}
# Angle below which faces of the mesh count as one, over that between two facets.
FOLD_SHARE = 1.1


def deck(job: Job) -> dict[str, str]:
    """Write the input files of LIGGGHTS: in.pour, funnel.stl and clump.txt.

    The result maps the names of the files to their texts. A single sphere needs no
    clump.txt.
    """
    simulation = job.simulation
    spheres_m = job.particle.spheres_m
    has_cohesion = simulation.contact_law == "sjkr"
    rolling_law = simulation.rolling_law
    model = f"rolling_friction {ROLLING_MODELS.get(rolling_law, rolling_law)}"
    if has_cohesion:
        model = f"cohesion sjkr {model}"

    # The names of the numbers of a contact end with the name of the pair.
    pair_values: dict[str, object] = {}
    for name, pair in job.pairs.items():
        pair_values[f"e_{name}"] = equivalent_restitution(pair, LEAST_RESTITUTION)
        pair_values[f"mur_{name}"] = rolling_coefficient(job, pair)
        if has_cohesion:
            pair_values[f"k_{name}"] = pair.constants[COHESION_ENERGY_DENSITY.name]

    text = fill_template(
        "liggghts.in.jinja",
        job,
        head=head(job, _notes(job)),
        seed=prime(job.seed),
        model=model,
        sjkr=has_cohesion,
        epsd=rolling_law == "epsd",
        eta=ETA,
        limit_force="off" if simulation.tension == "keep" else "on",
        fold=FOLD_SHARE * 360.0 / AROUND,
        n_spheres=len(spheres_m),
        **pair_values,
    )
    files = {"in.pour": text, "funnel.stl": stl(job.surfaces)}
    if not job.is_sphere:
        files["clump.txt"] = "".join(f"{numbers(sphere)}\n" for sphere in spheres_m)
    return files


def _notes(job: Job) -> list[str]:
    """List how LIGGGHTS differs from the study."""
    notes = []
    if job.simulation.contact_law != "hertz_mindlin":
        notes.append(
            "a tangential force grows and falls with the normal load; in the study it "
            "stays on loading and falls on unloading"
        )
    if job.simulation.tension == "release":
        notes.append(
            "coefficientRestitution is the number that gives the study's damping; with "
            "limitForce an impact then ends with the restitution calibrated"
        )
    for bodies, pair in (("grains", job.grains), ("grain and wall", job.on_wall)):
        if equivalent_restitution(pair, LEAST_RESTITUTION) == LEAST_RESTITUTION:
            notes.append(
                f"{bodies}: the study's damping is stronger than coefficientRestitution "
                f"{LEAST_RESTITUTION:g} gives, the least that LIGGGHTS takes"
            )
    return notes


def prime(seed: int) -> int:
    """Find a prime above 10000, as LIGGGHTS needs for its random numbers.

    It is different for each seed, 0 or more.
    """
    number = 20001 + 200 * seed
    while any(number % k == 0 for k in range(3, math.isqrt(number) + 1, 2)):
        number += 2
    return number
