"""Coded units: 0 at the centre of a factor, -1 and 1 at its low and high level."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


def two_level(factors: int) -> np.ndarray:
    """The full factorial (2^factors, factors) of -1 and 1 in standard order: the first factor changes fastest."""
    runs = np.arange(2**factors)
    return np.column_stack([2.0 * (runs >> k & 1) - 1.0 for k in range(factors)])


@dataclass(frozen=True)
class Coding:
    """Coded and natural units of k factors, converted into each other."""

    factors: tuple[str, ...]
    centre: np.ndarray  # (k,), natural units
    half: np.ndarray  # (k,), from the centre to the level coded 1, natural units

    def natural(self, coded: ArrayLike) -> np.ndarray:
        """Natural values (..., k) of coded values (..., k)."""
        return self.centre + np.asarray(coded, dtype=float) * self.half

    def coded(self, natural: ArrayLike) -> np.ndarray:
        """Coded values (..., k) of natural values (..., k)."""
        return (np.asarray(natural, dtype=float) - self.centre) / self.half
