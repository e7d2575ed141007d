"""Free rotation of a triaxial body beside Jacobi's elliptic functions."""

import math

import numpy as np
from refusals import value_error
from scipy.special import ellipj, ellipk
from verification.simulations import frictionless, grain_simulation, track

from repose.dem import rotation_matrix


def euler_solution(inertia, first, third, time):
    """Solve the free rotation of a body.

    Returns the angular velocity (3, T) [rad/s] in its frame, and the period [s].

    `inertia` are the principal moments, rising. The velocity at time 0 is (first, 0,
    third). ValueError unless the square of the angular momentum is above 2 E I_2.

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
    numerator = (i2 - i1) * (twice_energy * i3 - square)
    modulus = numerator / ((i3 - i2) * (square - twice_energy * i1))
    sn, cn, dn, _ = ellipj(rate * time, modulus)
    second = math.sqrt((twice_energy * i3 - square) / (i2 * (i3 - i2)))
    period = 4.0 * ellipk(modulus) / rate
    return np.array([first * cn, second * sn, third * dn]), period


def test_free_rotation(case, laws):
    """A grain in free flight rotates as Euler's equations predict."""
    step = 2e-5
    every = 50
    # components of the angular velocity [rad/s]
    first = 8.0
    third = 25.0
    simulation = grain_simulation(frictionless(), step, **laws)
    inertia = simulation.shapes["body"].inertia_kg_m2
    simulation.add("body", (0.0, 0.0, 0.0), angular_velocity_rad_s=(first, 0.0, third))
    momentum = simulation.angular_momenta[0]
    energy = simulation.kinetic_energies()[0]
    _, period = euler_solution(inertia, first, third, np.zeros(1))

    def look():
        turn = rotation_matrix(simulation.quaternions[0])
        velocity = (turn.T @ simulation.angular_momenta[0]) / inertia
        return simulation.time_s, simulation.kinetic_energies()[0], *velocity

    looks = int(2.0 * period / step / every)
    time, energies, *velocity = track(simulation, looks, every, look).T
    exact, _ = euler_solution(inertia, first, third, time)

    difference = np.abs(velocity - exact).max()
    size = np.linalg.norm(exact, axis=0).max()
    case.close("angular velocity over two periods", difference, 0.0, scale=size)
    change = np.linalg.norm(simulation.angular_momenta[0] - momentum)
    drift = change / np.linalg.norm(momentum)
    case.close("angular momentum", drift, 0.0, tolerance=1e-14, scale=1.0)
    drift = np.abs(energies / energy - 1.0).max()
    case.close("kinetic energy", drift, 0.0, tolerance=1e-5, scale=1.0)


def test_the_solution_obeys_eulers_equations():
    inertia = np.array([1.0, 2.4, 2.6])
    time = np.linspace(0.0, 3.0, 3001)
    omega, _ = euler_solution(inertia, 0.8, 2.5, time)
    slope = np.gradient(omega, time, axis=1)[:, 1:-1]
    torque_free = -np.cross(omega.T, inertia * omega.T).T[:, 1:-1] / inertia[:, None]
    assert np.abs(slope - torque_free).max() < 1e-5
    value_error("first is 2", euler_solution, inertia, 2.0, 0.5, time)
