"""Simulations that several cases share: impacts of spheres, and grains."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from repose.dem import Clump, Contact, Material, Plane, Shape, Simulation, time_steps
from repose.dem.laws.hertz_mindlin import damping_ratio

from .hertz import Solid, hertz_on_plane, rigid

STEPS_PER_CONTACT = 1500  # time steps in the contact time of Hertz
STILL = (0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)
ON_FLOOR = {"floor": Plane(STILL, UP, "wall")}
GRAVITY = 9.81
# Semi-axes [m] and density [kg/m3] of a published fruit (Ji et al. 2026): a long, soft body.
BERRY_M = (0.01057, 0.005685, 0.00494)
BERRY_DENSITY = 840.47
BERRY = Material(4.3e4, 0.32)
PVC = Material(1.12e9, 0.4)
Body = Shape | Clump
Vector = Sequence[float]


def smooth(radius_m: float, density_kg_m3: float, material: str) -> Shape:
    """Make a sphere as the sum of two of half its radius, which the engine treats as a smooth body, not as a sphere."""
    sphere = Shape.sphere(radius_m, density_kg_m3, material)
    return Shape(
        np.full((2, 3), 0.5 * radius_m), sphere.mass_kg, sphere.inertia_kg_m2, material
    )


def sphere_over_plane(
    solid: Solid,
    radius_m: float,
    contact: Contact,
    velocity_m_s: Vector,
    spin_rad_s: Vector = STILL,
    **laws: Any,
) -> tuple[Simulation, int]:
    """Put a sphere just above a rigid plane, without gravity; return also the steps until it has surely left."""
    hertz = hertz_on_plane(solid, radius_m, abs(velocity_m_s[2]))
    step, box = hertz.duration_s / STEPS_PER_CONTACT, 4.0 * radius_m
    body = smooth(radius_m, solid.density_kg_m3, "berry")
    room: dict[str, Any] = {"material": solid.material, "wall": rigid(solid.material)}
    room |= {"walls": ON_FLOOR, "lower": 3 * (-box,), "upper": 3 * (box,)}
    simulation = simulation_of(body, contact, step, **room, **laws)
    place = (0.0, 0.0, radius_m + 3.5 * step * hertz.speed)
    simulation.add(
        "body", place, velocity_m_s=velocity_m_s, angular_velocity_rad_s=spin_rad_s
    )
    return simulation, steps_of_impact(contact.restitution, laws.get("tension", "keep"))


def impact(
    solid: Solid, radius_m: float, contact: Contact, *motion: Vector, **laws: Any
) -> tuple[np.ndarray, ...]:
    """Simulate an impact on the rigid plane: velocity [m/s] and spin [rad/s] of the sphere after it, each (3,).

    `motion` is the velocity and, if it spins, the spin before.
    """
    simulation, steps = sphere_over_plane(solid, radius_m, contact, *motion, **laws)
    simulation.run_steps(steps)
    return simulation.velocities[0].copy(), simulation.angular_velocities[0].copy()


def steps_of_impact(restitution: float, tension: str = "keep") -> int:
    """Count the time steps of an impact, `STEPS_PER_CONTACT` in Hertz's time: a damped contact lasts longer."""
    return int(STEPS_PER_CONTACT * (1.3 + 1.5 * damping_ratio(restitution, tension)))


def spheres(
    balls: Mapping[str, tuple[Solid, float]],
    contact: Contact,
    step_s: float,
    **laws: Any,
) -> Simulation:
    """Make an empty simulation of two spheres in space, without gravity: solid and radius [m] of "a" and "b"."""
    reach = 4.0 * max(radius_m for _, radius_m in balls.values())
    room: dict[str, Any] = {
        "capacity": 2,
        "gravity_m_s2": STILL,
        "lower": 3 * (-reach,),
        "upper": 3 * (reach,),
    }
    contacts = dict.fromkeys((("a", "a"), ("a", "b"), ("b", "b")), contact)
    shapes: Any = {
        name: smooth(radius_m, solid.density_kg_m3, name)
        for name, (solid, radius_m) in balls.items()
    }
    materials = {name: solid.material for name, (solid, _) in balls.items()}
    return Simulation(shapes, materials, contacts, step_s, **(room | laws))


def simulation_of(
    shape: Body,
    contact: Contact,
    step_s: float,
    material: Material = BERRY,
    wall: Material = PVC,
    **keywords: Any,
) -> Simulation:
    """Make an empty simulation of bodies of one shape, "body"; without walls and gravity, and for one body.

    The materials are named "berry" and "wall"; the box reaches 0.1 m to each side. `keywords` replace that.
    """
    room: dict[str, Any] = {
        "capacity": 1,
        "gravity_m_s2": STILL,
        "lower": (-0.1, -0.1, -0.1),
        "upper": (0.1, 0.1, 0.1),
    }
    contacts = {("berry", "berry"): contact, ("berry", "wall"): contact}
    shapes: Any = {"body": shape}
    return Simulation(
        shapes, {"berry": material, "wall": wall}, contacts, step_s, **(room | keywords)
    )


def berry_simulation(
    contact: Contact, step_s: float, axes: Vector = BERRY_M, **keywords: Any
) -> Simulation:
    """Make `simulation_of` grains, ellipsoids whose semi-axes in m are `axes`."""
    return simulation_of(
        Shape.ellipsoid(axes, BERRY_DENSITY, "berry"), contact, step_s, **keywords
    )


def under_gravity(walls: Mapping[str, Any] = ON_FLOOR) -> dict[str, Any]:
    """Give the keywords of `simulation_of` for bodies under gravity, by default on a floor."""
    return {"walls": walls, "gravity_m_s2": (0.0, 0.0, -GRAVITY)}


def box(west: float, east: float, south: float, north: float) -> dict[str, Plane]:
    """Make a floor and four walls at these x and y [m]."""
    return ON_FLOOR | {
        "west": Plane((west, 0.0, 0.0), (1.0, 0.0, 0.0), "wall"),
        "east": Plane((east, 0.0, 0.0), (-1.0, 0.0, 0.0), "wall"),
        "south": Plane((0.0, south, 0.0), (0.0, 1.0, 0.0), "wall"),
        "north": Plane((0.0, north, 0.0), (0.0, -1.0, 0.0), "wall"),
    }


def before_impact(
    shape: Body,
    contact: Contact,
    speed_m_s: float,
    steps: int,
    times: float,
    **keywords: Any,
) -> tuple[Simulation, float]:
    """Make `simulation_of` bodies whose fastest contact lasts so many time steps, and return also the step [s].

    The shear moduli of grain and wall are multiplied by `times`.
    """
    berry, wall = (
        Material(times * m.shear_modulus_pa, m.poisson_ratio) for m in (BERRY, PVC)
    )

    def made(step_s: float) -> Simulation:
        return simulation_of(
            shape, contact, step_s, material=berry, wall=wall, **keywords
        )

    hit = time_steps.impact(made(1e-15).scene, shape, shape, speed_m_s).time_step_s
    step = hit * time_steps.STEPS_PER_CONTACT / steps
    return made(step), step


def track(
    simulation: Simulation, times: int, steps: int, look: Callable[[], Any]
) -> np.ndarray:
    """Run so many steps so many times, and give what `look` returns after each: an array of rows."""

    def after() -> Any:
        simulation.run_steps(steps)
        return look()

    return np.array([after() for _ in range(times)])


def random_direction(rng: np.random.Generator) -> np.ndarray:
    """Draw a uniformly random unit vector."""
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


def frictionless(restitution: float = 1.0) -> Contact:
    """Make a contact without any friction."""
    return Contact(restitution, 0.0, 0.0)
