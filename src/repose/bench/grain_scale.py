"""Units of a grain under gravity, in which limits and intervals are the same for all.

A pile of grains of another size, with the same shape and friction, moves alike in these
units: d for lengths, sqrt(d / g) for times, m g d for energies.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Self

if TYPE_CHECKING:
    from repose.grain.particle import Particle

# Simulated time between two looks at a bed that comes to rest or runs out.
LOOK_TIMES = 1.35


class GrainScale(NamedTuple):
    """Diameter and mass of a grain, and the gravity that acts on it.

    Attributes
    ----------
    diameter_m : float
        Of the sphere with the grain's volume.
    mass_kg : float
        Of the grain.
    gravity_m_s2 : float
        Gravity.
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

        Its mass is not a number.
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

    def interval_s(self, times: float = LOOK_TIMES) -> float:
        """Return a multiple of the unit of time, rounded to one digit [s].

        So the bodies that stand for one grain, whose volumes differ a little, are
        looked at equally often.
        """
        return rounded(times * self.time_s, digits=1)


def rounded(value: float, digits: int) -> float:
    """Round to a number of significant digits."""
    return float(f"{value:.{digits}g}")
