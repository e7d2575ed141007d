"""Coded units: 0 at the centre of a factor, -1 and 1 at its low and high level."""

import numpy as np


def make_full_factorial(factors: int) -> np.ndarray:
    """Make the full factorial (2^factors, factors) of -1 and 1 in standard order.

    The first factor changes fastest: its level is the lowest bit of the number of the
    run.
    """
    runs = np.arange(2**factors)
    return np.column_stack([2.0 * (runs >> k & 1) - 1.0 for k in range(factors)])
