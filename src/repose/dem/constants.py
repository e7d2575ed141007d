"""List the constants of pairs of materials that only some force laws need.

This module does not load the compiler, so that a configuration can be checked quickly.
"""

import math
from typing import NamedTuple


class Constant(NamedTuple):
    """A constant of a pair of materials that a force law needs.

    Attributes
    ----------
    name : str
        Its key in `Contact.constants`, which ends with its unit.
    short : str
        Prefix of the names of its parameters in a study. With ``gamma``, they are
        ``gamma_gg`` and ``gamma_gp``.
    symbol : str
        Symbol in figures, in LaTeX.
    unit : str
        Unit; empty for a ratio.
    words : str
        Name in messages and figures.
    least, most : float
        Smallest and largest value allowed.
    """

    name: str
    short: str
    symbol: str
    unit: str
    words: str
    least: float = 0.0
    most: float = math.inf

    def check(self, value: object) -> float:
        """Convert a value of this constant to a number, and check that it is allowed.

        Parameters
        ----------
        value : object
            The value that the user gave.

        Raises
        ------
        ValueError
            If it is not a finite number between `least` and `most`.
        """
        try:
            number = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            number = math.nan  # rejected below
        if not (self.least <= number <= self.most and math.isfinite(number)):
            upper_bound = f"to {self.most:g}" if self.most < math.inf else "or more"
            raise ValueError(
                f"{self.name} is {value!r}; "
                f"expected {self.least:g} {upper_bound} {self.unit}"
            )
        return number


SURFACE_ENERGY = Constant(
    name="surface_energy_j_m2",
    short="gamma",
    symbol=r"\gamma",
    unit="J/m2",
    words="surface energy",
)
COHESION_ENERGY_DENSITY = Constant(
    name="cohesion_energy_density_j_m3",
    short="k",
    symbol="k",
    unit="J/m3",
    words="cohesion energy density",
)
PLASTICITY_RATIO = Constant(
    name="plasticity_ratio",
    short="plas",
    symbol=r"\lambda",
    unit="",
    words="plasticity ratio",
    most=0.99,
)
# The coefficient mu_t with which some rolling laws (`laws.RollingLaw`) resist spin
# about the normal. It is optional; by default it is 3 pi / 16 mu_s.
TWISTING = Constant(
    name="twisting_friction",
    short="mut",
    symbol=r"{\mu_t}",
    unit="",
    words="twisting friction",
)

# The constants that each contact law needs; a law without constants has no entry.
OF_LAWS: dict[str, tuple[Constant, ...]] = {
    "jkr": (SURFACE_ENERGY,),
    "sjkr": (COHESION_ENERGY_DENSITY,),
    "eepa": (PLASTICITY_RATIO, SURFACE_ENERGY),
}
