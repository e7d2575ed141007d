"""A profile, a line of heights, as a response: its scores on a few smooth functions are numbers like any other.

The functions are polynomials of rising degree, orthonormal in the mean over the profile's abscissae: score 1 is the
mean height, score 2 the slope, score 3 the curvature, each in the unit of the heights. By Parseval's theorem the sum of
the squared differences of all scores of two profiles is the mean square distance of their smooth parts. A straight
profile has two scores; with cosines, the other usual choice, it would have many.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from repose.calibrate.responses import derived
from repose.common.section import ABSENT, Section


class OfProfile(Section):
    """The record of a profile in its targets."""

    name: str
    x: Annotated[tuple[float, ...], Field(strict=False)]
    z: Annotated[tuple[float, ...], Field(strict=False)]
    functions: int
    covered: float = ABSENT

    @property
    def abscissae(self) -> dict[str, Any]:
        """All of it but the heights, as a file has it."""
        return self.model_dump(mode="json", exclude={"z"}, exclude_none=True)


@dataclass(frozen=True)
class Profile:
    """A measured profile and the functions on which profiles are compared with it."""

    name: str  # ends with the unit of the heights, ``surface_mm``; the scores are ``surface_1_mm`` and so on
    x: tuple[float, ...]  # (n,), abscissae, rising
    z: tuple[float, ...]  # (n,), the measured heights there
    functions: int  # number of scores

    @classmethod
    def of(cls, section: Mapping[str, Any]) -> "Profile":
        """Read the profile of a target of the configuration."""
        return cls(
            section["name"],
            tuple(section["x"]),
            tuple(section["z"]),
            section["functions"],
        )

    @cached_property
    def basis(self) -> np.ndarray:
        """The functions at the abscissae, (n, functions); the mean of a square is 1, of a product of two 0."""
        x = np.array(self.x)
        middle, half = 0.5 * (x[-1] + x[0]), 0.5 * (x[-1] - x[0])
        q, r = np.linalg.qr(
            np.polynomial.legendre.legvander((x - middle) / half, self.functions - 1)
        )
        return q * np.sign(np.diagonal(r)) * math.sqrt(len(x))

    def scores(self, heights: ArrayLike) -> np.ndarray:
        """Compute the scores (..., functions) of heights (..., n) at the abscissae."""
        return np.asarray(heights, float) @ self.basis / len(self.x)

    def heights(self, scores: ArrayLike) -> np.ndarray:
        """Compute the smooth profile (..., n) from scores (..., functions)."""
        return np.asarray(scores, float) @ self.basis.T

    def columns(self, heights: ArrayLike) -> dict[str, float]:
        """Compute the scores of heights (n,) by their names, as a row of the table of runs has them."""
        return dict(zip(self.names, self.scores(heights).tolist(), strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the scores."""
        return tuple(derived(self.name, str(k)) for k in range(1, self.functions + 1))

    @property
    def height(self) -> float:
        """Root mean square height of the smooth measured profile."""
        return float(np.linalg.norm(self.scores(self.z)))

    @property
    def whole(self) -> float:
        """What 100 % of a score means: the height over the root of the number of scores.

        If each score is off by at most p % of it, the smooth profiles are at most p % of the height apart.
        """
        return self.height / math.sqrt(self.functions)
