"""Compute the restitution that a simulated hit really has at the time step of a study.

The coefficient of restitution, or restitution for short, is the speed after a hit over
the speed before it.

The damping of a contact gives the configured restitution only for an infinitely small
time step. If a contact lasts only a few time steps, the real restitution is smaller.
The difference grows as the restitution becomes lower.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from repose.bench.parameters import PAIRS
from repose.bench.scene import Scene, contacts_of, materials_of
from repose.common.numbers import format_significant

# Contact laws whose hits `compute_returned_restitution` can simulate.
HERTZ_LAWS = ("hertz_mindlin", "hertz_mindlin_rescaled")
# From this restitution on, the real restitution is nearly equal to the configured one.
LOW_RESTITUTION = 0.3
# The gap between the bodies at the start, as a fraction of the distance that they
# approach in a time step. The restitution depends a little on when the hit begins
# within a time step, so the result is averaged over these values.
PHASES = (0.1, 0.3, 0.5, 0.7, 0.9)
# Largest number of time steps for a hit, so that the loop always ends.
MAX_STEPS = 100_000
# Duration of a hit by Hertz's law without damping, times the speed of the impact and
# divided by the largest overlap.
HERTZ_DURATION = 2.943
# The largest overlap of this hit, if mass, speed and stiffness are 1.
HERTZ_OVERLAP = (5 / 4) ** 0.4


def compute_returned_restitution(
    restitution: float, tension: str, steps_per_contact: float
) -> float:
    """Compute the real restitution of a simulated hit of two spheres.

    Parameters
    ----------
    restitution : float
        The configured restitution, above 0, at most 1.
    tension : {"keep", "release"}
        How the contact ends: "keep" lets it pull the bodies together as they part,
        "release" does not (`repose.dem.Simulation`).
    steps_per_contact : float
        Duration of the hit without damping, over the time step.

    Returns
    -------
    float
        Speed after the hit over the speed before it, averaged over `PHASES`.

    Notes
    -----
    The hit is computed in units in which the mass, the speed and the stiffness k of the
    force F = k overlap^1.5 are 1.
    """
    from repose.dem.laws.hertz_mindlin import damping_ratio

    time_step = HERTZ_DURATION * HERTZ_OVERLAP / steps_per_contact
    # The damping force of this law is 2 sqrt(5/6) beta sqrt(stiffness mass) speed,
    # where beta is the damping ratio and the stiffness is that of the tangent.
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio(restitution, tension)
    speeds = [
        _simulate_rebound_speed(
            gap_fraction, time_step=time_step, damping=damping, tension=tension
        )
        for gap_fraction in PHASES
    ]
    return float(np.mean(speeds))


def _simulate_rebound_speed(
    gap_fraction: float, time_step: float, damping: float, tension: str
) -> float:
    """Simulate a hit at speed 1 step by step, and return the speed of the rebound.

    Mass, speed and stiffness are 1, so all numbers are without units.

    Parameters
    ----------
    gap_fraction : float
        Gap between the bodies at the start, as a fraction of the distance that they
        approach in a time step.
    time_step : float
        Time step.
    damping : float
        Damping force, divided by the speed and the square root of the tangent
        stiffness.
    tension : {"keep", "release"}
        With "keep" the contact may pull the bodies together as they part. With
        "release" it may not.

    Returns
    -------
    float
        The speed, positive if the bodies part. Because they start at speed 1, it equals
        the restitution of this hit. If they have not parted after `MAX_STEPS`, it is
        their speed at this time.
    """
    # A negative overlap is a gap.
    overlap = -gap_fraction * time_step
    approach_speed = 1.0
    for _ in range(MAX_STEPS):
        force = 0.0
        if overlap > 0.0:
            # The tangent stiffness is the derivative of the elastic force overlap^1.5.
            stiffness = 1.5 * math.sqrt(overlap)
            force = overlap**1.5 + damping * math.sqrt(stiffness) * approach_speed
            if tension == "release":
                force = max(force, 0.0)
        # Integrate as the engine does: first the speed, then the overlap with the new
        # speed.
        approach_speed -= force * time_step
        overlap += approach_speed * time_step
        has_parted = approach_speed < 0.0 and overlap < 0.0
        if has_parted:
            break
    return -approach_speed


def describe_low_restitutions(
    scene: Scene, lowest_values: Mapping[str, float]
) -> Iterator[str]:
    """Describe by how much simulated hits fall short of a low configured restitution.

    The time step shortens the rebound, which matters for restitutions below
    `LOW_RESTITUTION`. The sentence states the restitution that a simulated hit really
    has.

    Parameters
    ----------
    scene : Scene
        Grain, laws and time step.
    lowest_values : mapping
        Lowest value of each parameter in the study. The restitutions between two grains
        and between grain and wall, ``e_gg`` and ``e_gp``, are among them.

    Yields
    ------
    str
        At most one sentence. Nothing is yielded if all restitutions are higher, or if
        the contact law is not one of `HERTZ_LAWS`.
    """
    from repose.dem.time_steps import FASTEST_IMPACT_M_S

    settings = scene.simulation
    descriptions = []
    for pair in PAIRS:
        name = f"e_{pair}"
        restitution = lowest_values[name]
        if restitution >= LOW_RESTITUTION:
            continue
        contact_s = _compute_contact_time_s(scene, pair, restitution)
        # The duration is unknown for other laws than `HERTZ_LAWS`.
        if contact_s is None:
            continue

        # Simulate a hit that takes as many time steps as a contact in the study.
        returned = compute_returned_restitution(
            restitution,
            settings.tension,
            steps_per_contact=contact_s / settings.time_step_s,
        )
        descriptions.append(
            f"{returned:.3f} where {name} is {format_significant(restitution)}"
        )
    if descriptions:
        yield (
            f"restitution: at this time step a hit at {FASTEST_IMPACT_M_S:g} m/s "
            f"returns {' and '.join(descriptions)}"
        )


def _compute_contact_time_s(
    scene: Scene, pair: str, restitution: float
) -> float | None:
    """Compute how long a hit between two bodies lasts [s].

    Parameters
    ----------
    scene : Scene
        Grain, wall and laws.
    pair : {"gg", "gp"}
        Which bodies hit each other: two grains, or a grain and the wall.
    restitution : float
        The coefficient of restitution of this pair.

    Returns
    -------
    float or None
        The duration [s] at the speed `FASTEST_IMPACT_M_S`. None for other contact laws
        than `HERTZ_LAWS`.
    """
    from repose.dem.laws import CONTACT_LAWS
    from repose.dem.time_steps import FASTEST_IMPACT_M_S

    law = scene.simulation.contact_law
    contact_time = CONTACT_LAWS[law].contact_time
    if law not in HERTZ_LAWS or contact_time is None:
        return None

    # The laws of these contacts need the effective mass and the effective radius,
    # 1 / (1/m1 + 1/m2) and 1 / (1/r1 + 1/r2). For two equal grains these are half the
    # mass and half the radius of one. A wall has an infinite mass and radius.
    is_pair_of_grains = pair == "gg"
    effective_fraction = 0.5 if is_pair_of_grains else 1.0

    # Bodies have the name of their material; that of grains is `berry`.
    grain = "berry"
    other_body = grain if is_pair_of_grains else "wall"
    shape = scene.particle.dem_shape(grain)
    materials = materials_of(scene)
    parameters = {**scene.parameters, f"e_{pair}": restitution}
    # The function of a law takes these arguments by position: both materials, their
    # contact, the effective mass, the effective radius and the speed.
    return contact_time(
        materials[grain],
        materials[other_body],
        contacts_of(parameters)[grain, other_body],
        effective_fraction * shape.mass_kg,
        effective_fraction * shape.smallest_radius_m,
        FASTEST_IMPACT_M_S,
    )
