"""Bodies that slide and roll under gravity: a sphere on a floor, a grain on a slope."""

import math

import numpy as np
from verification.laws import with_all_laws
from verification.simulations import (
    GRAIN_DENSITY,
    GRAIN_M,
    GRAVITY,
    STIFF,
    grain_simulation,
    resting_overlap,
    simulation_of,
    track,
    under_gravity,
)

from repose.dem import Contact, Shape

RADIUS = 0.006


def sphere_on_floor(contact, speed_m_s, spin_rad_s, laws):
    """Put a stiff sphere on a floor, moving along x and spinning about y.

    It has the radius `RADIUS` and its resting overlap.
    """
    shape = Shape.sphere(RADIUS, GRAIN_DENSITY, "grain")
    simulation = simulation_of(
        shape,
        contact,
        1e-5,
        material=STIFF,
        lower=(-1.0, -0.1, -0.1),
        upper=(1.0, 0.1, 0.1),
        **under_gravity(),
        **laws,
    )
    height = RADIUS - resting_overlap(shape.mass_kg, RADIUS, STIFF)
    simulation.add(
        "body",
        (0.0, 0.0, height),
        velocity_m_s=(speed_m_s, 0.0, 0.0),
        angular_velocity_rad_s=(0.0, spin_rad_s, 0.0),
    )
    return simulation


def track_sphere(simulation, steps, every):
    """Follow time, speed, and the rim's velocity by the spin."""

    def look():
        speed = simulation.velocities[0, 0]
        rim = RADIUS * simulation.angular_velocities[0, 1]
        return simulation.time_s, speed, rim

    return track(simulation, steps // every, every, look).T


@with_all_laws
def test_rolling(case, laws):
    """A sphere slides, rolls at 5/7 of its speed, and is slowed by 5/7 mu_r g."""
    start = 0.5
    friction = 0.4
    rolling_friction = 0.05
    sliding = sphere_on_floor(Contact(0.3, friction, 0.0), start, 0.0, laws)
    time, speed, rim = track_sphere(sliding, 6000, 150)
    case.close("speed after slipping [m/s]", speed[-1], 5.0 / 7.0 * start)
    case.close("R spin after slipping [m/s]", rim[-1], 5.0 / 7.0 * start)
    deceleration = (speed[0] - speed[12]) / (time[12] - time[0])
    case.close("while slipping [m/s2]", deceleration, friction * GRAVITY)

    rolling = sphere_on_floor(
        Contact(0.3, 0.8, rolling_friction), 0.3, 0.3 / RADIUS, laws
    )
    time, speed, _ = track_sphere(rolling, 20000, 500)
    deceleration = (speed[0] - speed[-1]) / (time[-1] - time[0])
    expected = 5.0 / 7.0 * rolling_friction * GRAVITY
    case.close("by the rolling torque [m/s2]", deceleration, expected)


def slope_acceleration(angle_deg, friction, laws):
    """Simulate a grain that cannot roll on a slope.

    Returns its mean acceleration [m/s2] from 0.06 s to 0.16 s.
    """
    slope = math.radians(angle_deg)
    downhill = GRAVITY * math.sin(slope)
    into_slope = GRAVITY * math.cos(slope)
    world = under_gravity()
    world["gravity_m_s2"] = (downhill, 0.0, -into_slope)
    simulation = grain_simulation(
        Contact(0.3, friction, 5.0),
        2e-5,
        material=STIFF,
        upper=(0.5, 0.1, 0.1),
        **world,
        **laws,
    )
    simulation.add("body", (0.0, 0.0, GRAIN_M[2]))
    simulation.run_steps(3000)
    before = simulation.velocities[0, 0]
    simulation.run_steps(5000)
    return (simulation.velocities[0, 0] - before) / 0.1


@with_all_laws
def test_slope(case, laws):
    """A grain on a slope sticks below the angle of friction and slides above it."""
    friction = 0.5
    limit = math.degrees(math.atan(friction))
    for angle in (10.0, 20.0, limit - 0.5, limit + 0.5, 30.0, 35.0, 45.0):
        acceleration = slope_acceleration(angle, friction, laws)
        slope = np.radians(angle)
        driving = GRAVITY * (np.sin(slope) - friction * np.cos(slope))
        expected = max(float(driving), 0.0)
        case.close(
            f"acceleration at {angle:.2f} deg [m/s2]",
            acceleration,
            expected,
            scale=max(expected, 0.1),
        )
