"""Coded units: 0 at the centre of a factor, -1 and 1 at its low and high level."""

import numpy as np


def two_level(factors: int) -> np.ndarray:
    """Make the full factorial (2^factors, factors) of -1 and 1 in standard order: the first factor changes fastest."""
    return np.column_stack(
        [2.0 * (np.arange(2**factors) >> k & 1) - 1.0 for k in range(factors)]
    )
