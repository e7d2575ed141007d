"""Angle of repose of a pile's profile by five definitions.

docs/measurement.md states each of them.

flank
    The regression of height on distance between two heights (section 2.3 of the paper).
secant
    atan(2 H / D): H is the crest's height over the plate, D the pile's width one grain
    above the plate.
steepest
    The largest slope of such a regression over any stretch at least half as high as the
    flank, the whole flank among them.
whole
    Such a regression over all of the side.
straightest
    Such a regression through the window of the side in which distance and height
    correlate most (Li et al. 2020).

A profile is one side of a pile: the heights (M,) over the plate of each pixel column,
from outside the foot to the crest. All lengths are in pixels, all angles in degrees.
`repose.measure.profile_points` selects the points of a line. Numbers from different
definitions or rules must not be compared.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from repose.common.errors import NoFlankError
from repose.measure.definitions import (  # noqa: F401 (imported from here elsewhere)
    CALIBRATED_ANGLE,
    DEFINITIONS,
    MEAN_KEYS,
    VIEW_KEYS,
)
from repose.measure.profile_points import (
    MIN_LEVELS,
    NO_FOOT,
    find_outermost_crossing,
    select_points,
)
from repose.measure.settings import ONE_GRAIN, MeasureSettings

# Points whose distances from the foot have a smaller standard deviation than this lie
# above each other. They form a wall, which has no regression of height on distance.
SMALLEST_SD_PX = 0.5
# A vertical side also has few points, because each pixel column gives only one. So both
# cases have the same reason.
WALL_REASON = "too few boundary points on the flank, it is a wall"
# Height at which the whole side begins. A lower pixel column shows no pile.
FOOT_HEIGHT_PX = 1.0
# Windows of the straightest line begin and end at multiples of this part of the side.
WINDOW_STEPS = 100

Point = tuple[float, float]  # distance and height


class Line(NamedTuple):
    """Line through one side of a profile."""

    angle_deg: float  # from the horizontal
    ends: tuple[Point, Point]  # lower and upper end


class PileAngle(NamedTuple):
    """Angle of a pile by one definition."""

    angle_deg: float
    left: Line
    right: Line


# The angles by definition, and the reasons why the others were not measured.
MeasuredAngles = tuple[dict[str, PileAngle], dict[str, str]]


class _Moments(NamedTuple):
    """Sums over the points of each window (windows,), with distances x and heights z.

    The sums are taken about the means of the window, and not divided by the number of
    points.
    """

    n: np.ndarray  # number of points
    xx: np.ndarray  # sum of (x - mean x)²
    zz: np.ndarray  # sum of (z - mean z)²
    xz: np.ndarray  # sum of (x - mean x) (z - mean z)


def fit_flank(
    profile: np.ndarray, low: float, high: float, rule: str = "columns"
) -> Line:
    """Fit a line by the definition "flank": the regression of height on distance.

    It uses the points of one side whose heights lie in a band.

    Parameters
    ----------
    profile : ndarray
        Heights (M,) of one side in pixels, from outside the foot to the crest.
    low, high : float
        Lower and upper end of the band.
    rule : str
        The rule of `FLANK_RULES` that selects the points.

    Returns
    -------
    Line
        The line, which ends at both heights of the band.

    Raises
    ------
    NoFlankError
        If no line can be fitted: the band is too low, has too few points, contains a
        wall, or does not rise.
    """
    distance, height = select_points(profile, low, high, rule)
    return fit_line(distance, height, low, high)


def fit_whole_side(profile: np.ndarray, rule: str = "columns") -> Line:
    """Fit a line by the definition "whole": the regression over all of a side.

    The parameters are those of `fit_flank`. The band begins at the lowest pixel and
    ends at the crest, which is the last value of the profile.
    """
    return fit_flank(profile, FOOT_HEIGHT_PX, float(profile[-1]), rule)


def fit_steepest(
    profile: np.ndarray, low: float, high: float, rule: str = "columns"
) -> Line:
    """Fit a line by the definition "steepest": the steepest over at least half a band.

    A stretch is a part of the band: some whole rows of pixels are cut off at the lower
    end of the band, and some at its upper end. The line is fitted to the steepest of
    all stretches. The whole band is a stretch, too, so the line is never flatter than
    the flank. On a lumpy flank the line is too steep, because it is the steepest of
    many.

    Parameters
    ----------
    profile : ndarray
        Heights (M,) of one side in pixels, from outside the foot to the crest.
    low, high : float
        Lower and upper end of the band.
    rule : str
        The rule of `FLANK_RULES` that selects the points.

    Returns
    -------
    Line
        The line, which ends at both heights of the steepest stretch.

    Raises
    ------
    NoFlankError
        If half of the band is too low, or if no stretch rises.
    """
    distance, height = select_points(profile, low, high, rule)
    # The lowest stretch must have at least `MIN_LEVELS` rows of pixels, and the band at
    # least as many points.
    min_height = (high - low) / 2
    if min_height < MIN_LEVELS:
        raise NoFlankError(
            f"half of the flank is only {min_height:.0f} pixels high, {MIN_LEVELS} are "
            "needed"
        )
    if distance.size < MIN_LEVELS:
        raise NoFlankError(WALL_REASON)

    # Compute only the slopes of all stretches, which is fast. Then fit a line to the
    # steepest one.
    lows, highs = _list_stretches(low, high, min_height)
    slopes = compute_window_slopes(distance, height, lows, highs)
    steepest = _find_best_window(slopes)
    steepest_low = float(lows[steepest])
    steepest_high = float(highs[steepest])
    is_inside = (height >= steepest_low) & (height <= steepest_high)
    return fit_line(distance[is_inside], height[is_inside], steepest_low, steepest_high)


def _list_stretches(
    low: float, high: float, min_height: float
) -> tuple[np.ndarray, np.ndarray]:
    """List the stretches of a band that are at least half as high as the band.

    Whole pixels are cut off below and above, in all combinations.

    Parameters
    ----------
    low, high : float
        Lower and upper end of the band.
    min_height : float
        Half of the band's height. This is also the most that may be cut off.

    Returns
    -------
    lows, highs : ndarray
        Lower and upper end of each stretch (stretches,).
    """
    cuts = np.arange(math.floor(min_height) + 1)
    is_allowed = cuts[:, None] + cuts <= min_height
    cuts_below, cuts_above = np.nonzero(is_allowed)
    return low + cuts_below, high - cuts_above


def fit_straightest(
    profile: np.ndarray, smallest_fraction: float, rule: str = "columns"
) -> Line:
    """Fit a line by the definition "straightest": through the straightest window.

    A window consists of successive points of the side. The line is fitted to the window
    in which distance and height correlate most, as in Li et al. (2020). They do not
    state the size of their smallest window, so it is a parameter here.

    Parameters
    ----------
    profile : ndarray
        Heights (M,) of one side in pixels, from outside the foot to the crest.
    smallest_fraction : float
        Number of points of the smallest window, as a fraction of all points of the
        side.
    rule : str
        The rule of `FLANK_RULES` that selects the points.

    Returns
    -------
    Line
        The line, which ends at the lowest and the highest point of the window.

    Raises
    ------
    NoFlankError
        If the side has too few points, if it is a wall, or if no window rises towards
        the crest.

    References
    ----------
    Li, Ucgul, Lee, Saunders (2020). Comput. Electron. Agric. 172, 105356.
    """
    distance, height = select_points(profile, FOOT_HEIGHT_PX, float(profile[-1]), rule)
    n_points = distance.size
    min_points = max(MIN_LEVELS, math.ceil(smallest_fraction * n_points))
    if n_points < min_points:
        raise NoFlankError(WALL_REASON)
    first, last = _list_windows(n_points, min_points)
    correlations = compute_window_correlations(distance, height, first, last)
    # This raises NoFlankError if no window is usable.
    straightest = _find_best_window(correlations)
    window = slice(first[straightest], last[straightest])
    window_height = height[window]
    low = float(window_height.min())
    high = float(window_height.max())
    return fit_line(distance[window], window_height, low, high)


def _list_windows(n_points: int, min_points: int) -> tuple[np.ndarray, np.ndarray]:
    """List windows of successive points that begin and end at a limited set of points.

    Parameters
    ----------
    n_points : int
        Number of points of the side.
    min_points : int
        Smallest number of points in a window.

    Returns
    -------
    first, last : ndarray
        Number of the first point of each window, and of the point after its last one
        (windows,).
    """
    # Place borders between points. Each pair of borders with enough points between them
    # is a window.
    n_steps = min(n_points, WINDOW_STEPS)
    borders = np.linspace(0, n_points, n_steps + 1).round().astype(int)
    # Entry (i, j) is the number of points from border i to border j.
    n_between = borders - borders[:, None]
    first_index, last_index = np.nonzero(n_between >= min_points)
    return borders[first_index], borders[last_index]


def _find_best_window(values: np.ndarray) -> int:
    """Find the window of the largest slope or correlation.

    Parameters
    ----------
    values : ndarray
        Slope or correlation of each window (windows,); NaN for a wall.

    Returns
    -------
    int
        Index of the window.

    Raises
    ------
    NoFlankError
        If all windows are walls, or if none rises.
    """
    if np.isnan(values).all():
        raise NoFlankError(WALL_REASON)
    if not np.any(values > 0):
        raise NoFlankError("no stretch of the boundary rises towards the crest")
    return int(np.nanargmax(values))


def compute_window_correlations(
    distance: np.ndarray, height: np.ndarray, first: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Compute the correlation of distance and height in each of many windows of points.

    Parameters
    ----------
    distance, height : ndarray
        The points (N,) of one side, in order.
    first, last : ndarray
        Number of the first point of each window, and of the point after its last one
        (windows,).

    Returns
    -------
    ndarray
        Correlations (windows,); NaN for a wall.
    """
    x = distance - distance.mean()
    z = height - height.mean()
    moments = _compute_window_moments(x, z, first, last)
    is_usable = (moments.xx >= moments.n * SMALLEST_SD_PX**2) & (moments.zz > 0)
    # Windows that are not usable get a 1, to avoid a division by zero.
    squared_norm = np.where(is_usable, moments.xx * moments.zz, 1.0)
    return np.where(is_usable, moments.xz / np.sqrt(squared_norm), np.nan)


