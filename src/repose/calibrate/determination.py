"""Judge how well measurements determine a parameter, in the same words everywhere."""

from collections import Counter
from collections.abc import Sequence
from enum import StrEnum

# Limit of the Kullback-Leibler information, in bits. A uniform distribution over half
# the range has 1 bit.
DETERMINED_BITS = 1.0
# With little information, an interval of this fraction of the prior's interval or more
# does not determine a parameter.
UNDETERMINED_RATIO = 0.9
# With much information, the draws form several groups if the interval is wider than
# this fraction of the prior's interval.
WIDE_RATIO = 0.75


class Determination(StrEnum):
    """How well measurements determine a parameter."""

    NOT = "not determined"
    WEAK = "weakly determined"
    SEVERAL = "in one of several places"
    DETERMINED = "determined"


def judge_determination(width_ratio: float, bits: float) -> Determination:
    """Judge how well measurements determine a parameter.

    Parameters
    ----------
    width_ratio : float
        Width of the 95 % interval, divided by its width without the measurements.
    bits : float
        Information about the parameter.
    """
    if bits >= DETERMINED_BITS:
        is_wide = width_ratio > WIDE_RATIO
        return Determination.SEVERAL if is_wide else Determination.DETERMINED
    is_open = width_ratio >= UNDETERMINED_RATIO
    return Determination.NOT if is_open else Determination.WEAK


def describe_determinations(determinations: Sequence[str]) -> str:
    """Say in a sentence how many parameters the measurements determine.

    `determinations` has the value of a `Determination` for each free parameter.
    """
    n_parameters = len(determinations)
    counts = Counter(determinations)
    noun = "parameter" if n_parameters == 1 else "parameters"
    if counts[Determination.NOT] == n_parameters:
        return f"The measurements determine none of the {n_parameters} {noun}."
    parts = [f"{counts[kind]} {kind}" for kind in Determination if counts[kind]]
    return f"Of the {n_parameters} calibrated {noun}: {', '.join(parts)}."
