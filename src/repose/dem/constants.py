"""Constants of two materials beyond restitution and friction, by the law that needs them; it loads no compiler."""

import math
from typing import NamedTuple


class Constant(NamedTuple):
    """A constant that a force law needs of two materials.

    Attributes
    ----------
    name : str
        Its key in `Contact.constants`, which ends with its unit.
    short : str
        Begins the names of its parameters in a study: ``gamma`` stands for ``gamma_gg`` and ``gamma_gp``.
    symbol, unit, words : str
        For people; the symbol in LaTeX.
    least, most : float
        Bounds of its value.
    """

    name: str
    short: str
    symbol: str
    unit: str
    words: str
    least: float = 0.0
    most: float = math.inf

    def check(self, value: object) -> float:
        """Return the value as a number, or raise ValueError with the name and what is allowed."""
        try:
            number = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            number = math.nan
        if not (self.least <= number <= self.most and math.isfinite(number)):
            end = f"to {self.most:g}" if self.most < math.inf else "or more"
            raise ValueError(
                f"{self.name} is {value!r}; expected {self.least:g} {end} {self.unit}"
            )
        return number


SURFACE_ENERGY = Constant(
    "surface_energy_j_m2", "gamma", r"\gamma", "J/m2", "surface energy"
)
COHESION_ENERGY_DENSITY = Constant(
    "cohesion_energy_density_j_m3", "k", "k", "J/m3", "cohesion energy density"
)
PLASTICITY_RATIO = Constant(
    "plasticity_ratio", "plas", r"\lambda", "", "plasticity ratio", 0.0, 0.99
)
# Of the rolling laws that resist spin about the normal; without it mu_t is 3 pi / 16 mu_s.
TWISTING = Constant("twisting_friction", "mut", r"{\mu_t}", "", "twisting friction")
TWISTED_BY = ("constant_torque", "epsd", "epsd2")

# The constants that each contact law needs; a law without constants has no entry.
OF_LAWS: dict[str, tuple[Constant, ...]] = {
    "jkr": (SURFACE_ENERGY,),
    "sjkr": (COHESION_ENERGY_DENSITY,),
    "eepa": (PLASTICITY_RATIO, SURFACE_ENERGY),
}