def compute_window_slopes(
    distance: np.ndarray, height: np.ndarray, lows: np.ndarray, highs: np.ndarray
) -> np.ndarray:
    """Compute the slope of the regression line in each of many windows of heights.

    Parameters
    ----------
    distance, height : ndarray
        The points (N,) of one side in pixels.
    lows, highs : ndarray
        Lowest and highest height of each window (windows,) in pixels.

    Returns
    -------
    ndarray
        Slopes (windows,), height over distance. A slope is NaN if the window has too
        few points, or if it is a wall, which is a vertical part of the side.
    """
    # Sort the points by height. The points of each window are then a slice, which
    # begins at `first` and ends before `last`.
    order = np.argsort(height, kind="stable")
    first = np.searchsorted(height[order], lows, side="left")
    last = np.searchsorted(height[order], highs, side="right")
    x = distance[order] - distance.mean()
    z = height[order] - height.mean()
    moments = _compute_window_moments(x, z, first, last)
    has_points = moments.n >= MIN_LEVELS
    is_usable = has_points & (moments.xx >= moments.n * SMALLEST_SD_PX**2)
    # The slope is the covariance over the variance of the distance.
    divisor = np.where(is_usable, moments.xx, 1.0)
    return np.where(is_usable, moments.xz / divisor, np.nan)


