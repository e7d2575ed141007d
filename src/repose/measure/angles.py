"""Angle of repose of a pile's profile by five definitions, each stated in docs/measurement.md.

flank
    regression of height on distance between two heights (section 2.3 of the paper)
secant
    atan(2 H / D): H the crest over the plate, D the pile's width one grain above the plate
steepest
    the largest slope of such a line over any stretch at least half as high as the flank, the whole flank among them
whole
    such a line from foot to crest
straightest
    such a line through the window of the side in which distance and height correlate most (Li et al. 2020)

A profile is one side of a pile: heights (M,) over the plate from outside the foot to the crest, for each pixel column.
All lengths are pixels, all angles degrees. `repose.measure.profile_points` selects the points of a line. Numbers from
different definitions or rules must not be compared.
"""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from repose.common.errors import NoFlankError, require_flank
from repose.measure.profile_points import (
    MIN_LEVELS,
    NO_FOOT,
    outermost_crossing,
    points_between,
)

if TYPE_CHECKING:
    from repose.measure.settings import MeasureSettings

DEFINITIONS = ("flank", "secant", "steepest", "whole", "straightest")
MEAN_KEYS = {name: f"aor_{name}_deg" for name in DEFINITIONS}  # mean of all views
CALIBRATED_ANGLE = (
    "aor_deg"  # one of the definitions under a name of its own (`measure.response`)
)
# the first view alone, as a camera sees it
VIEW_KEYS = {name: f"aor_{name}_view_deg" for name in DEFINITIONS}

WALL_SD = 0.5  # points whose distances scatter by less than this are a wall
WALL = "too few boundary points on the flank, it is a wall"
FOOT = 1.0  # the whole profile begins here: a column below it shows no pile
WINDOW_STEPS = 100  # windows of the straightest line begin and end at multiples of this part of the side


class Line(NamedTuple):
    """Line through one side of a profile."""

    angle_deg: float  # from the horizontal
    ends: tuple[
        tuple[float, float], tuple[float, float]
    ]  # lower and upper end, each (distance, height)


Measured = tuple[dict[str, tuple[float, Line, Line]], dict[str, str]]


# --- the definitions ------------------------------------------------------------------------------


def flank(profile: np.ndarray, low: float, high: float, rule: str = "columns") -> Line:
    """Definition "flank": the regression of height on distance between two heights (section 2.3 of the paper)."""
    return fitted(*points_between(profile, low, high, rule), low, high)


def whole(profile: np.ndarray, rule: str = "columns") -> Line:
    """Definition "whole": the regression over the whole side, from foot to crest."""
    return flank(profile, FOOT, float(profile[-1]), rule)


def steepest(
    profile: np.ndarray, low: float, high: float, rule: str = "columns"
) -> Line:
    """Definition "steepest": the steepest line over any stretch at least half as high as from `low` to `high`.

    The whole flank is such a stretch, so no flank is steeper. Half a flank can be flatter than the whole: a regression
    on the distance flattens where its heights are cut off, the more the shorter the stretch is. The maximum of many
    slopes exceeds the mean slope: on a lumpy flank this definition biases the angle upwards.
    """
    distance, height = points_between(profile, low, high, rule)
    least = (high - low) / 2
    require_flank(
        least >= MIN_LEVELS,
        f"half of the flank is only {least:.0f} pixels high, {MIN_LEVELS} are needed",
    )
    require_flank(distance.size >= MIN_LEVELS, WALL)
    cut = np.arange(math.floor(least) + 1)  # off either end, pixel by pixel
    below, above = (cut[part] for part in np.nonzero(cut[:, None] + cut <= least))
    best = _best(window_slopes(distance, height, low + below, high - above))
    start, end = float(low + below[best]), float(high - above[best])
    inside = (height >= start) & (height <= end)
    return fitted(distance[inside], height[inside], start, end)


def straightest(profile: np.ndarray, smallest: float, rule: str = "columns") -> Line:
    """Definition "straightest": the line through the window in which distance and height correlate most.

    Windows are stretches of the side's points, from the share `smallest` of them to all (Li, Ucgul, Lee, Saunders 2020,
    Comput. Electron. Agric. 172, 105356: of windows that grow from the open end to the centre, the one of the largest
    correlation coefficient gives the angle). The source does not give its smallest window.
    """
    distance, height = points_between(profile, FOOT, float(profile[-1]), rule)
    count = distance.size
    least = max(MIN_LEVELS, math.ceil(smallest * count))
    require_flank(count >= least, WALL)
    places = np.linspace(0, count, min(count, WINDOW_STEPS) + 1).round().astype(int)
    first, last = (
        places[ends] for ends in np.nonzero(places - places[:, None] >= least)
    )
    best = _best(window_correlations(distance, height, first, last))
    inside = slice(first[best], last[best])
    return fitted(
        distance[inside],
        height[inside],
        float(height[inside].min()),
        float(height[inside].max()),
    )


def _best(windows: np.ndarray) -> int:
    """Find the window with the largest slope or correlation; NoFlankError where all are walls or none rises."""
    require_flank(not np.isnan(windows).all(), WALL)
    require_flank(
        np.any(windows > 0), "no stretch of the boundary rises towards the crest"
    )
    return int(np.nanargmax(windows))


