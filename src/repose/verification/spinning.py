"""Impacts of spinning spheres: tests 6 to 8 of Chung & Ooi (2011), Granular Matter 13, 643-656; see also `oblique`."""

from itertools import product
from typing import Any

from repose.dem import Contact

from .case import Effort, Rows, close
from .hertz import Solid, hertz_on_plane
from .machine import STEPS_PER_CONTACT, STILL, impact, spheres, steps_of_impact
from .oblique import sliding_rows

SOLIDS = (Solid("aluminium", 70e9, 0.33, 2700.0), Solid("nylon", 2.5e9, 0.40, 1000.0))
SLIDING = (6.0, 13.0, 21.0)  # spins that slide through the whole impact [rad/s]
COMPARED = (0.5, 1.75, 3.5, 9.0, 21.0)  # spins of test 8 [rad/s]
CONTACT, RADIUS, NORMAL = Contact(0.5, 0.4, 0.0), 0.1, 0.2


def _on_plane(solid: Solid, spin: float, **laws: Any) -> tuple[float, float]:
    """Simulate an impact of test 6: tangential velocity and spin after it."""
    v, w = impact(solid, RADIUS, CONTACT, (0.0, 0.0, -NORMAL), (0.0, spin, 0.0), **laws)
    return v[0], w[1]


def _on_sphere(
    solid: Solid,
    spin: float,
    sense: float = 1.0,
    radius: float = RADIUS,
    factor: float = 1.0,
    **laws: Any,
) -> tuple[float, float]:
    """Simulate the same for the upper of two spheres; the spin of the other is `sense` times its own.

    `radius` is that of the other sphere, `factor` its stiffness and density over the first sphere's; with a factor
    above 1 it is at rest.
    """
    other = Solid(
        "other",
        factor * solid.elastic_modulus_pa,
        solid.poisson_ratio,
        factor * solid.density_kg_m3,
    )
    gap, velocity, turning = 1e-7, (0.0, 0.0, NORMAL), (0.0, sense * spin, 0.0)
    if factor > 1.0:
        velocity = turning = STILL
    step = 0.5 * hertz_on_plane(solid, RADIUS, NORMAL).duration_s / STEPS_PER_CONTACT
    simulation = spheres(
        {"a": (solid, RADIUS), "b": (other, radius)}, CONTACT, step, **laws
    )
    down, turned = (0.0, 0.0, -NORMAL), (0.0, spin, 0.0)
    simulation.add(
        "a", (0.0, 0.0, RADIUS + gap), velocity_m_s=down, angular_velocity_rad_s=turned
    )
    simulation.add(
        "b",
        (0.0, 0.0, -radius - gap),
        velocity_m_s=velocity,
        angular_velocity_rad_s=turning,
    )
    simulation.run_steps(
        2 * steps_of_impact(CONTACT.restitution, laws.get("tension", "keep"))
    )
    return simulation.velocities[0, 0], simulation.angular_velocities[0, 1]


def _sliding_rows(
    solid: Solid, spin: float, after: tuple[float, float], effort: Effort
) -> Rows:
    """Compare a spin that slides through the whole impact."""
    hertz, at = hertz_on_plane(solid, RADIUS, NORMAL), f"{solid.name}, {spin:g} rad/s"
    return sliding_rows(at, CONTACT, hertz, after, (0.0, spin), effort.tension)


def plane_spins(effort: Effort) -> Rows:
    """Test 6: radius 0.1 m, 0.2 m/s, e 0.5, mu 0.4, spins 6 to 21 rad/s; aluminium and nylon."""
    for solid, spin in product(SOLIDS, SLIDING):
        yield from _sliding_rows(
            solid, spin, _on_plane(solid, spin, **effort.laws), effort
        )


def equal_spheres(effort: Effort) -> Rows:
    """Test 7: two equal spheres of test 6's materials, each 0.2 m/s, spins of the same and of opposite sense.

    With equal spin vectors the surfaces move against each other and the contact point stays: each sphere behaves as on
    a plane. With opposite vectors the surfaces move together and nothing is exchanged.
    """
    for solid in SOLIDS:
        for spin in SLIDING:
            yield from _sliding_rows(
                solid, spin, _on_sphere(solid, spin, **effort.laws), effort
            )
        (slow, _), (fast, w) = (
            _on_sphere(solid, spin, -1.0, **effort.laws) for spin in (1.75, 21.0)
        )
        at, moved = (
            f"{solid.name}: tangential velocity, opposite spin vectors",
            max(abs(slow), abs(fast)),
        )
        yield close(at, "m/s", moved, 0.0, scale=0.12)
        yield close(f"{solid.name}: spin, opposite spin vectors", "rad/s", w, 21.0)


def unequal_spheres(effort: Effort) -> Rows:
    """Test 8: spheres of radii 0.1 and 0.5 m, the second 1000 times stiffer and denser: test 6 again."""
    source = "test 6, same simulator"
    for solid, spin in product(SOLIDS, COMPARED):
        at = f"{solid.name}, {spin:g} rad/s"
        v, w = _on_sphere(solid, spin, radius=0.5, factor=1000.0, **effort.laws)
        plane_v, plane_w = _on_plane(solid, spin, **effort.laws)
        yield close(f"{at}: tangential velocity", "m/s", v, plane_v, source)
        yield close(
            f"{at}: spin", "rad/s", w, plane_w, source, scale=max(abs(plane_w), spin)
        )