def _compute_window_moments(
    x: np.ndarray, z: np.ndarray, first: np.ndarray, last: np.ndarray
) -> _Moments:
    """Compute the sums of squares and products of the points in each window.

    They are differences of running sums, which are fast to compute for many windows.

    Parameters
    ----------
    x, z : ndarray
        Distances and heights (N,) of the points.
    first, last : ndarray
        Number of the first point of each window, and of the point after its last one
        (windows,).
    """
    # Running sums, which begin with 0 before the first point. The sum over a window is
    # then the difference of two of them, and is 0 for an empty window.
    sums = np.cumsum([x, z, x * x, z * z, x * z], axis=1)
    sums = np.concatenate([np.zeros((len(sums), 1)), sums], axis=1)
    in_window = sums.take(last, axis=1) - sums.take(first, axis=1)
    sum_x, sum_z, sum_xx, sum_zz, sum_xz = in_window
    # Convert them to sums about the means of the window. For an empty window, n is 1 to
    # avoid a division by zero.
    n = np.maximum(last - first, 1)
    return _Moments(
        n=n,
        xx=sum_xx - sum_x * sum_x / n,
        zz=sum_zz - sum_z * sum_z / n,
        xz=sum_xz - sum_x * sum_z / n,
    )


def fit_line(distance: np.ndarray, height: np.ndarray, low: float, high: float) -> Line:
    """Fit the regression line of height on distance through the points of a side.

    Parameters
    ----------
    distance, height : ndarray
        The points (N,) in pixels: distance from the beginning of the profile, and
        height over the plate.
    low, high : float
        Heights in pixels at which the line ends.

    Returns
    -------
    Line
        The line with its angle, its lower end and its upper end.

    Raises
    ------
    NoFlankError
        If there are fewer than `MIN_LEVELS` points, if they lie nearly above each
        other, or if the line does not rise towards the crest.
    """
    if distance.size < MIN_LEVELS:
        raise NoFlankError(WALL_REASON)
    deviation = distance - distance.mean()
    sum_of_squares = deviation @ deviation
    if sum_of_squares < distance.size * SMALLEST_SD_PX**2:
        raise NoFlankError(WALL_REASON)
    # By least squares, the slope is the covariance over the variance of the distance.
    slope = float(deviation @ (height - height.mean()) / sum_of_squares)
    if slope <= 0:
        raise NoFlankError("the boundary does not rise towards the crest")
    # The line goes through the mean point. Find where it reaches both heights.
    intercept = float(height.mean() - slope * distance.mean())
    lower_end = ((low - intercept) / slope, low)
    upper_end = ((high - intercept) / slope, high)
    return Line(math.degrees(math.atan(slope)), (lower_end, upper_end))


