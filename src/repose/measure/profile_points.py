"""Select the points of a pile's boundary to which the line along a flank is fitted.

A profile is one side of a pile, as in `repose.measure.angles`. On a lumpy boundary a
rule selects the points; `FLANK_RULES` names the rules, and a new rule is added there:

levels
    At every height, the middle between the outermost and the innermost point at which
    the boundary crosses it. The heights do not scatter, so the ends of the band do not
    bias the line.
rows
    At every height, the outermost of these points only.
columns
    The top of every pixel column that lies in the band. This is the most obvious way to
    fit a line to the boundary. It makes the line too flat for two reasons: lumps are
    cut off at the ends of the band, and the distances in the regression scatter.
"""

import math
from typing import NamedTuple

import numpy as np

from repose.common.errors import NoFlankError

# Smallest number of pixel rows in a band, and of points of a line; fewer do not
# determine an angle
MIN_LEVELS = 12
NO_FOOT = (
    "the pile runs out of the picture sideways, or the background is not plain: its "
    "foot is not seen"
)


class Points(NamedTuple):
    """Points of one side, in pixels."""

    distance: np.ndarray  # (N,), from the beginning of the profile
    height: np.ndarray  # (N,), over the plate


def list_levels(low: float, high: float) -> np.ndarray:
    """List the whole heights in pixels inside a band, rising; may be empty."""
    return np.arange(math.ceil(low), math.floor(high) + 1, dtype=float)


def interpolate_crossing(
    profile: np.ndarray, index: np.ndarray, heights: np.ndarray
) -> np.ndarray:
    """Interpolate where a profile crosses given heights, to a fraction of a column.

    Parameters
    ----------
    profile : ndarray
        Heights (M,) of one side in pixels.
    index : ndarray of int
        For each height the column (N,) just after the crossing, at least 1.
    heights : ndarray
        The heights (N,).

    Returns
    -------
    ndarray
        Distances (N,) from the beginning of the profile in pixels.
    """
    before = profile[index - 1]
    after = profile[index]
    return index - (after - heights) / (after - before)


def find_outermost_crossing(profile: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Find where a profile first reaches several heights, from the foot inwards.

    Parameters
    ----------
    profile : ndarray
        Heights (M,) of one side in pixels, from outside the foot to the crest. It
        begins below all of the heights and reaches them.
    heights : ndarray
        The heights (N,).

    Returns
    -------
    ndarray
        Distances (N,) from the beginning of the profile in pixels.
    """
    highest_so_far = np.maximum.accumulate(profile)
    return interpolate_crossing(
        profile, np.searchsorted(highest_so_far, heights), heights
    )


def find_innermost_crossing(profile: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Find where a profile last rises through each of several heights.

    The parameters and the result are those of `find_outermost_crossing`.
    """
    lowest_from_here = np.minimum.accumulate(profile[::-1])[::-1]
    return interpolate_crossing(
        profile, np.searchsorted(lowest_from_here, heights), heights
    )


def select_by_levels(profile: np.ndarray, low: float, high: float) -> Points:
    """Select points by the rule "levels": the middle of both crossings."""
    heights = list_levels(low, high)
    outermost = find_outermost_crossing(profile, heights)
    innermost = find_innermost_crossing(profile, heights)
    return Points(0.5 * (outermost + innermost), heights)


def select_by_rows(profile: np.ndarray, low: float, high: float) -> Points:
    """Select points by the rule "rows": the outermost crossings."""
    heights = list_levels(low, high)
    return Points(find_outermost_crossing(profile, heights), heights)


def select_by_columns(profile: np.ndarray, low: float, high: float) -> Points:
    """Select points by the rule "columns": the tops of the columns."""
    columns = np.flatnonzero((profile >= low) & (profile <= high))
    return Points(columns.astype(float), profile[columns])


FLANK_RULES = {
    "levels": select_by_levels,
    "rows": select_by_rows,
    "columns": select_by_columns,
}


def select_points(profile: np.ndarray, low: float, high: float, rule: str) -> Points:
    """Select the points of one side inside a band of heights, by a rule.

    Parameters
    ----------
    profile : ndarray
        Heights (M,) of one side in pixels, from outside the foot to the crest.
    low, high : float
        Lower and upper end of the band.
    rule : str
        One of `FLANK_RULES`.

    Returns
    -------
    Points
        The points of the band.

    Raises
    ------
    NoFlankError
        If the band is too low, or if the profile already begins in or above the band,
        so that the picture does not show the foot.
    """
    if list_levels(low, high).size < MIN_LEVELS:
        raise NoFlankError(
            f"the flank is only {high - low:.0f} pixels high, {MIN_LEVELS} are needed"
        )
    if profile[0] >= low:
        raise NoFlankError(NO_FOOT)
    return FLANK_RULES[rule](profile, low, high)
