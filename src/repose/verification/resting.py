"""A grain on a plane under gravity: at rest, and rocking."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import ellipe, ellipk

from repose.dem import Contact, Material
from repose.dem.materials import effective_moduli

from .case import Effort, Rows, close, reported
from .machine import (
    BERRY,
    BERRY_M,
    GRAVITY,
    PVC,
    berry_simulation,
    track,
    under_gravity,
)

STIFF = Material(
    4.3e7, 0.32
)  # a thousand berries stiff: the overlap is 1e-5 of the radius
ELLIPTIC_NOTE = "the engine takes R* = sqrt(R1 R2) in the law of spheres; Hertz's own solution is elliptic"


def resting_overlap(mass: float, radius: float, material: Material) -> float:
    """Compute the overlap [m] that carries a sphere on a plate of PVC: (m g / (4/3 E* sqrt(R*)))^(2/3)."""
    young, _ = effective_moduli(material, PVC)
    return (mass * GRAVITY / (4.0 / 3.0 * young * math.sqrt(radius))) ** (2.0 / 3.0)


def elliptic_overlap(mass: float, radii: Sequence[float], young: float) -> float:
    """Compute Hertz's overlap [m] of an elliptic contact under the weight of a body of `mass` [kg].

    The eccentricity e solves R1 / R2 = (E(e) / (1 - e^2) - K(e)) / (K(e) - E(e)) with complete elliptic integrals of
    e^2. `radii` are the relative radii of curvature R1 and R2 in m, the larger first; `young` is E* in Pa.

    Johnson, K. L. (1985). Contact Mechanics. Cambridge University Press, Eq. 4.26-4.28.
    """
    low, high = 1e-9, 1.0 - 1e-9
    for _ in range(200):
        m = 0.5 * (low + high)
        ratio = (ellipe(m) / (1.0 - m) - ellipk(m)) / (ellipk(m) - ellipe(m))
        low, high = (m, high) if ratio < radii[0] / radii[1] else (low, m)
    shape = (ellipe(m) / (1.0 - m) - ellipk(m)) * (ellipk(m) - ellipe(m))
    axis_ratio = (1.0 - m) ** -0.5  # a / b
    radius_e = math.sqrt(radii[0] * radii[1])
    # c^3 = (a b)^1.5 = 3 P R_e / (4 E*) * 4 / (pi e^2) (b / a)^1.5 sqrt(shape)
    c3 = (
        0.75
        * mass
        * GRAVITY
        * radius_e
        / young
        * 4.0
        / (math.pi * m)
        * axis_ratio**-1.5
        * math.sqrt(shape)
    )
    a, b = (
        c3 ** (1.0 / 3.0) * math.sqrt(axis_ratio),
        c3 ** (1.0 / 3.0) / math.sqrt(axis_ratio),
    )
    return 1.5 * mass * GRAVITY / (math.pi * a * b * young) * b * ellipk(m)


def berry_at_rest(effort: Effort) -> Rows:
    """Lay a grain on a plate, each of its axes vertical in turn: the overlap is that of its curvature."""
    quarter = math.sqrt(0.5)
    turns = {
        "shortest": (1, 0, 0, 0),
        "middle": (quarter, quarter, 0, 0),
        "longest": (quarter, 0, quarter, 0),
    }
    young, _ = effective_moduli(BERRY, PVC)
    for (name, turn), up in zip(turns.items(), (2, 1, 0), strict=True):
        height = BERRY_M[up]
        radii = sorted(
            (axis**2 / height for k, axis in enumerate(BERRY_M) if k != up),
            reverse=True,
        )
        simulation = berry_simulation(
            Contact(0.3, 0.5, 0.1), 1e-4, **under_gravity(), **effort.laws
        )
        mass = simulation.shapes["body"].mass_kg
        expected = resting_overlap(mass, math.sqrt(radii[0] * radii[1]), BERRY)
        simulation.add("body", (0.0, 0.0, height), turn)
        simulation.run_steps(6000)
        sunk = (
            f"{name} axis up: overlap",
            "um",
            1e6 * (height - simulation.positions[0, 2]),
        )
        yield close(*sunk, 1e6 * expected)
        note, exact = (
            f"{ELLIPTIC_NOTE}; R1 / R2 = {radii[0] / radii[1]:.2f}",
            elliptic_overlap(mass, radii, young),
        )
        yield reported(*sunk, note, 1e6 * exact, "closed form, elliptic Hertz contact")


def rocking_period(a: float, c: float) -> float:
    """Compute the period [s] of a grain that rocks without slipping, at small angles.

    Its semi-axes in the plane of the motion are a, level, and c, upright, a above c, in m. Its potential energy is
    m g h(theta), h the support function; the moment of inertia about the contact is I + m c^2, I = m (a^2 + c^2) / 5,
    and the stiffness m g h'' = m g (a^2 / c - c).
    """
    return (
        2.0
        * math.pi
        * math.sqrt(((a * a + c * c) / 5.0 + c * c) / (GRAVITY * (a * a / c - c)))
    )


def rocking(effort: Effort) -> Rows:
    """Tilt a grain by a degree from its flat rest: it rocks with the theoretical period, about either level axis."""
    for name, level, about in (
        ("about the middle axis", 0, 1),
        ("about the long axis", 1, 0),
    ):
        period = rocking_period(BERRY_M[level], BERRY_M[2])
        time, tilt = _rocking_history(level, about, 3.0 * period, effort.laws)
        yield close(f"period {name}", "s", period_of(time, tilt), period)


def _rocking_history(
    level: int, about: int, duration_s: float, laws: Mapping[str, Any]
) -> np.ndarray:
    """Simulate a grain released at one degree: time and tilt [deg] about a body axis."""
    step, start, every = 2e-5, math.radians(1.0), 20
    simulation = berry_simulation(
        Contact(0.3, 10.0, 0.0), step, material=STIFF, **under_gravity(), **laws
    )
    mass = simulation.shapes["body"].mass_kg
    height = math.hypot(BERRY_M[2] * math.cos(start), BERRY_M[level] * math.sin(start))
    turn = np.zeros(4)
    turn[0], turn[1 + about] = math.cos(0.5 * start), math.sin(0.5 * start)
    radius = BERRY_M[0] * BERRY_M[1] / BERRY_M[2]
    simulation.add(
        "body", (0.0, 0.0, height - resting_overlap(mass, radius, STIFF)), turn
    )

    def look() -> tuple[float, float]:
        return simulation.time_s, math.degrees(
            2.0 * math.asin(simulation.quaternions[0, 1 + about])
        )

    return track(simulation, int(duration_s / step / every), every, look).T


def period_of(time: np.ndarray, wave: np.ndarray) -> float:
    """Average the period [s] of a wave about 0, from its zero crossings, at least two."""
    k = np.flatnonzero(wave[:-1] * wave[1:] < 0.0)
    zeros = time[k] - wave[k] * (time[k + 1] - time[k]) / (wave[k + 1] - wave[k])
    return 2.0 * (zeros[-1] - zeros[0]) / (len(zeros) - 1)
