"""Recognise responses that a table gives in another unit than their targets."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from repose.calibrate.targets import Target, Targets
from repose.common.numbers import format_significant

# Results of runs count as near their target if the ratio of both is at most this, in
# either direction. It must be smaller than the root of the factor of each unit below:
# numbers in one unit and the same numbers in the other are then never both near.
MAX_RATIO = 5.0


class OtherUnit(NamedTuple):
    """A unit in which a program may give a quantity, in place of the usual one."""

    name: str
    factor: float  # numbers in this unit times the factor are in the usual unit
    factor_text: str


# For each usual unit, the one with which it is confused.
OTHER_UNITS = {
    "deg": OtherUnit("radians", 180 / math.pi, "180/pi"),
    "mm": OtherUnit("metres", 1000.0, "1000"),
}


def describe_other_units(
    targets: Targets, values: Mapping[str, Sequence[float]]
) -> dict[str, str]:
    """Describe each response whose results are probably in another unit.

    They are if all of them, converted from the other unit, lie near the target, but
    none of them does as it is.

    Parameters
    ----------
    targets : Targets
        The targets. Each has a unit, or its name ends with it.
    values : mapping of str to sequence
        The results of all runs by response; NaN for a run that failed.

    Returns
    -------
    dict of str to str
        A sentence by the name of the response.
    """
    sentences = {}
    for target in targets:
        # The scores of a profile may be any numbers, and their targets may be 0.
        if target.profile is not None:
            continue
        unit = _find_unit(target)
        if unit in OTHER_UNITS:
            sentence = _describe_column(
                target, unit, OTHER_UNITS[unit], np.array(values[target.name], float)
            )
            if sentence:
                sentences[target.name] = sentence
    return sentences


def _find_unit(target: Target) -> str:
    """Return the unit of a target: the last part of its name, or else its own."""
    _, _, unit_of_name = target.name.rpartition("_")
    return unit_of_name if unit_of_name in OTHER_UNITS else target.response.unit


def _describe_column(
    target: Target, unit: str, other: OtherUnit, values: np.ndarray
) -> str:
    """Describe the results of a response; empty unless they are in the other unit."""
    good_values = values[np.isfinite(values)]
    if good_values.size == 0:
        return ""
    converted = good_values * other.factor
    if not _are_near(converted, target.value).all():
        return ""
    if _are_near(good_values, target.value).any():
        return ""
    return (
        f"column {target.name} has {_format_range(good_values)}, although its target is "
        f"{format_significant(target.value)} {unit}; these numbers are probably in "
        f"{other.name}, which would be {_format_range(converted)} {unit}: multiply the "
        f"column by {other.factor_text}"
    )


def _are_near(values: np.ndarray, target_value: float) -> np.ndarray:
    """Tell which results are near a target."""
    ratios = values / target_value
    return (ratios >= 1 / MAX_RATIO) & (ratios <= MAX_RATIO)


def _format_range(values: np.ndarray) -> str:
    """Write the smallest and the largest result, or a single one."""
    low = format_significant(float(values.min()), 3)
    high = format_significant(float(values.max()), 3)
    return low if low == high else f"{low} to {high}"
