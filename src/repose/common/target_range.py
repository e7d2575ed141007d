"""Compute the range of a target for which the user gives no range."""

import math

# Smallest distance of a limit from the value, as a fraction of the value.
MIN_RELATIVE_RANGE = 0.01
# Number of standard errors between the mean and each limit. With only one standard
# error, the range would contain the true mean with a probability of 58 % after three
# repetitions, and of 66 % after ten.
STANDARD_ERRORS = 2


def compute_target_range(
    value: float, sd: float, repetitions: int
) -> tuple[float, float]:
    """Compute the range of a target from its mean and its scatter.

    Parameters
    ----------
    value : float
        Mean of the repetitions.
    sd : float
        Standard deviation of the repetitions.
    repetitions : int
        Number of repetitions.

    Returns
    -------
    tuple of float
        The lower and the upper limit. Their distance from the mean is `STANDARD_ERRORS`
        standard errors, but at least `MIN_RELATIVE_RANGE` of the mean.
    """
    standard_error = sd / math.sqrt(repetitions)
    half_range = max(STANDARD_ERRORS * standard_error, MIN_RELATIVE_RANGE * abs(value))
    return value - half_range, value + half_range
