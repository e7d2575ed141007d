"""Free rotation of a triaxial body beside Jacobi's elliptic functions."""

import math

import numpy as np
from scipy.special import ellipj, ellipk

from repose.dem import rotation_matrix

from .case import Effort, Rows, close
from .machine import berry_simulation, frictionless, track


def euler_solution(
    inertia: np.ndarray, first: float, third: float, time: np.ndarray
) -> tuple[np.ndarray, float]:
    """Solve the free rotation: angular velocity (3, T) [rad/s] in the body's frame, and period of the motion [s].

    `inertia` are the principal moments, rising. The velocity at time 0 is (first, 0, third). ValueError unless the
    square of the angular momentum is above 2 E I_2.

    Landau, L. D., & Lifshitz, E. M. Mechanics, section 37.
    """
    i1, i2, i3 = inertia
    twice_energy = i1 * first**2 + i3 * third**2
    square = (i1 * first) ** 2 + (i3 * third) ** 2
    if not square > twice_energy * i2:
        raise ValueError(
            f"first is {first!r}, third {third!r}; expected L^2 above 2 E I_2"
        )
    rate = math.sqrt((i3 - i2) * (square - twice_energy * i1) / (i1 * i2 * i3))
    modulus = (
        (i2 - i1)
        * (twice_energy * i3 - square)
        / ((i3 - i2) * (square - twice_energy * i1))
    )
    sn, cn, dn, _ = ellipj(rate * time, modulus)
    second = math.sqrt((twice_energy * i3 - square) / (i2 * (i3 - i2)))
    return np.array([first * cn, second * sn, third * dn]), 4.0 * ellipk(modulus) / rate


def free_rotation(effort: Effort) -> Rows:
    """Let a grain tumble in space: it keeps angular momentum and energy, and turns as Euler's equations predict."""
    step, every, first, third = 2e-5, 50, 8.0, 25.0
    simulation = berry_simulation(frictionless(), step, **effort.laws)
    inertia = simulation.shapes["body"].inertia_kg_m2
    simulation.add("body", (0.0, 0.0, 0.0), angular_velocity_rad_s=(first, 0.0, third))
    momentum, energy = simulation.angular_momenta[0], simulation.kinetic_energies()[0]
    _, period = euler_solution(inertia, first, third, np.zeros(1))

    def look() -> tuple[float, ...]:
        velocity = (
            rotation_matrix(simulation.quaternions[0]).T @ simulation.angular_momenta[0]
        ) / inertia
        return simulation.time_s, simulation.kinetic_energies()[0], *velocity

    time, energies, *velocity = track(
        simulation, int(2.0 * period / step / every), every, look
    ).T
    exact, _ = euler_solution(inertia, first, third, time)
    drift = float(
        np.linalg.norm(simulation.angular_momenta[0] - momentum)
        / np.linalg.norm(momentum)
    )
    size, worst = (
        float(np.linalg.norm(exact, axis=0).max()),
        float(np.abs(velocity - exact).max()),
    )
    yield close(
        "angular velocity, largest difference over two periods",
        "rad/s",
        worst,
        0.0,
        scale=size,
    )
    yield close(
        "angular momentum, relative drift", "", drift, 0.0, tolerance=1e-14, scale=1.0
    )
    worst = np.abs(energies / energy - 1.0).max()
    yield close(
        "kinetic energy, largest relative drift",
        "",
        worst,
        0.0,
        tolerance=1e-5,
        scale=1.0,
    )
