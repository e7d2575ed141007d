"""Points of a pile's boundary for the line along a flank.

A profile is one side of a pile, as in `repose.measure.angles`. On a lumpy boundary a rule selects the points;
`FLANK_RULES` names the rules, and a new rule is added there:

levels
    at every height the middle of the outermost and the innermost place where the boundary crosses it. The
    heights are not scattered, so the ends of the band do not bias the line.
rows
    only the outermost crossing.
columns
    the top of every pixel column that lies in the band: the plain reading of a linear fit to the boundary.
    Lumps cut off at the ends of the band, and the regression on a scattered distance, both flatten the line.
"""

import math

import numpy as np

from repose.common.errors import NoFlankError, require_flank

MIN_LEVELS = 12  # pixel rows in the band: fewer carry no angle
NO_FOOT = "the pile runs out of the picture sideways, or the background is not plain: its foot is not seen"

Points = tuple[np.ndarray, np.ndarray]


def levels_between(low: float, high: float) -> np.ndarray:
    """Whole heights in pixels inside a band, rising; may be empty."""
    return np.arange(math.ceil(low), math.floor(high) + 1, dtype=float)


def crossing(profile: np.ndarray, index: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Columns at which a profile rises through some heights, by linear interpolation."""
    before, after = profile[index - 1], profile[index]
    return index - (after - heights) / (after - before)


def outermost_crossing(profile: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Column, between pixels, at which the profile first reaches each height, from the foot inwards."""
    return crossing(
        profile, np.searchsorted(np.maximum.accumulate(profile), heights), heights
    )


def innermost_crossing(profile: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Column, between pixels, at which the profile last rises through each height, from the foot inwards."""
    return crossing(
        profile,
        np.searchsorted(np.minimum.accumulate(profile[::-1])[::-1], heights),
        heights,
    )


def points_by_levels(profile: np.ndarray, low: float, high: float) -> Points:
    """Rule "levels": the middle of outermost and innermost crossing of each height."""
    heights = levels_between(low, high)
    return 0.5 * (
        outermost_crossing(profile, heights) + innermost_crossing(profile, heights)
    ), heights


def points_by_rows(profile: np.ndarray, low: float, high: float) -> Points:
    """Rule "rows": the outermost crossing of each height."""
    heights = levels_between(low, high)
    return outermost_crossing(profile, heights), heights


def points_by_columns(profile: np.ndarray, low: float, high: float) -> Points:
    """Rule "columns": the column tops inside the band."""
    distance = np.flatnonzero((profile >= low) & (profile <= high))
    return distance.astype(float), profile[distance]


FLANK_RULES = {
    "levels": points_by_levels,
    "rows": points_by_rows,
    "columns": points_by_columns,
}


def points_between(profile: np.ndarray, low: float, high: float, rule: str) -> Points:
    """Points of one side inside a band, by a rule of `FLANK_RULES`: distances and heights in pixels."""
    if levels_between(low, high).size < MIN_LEVELS:
        raise NoFlankError(
            f"the flank is only {high - low:.0f} pixels high, {MIN_LEVELS} are needed"
        )
    require_flank(profile[0] < low, NO_FOOT)
    return FLANK_RULES[rule](profile, low, high)
