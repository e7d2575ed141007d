"""Sphere and grain on a plane under gravity: sliding, rolling, a slope."""

import math
from typing import Any

import numpy as np

from repose.dem import Contact, Shape, Simulation

from .case import Effort, Rows, close
from .machine import (
    BERRY_DENSITY,
    BERRY_M,
    GRAVITY,
    berry_simulation,
    simulation_of,
    track,
    under_gravity,
)
from .resting import STIFF, resting_overlap

RADIUS = 0.006


def sphere_on_floor(
    contact: Contact, speed_m_s: float, spin_rad_s: float, **laws: Any
) -> Simulation:
    """Put a stiff sphere of radius `RADIUS` at its resting overlap, moving along x and spinning about y."""
    shape = Shape.sphere(RADIUS, BERRY_DENSITY, "berry")
    room: dict[str, Any] = {
        "material": STIFF,
        "lower": (-1.0, -0.1, -0.1),
        "upper": (1.0, 0.1, 0.1),
        **under_gravity(),
    }
    simulation = simulation_of(shape, contact, 1e-5, **room, **laws)
    height = RADIUS - resting_overlap(shape.mass_kg, RADIUS, STIFF)
    velocity, spin = (speed_m_s, 0.0, 0.0), (0.0, spin_rad_s, 0.0)
    simulation.add(
        "body", (0.0, 0.0, height), velocity_m_s=velocity, angular_velocity_rad_s=spin
    )
    return simulation


def _track(simulation: Simulation, steps: int, every: int) -> np.ndarray:
    """Follow time, speed and R times spin of the first body, once every `every` steps."""

    def look() -> tuple[float, float, float]:
        return (
            simulation.time_s,
            simulation.velocities[0, 0],
            RADIUS * simulation.angular_velocities[0, 1],
        )

    return track(simulation, steps // every, every, look).T


def slip_to_roll(effort: Effort) -> Rows:
    """Let a sphere slide, which ends rolling with 5/7 of its speed, and roll, slowed by 5/7 mu_r g."""
    start, friction, rolling = 0.5, 0.4, 0.05
    time, speed, rim = _track(
        sphere_on_floor(Contact(0.3, friction, 0.0), start, 0.0, **effort.laws),
        6000,
        150,
    )
    yield close("speed after slipping", "m/s", speed[-1], 5.0 / 7.0 * start)
    yield close("R spin after slipping", "m/s", rim[-1], 5.0 / 7.0 * start)
    slowed = (speed[0] - speed[12]) / (time[12] - time[0])
    yield close("deceleration while slipping", "m/s2", slowed, friction * GRAVITY)
    t, v, _ = _track(
        sphere_on_floor(Contact(0.3, 0.8, rolling), 0.3, 0.3 / RADIUS, **effort.laws),
        20000,
        500,
    )
    slope = 5.0 / 7.0 * rolling * GRAVITY
    yield close(
        "deceleration by the rolling torque",
        "m/s2",
        (v[0] - v[-1]) / (t[-1] - t[0]),
        slope,
    )


def slope_acceleration(angle_deg: float, friction: float, **laws: Any) -> float:
    """Simulate a grain that cannot roll, on a slope: acceleration [m/s2], the mean from 0.06 s to 0.16 s."""
    slope = math.radians(angle_deg)
    room = under_gravity() | {
        "gravity_m_s2": (GRAVITY * math.sin(slope), 0.0, -GRAVITY * math.cos(slope))
    }
    room |= {"material": STIFF, "upper": (0.5, 0.1, 0.1)}
    simulation = berry_simulation(Contact(0.3, friction, 5.0), 2e-5, **room, **laws)
    simulation.add("body", (0.0, 0.0, BERRY_M[2]))
    simulation.run_steps(3000)
    before = simulation.velocities[0, 0]
    simulation.run_steps(5000)
    return (simulation.velocities[0, 0] - before) / 0.1


def coulomb_slope(effort: Effort) -> Rows:
    """Put a grain on slopes: it sticks below the angle of friction and slides above it."""
    friction = 0.5
    limit = math.degrees(math.atan(friction))
    for angle in (10.0, 20.0, limit - 0.5, limit + 0.5, 30.0, 35.0, 45.0):
        a, slope = slope_acceleration(angle, friction, **effort.laws), np.radians(angle)
        exact = float(max(GRAVITY * (np.sin(slope) - friction * np.cos(slope)), 0.0))
        yield close(
            f"acceleration at {angle:.2f} deg", "m/s2", a, exact, scale=max(exact, 0.1)
        )