def fit_secant(profile: np.ndarray, grain_px: float) -> Line:
    """Fit a line by the definition "secant": from the foot of a side to the crest.

    The foot lies on the plate, below the outermost point that is as high as a grain.

    Parameters
    ----------
    profile : ndarray
        Heights (M,) of the side in pixels, from outside the foot to the crest.
    grain_px : float
        Height of a grain in pixels.

    Returns
    -------
    Line
        The line, from the foot to the crest.

    Raises
    ------
    NoFlankError
        If the pile is not higher than a grain, or if the side has no foot.
    """
    # Positions are counted in columns from the beginning of the profile, which ends at
    # the crest.
    crest_x = float(profile.size - 1)
    height = float(profile[-1])
    if not 0 < grain_px < height:
        raise NoFlankError("the pile is not higher than one grain")
    if profile[0] >= grain_px:
        raise NoFlankError(NO_FOOT)
    # There is one crossing, because only one height is given.
    (crossing,) = find_outermost_crossing(profile, np.array([grain_px]))
    foot_x = float(crossing)
    angle_deg = math.degrees(math.atan2(height, crest_x - foot_x))
    return Line(angle_deg, ((foot_x, 0.0), (crest_x, height)))


def compute_secant(left: Line, right: Line) -> float:
    """Compute a pile's angle by the definition "secant" from the lines of both sides.

    It is atan(2 H / D) in degrees, where H is the height of the crest and D the sum of
    the widths of both sides.
    """
    (left_foot, _), (left_crest, height) = left.ends
    (right_foot, _), (right_crest, _) = right.ends
    width = left_crest - left_foot + right_crest - right_foot
    return math.degrees(math.atan2(2 * height, width))


