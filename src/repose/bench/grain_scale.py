"""Units of length, time and energy of a grain: diameter d, mass m, under gravity g.

They are d for lengths, sqrt(d / g) for times and m g d for energies. In these units,
grains of different sizes move in the same way if their shape and friction are the same.
A limit or an interval in these units therefore holds for all sizes.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Self

if TYPE_CHECKING:
    from repose.grain.particle import Particle

# Simulated time between two checks of a bed that comes to rest or flows out, in units
# of `GrainScale.time_s`.
CHECK_TIMES = 1.35


class GrainScale(NamedTuple):
    """The units of a scene: diameter and mass of a grain, and the gravity on it.

    Attributes
    ----------
    diameter_m : float
        Diameter of the sphere with the volume of the grain.
    mass_kg : float
        Mass of the grain.
    gravity_m_s2 : float
        Acceleration of gravity.
    """

    diameter_m: float
    mass_kg: float
    gravity_m_s2: float

    @classmethod
    def of(cls, particle: "Particle", gravity_m_s2: float) -> Self:
        """Make the units of a particle."""
        diameter_m = (6.0 * particle.volume_m3 / math.pi) ** (1.0 / 3.0)
        return cls(diameter_m, particle.mass_kg, gravity_m_s2)

    @classmethod
    def of_axes(cls, axes_mm: Sequence[float], gravity_m_s2: float) -> Self:
        """Make the units of length and time of an ellipsoid with three full axes.

        Its mass is unknown, so the mass and the unit of energy are NaN.
        """
        diameter_m = 1e-3 * math.prod(axes_mm) ** (1.0 / 3.0)
        return cls(diameter_m, math.nan, gravity_m_s2)

    @property
    def time_s(self) -> float:
        """The time in which a grain falls by half of its diameter."""
        return math.sqrt(self.diameter_m / self.gravity_m_s2)

    @property
    def energy_j(self) -> float:
        """The energy that lifts a grain by its diameter."""
        return self.mass_kg * self.gravity_m_s2 * self.diameter_m

    def interval_s(self, times: float = CHECK_TIMES) -> float:
        """Return a multiple of the unit of time, rounded to one significant digit [s].

        The bodies that may represent the same grain differ slightly in volume. Because
        of the rounding, they all have the same interval.
        """
        return round_to_digits(times * self.time_s, digits=1)


def round_to_digits(value: float, digits: int) -> float:
    """Round a value to a number of significant digits."""
    return float(f"{value:.{digits}g}")
