"""Range of a target for which the user gives none."""

import math

LEAST_RANGE = 0.01  # of the value, to each side


def range_about(value: float, sd: float, repetitions: int) -> tuple[float, float]:
    """Compute the range of a target from its mean and its scatter.

    It is the mean with one standard error to each side, at least 1 % of the mean.
    """
    standard_error = sd / math.sqrt(repetitions)
    half_range = max(standard_error, LEAST_RANGE * abs(value))
    return value - half_range, value + half_range
