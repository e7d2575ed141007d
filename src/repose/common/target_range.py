"""Compute the range of a target for which the user gives none."""

import math

LEAST_RANGE = 0.01  # of the value, to each side
# Standard errors of the mean to each side. One of them would hold the true mean with a
# probability of 58 % after three repetitions, and of 66 % after ten.
STANDARD_ERRORS = 2


def range_about(value: float, sd: float, repetitions: int) -> tuple[float, float]:
    """Compute the range of a target from its mean and its scatter.

    It is the mean with two standard errors to each side, at least 1 % of the mean.
    """
    standard_error = sd / math.sqrt(repetitions)
    half_range = max(STANDARD_ERRORS * standard_error, LEAST_RANGE * abs(value))
    return value - half_range, value + half_range