def measure_sides(
    profile: np.ndarray,
    crest: int,
    settings: MeasureSettings,
    definitions: Sequence[str] = DEFINITIONS,
) -> MeasuredAngles:
    """Measure the angle of a pile by several definitions.

    The angle of a pile is the mean of the angles of its two sides. Only the secant has
    its own formula, `compute_secant`.

    Parameters
    ----------
    profile : ndarray
        Heights (W,) over the plate in pixels of all columns of the pile.
    crest : int
        Index of the column of the crest, which belongs to both sides.
    settings : MeasureSettings
        Settings of the lines.
    definitions : sequence of str
        Names of the definitions.

    Returns
    -------
    measured : dict
        A `PileAngle` for each definition by which the angle could be measured.
    reasons : dict
        For each other definition, the reason why it could not.
    """
    # Both sides run from outside the foot to the crest, so the right one is reversed.
    left_side = profile[: crest + 1]
    right_side = profile[crest:][::-1]
    measured = {}
    reasons = {}
    for name in definitions:
        try:
            left = _fit_side(left_side, name, settings)
            right = _fit_side(right_side, name, settings)
        except NoFlankError as error:
            reasons[name] = error.reason
            continue
        if name == "secant":
            angle_deg = compute_secant(left, right)
        else:
            angle_deg = 0.5 * (left.angle_deg + right.angle_deg)
        measured[name] = PileAngle(angle_deg, left, right)
    return measured, reasons


def _fit_side(side: np.ndarray, definition: str, settings: MeasureSettings) -> Line:
    """Fit a line to one side of a pile by a given definition.

    Parameters
    ----------
    side : ndarray
        Heights (M,) of the side in pixels, from outside the foot to the crest.
    definition : str
        One of `DEFINITIONS`.
    settings : MeasureSettings
        Settings of the lines. Their key `flank` is the rule that selects the points for
        the definitions "flank" and "steepest".

    Returns
    -------
    Line
        The line.

    Raises
    ------
    NoFlankError
        If no such line can be fitted to the side.
    ValueError
        For an unknown definition.
    """
    if definition == "whole":
        return fit_whole_side(side)
    if definition == "straightest":
        return fit_straightest(side, settings.smallest_window)
    if definition == "secant":
        return fit_secant(side, _compute_grain_height(settings))
    # The other two definitions fit a line between two heights.
    height = float(side[-1])
    low = _compute_end_height(settings.fit_from, height, settings)
    high = _compute_end_height(settings.fit_to, height, settings)
    if definition == "flank":
        return fit_flank(side, low, high, settings.flank)
    if definition == "steepest":
        return fit_steepest(side, low, high, settings.flank)
    raise ValueError(f"no definition of the angle is named {definition}")


def _compute_end_height(
    end: float | str, height: float, settings: MeasureSettings
) -> float:
    """Compute the height in pixels of an end of the flank.

    Parameters
    ----------
    end : float or str
        A fraction of the height, or `ONE_GRAIN` for the height of a grain.
    height : float
        Height of the crest in pixels.
    settings : MeasureSettings
        Settings with the scale and the height of a grain.
    """
    if end == ONE_GRAIN:
        return _compute_grain_height(settings)
    return float(end) * height


def _compute_grain_height(settings: MeasureSettings) -> float:
    """Compute the height of a grain in pixels; raise NoFlankError if it is unknown."""
    if settings.berry_height_mm is None:
        raise NoFlankError("the grain's height is not known")
    return settings.berry_height_mm / settings.mm_per_pixel
