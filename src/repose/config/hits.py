"""The restitution that a hit returns at the time step of a study.

The damping of a contact is made for a hit that is followed exactly. With a few time steps
for each contact a hit returns less, and the more so the lower the restitution.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from repose.bench.parameters import PAIRS
from repose.bench.scene import Scene, contacts_of, materials_of

# Contact laws whose hit `returned` follows.
HERTZ_LAWS = ("hertz_mindlin", "hertz_mindlin_rescaled")
# A restitution above this returns nearly what it says.
LOW_RESTITUTION = 0.3
# Where the bodies are before their first overlap, as shares of their way in a time step.
PHASES = (0.1, 0.3, 0.5, 0.7, 0.9)
MOST_STEPS = 100_000


def returned(restitution: float, tension: str, steps_per_contact: float) -> float:
    """Compute the restitution that a hit of two spheres returns.

    Parameters
    ----------
    restitution : float
        The configured restitution, above 0, at most 1.
    tension : {"keep", "release"}
        How the contact ends, see `repose.dem.Simulation`.
    steps_per_contact : float
        Duration of the hit without damping, over the time step.

    Returns
    -------
    float
        Speed after the hit over the speed before it, averaged over `PHASES`.

    Notes
    -----
    Mass, speed and the stiffness k of F = k overlap^1.5 are 1. Hertz's hit lasts 2.943
    times its largest overlap, (5/4)^0.4. The time steps are those of the engine: the
    force of the present overlap and speed, then speed and place.
    """
    from repose.dem.laws.hertz_mindlin import damping_ratio

    time_step = 2.943 * 1.25**0.4 / steps_per_contact
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio(restitution, tension)
    speeds = []
    for phase in PHASES:
        overlap = -phase * time_step
        speed = 1.0  # of the approach
        for _ in range(MOST_STEPS):
            force = 0.0
            if overlap > 0.0:
                stiffness = 1.5 * math.sqrt(overlap)
                force = overlap**1.5 + damping * math.sqrt(stiffness) * speed
                if tension == "release":
                    force = max(force, 0.0)
            speed -= force * time_step
            overlap += speed * time_step
            if speed < 0.0 and overlap < 0.0:
                break
        speeds.append(-speed)
    return float(np.mean(speeds))


def low_restitutions(scene: Scene, lowest: Mapping[str, float]) -> Iterator[str]:
    """Yield a sentence about restitutions below `LOW_RESTITUTION`.

    Parameters
    ----------
    scene : Scene
        Grain, laws and time step.
    lowest : mapping
        Lowest value of each parameter, ``e_gg`` and ``e_gp`` among them.
    """
    from repose.dem.laws import CONTACT_LAWS
    from repose.dem.time_steps import FASTEST_IMPACT_M_S

    settings = scene.simulation
    contact_time = CONTACT_LAWS[settings.contact_law].contact_time
    if settings.contact_law not in HERTZ_LAWS or contact_time is None:
        return
    shape = scene.particle.dem_shape("berry")
    materials = materials_of(scene)
    sides = {"gg": ("berry", 0.5), "gp": ("wall", 1.0)}
    texts = []
    for pair in PAIRS:
        restitution = lowest[f"e_{pair}"]
        if restitution >= LOW_RESTITUTION:
            continue
        other, share = sides[pair]
        parameters = {**scene.parameters, f"e_{pair}": restitution}
        duration_s = contact_time(
            materials["berry"],
            materials[other],
            contacts_of(parameters)["berry", other],
            share * shape.mass_kg,
            share * shape.smallest_radius_m,
            FASTEST_IMPACT_M_S,
        )
        steps = duration_s / settings.time_step_s
        value = returned(restitution, settings.tension, steps)
        texts.append(f"{value:.3f} where e_{pair} is {restitution:g}")
    if texts:
        yield (
            f"restitution: at this time step a hit at {FASTEST_IMPACT_M_S:g} m/s "
            f"returns {' and '.join(texts)}"
        )