def window_correlations(
    distance: np.ndarray, height: np.ndarray, first: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Correlation (windows,) of distance and height of points first to last - 1, by running sums; NaN for a wall."""
    n, spread_x, spread_z, product = _moments(
        distance - distance.mean(), height - height.mean(), first, last
    )
    usable = (spread_x >= n * WALL_SD**2) & (spread_z > 0)
    return np.where(
        usable, product / np.sqrt(np.where(usable, spread_x * spread_z, 1.0)), np.nan
    )


def window_slopes(
    distance: np.ndarray, height: np.ndarray, lows: np.ndarray, highs: np.ndarray
) -> np.ndarray:
    """Slope (windows,) of the regression line in each window of heights, by running sums; NaN if too few, or a wall."""
    order = np.argsort(height, kind="stable")
    first = np.searchsorted(height[order], lows, side="left")
    last = np.searchsorted(height[order], highs, side="right")
    x, z = distance[order] - distance.mean(), height[order] - height.mean()
    n, spread, _, product = _moments(x, z, first, last)
    usable = (n >= MIN_LEVELS) & (spread >= n * WALL_SD**2)
    return np.where(usable, product / np.where(usable, spread, 1.0), np.nan)


def _moments(
    x: np.ndarray, z: np.ndarray, first: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Count the points of each window, and sum x squared, z squared and x z about its means."""
    sums = np.cumsum([x, z, x * x, z * z, x * z], axis=1)
    sums = np.concatenate([np.zeros((len(sums), 1)), sums], axis=1)
    sum_x, sum_z, sum_xx, sum_zz, sum_xz = sums.take(last, axis=1) - sums.take(
        first, axis=1
    )
    n = np.maximum(last - first, 1)
    return (
        n,
        sum_xx - sum_x * sum_x / n,
        sum_zz - sum_z * sum_z / n,
        sum_xz - sum_x * sum_z / n,
    )


def fitted(distance: np.ndarray, height: np.ndarray, low: float, high: float) -> Line:
    """Fit the line of height on distance, drawn from height `low` to height `high`."""
    spread = distance - distance.mean() if distance.size else distance
    require_flank(
        distance.size >= MIN_LEVELS and spread @ spread >= distance.size * WALL_SD**2,
        WALL,
    )
    slope = float(spread @ (height - height.mean()) / (spread @ spread))
    require_flank(slope > 0, "the boundary does not rise towards the crest")
    intercept = float(height.mean() - slope * distance.mean())
    below, above = (((z - intercept) / slope, z) for z in (low, high))
    return Line(math.degrees(math.atan(slope)), (below, above))


def secant(profile: np.ndarray, berry: float) -> Line:
    """One side of the definition "secant": from the outermost place one grain high, on the plate, to the crest."""
    crest, height = profile.size - 1, float(profile[-1])
    require_flank(0 < berry < height, "the pile is not higher than one grain")
    require_flank(profile[0] < berry, NO_FOOT)
    place = float(outermost_crossing(profile, np.array([berry]))[0])
    return Line(
        math.degrees(math.atan2(height, crest - place)),
        ((place, 0.0), (float(crest), height)),
    )


def secant_of_pile(left: Line, right: Line) -> float:
    """Combine the secant of a pile in degrees from the lines of its two sides: atan(2 H / D), D = W_left + W_right."""
    (foot_left, _), (crest_left, height) = left.ends
    (foot_right, _), (crest_right, _) = right.ends
    width = crest_left - foot_left + crest_right - foot_right
    return math.degrees(math.atan2(2 * height, width))


def measure_sides(
    profile: np.ndarray,
    crest: int,
    how: "MeasureSettings",
    definitions: Sequence[str] = DEFINITIONS,
) -> Measured:
    """Angle [deg], left and right line of a pile by definition, and the reasons for missing definitions."""
    height, ends = float(profile[crest]), (how.fit_from, how.fit_to)
    grain = (
        math.nan
        if how.berry_height_mm is None
        else how.berry_height_mm / how.mm_per_pixel
    )
    low, high = (grain if isinstance(end, str) else end * height for end in ends)
    line_of: dict[str, Callable[[np.ndarray], Line]] = {
        "flank": lambda side: flank(side, low, high, how.flank),
        "secant": lambda side: secant(side, grain),
        "steepest": lambda side: steepest(side, low, high, how.flank),
        "whole": whole,
        "straightest": lambda side: straightest(side, how.smallest_window),
    }
    by_grain = ("secant", "flank", "steepest") if "berry" in ends else ("secant",)
    measured, reasons = {}, {}
    for name in definitions:
        try:
            require_flank(
                not math.isnan(grain) or name not in by_grain,
                "the grain's height is not known",
            )
            left, right = (
                line_of[name](side)
                for side in (profile[: crest + 1], profile[crest:][::-1])
            )
        except NoFlankError as error:
            reasons[name] = error.reason
            continue
        mean = 0.5 * (left.angle_deg + right.angle_deg)
        measured[name] = (
            secant_of_pile(left, right) if name == "secant" else mean,
            left,
            right,
        )
    return measured, reasons
