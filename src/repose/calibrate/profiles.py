"""Profiles (lines of heights) as responses: a few scores describe each.

The scores of a profile on a few smooth functions are numbers like any other response.
The functions are polynomials of rising degree, orthonormal in the mean over the
abscissae of the profile. Score 1 is the mean height, score 2 the slope, score 3 the
curvature, each in the unit of the heights. By Parseval's theorem the sum of the squared
differences of all scores of two profiles is the mean square distance of their smooth
parts. A straight profile has two scores; with cosines, the other usual choice, it would
have many.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from repose.calibrate.responses import name_derived_column
from repose.common.section import ABSENT, Section


class ProfileSection(Section):
    """The section `profile` of a target that is a score of a profile."""

    name: str
    x: Annotated[tuple[float, ...], Field(strict=False)]
    z: Annotated[tuple[float, ...], Field(strict=False)]
    functions: int
    covered: float = ABSENT

    @property
    def abscissae(self) -> dict[str, Any]:
        """All keys but the heights, as plain values for a file."""
        return self.model_dump(mode="json", exclude={"z"}, exclude_none=True)


@dataclass(frozen=True)
class Profile:
    """A measured profile and the functions on which profiles are compared with it.

    Attributes
    ----------
    name : str
        It ends with the unit of the heights, as in ``surface_mm``; the scores are then
        ``surface_1_mm`` and so on.
    x : tuple of float, (n,)
        Abscissae, rising.
    z : tuple of float, (n,)
        The measured heights there.
    n_functions : int
        Number of functions, and of scores.
    """

    name: str
    x: tuple[float, ...]
    z: tuple[float, ...]
    n_functions: int

    @classmethod
    def of(cls, section: Mapping[str, Any]) -> "Profile":
        """Read the profile of a target of the configuration."""
        return cls(
            name=section["name"],
            x=tuple(section["x"]),
            z=tuple(section["z"]),
            n_functions=section["functions"],
        )

    @cached_property
    def basis(self) -> np.ndarray:
        """Polynomials of rising degree at the abscissae, (n, functions).

        They are orthonormal: over the abscissae, the mean of the square of a function
        is 1, and the mean of the product of two different functions is 0.
        """
        # Evaluate Legendre polynomials, after scaling the abscissae to [-1, 1].
        abscissae = np.array(self.x)
        middle = 0.5 * (abscissae[-1] + abscissae[0])
        half_width = 0.5 * (abscissae[-1] - abscissae[0])
        degree = self.n_functions - 1
        polynomials = np.polynomial.legendre.legvander(
            (abscissae - middle) / half_width, degree
        )

        # Legendre polynomials are orthogonal in the mean over the whole interval, but
        # not in the mean over the abscissae. The QR decomposition makes them so: the
        # columns of Q have the length 1 and are orthogonal, and column k is a
        # polynomial of degree k.
        Q, R = np.linalg.qr(polynomials)
        # The signs of the columns of Q are arbitrary. Choose those of the Legendre
        # polynomials. The factor turns the sum of squares 1 into a mean square of 1.
        signs = np.sign(np.diagonal(R))
        return Q * signs * math.sqrt(len(abscissae))

    def scores(self, heights: ArrayLike) -> np.ndarray:
        """Compute the scores (..., functions) of heights (..., n) at the abscissae."""
        return np.asarray(heights, float) @ self.basis / len(self.x)

    def heights(self, scores: ArrayLike) -> np.ndarray:
        """Compute the smooth profile (..., n) from scores (..., functions)."""
        return np.asarray(scores, float) @ self.basis.T

    def columns(self, heights: ArrayLike) -> dict[str, float]:
        """Compute the scores of heights (n,) by name, as in a row of the table of runs."""
        return dict(zip(self.names, self.scores(heights).tolist(), strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the scores."""
        return tuple(
            name_derived_column(self.name, str(k))
            for k in range(1, self.n_functions + 1)
        )

    @property
    def height(self) -> float:
        """Root mean square height of the smooth measured profile."""
        return float(np.linalg.norm(self.scores(self.z)))

    @property
    def whole(self) -> float:
        """The number that counts as 100 % of a score.

        It is the height divided by the root of the number of scores. If each score
        deviates by at most p % of this number, the root mean square distance of the
        smooth profiles is at most p % of the height.
        """
        return self.height / math.sqrt(self.n_functions)
