"""A grain on a plane under gravity: at rest, and rocking."""

import math

import numpy as np
from scipy.special import ellipe, ellipk
from verification.laws import with_all_laws
from verification.simulations import (
    GRAIN,
    GRAIN_M,
    GRAVITY,
    PVC,
    STIFF,
    grain_simulation,
    resting_overlap,
    track,
    under_gravity,
)

from repose.dem import Contact
from repose.dem.materials import effective_moduli

HALF = math.sqrt(0.5)
# Quaternions that turn an axis of the body upright, by the number of the axis.
UPRIGHT = {2: (1, 0, 0, 0), 1: (HALF, HALF, 0, 0), 0: (HALF, 0, HALF, 0)}
ELLIPTIC_DEVIATIONS = {2: 0.0212, 1: 0.0317, 0: 0.0011}  # of the same axes


def elliptic_overlap(mass, radii, young):
    """Compute Hertz's overlap [m] of an elliptic contact under a body's weight.

    The eccentricity e solves R1 / R2 = (E(e) / (1 - e^2) - K(e)) / (K(e) - E(e)) with
    complete elliptic integrals of e^2. `radii` are the relative radii of curvature R1
    and R2 in m, the larger first; `young` is E* in Pa.

    Johnson, K. L. (1985). Contact Mechanics. Cambridge University Press, Eq. 4.26-4.28.
    """
    low = 1e-9
    high = 1.0 - 1e-9
    for _ in range(200):
        m = 0.5 * (low + high)  # e^2
        ratio = (ellipe(m) / (1.0 - m) - ellipk(m)) / (ellipk(m) - ellipe(m))
        if ratio < radii[0] / radii[1]:
            low = m
        else:
            high = m
    weight = mass * GRAVITY
    radius = math.sqrt(radii[0] * radii[1])
    shape = (ellipe(m) / (1.0 - m) - ellipk(m)) * (ellipk(m) - ellipe(m))
    axis_ratio = (1.0 - m) ** -0.5  # a / b
    # c^3 = (a b)^1.5 = 3 P R_e / (4 E*) * 4 / (pi e^2) (b / a)^1.5 sqrt(shape)
    c3 = 0.75 * weight * radius / young * 4.0 / (math.pi * m)
    c3 *= axis_ratio**-1.5 * math.sqrt(shape)
    a = c3 ** (1.0 / 3.0) * math.sqrt(axis_ratio)
    b = c3 ** (1.0 / 3.0) / math.sqrt(axis_ratio)
    return 1.5 * weight / (math.pi * a * b * young) * b * ellipk(m)


@with_all_laws
def test_resting_overlap(case, laws):
    """A grain at rest on a plate has the overlap of a sphere of radius sqrt(R1 R2).

    Each of its axes is upright in turn.

    Hertz's own solution for R1 and R2 is elliptic. The engine's law of spheres deviates
    from it by the numbers of `case.deviates`.
    """
    young, _ = effective_moduli(GRAIN, PVC)
    for axis, turn in UPRIGHT.items():
        height = GRAIN_M[axis]
        level_axes = [GRAIN_M[k] for k in range(3) if k != axis]
        radii = sorted((level**2 / height for level in level_axes), reverse=True)

        simulation = grain_simulation(
            Contact(0.3, 0.5, 0.1), 1e-4, **under_gravity(), **laws
        )
        mass = simulation.shapes["body"].mass_kg
        simulation.add("body", (0.0, 0.0, height), turn)
        simulation.run_steps(6000)
        overlap = height - simulation.positions[0, 2]

        sphere = resting_overlap(mass, math.sqrt(radii[0] * radii[1]), GRAIN)
        case.close(f"axis {axis} up: overlap [m]", overlap, sphere)
        elliptic = elliptic_overlap(mass, radii, young)
        name = f"R1/R2 {radii[0] / radii[1]:.2f}: elliptic overlap"
        case.deviates(name, overlap, elliptic, ELLIPTIC_DEVIATIONS[axis], 5e-4)


def rocking_period(a, c):
    """Compute the period [s] of a grain that rocks without slipping, at small angles.

    Its semi-axes in the plane of the motion are a, level, and c, upright, a above c, in
    m. Its potential energy is m g h(theta), h the support function; the moment of
    inertia about the contact is I + m c^2, I = m (a^2 + c^2) / 5, and the stiffness m g
    h'' = m g (a^2 / c - c).
    """
    inertia = (a * a + c * c) / 5.0 + c * c
    stiffness = GRAVITY * (a * a / c - c)
    return 2.0 * math.pi * math.sqrt(inertia / stiffness)


def test_rocking(case, laws):
    """A grain tilted by a degree rocks with the theoretical period."""
    long, middle, short = GRAIN_M
    period = rocking_period(long, short)
    time, tilt = rocking_history(0, 1, 3.0 * period, laws)
    case.close("period about the middle axis [s]", period_of(time, tilt), period)

    period = rocking_period(middle, short)
    time, tilt = rocking_history(1, 0, 3.0 * period, laws)
    case.close("period about the long axis [s]", period_of(time, tilt), period)


def rocking_history(moving_axis, fixed_axis, duration_s, laws):
    """Simulate a grain released at one degree.

    Returns time and tilt [deg] about the fixed axis of the body.
    """
    step = 2e-5
    start = math.radians(1.0)
    every = 20
    simulation = grain_simulation(
        Contact(0.3, 10.0, 0.0), step, material=STIFF, **under_gravity(), **laws
    )
    mass = simulation.shapes["body"].mass_kg
    height = math.hypot(
        GRAIN_M[2] * math.cos(start), GRAIN_M[moving_axis] * math.sin(start)
    )
    overlap = resting_overlap(mass, GRAIN_M[0] * GRAIN_M[1] / GRAIN_M[2], STIFF)
    turn = np.zeros(4)
    turn[0] = math.cos(0.5 * start)
    turn[1 + fixed_axis] = math.sin(0.5 * start)
    simulation.add("body", (0.0, 0.0, height - overlap), turn)

    def time_and_tilt():
        half_angle = math.asin(simulation.quaternions[0, 1 + fixed_axis])
        return simulation.time_s, math.degrees(2.0 * half_angle)

    return track(simulation, int(duration_s / step / every), every, time_and_tilt).T


def period_of(time, wave):
    """Average the period [s] of a wave about 0, from two or more zero crossings."""
    k = np.flatnonzero(wave[:-1] * wave[1:] < 0.0)
    zeros = time[k] - wave[k] * (time[k + 1] - time[k]) / (wave[k + 1] - wave[k])
    return 2.0 * (zeros[-1] - zeros[0]) / (len(zeros) - 1)
