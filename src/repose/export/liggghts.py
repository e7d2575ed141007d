"""Make the input files of LIGGGHTS-PUBLIC 3.8, with spheres or multispheres in a mesh.

The funnel is a mesh of triangles.
"""

import math

from repose.dem.constants import COHESION_ENERGY_DENSITY
from repose.dem.laws.epsd import ETA
from repose.export.decks import fill_template, format_head, join_numbers
from repose.export.job import Job
from repose.export.laws import (
    compute_equivalent_restitution,
    compute_rolling_coefficient,
)
from repose.export.surface import N_FACETS, write_stl

# LIGGGHTS refuses a coefficient of restitution of 0.05 or less.
MIN_RESTITUTION = 0.0501
# Rolling models of LIGGGHTS for laws that have another name in the study.
ROLLING_MODELS = {"budget": "epsd2", "constant_torque": "cdt"}
# LIGGGHTS treats two faces as one if the angle between them is below a limit. This
# limit is set to this factor times the angle between neighbouring facets of the funnel.
FOLD_FRACTION = 1.1


def make_deck(job: Job) -> dict[str, str]:
    """Make the input files of a LIGGGHTS run: in.pour, funnel.stl and clump.txt.

    The keywords of `fill_template` are the names that the template liggghts.in.jinja
    uses, so both must be changed together.

    Parameters
    ----------
    job : Job
        The grain and its pour.

    Returns
    -------
    dict
        The contents of the files by name. A single sphere needs no clump.txt.
    """
    simulation = job.simulation
    spheres_m = job.particle.spheres_m

    # Express the contact laws in the keywords of LIGGGHTS. Laws without an entry in
    # `ROLLING_MODELS` have the same name in LIGGGHTS.
    has_cohesion = simulation.contact_law == "sjkr"
    rolling_law = simulation.rolling_law
    model = f"rolling_friction {ROLLING_MODELS.get(rolling_law, rolling_law)}"
    if has_cohesion:
        model = f"cohesion sjkr {model}"

    # The names of the numbers end in gg for contacts between grains, and in gp for
    # contacts between grain and wall.
    pair_values: dict[str, object] = {}
    for name, pair in job.pairs.items():
        pair_values[f"e_{name}"] = compute_equivalent_restitution(pair, MIN_RESTITUTION)
        pair_values[f"mur_{name}"] = compute_rolling_coefficient(job, pair)
        if has_cohesion:
            pair_values[f"k_{name}"] = pair.constants[COHESION_ENERGY_DENSITY.name]

    text = fill_template(
        "liggghts.in.jinja",
        job,
        head=format_head(job, _list_differences(job)),
        seed=find_prime(job.seed),
        model=model,
        sjkr=has_cohesion,
        # `ETA` is the damping of the rolling law "epsd".
        epsd=rolling_law == "epsd",
        eta=ETA,
        # With limitForce, the damped normal force never pulls. In a study with the
        # tension "keep", it may pull.
        limit_force="off" if simulation.tension == "keep" else "on",
        fold=FOLD_FRACTION * 360.0 / N_FACETS,
        n_spheres=len(spheres_m),
        **pair_values,
    )
    # The main file must come first, because `write_template` relies on it.
    files = {"in.pour": text, "funnel.stl": write_stl(job.surfaces)}
    if not job.is_sphere:
        files["clump.txt"] = "".join(
            f"{join_numbers(sphere)}\n" for sphere in spheres_m
        )
    return files


def _list_differences(job: Job) -> list[str]:
    """List the differences between LIGGGHTS and the study.

    Parameters
    ----------
    job : Job
        The grain and its pour.

    Returns
    -------
    list of str
        A description of each difference, without a full stop.
    """
    differences = []
    if job.simulation.contact_law != "hertz_mindlin":
        differences.append(
            "the tangential force grows and falls with the normal force; in the study it "
            "stays as it is while the normal force grows, and falls with it"
        )
    if job.simulation.tension == "release":
        differences.append(
            "coefficientRestitution is not the calibrated restitution, but the number "
            "that gives the study's damping; together with limitForce, an impact has the "
            "calibrated restitution"
        )
    for bodies, pair in (("grains", job.grains), ("grain and wall", job.on_wall)):
        # The function returns exactly the minimum if the damping needs a smaller
        # number.
        if compute_equivalent_restitution(pair, MIN_RESTITUTION) == MIN_RESTITUTION:
            differences.append(
                f"{bodies}: the study's damping is stronger than coefficientRestitution "
                f"{MIN_RESTITUTION:g} gives, the minimum that LIGGGHTS accepts"
            )
    return differences


def find_prime(seed: int) -> int:
    """Find the prime number with which LIGGGHTS seeds its random numbers.

    LIGGGHTS requires a prime above 10000. Each seed of the study gives a different
    prime.

    Parameters
    ----------
    seed : int
        Seed of the study, 0 or more.

    Returns
    -------
    int
        The prime number.
    """
    # The searches for consecutive seeds begin 200 numbers apart, which is more than the
    # largest gap between primes of this size.
    number = 20001 + 200 * seed
    while any(number % k == 0 for k in range(3, math.isqrt(number) + 1, 2)):
        number += 2
    return number
