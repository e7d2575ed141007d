"""Angle of repose of a pile's profile by four definitions, each stated in docs/measurement.md.

flank
    regression of height on distance between two heights (section 2.3 of the paper)
secant
    atan(2 H / D): H the crest over the plate, D the pile's width one berry above the plate
steepest
    the largest slope of such a line over any stretch of half the flank's height
whole
    such a line from foot to crest

A profile here is one side of a pile: heights (M,) over the plate from outside the foot to the crest, one a
pixel column, in pixels. All lengths are pixels, all angles degrees.

What the line goes through where the boundary is lumpy is said by a rule; `FLANK_RULES` names them and can
take another:

levels
    at every height the middle of the outermost and the innermost place where the boundary crosses it. The
    heights are not scattered, so the ends of the band bend nothing.
rows
    the outermost crossing alone.
columns
    the top of every pixel column that lies in the band: the plain reading of a linear fit to the boundary.
    Lumps cut off at the ends of the band, and the regression on a scattered distance, both flatten the line.

Numbers from different definitions or rules must not be compared.
"""

import math
from typing import NamedTuple

import numpy as np

from repose.core.errors import NoFlankError

DEFINITIONS = ("flank", "secant", "steepest", "whole")
MEAN_KEYS = {name: f"aor_{name}_deg" for name in DEFINITIONS}  # mean of all views
# the first view alone, as a camera sees it
VIEW_KEYS = {name: f"aor_{name}_view_deg" for name in DEFINITIONS}

MIN_LEVELS = 12  # pixel rows in the band: fewer carry no angle
WALL_SD = 0.5  # points whose distances scatter by less than this are a wall
WALL = "too few boundary points on the flank, it is a wall"
FOOT = 1.0  # the whole profile begins here: a column below it shows no pile


class Line(NamedTuple):
    """A side's angle and its line, ((distance, height) below, (distance, height) above)."""

    angle_deg: float
    ends: tuple


# --- the points that a line goes through ----------------------------------------------------------


def levels_between(low, high):
    """Heights one pixel apart inside a band."""
    return np.arange(math.ceil(low), math.floor(high) + 1, dtype=float)


def crossing(profile, index, heights):
    """Where the profile rises through `heights` just before `index`, between columns by linear
    interpolation."""
    before, after = profile[index - 1], profile[index]
    return index - (after - heights) / (after - before)


def outermost_crossing(profile, heights):
    """Where, coming from the foot, the profile first reaches each height."""
    return crossing(profile, np.searchsorted(np.maximum.accumulate(profile), heights), heights)


def innermost_crossing(profile, heights):
    """Where, coming from the foot, the profile last rises through each height."""
    never_lower = np.minimum.accumulate(profile[::-1])[::-1]
    return crossing(profile, np.searchsorted(never_lower, heights), heights)


def points_by_levels(profile, low, high):
    """Rule "levels": the middle of outermost and innermost crossing of each height."""
    heights = levels_between(low, high)
    return 0.5 * (outermost_crossing(profile, heights) + innermost_crossing(profile, heights)), heights


def points_by_rows(profile, low, high):
    """Rule "rows": the outermost crossing of each height."""
    heights = levels_between(low, high)
    return outermost_crossing(profile, heights), heights


def points_by_columns(profile, low, high):
    """Rule "columns": the column tops inside the band."""
    distance = np.flatnonzero((profile >= low) & (profile <= high))
    return distance.astype(float), profile[distance]


FLANK_RULES = {"levels": points_by_levels, "rows": points_by_rows, "columns": points_by_columns}


def points_between(profile, low, high, rule):
    """Distances and heights that a rule takes from a band; NoFlankError where the band is thin or its foot unseen."""
    if levels_between(low, high).size < MIN_LEVELS:
        raise NoFlankError(f"the flank is only {high - low:.0f} pixels high, {MIN_LEVELS} are needed")
    if profile[0] >= low:
        raise NoFlankError("the pile runs out of the picture sideways: its foot is not seen")
    return FLANK_RULES[rule](profile, low, high)


# --- the definitions ------------------------------------------------------------------------------


def flank(profile, low, high, rule="columns"):
    """Line by regression of height on distance between the heights low and high. Raises NoFlankError."""
    return fitted(*points_between(profile, low, high, rule), low, high)


def whole(profile, rule="columns"):
    """Line by regression over the whole side, foot to crest. Raises NoFlankError."""
    return flank(profile, FOOT, float(profile[-1]), rule)


