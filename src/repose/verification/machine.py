"""Simulations that several cases share: impacts of spheres, and the reference solution of the contact law."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from repose.dem import Contact, Material, Plane, Shape, Simulation
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

RIGID = 1e9  # how many times stiffer than the sphere a wall is that stands for a rigid one
STEPS_PER_CONTACT = 1500  # time steps in the contact time of Hertz
FLOOR = (0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)
BERRY_M = (0.01057, 0.005685, 0.00494)  # half the mean axes of the goji berry
BERRY_DENSITY = 840.47
BERRY = Material(4.3e4, 0.32)
PVC = Material(1.12e9, 0.4)


@dataclass(frozen=True)
class Solid:
    """Elastic constants and density of a sphere: E [Pa], Poisson's ratio, density [kg/m3]."""

    name: str
    elastic_modulus_pa: float
    poisson_ratio: float
    density_kg_m3: float

    @property
    def material(self) -> Material:
        """The engine's material: G = E / (2 (1 + nu))."""
        return Material(self.elastic_modulus_pa / (2.0 * (1.0 + self.poisson_ratio)), self.poisson_ratio)

    def sphere_mass(self, radius_m: float) -> float:
        """Mass of a solid sphere [kg]."""
        return self.density_kg_m3 * 4.0 / 3.0 * math.pi * radius_m**3


