"""Normal impacts: tests 1 to 3 of Chung & Ooi (2011), Granular Matter 13, 643-656.

The engine stores no forces: the force is the mass times the change of velocity in a time step.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from repose.dem import Simulation

from .case import CLOSED, DIGITISED, Effort, Rows, close
from .hertz import Hertz, Solid, hertz_of_pair, hertz_on_plane
from .machine import (
    STEPS_PER_CONTACT,
    frictionless,
    impact,
    sphere_over_plane,
    spheres,
    steps_of_impact,
    track,
)

GLASS = Solid("glass", 48e9, 0.20, 2800.0)
LIMESTONE = Solid("limestone", 20e9, 0.25, 2500.0)
ALUMINIUM_ALLOY = Solid("aluminium alloy", 70e9, 0.30, 2699.0)
MAGNESIUM_ALLOY = Solid("magnesium alloy", 40e9, 0.35, 1800.0)
ALUMINIUM_OXIDE = Solid("aluminium oxide", 380e9, 0.23, 4000.0)
CAST_IRON = Solid("cast iron", 100e9, 0.25, 7000.0)
History = tuple[
    np.ndarray, np.ndarray, np.ndarray
]  # time [s], overlap [m] and normal force [N] in contact
# Of an elastic impact: name and unit, and SI units in one of these.
QUANTITIES = (("peak force", "kN"), ("largest overlap", "um"), ("contact time", "us"))
SCALES = np.array([1e-3, 1e6, 1e6])


def pair_history(
    solid: Solid, radius_m: float, speed_m_s: float, **laws: Any
) -> History:
    """Simulate an elastic head-on impact of two equal spheres."""
    step = hertz_of_pair(solid, radius_m, speed_m_s).duration_s / STEPS_PER_CONTACT
    reach, half = radius_m + 2.0 * step * speed_m_s, 0.5 * speed_m_s
    simulation = spheres(
        {"a": (solid, radius_m), "b": (solid, radius_m)}, frictionless(), step, **laws
    )
    simulation.add("a", (-reach, 0.0, 0.0), velocity_m_s=(half, 0.0, 0.0))
    simulation.add("b", (reach, 0.0, 0.0), velocity_m_s=(-half, 0.0, 0.0))

    def look() -> tuple[float, float]:
        x = simulation.positions[:, 0]
        return 2.0 * radius_m - (x[1] - x[0]), simulation.velocities[1, 0]

    return _history(
        simulation, step, solid.sphere_mass(radius_m), steps_of_impact(1.0), look
    )


def plane_history(
    solid: Solid,
    radius_m: float,
    speed_m_s: float,
    restitution: float = 1.0,
    **laws: Any,
) -> History:
    """Simulate an impact of a sphere on a rigid plane, along its normal and without friction."""
    simulation, steps = sphere_over_plane(
        solid, radius_m, frictionless(restitution), (0.0, 0.0, -speed_m_s), **laws
    )
    step = hertz_on_plane(solid, radius_m, speed_m_s).duration_s / STEPS_PER_CONTACT

    def look() -> tuple[float, float]:
        return radius_m - simulation.positions[0, 2], simulation.velocities[0, 2]

    return _history(simulation, step, solid.sphere_mass(radius_m), steps, look)


def _history(
    simulation: Simulation,
    step: float,
    mass: float,
    steps: int,
    look: Callable[[], Any],
) -> History:
    """Find the time since the overlap began, overlap and m dv/dt in contact; `look` returns overlap and velocity."""
    overlap, speed = track(simulation, steps, 1, look).T
    # the force at the end of step k moves the velocity of step k + 1
    force = mass * np.diff(speed) / step
    inside = np.flatnonzero(overlap[:-1] > 0.0)
    first = inside[0]
    lead = overlap[first] / (overlap[first] - overlap[first - 1])
    return step * (inside - first + lead), overlap[inside], force[inside]


def _elastic(
    solid: Solid, hertz: Hertz, history: History, published: Sequence[float] = ()
) -> Rows:
    """Compare an elastic impact with Hertz's solution, and with published numbers."""
    time, overlap, force = history
    # the contact time: the overlap at the last step in contact goes on to zero with its last speed
    duration = time[-1] + (time[1] - time[0]) * overlap[-1] / (
        overlap[-2] - overlap[-1]
    )
    results = SCALES * (force.max(), overlap.max(), duration)
    exact = SCALES * (hertz.force_n, hertz.overlap_m, hertz.duration_s)
    for references, source in ((exact, CLOSED), (published, DIGITISED)):
        for (name, unit), ours, reference in zip(
            QUANTITIES, results, references, strict=False
        ):
            yield close(f"{solid.name}: {name}", unit, ours, reference, source)


def two_spheres(effort: Effort) -> Rows:
    """Test 1: two equal spheres of radius 10 mm, head-on at 10 m/s each, elastic."""
    for solid, published in ((GLASS, (10.70, 274.0, 40.3)), (LIMESTONE, ())):
        history = pair_history(solid, 0.01, 20.0, **effort.laws)
        yield from _elastic(solid, hertz_of_pair(solid, 0.01, 20.0), history, published)


def sphere_on_plane(effort: Effort) -> Rows:
    """Test 2: a sphere of radius 0.1 m on a rigid plane at 0.2 m/s, elastic."""
    for solid, published in (
        (ALUMINIUM_ALLOY, (11.37, 49.7, 731.0)),
        (MAGNESIUM_ALLOY, ()),
    ):
        history = plane_history(solid, 0.1, 0.2, **effort.laws)
        yield from _elastic(solid, hertz_on_plane(solid, 0.1, 0.2), history, published)


def damped_impact(effort: Effort) -> Rows:
    """Test 3: simulated for nominal restitution, a sphere of radius 2.5 mm on a rigid plane at 3.9 m/s."""
    for solid in (ALUMINIUM_OXIDE, CAST_IRON):
        for e in np.linspace(0.2, 1.0, 9):
            velocity, _ = impact(
                solid, 0.0025, frictionless(e), (0.0, 0.0, -3.9), **effort.laws
            )
            yield close(
                f"{solid.name}: restitution at {e:.1f}", "", velocity[2] / 3.9, e
            )
    hertz = hertz_on_plane(ALUMINIUM_OXIDE, 0.0025, 3.9)
    source = "damped Hertz equation, solved by scipy"
    for e in (0.2, 0.6, 1.0):
        *_, exact = hertz.history(e, tension=effort.tension)
        *_, force = plane_history(ALUMINIUM_OXIDE, 0.0025, 3.9, e, **effort.laws)
        peaks = 1e-3 * force.max(), 1e-3 * exact.max()
        yield close(f"aluminium oxide: peak force at e {e:.1f}", "kN", *peaks, source)
