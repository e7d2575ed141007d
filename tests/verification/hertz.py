"""Reference solution of a normal impact: Hertz's law, elastic and damped."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from repose.dem import Material
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

RIGID = 1e9  # stiffness of a rigid wall over that of the sphere


@dataclass(frozen=True)
class Solid:
    """Elastic constants and density of a sphere."""

    name: str
    elastic_modulus_pa: float  # Young's modulus
    poisson_ratio: float
    density_kg_m3: float

    @property
    def material(self):
        """The engine's material: G = E / (2 (1 + nu))."""
        shear_modulus = self.elastic_modulus_pa / (2.0 * (1.0 + self.poisson_ratio))
        return Material(shear_modulus, self.poisson_ratio)

    def sphere_mass(self, radius_m):
        """Compute the mass of a solid sphere [kg]."""
        return self.density_kg_m3 * 4.0 / 3.0 * math.pi * radius_m**3


ALUMINIUM_OXIDE = Solid("aluminium oxide", 380e9, 0.23, 4000.0)  # of tests 3 and 4


@dataclass(frozen=True)
class Hertz:
    """Elastic impact of two spheres, or of a sphere on a plane.

    Johnson, K. L. (1985). Contact Mechanics. Cambridge University Press, section 11.4.
    """

    mass: float  # effective mass m* [kg]
    radius: float  # effective radius R* [m]
    young: float  # effective modulus E* [Pa]
    speed: float  # of approach [m/s]

    @property
    def overlap_m(self):
        """Largest overlap: (15 m* v^2 / (16 E* sqrt(R*)))^(2/5)."""
        energy = 15.0 * self.mass * self.speed**2
        return (energy / (16.0 * self.young * math.sqrt(self.radius))) ** 0.4

    @property
    def force_n(self):
        """Largest force: 4/3 E* sqrt(R*) delta^(3/2)."""
        stiffness = 4.0 / 3.0 * self.young * math.sqrt(self.radius)
        return stiffness * self.overlap_m**1.5

    @property
    def duration_s(self):
        """Contact time, 4/5 sqrt(pi) Gamma(2/5) / Gamma(9/10) delta / v.

        The factor is 2.9432.
        """
        factor = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9)
        return factor * self.overlap_m / self.speed

    def history(self, restitution, count=400, tension="keep"):
        """Solve the damped impact (Tsuji 1992).

        Returns time [s], overlap [m] and normal force [N], each (count,).

        m* d2(delta)/dt2 = -F
        F = 4/3 E* sqrt(R*) delta^1.5 + 2 sqrt(5/6) b sqrt(S m*) d(delta)/dt
        S = 2 E* sqrt(R* delta), and b is the damping ratio.

        With `tension` "keep" the contact lasts until the overlap ends, with "release"
        until the force vanishes. The equation is solved in units in which the largest
        elastic overlap, the mass and the speed are 1.
        """
        beta = damping_ratio(restitution, tension)
        damping = 2.0 * math.sqrt(5.0 / 6.0) * beta * math.sqrt(15.0 / 8.0)

        def force(overlap, speed):
            overlap = np.maximum(overlap, 0.0)
            return 1.25 * overlap**1.5 + damping * overlap**0.25 * speed

        def derivatives(_time, state):
            return state[1], -force(state[0], state[1])

        def end_of_contact(_time, state):
            """Pass through zero when the contact ends.

            Positive before, and while the bodies approach.
            """
            if state[1] >= 0.0:
                return 1.0
            if tension == "release":
                return min(state[0], force(state[0], state[1]))
            return min(state[0], 1.0)

        end_of_contact.terminal = True
        end_of_contact.direction = -1
        solution = solve_ivp(
            derivatives,
            (0.0, 40.0),
            (0.0, 1.0),
            events=end_of_contact,
            rtol=1e-9,
            atol=1e-12,
            dense_output=True,
        )
        time = np.linspace(0.0, solution.t[-1], count)
        overlap, speed = solution.sol(time)
        unit_s = self.overlap_m / self.speed
        unit_n = self.mass * self.speed**2 / self.overlap_m
        return time * unit_s, overlap * self.overlap_m, force(overlap, speed) * unit_n


def hertz_of_pair(solid, radius_m, speed_m_s):
    """Describe the impact of two equal spheres: m* = m / 2, R* = R / 2."""
    young, _ = effective_moduli(solid.material, solid.material)
    mass = 0.5 * solid.sphere_mass(radius_m)
    return Hertz(mass, 0.5 * radius_m, young, speed_m_s)


def hertz_on_plane(solid, radius_m, speed_m_s):
    """Describe the impact of a sphere on a rigid plane: m* = m, R* = R."""
    young, _ = effective_moduli(solid.material, rigid(solid.material))
    return Hertz(solid.sphere_mass(radius_m), radius_m, young, speed_m_s)


def rigid(material):
    """Make a material with `RIGID` times the shear modulus."""
    return Material(RIGID * material.shear_modulus_pa, material.poisson_ratio)