@dataclass(frozen=True)
class Hertz:
    """Elastic impact of two spheres, or of a sphere on a plane (Johnson 1985, section 11.4).

    mass, radius: the effective ones m*, R* [kg, m]; young: E* [Pa]; speed: of approach [m/s].
    """

    mass: float
    radius: float
    young: float
    speed: float

    @property
    def overlap_m(self) -> float:
        """Largest overlap: (15 m* v^2 / (16 E* sqrt(R*)))^(2/5)."""
        return (15.0 * self.mass * self.speed**2 / (16.0 * self.young * math.sqrt(self.radius))) ** 0.4

    @property
    def force_n(self) -> float:
        """Largest force: 4/3 E* sqrt(R*) delta^(3/2)."""
        return 4.0 / 3.0 * self.young * math.sqrt(self.radius) * self.overlap_m**1.5

    @property
    def duration_s(self) -> float:
        """Contact time: 2.9432 delta / v, the number being 4/5 sqrt(pi) Gamma(2/5) / Gamma(9/10)."""
        factor = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9)
        return factor * self.overlap_m / self.speed

    def history(self, restitution: float, count: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The damped impact from its differential equation (Tsuji 1992).

        m* d2(delta)/dt2 = -F, F = 4/3 E* sqrt(R*) delta^1.5 + 2 sqrt(5/6) b sqrt(S m*) d(delta)/dt, S = 2 E*
        sqrt(R* delta), b the damping ratio; in units in which overlap, mass and speed are 1.

        Parameters
        ----------
        restitution : float
        count : int, optional
            Number of times.

        Returns
        -------
        time, overlap, force : numpy.ndarray
            s, m, and the normal force in N.
        """
        damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio(restitution) * math.sqrt(15.0 / 8.0)

        def force(x: np.ndarray, v: np.ndarray) -> np.ndarray:
            x = np.maximum(x, 0.0)
            return 1.25 * x**1.5 + damping * x**0.25 * v

        def parts(_t: float, state: np.ndarray) -> tuple[float, np.ndarray]:
            return state[1], -force(state[0], state[1])

        def leaves(_t: float, state: np.ndarray) -> float:
            return state[0]

        leaves.terminal, leaves.direction = True, -1  # type: ignore[attr-defined]  # so scipy wants it
        found = solve_ivp(
            parts, (0.0, 40.0), (0.0, 1.0), events=leaves, rtol=1e-9, atol=1e-12, dense_output=True
        )
        time = np.linspace(0.0, found.t[-1], count)
        overlap, speed = found.sol(time)
        unit_s = self.overlap_m / self.speed
        unit_n = self.mass * self.speed**2 / self.overlap_m
        return time * unit_s, overlap * self.overlap_m, force(overlap, speed) * unit_n


def hertz_of_pair(solid: Solid, radius_m: float, speed_m_s: float) -> Hertz:
    """Two equal spheres that approach with a speed."""
    young, _ = effective_moduli(solid.material, solid.material)
    return Hertz(0.5 * solid.sphere_mass(radius_m), 0.5 * radius_m, young, speed_m_s)


def hertz_on_plane(solid: Solid, radius_m: float, speed_m_s: float) -> Hertz:
    """A sphere on the wall that stands for a rigid plane."""
    young, _ = effective_moduli(solid.material, rigid(solid.material))
    return Hertz(solid.sphere_mass(radius_m), radius_m, young, speed_m_s)


def rigid(material: Material) -> Material:
    """A material that gives way to this one by one part in 1e9."""
    return Material(RIGID * material.shear_modulus_pa, material.poisson_ratio)


def sphere_over_plane(
    solid: Solid,
    radius_m: float,
    contact: Contact,
    velocity_m_s: Sequence[float],
    spin_rad_s: Sequence[float] = (0.0, 0.0, 0.0),
    tension: str = "keep",
    friction_limit: str = "elastic",
) -> tuple[Simulation, int]:
    """A sphere just above a rigid plane, without gravity.

    Parameters
    ----------
    solid : Solid
    radius_m : float
    contact : Contact
    velocity_m_s : sequence of float, (3,)
        Towards the plane, z negative.
    spin_rad_s : sequence of float, (3,), optional
    tension, friction_limit : str, optional
        As the simulation takes them.

    Returns
    -------
    simulation : Simulation
    steps : int
        Steps until the sphere has surely left.
    """
    hertz = hertz_on_plane(solid, radius_m, abs(velocity_m_s[2]))
    step = hertz.duration_s / STEPS_PER_CONTACT
    box = 4.0 * radius_m
    simulation = Simulation(
        {"sphere": Shape.sphere(radius_m, solid.density_kg_m3, "sphere")},
        {"sphere": solid.material, "wall": rigid(solid.material)},
        {("sphere", "sphere"): contact, ("sphere", "wall"): contact},
        step,
        capacity=1,
        lower=(-box, -box, -box),
        upper=(box, box, box),
        walls={"floor": Plane(FLOOR, UP, "wall")},
        gravity_m_s2=(0.0, 0.0, 0.0),
        tension=tension,
        friction_limit=friction_limit,
    )
    gap = 3.5 * step * hertz.speed
    simulation.add(
        "sphere",
        (0.0, 0.0, radius_m + gap),
        velocity_m_s=velocity_m_s,
        angular_velocity_rad_s=spin_rad_s,
    )
    return simulation, steps_of_impact(contact.restitution, tension)


def steps_of_impact(restitution: float, tension: str = "keep") -> int:
    """Time steps after which an impact is over: a damped contact lasts longer than an elastic one."""
    return int(STEPS_PER_CONTACT * (1.3 + 1.5 * damping_ratio(restitution, tension)))


def spheres(
    solids: Sequence[Solid],
    radii_m: Sequence[float],
    contact: Contact,
    places_m: Sequence[Sequence[float]],
    velocities_m_s: Sequence[Sequence[float]],
    spins_rad_s: Sequence[Sequence[float]],
    step_s: float,
    tension: str = "keep",
    friction_limit: str = "elastic",
) -> Simulation:
    """Two spheres in space, each of its own solid and radius."""
    names = ("a", "b")
    reach = 4.0 * max(radii_m)
    simulation = Simulation(
        {n: Shape.sphere(r, s.density_kg_m3, n) for n, r, s in zip(names, radii_m, solids, strict=True)},
        {n: s.material for n, s in zip(names, solids, strict=True)},
        {pair: contact for pair in (("a", "a"), ("a", "b"), ("b", "b"))},
        step_s,
        capacity=2,
        lower=(-reach, -reach, -reach),
        upper=(reach, reach, reach),
        gravity_m_s2=(0.0, 0.0, 0.0),
        tension=tension,
        friction_limit=friction_limit,
    )
    for name, place, velocity, spin in zip(names, places_m, velocities_m_s, spins_rad_s, strict=True):
        simulation.add(name, place, velocity_m_s=velocity, angular_velocity_rad_s=spin)
    return simulation


def berry_simulation(
    contact: Contact,
    step_s: float,
    capacity: int = 1,
    walls: Mapping[str, Any] | None = None,
    material: Material = BERRY,
    axes: tuple[float, float, float] = BERRY_M,
    **keywords: Any,
) -> Simulation:
    """Berries, ellipsoids of the mean axes unless given, with walls of PVC; without gravity unless asked for."""
    shape = Shape.ellipsoid(axes, BERRY_DENSITY, "berry")
    keywords.setdefault("gravity_m_s2", (0.0, 0.0, 0.0))
    keywords.setdefault("lower", (-0.1, -0.1, -0.1))
    keywords.setdefault("upper", (0.1, 0.1, 0.1))
    return Simulation(
        {"berry": shape},
        {"berry": material, "wall": PVC},
        {("berry", "berry"): contact, ("berry", "wall"): contact},
        step_s,
        capacity=capacity,
        walls=walls,
        **keywords,
    )


def random_direction(rng: np.random.Generator) -> np.ndarray:
    """A uniformly random unit vector (3,)."""
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


def frictionless(restitution: float = 1.0) -> Contact:
    """A contact without any friction."""
    return Contact(restitution, 0.0, 0.0)