def steepest(profile, low, high, rule="columns"):
    """The steepest line over any stretch of half the height between low and high, moved by one pixel.

    The largest of many slopes is larger than the slope: on a lumpy flank it is biased upwards by its own
    choice. Raises NoFlankError.
    """
    distance, height = points_between(profile, low, high, rule)
    window = (high - low) / 2
    if window < MIN_LEVELS:
        raise NoFlankError(f"half of the flank is only {window:.0f} pixels high, {MIN_LEVELS} are needed")
    if distance.size < MIN_LEVELS:
        raise NoFlankError(WALL)
    starts = low + np.arange(math.floor(window) + 1)
    slopes = window_slopes(distance, height, starts, starts + window)
    if np.isnan(slopes).all():
        raise NoFlankError(WALL)
    if not np.any(slopes > 0):
        raise NoFlankError("no stretch of the boundary rises towards the crest")
    start = float(starts[np.nanargmax(slopes)])
    inside = (height >= start) & (height <= start + window)
    return fitted(distance[inside], height[inside], start, start + window)


def window_slopes(distance, height, lows, highs):
    """Slope of the regression line of the points whose height lies in each window; NaN where there is none.

    From sums accumulated over the points in order of height, so that all windows cost one pass.
    """
    order = np.argsort(height, kind="stable")
    x, z = distance[order] - distance.mean(), height[order] - height.mean()
    first = np.searchsorted(height[order], lows, side="left")
    last = np.searchsorted(height[order], highs, side="right")
    sums = np.concatenate(
        [np.zeros((5, 1)), np.cumsum([np.ones_like(x), x, z, x * x, x * z], axis=1)], axis=1
    )
    n, sum_x, sum_z, sum_xx, sum_xz = sums[:, last] - sums[:, first]
    n = np.maximum(n, 1)
    spread = sum_xx - sum_x * sum_x / n
    usable = (n >= MIN_LEVELS) & (spread >= n * WALL_SD**2)
    return np.where(usable, (sum_xz - sum_x * sum_z / n) / np.where(usable, spread, 1.0), np.nan)


def fitted(distance, height, low, high):
    """The regression line of height on distance, drawn from low to high."""
    spread = distance - distance.mean() if distance.size else distance
    if distance.size < MIN_LEVELS or spread @ spread < distance.size * WALL_SD**2:
        raise NoFlankError(WALL)
    slope = float(spread @ (height - height.mean()) / (spread @ spread))
    if slope <= 0:
        raise NoFlankError("the boundary does not rise towards the crest")
    intercept = float(height.mean() - slope * distance.mean())
    ends = tuple(((z - intercept) / slope, z) for z in (low, high))
    return Line(math.degrees(math.atan(slope)), ends)


def secant(profile, berry):
    """One side of the secant: from the plate below the outermost place one berry high, to the crest.

    The angle is atan(H / W) with W the half width, that place's distance from the crest's column. A pile's
    secant is not the mean of its two sides but atan(2 H / (W_left + W_right)), which does not depend on where
    between the flanks the highest berry happens to lie. Raises NoFlankError.
    """
    crest, height = profile.size - 1, float(profile[-1])
    if not 0 < berry < height:
        raise NoFlankError("the pile is not higher than one berry")
    if profile[0] >= berry:
        raise NoFlankError("the pile runs out of the picture sideways: its foot is not seen")
    place = float(outermost_crossing(profile, np.array([berry]))[0])
    return Line(math.degrees(math.atan2(height, crest - place)), ((place, 0.0), (float(crest), height)))


def secant_of_pile(left, right):
    """atan(2 H / D) of a pile from the lines of its two sides."""
    (foot_left, _), (crest_left, height) = left.ends
    (foot_right, _), (crest_right, _) = right.ends
    width = crest_left - foot_left + crest_right - foot_right
    return math.degrees(math.atan2(2 * height, width))


def measure_sides(profile, crest, fit_from, fit_to, berry, rule):
    """Every definition on both sides of a pile.

    profile : (M,) heights of the whole pile, foot to foot; crest : its highest column; fit_from, fit_to :
    fractions of the height, or "berry"; berry : a berry's height, or None where it is not known. Returns
    ({definition: (angle, left Line, right Line)}, {definition: why it could not be measured}).
    """
    height = float(profile[crest])
    sides = profile[: crest + 1], profile[crest:][::-1]
    measured, reasons = {}, {}
    for name in DEFINITIONS:
        try:
            if berry is None and (name == "secant" or (name != "whole" and "berry" in (fit_from, fit_to))):
                raise NoFlankError("the berry's height is not known")
            low, high = (berry if end == "berry" else end * height for end in (fit_from, fit_to))
            left, right = (_one_side(name, side, low, high, berry, rule) for side in sides)
        except NoFlankError as error:
            reasons[name] = error.reason
            continue
        mean = 0.5 * (left.angle_deg + right.angle_deg)
        measured[name] = (secant_of_pile(left, right) if name == "secant" else mean, left, right)
    return measured, reasons


def _one_side(name, profile, low, high, berry, rule):
    """One definition on one side."""
    if name == "secant":
        return secant(profile, berry)
    if name == "whole":
        return whole(profile, rule)
    return {"flank": flank, "steepest": steepest}[name](profile, low, high, rule)
