"""Simulations that several cases share: impacts of spheres, and berries."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from repose.dem import Clump, Contact, Material, Plane, Shape, Simulation
from repose.dem.laws.hertz_mindlin import damping_ratio

from .hertz import Solid, hertz_on_plane, rigid

STEPS_PER_CONTACT = 1500  # time steps in the contact time of Hertz
FLOOR = (0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)
# Semi-axes [m] and density [kg/m3] of a published fruit (Ji et al. 2026): a long, soft body.
BERRY_M = (0.01057, 0.005685, 0.00494)
BERRY_DENSITY = 840.47
BERRY = Material(4.3e4, 0.32)
PVC = Material(1.12e9, 0.4)


def smooth(radius_m: float, density_kg_m3: float, material: str) -> Shape:
    """A sphere as the sum of two of half its radius, which the engine treats as a smooth body and not as a sphere."""
    sphere = Shape.sphere(radius_m, density_kg_m3, material)
    return Shape(np.full((2, 3), 0.5 * radius_m), sphere.mass_kg, sphere.inertia_kg_m2, material)


def sphere_over_plane(
    solid: Solid,
    radius_m: float,
    contact: Contact,
    velocity_m_s: Sequence[float],
    spin_rad_s: Sequence[float] = (0.0, 0.0, 0.0),
    **laws: Any,
) -> tuple[Simulation, int]:
    """A sphere just above a rigid plane, without gravity, and the number of steps until it has surely left."""
    hertz = hertz_on_plane(solid, radius_m, abs(velocity_m_s[2]))
    step = hertz.duration_s / STEPS_PER_CONTACT
    box = 4.0 * radius_m
    simulation = Simulation(
        {"sphere": smooth(radius_m, solid.density_kg_m3, "sphere")},
        {"sphere": solid.material, "wall": rigid(solid.material)},
        {("sphere", "sphere"): contact, ("sphere", "wall"): contact},
        step,
        capacity=1,
        lower=(-box, -box, -box),
        upper=(box, box, box),
        walls={"floor": Plane(FLOOR, UP, "wall")},
        gravity_m_s2=(0.0, 0.0, 0.0),
        **laws,
    )
    gap = 3.5 * step * hertz.speed
    simulation.add("sphere", (0.0, 0.0, radius_m + gap), velocity_m_s=velocity_m_s, angular_velocity_rad_s=spin_rad_s)
    return simulation, steps_of_impact(contact.restitution, laws.get("tension", "keep"))


def steps_of_impact(restitution: float, tension: str = "keep") -> int:
    """Time steps of an impact, at `STEPS_PER_CONTACT` in Hertz's contact time: a damped contact lasts longer."""
    return int(STEPS_PER_CONTACT * (1.3 + 1.5 * damping_ratio(restitution, tension)))


def spheres(
    solids: Sequence[Solid],
    radii_m: Sequence[float],
    contact: Contact,
    places_m: Sequence[Sequence[float]],
    velocities_m_s: Sequence[Sequence[float]],
    spins_rad_s: Sequence[Sequence[float]],
    step_s: float,
    **laws: Any,
) -> Simulation:
    """Two spheres in space, without gravity; places, velocities and spins have shape (2, 3)."""
    names = ("a", "b")
    reach = 4.0 * max(radii_m)
    simulation = Simulation(
        {n: smooth(r, s.density_kg_m3, n) for n, r, s in zip(names, radii_m, solids, strict=True)},
        {n: s.material for n, s in zip(names, solids, strict=True)},
        {pair: contact for pair in (("a", "a"), ("a", "b"), ("b", "b"))},
        step_s,
        capacity=2,
        lower=(-reach, -reach, -reach),
        upper=(reach, reach, reach),
        gravity_m_s2=(0.0, 0.0, 0.0),
        **laws,
    )
    for name, place, velocity, spin in zip(names, places_m, velocities_m_s, spins_rad_s, strict=True):
        simulation.add(name, place, velocity_m_s=velocity, angular_velocity_rad_s=spin)
    return simulation


def simulation_of(
    shape: Shape | Clump,
    contact: Contact,
    step_s: float,
    walls: Mapping[str, Any] | None = None,
    material: Material = BERRY,
    wall: Material = PVC,
    **keywords: Any,
) -> Simulation:
    """An empty simulation of bodies of one shape, "body", between walls; by default without gravity and for one body.

    The materials are named "berry" and "wall"; the default box reaches 0.1 m to each side.
    """
    shapes: Any = {"body": shape}
    keywords.setdefault("capacity", 1)
    keywords.setdefault("gravity_m_s2", (0.0, 0.0, 0.0))
    keywords.setdefault("lower", (-0.1, -0.1, -0.1))
    keywords.setdefault("upper", (0.1, 0.1, 0.1))
    return Simulation(
        shapes,
        {"berry": material, "wall": wall},
        {("berry", "berry"): contact, ("berry", "wall"): contact},
        step_s,
        walls=walls,
        **keywords,
    )


def berry_simulation(
    contact: Contact, step_s: float, axes: tuple[float, float, float] = BERRY_M, **keywords: Any
) -> Simulation:
    """`simulation_of` berries, ellipsoids whose semi-axes in m are `axes`."""
    return simulation_of(Shape.ellipsoid(axes, BERRY_DENSITY, "berry"), contact, step_s, **keywords)


def stiffer(times: float) -> tuple[Material, Material]:
    """The materials of berry and wall with `times` the shear moduli."""
    berry, wall = (Material(times * m.shear_modulus_pa, m.poisson_ratio) for m in (BERRY, PVC))
    return berry, wall


def random_direction(rng: np.random.Generator) -> np.ndarray:
    """A uniformly random unit vector."""
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


def frictionless(restitution: float = 1.0) -> Contact:
    """A contact without any friction."""
    return Contact(restitution, 0.0, 0.0)
