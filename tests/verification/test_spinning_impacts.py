"""Impacts of spinning spheres: tests 6 to 8 of Chung & Ooi (2011).

Granular Matter 13, 643-656; see `sliding`.
"""

from itertools import product
from typing import NamedTuple

from verification.hertz import Solid, hertz_on_plane
from verification.laws import with_all_laws
from verification.simulations import (
    STEPS_PER_CONTACT,
    STILL,
    impact,
    steps_of_impact,
    two_spheres,
)
from verification.sliding import sliding_loss, sliding_spin

from repose.dem import Contact

SOLIDS = (Solid("aluminium", 70e9, 0.33, 2700.0), Solid("nylon", 2.5e9, 0.40, 1000.0))
SLIDING_SPINS = (6.0, 13.0, 21.0)  # they slide through the whole impact [rad/s]
ALL_SPINS = (0.5, 1.75, 3.5, 9.0, 21.0)  # of test 8 [rad/s]
CONTACT = Contact(0.5, 0.4, 0.0)
RADIUS = 0.1
NORMAL = 0.2  # approach of each sphere to the plane between them [m/s]
GAP = 1e-7  # of each sphere to that plane at the start [m]


class Motion(NamedTuple):
    """Motion of a sphere after its impact."""

    tangential_m_s: float
    spin_rad_s: float


def hit_plane(solid, spin, laws):
    """Simulate an impact of a spinning sphere on a rigid plane."""
    velocity, rotation = impact(
        solid, RADIUS, CONTACT, (0.0, 0.0, -NORMAL), (0.0, spin, 0.0), **laws
    )
    return Motion(velocity[0], rotation[1])


def hit_equal_sphere(solid, spin, other_spin, laws):
    """Simulate an impact of two equal spheres, of which the upper is returned."""
    simulation = _spheres(solid, (solid, RADIUS), laws)
    _add_upper(simulation, spin)
    simulation.add(
        "b",
        (0.0, 0.0, -RADIUS - GAP),
        velocity_m_s=(0.0, 0.0, NORMAL),
        angular_velocity_rad_s=(0.0, other_spin, 0.0),
    )
    return _run(simulation, laws)


def hit_great_sphere(solid, spin, laws):
    """Simulate an impact on a sphere at rest, 1000 times as stiff and dense."""
    radius = 0.5
    great = Solid(
        "great",
        1000.0 * solid.elastic_modulus_pa,
        solid.poisson_ratio,
        1000.0 * solid.density_kg_m3,
    )
    simulation = _spheres(solid, (great, radius), laws)
    _add_upper(simulation, spin)
    simulation.add(
        "b",
        (0.0, 0.0, -radius - GAP),
        velocity_m_s=STILL,
        angular_velocity_rad_s=STILL,
    )
    return _run(simulation, laws)


def _spheres(solid, other, laws):
    duration = 0.5 * hertz_on_plane(solid, RADIUS, NORMAL).duration_s
    step = duration / STEPS_PER_CONTACT
    return two_spheres((solid, RADIUS), other, CONTACT, step, **laws)


def _add_upper(simulation, spin):
    simulation.add(
        "a",
        (0.0, 0.0, RADIUS + GAP),
        velocity_m_s=(0.0, 0.0, -NORMAL),
        angular_velocity_rad_s=(0.0, spin, 0.0),
    )


def _run(simulation, laws):
    simulation.run_steps(2 * steps_of_impact(CONTACT.restitution, laws["tension"]))
    return Motion(simulation.velocities[0, 0], simulation.angular_velocities[0, 1])


def compare_sliding(case, solid, spin, after, laws):
    """Compare a hit that slides throughout.

    The change of velocity is that of rigid bodies, the change of spin that of the law.
    """
    at = f"{solid.name}, {spin:g} rad/s"
    hertz = hertz_on_plane(solid, RADIUS, NORMAL)
    lost = sliding_loss(CONTACT, NORMAL)
    slowed = spin - after.spin_rad_s
    by_law = sliding_spin(CONTACT, hertz, laws["tension"])
    case.close(f"{at}: tangential velocity [m/s]", abs(after.tangential_m_s), lost)
    case.close(f"{at}: change of spin [rad/s]", slowed, by_law)
    case.close(f"{at}: the same with lever R", slowed, 2.5 * lost / RADIUS)


@with_all_laws
def test_spinning_sphere_on_plane(case, laws):
    """A spinning sphere hits a plane at 0.2 m/s and slides (test 6)."""
    # mu (1 + e) V_n by hand
    assert abs(sliding_loss(CONTACT, NORMAL) - 0.12) < 1e-12
    for solid, spin in product(SOLIDS, SLIDING_SPINS):
        compare_sliding(case, solid, spin, hit_plane(solid, spin, laws), laws)


def test_two_spinning_spheres(case, laws):
    """Two equal spheres, each 0.2 m/s, with equal spins or opposite ones (test 7).

    With equal spin vectors the surfaces move against each other and the contact point
    stays: each sphere behaves as on a plane. With opposite vectors the surfaces move
    together and nothing is exchanged.
    """
    for solid in SOLIDS:
        for spin in SLIDING_SPINS:
            after = hit_equal_sphere(solid, spin, spin, laws)
            compare_sliding(case, solid, spin, after, laws)

        name = f"{solid.name}, opposite spins"
        slow = hit_equal_sphere(solid, 1.75, -1.75, laws).tangential_m_s
        fast, spin = hit_equal_sphere(solid, 21.0, -21.0, laws)
        largest = max(abs(slow), abs(fast))
        case.close(f"{name}: tangential velocity [m/s]", largest, 0.0, scale=0.12)
        case.close(f"{name}: spin [rad/s]", spin, 21.0)


def test_spinning_sphere_on_great_sphere(case, laws):
    """A spinning sphere hits a large, stiff sphere as if it were a plane (test 8)."""
    for solid, spin in product(SOLIDS, ALL_SPINS):
        at = f"{solid.name}, {spin:g} rad/s"
        after = hit_great_sphere(solid, spin, laws)
        expected = hit_plane(solid, spin, laws)
        case.close(
            f"{at}: velocity [m/s]", after.tangential_m_s, expected.tangential_m_s
        )
        case.close(
            f"{at}: spin [rad/s]",
            after.spin_rad_s,
            expected.spin_rad_s,
            scale=max(abs(expected.spin_rad_s), spin),
        )
