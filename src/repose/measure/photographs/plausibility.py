"""Check whether a measured photograph plausibly shows a single pile.

Each sign against it is a warning, a sentence for the user. A photograph with a warning
is called doubtful: it is measured, but by default it does not count in the mean. Only
the warning that the two sides differ leaves it in the mean (`make_sides_warning`).
Worse signs raise NoFlankError, which rejects the photograph.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from repose.common.errors import NoFlankError
from repose.measure.outline_shape import (
    DOUBTFUL,
    LARGEST_SIDE_DIFFERENCE_DEG,
    PileSize,
    measure_drop,
    measure_rise,
    sides_differ,
    split_sides,
)
from repose.measure.photographs import finding
from repose.measure.photographs.segmentation import Segmentation
from repose.measure.pile import LOWEST_PILE_GRAINS, find_profile
from repose.measure.results import Measurement

BASE_ROW_ADVICE = "give --base-row, the row of the plate, or show the printed sheet"
# Reason why a base is rejected. `part` is the part of the pile above the lowest row.
LOW_BASE_REASON = (
    "the pile's lowest row lies {depth:.1%} of its height below its {part}: there is a "
    "shadow at the foot (give --base-row), or the camera looks down or is rolled (give "
    "--length)"
)

MIN_HEIGHT_PX = 80  # of a pile: the angle of a lower one is off by up to 1.5 degrees

TYPICAL_PILE_GRAINS = 8  # height of a pile in grains, if the size of these is unknown

# Heights at which the lines of both flanks may meet, in heights of the pile
LOWEST_APEX = 0.7
HIGHEST_APEX = 1.3

# Limits of a base that was found without the sheet
LARGEST_SHADOW_GRAINS = 0.3  # height of the shadow below the grains
LARGEST_UNDERSIDE_GRAINS = 0.6  # height of the pile below its widest row
WIDEST_FRACTION = (
    0.99  # fraction of the largest width from which a row counts as widest
)
# The end of a row of round grains is upright over less than this height.
LARGEST_UPRIGHT_GRAINS = 0.75
LARGEST_UPRIGHT_PX = 12
END_PX = 2  # a row ends upright if it reaches within this distance of the outermost end
SMALLEST_STRIP_PX = 4  # height of the strip below the base that is compared
# If both show a plate, the colours of the strip below the pile and of the strip beside
# it differ by at most this number of tones in each channel.
LARGEST_PLATE_DIFFERENCE = 30
LARGEST_SHADOW_FRACTION = 0.03  # of a pile that differs in colour from the background


class _Margins(NamedTuple):
    """Widths of the background on both sides of a pile, for each row of the pile."""

    rows: np.ndarray  # (N,), from the crest to the lowest row
    left: np.ndarray  # (N,), pixels between the picture's left border and the pile
    right: np.ndarray  # (N,), pixels between the pile and the right border


def estimate_grain_mm(height_mm: float) -> float:
    """Estimate the unknown height of a grain from the height of a pile."""
    return height_mm / TYPICAL_PILE_GRAINS


def list_pile_warnings(
    pile: Segmentation, measurement: Measurement, grain_mm: float, mm_per_pixel: float
) -> list[str]:
    """List the signs that a photograph shows no single pile, or shows it too coarsely.

    Parameters
    ----------
    pile : Segmentation
        The pile in the photograph.
    measurement : Measurement
        The result of its measurement.
    grain_mm : float
        Height of a grain.
    mm_per_pixel : float
        Scale of the photograph.

    Returns
    -------
    list of str
        A sentence for each warning, which begins with `DOUBTFUL`. The list is empty if
        there is none.

    Raises
    ------
    NoFlankError
        If the grains form a layer, which is too low to have a measurable slope.
    """
    height_mm = measurement.height_mm
    if height_mm < LOWEST_PILE_GRAINS * grain_mm:
        raise NoFlankError(
            f"the pile is {height_mm / grain_mm:.1f} grains high, less than "
            f"{LOWEST_PILE_GRAINS:g}: a layer, not a pile"
        )

    profile, crest = find_profile(pile)
    sides = split_sides(profile, crest)
    size = PileSize(height_mm, grain_mm, mm_per_pixel)
    # Each of these functions returns an empty string if it has no warning.
    warnings = [
        _make_rise_warning(sides, size),
        _make_drop_warning(sides, size),
        _make_flank_warning(measurement, pile.base_row, mm_per_pixel),
    ]
    if pile.has_neighbour:
        warnings.append(f"{DOUBTFUL}: another pile stands beside it")
    warnings.append(_make_resolution_warning(measurement, mm_per_pixel))
    return [warning for warning in warnings if warning]


def make_sides_warning(measurement: Measurement) -> str:
    """Return a warning if the angles of the pile's two sides differ too much.

    Parameters
    ----------
    measurement : Measurement
        Measurement of the photograph.

    Returns
    -------
    str
        The warning; empty if there is none. It does not exclude the photograph from the
        mean, because lopsided piles also occur in simulations, and count there.
    """
    left_deg = measurement.angle.left_deg
    right_deg = measurement.angle.right_deg
    if not sides_differ(left_deg, right_deg):
        return ""
    return (
        f"{DOUBTFUL}: the angles of the pile's two sides differ by "
        f"{abs(left_deg - right_deg):.1f} degrees, more than "
        f"{LARGEST_SIDE_DIFFERENCE_DEG:g}: it is lopsided, or the lines do not follow it"
    )


def _make_rise_warning(sides: Sequence[np.ndarray], size: PileSize) -> str:
    """Return a warning if the outline of the pile rises again away from the crest.

    Parameters
    ----------
    sides : sequence of ndarray
        For each side the heights in pixels, from the crest outwards.
    size : PileSize
        Size of the pile.

    Returns
    -------
    str
        The warning; empty if there is none.
    """
    rise_mm = measure_rise(sides, size)
    if rise_mm <= size.largest_rise_mm:
        return ""
    return (
        f"{DOUBTFUL}: away from its crest the outline rises by "
        f"{rise_mm / size.height_mm:.0%} of the pile's height, as with two piles"
    )


def _make_drop_warning(sides: Sequence[np.ndarray], size: PileSize) -> str:
    """Return a warning if the outline of the pile falls steeply within half a grain.

    Parameters
    ----------
    sides : sequence of ndarray
        For each side the heights in pixels, from the crest outwards.
    size : PileSize
        Size of the pile.

    Returns
    -------
    str
        The warning; empty if there is none.
    """
    drop_mm = measure_drop(sides, size)
    if drop_mm <= size.largest_drop_mm:
        return ""
    return (
        f"{DOUBTFUL}: the outline falls by {drop_mm / size.height_mm:.0%} of the "
        "pile's height at once, as with a box behind the pile"
    )


def _make_flank_warning(
    measurement: Measurement, base_row: float, mm_per_pixel: float
) -> str:
    """Return a warning if the lines of both flanks do not meet near the crest.

    Parameters
    ----------
    measurement : Measurement
        Measurement of the photograph.
    base_row : float
        Row of the plate.
    mm_per_pixel : float
        Scale of the photograph.

    Returns
    -------
    str
        The warning. It is empty if the lines meet near the crest, or if no lines were
        fitted to the flanks.
    """
    flank = measurement.angles.get("flank")
    if flank is None:
        return ""
    # The lines of a cone meet at its apex. If the top of the pile is level, they meet
    # above it.
    height_mm = measurement.height_mm
    apex_mm = _compute_apex_height(flank.lines, base_row) * mm_per_pixel
    if LOWEST_APEX * height_mm < apex_mm < HIGHEST_APEX * height_mm:
        return ""
    if apex_mm > height_mm:
        cause = "its top is level"
    else:
        cause = "something else stands behind it and raises the outline"
    return (
        f"{DOUBTFUL}: the lines of its flanks meet at {apex_mm / height_mm:.0%} of the "
        f"pile's height: {cause}"
    )


def _make_resolution_warning(measurement: Measurement, mm_per_pixel: float) -> str:
    """Return a warning if the pile is too few pixels high, else an empty string."""
    height_px = math.floor(measurement.height_mm / mm_per_pixel)
    if height_px >= MIN_HEIGHT_PX:
        return ""
    angle_error = _compute_angle_error(measurement)
    return (
        f"{DOUBTFUL}: the photograph is too coarse: the pile is {height_px} pixels "
        f"high, at least {MIN_HEIGHT_PX} are needed; the angle may be off by "
        f"{angle_error:.1f} degrees, and the height by 2 pixels"
    )


def _compute_angle_error(measurement: Measurement) -> float:
    """Compute the change of the angle [degrees] if a line rises by 2 pixels more."""
    left_line, _ = measurement.angle.lines
    (_, lower_row), (_, upper_row) = left_line
    # A line that rises by h over a width w has the angle a = atan(h / w), whose
    # derivative by h is sin(2 a) / (2 h).
    sine = math.sin(2 * math.radians(measurement.aor_deg))
    return math.degrees(sine / abs(lower_row - upper_row))


def _compute_apex_height(lines: tuple, base_row: float) -> float:
    """Compute the height over the plate at which the lines of both flanks meet.

    Parameters
    ----------
    lines : tuple
        The left and the right line, each given by two points (column, row).
    base_row : float
        Row of the plate.

    Returns
    -------
    float
        Height in pixels.
    """
    ((x1, row1), (x2, row2)), ((x3, row3), (x4, row4)) = lines
    slope = (row2 - row1) / (x2 - x1)
    other_slope = (row4 - row3) / (x4 - x3)
    # Horizontal distance of the meeting point from the first point, times the
    # difference of the slopes
    offset = row3 - row1 + other_slope * (x1 - x3)
    return base_row - (row1 + slope * offset / (slope - other_slope))


def require_visible_foot(
    image: np.ndarray, pile: Segmentation, grain_mm: float | None, mm_per_pixel: float
) -> None:
    """Raise NoFlankError if the lowest rows of a pile do not show its foot.

    In a photograph without the printed sheet, these rows may instead show a shadow, or
    the near rim of a pile if the camera looks down on it. The base would then be found
    too low.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR, or (H, W).
    pile : Segmentation
        The pile found in it; its mask is not empty.
    grain_mm : float or None
        Height of a grain. If it is None, it is estimated (`estimate_grain_mm`).
    mm_per_pixel : float
        Scale of the picture.

    Raises
    ------
    NoFlankError
        If the lowest rows do not show the foot, or if the picture does not contain the
        whole foot.
    """
    if pile.mask[-1].any():
        raise NoFlankError(
            "the pile runs out of the picture at the bottom: its foot is not seen; "
            "give --base-row, the row of the plate"
        )
    widths = pile.mask.sum(axis=1, dtype=int)
    rows = np.flatnonzero(widths)  # rows of the pile, from top to bottom
    if grain_mm is None:
        grain_mm = estimate_grain_mm(rows.size * mm_per_pixel)
    grain_px = grain_mm / mm_per_pixel

    n_shadow_rows = finding.count_shadow_rows(image, pile.mask)
    if n_shadow_rows > LARGEST_SHADOW_GRAINS * grain_px:
        part = "grains, with the colour of the background"
        depth = n_shadow_rows / rows.size
        raise NoFlankError(LOW_BASE_REASON.format(depth=depth, part=part))

    # If the camera looks down on the pile, the lowest rows show its near rim, which is
    # narrower than the rows above. So the rim lies below all rows that are about as
    # wide as the widest one.
    is_widest = widths[rows] >= WIDEST_FRACTION * widths.max()
    lowest_widest_row = rows[np.flatnonzero(is_widest)[-1]]
    n_rim_rows = rows[-1] - lowest_widest_row
    if n_rim_rows > LARGEST_UNDERSIDE_GRAINS * grain_px:
        depth = n_rim_rows / rows.size
        raise NoFlankError(LOW_BASE_REASON.format(depth=depth, part="widest row"))


def list_base_warnings(
    image: np.ndarray, pile: Segmentation, grain_px: float
) -> list[str]:
    """List signs that something else was taken for a part of a pile, without the sheet.

    It may be a plate or ruler at the foot, the surface below the base, or a shadow.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR, or (H, W).
    pile : Segmentation
        The pile found in it.
    grain_px : float
        Height of a grain in pixels.

    Returns
    -------
    list of str
        A sentence for each warning, which begins with `DOUBTFUL`. The list is empty if
        there is none.
    """
    rows = np.flatnonzero(pile.mask.any(axis=1))
    # In a row of the mask, argmax returns the first pixel of the pile. Its column is
    # the width of the margin before it.
    margins = _Margins(
        rows=rows,
        left=pile.mask[rows].argmax(axis=1),
        right=pile.mask[rows, ::-1].argmax(axis=1),
    )
    warnings = []

    n_upright_rows = max(
        _count_upright_rows(margins.left), _count_upright_rows(margins.right)
    )
    if n_upright_rows > max(LARGEST_UPRIGHT_GRAINS * grain_px, LARGEST_UPRIGHT_PX):
        warnings.append(
            f"{DOUBTFUL}: an end of the pile's foot is upright over {n_upright_rows} "
            f"pixels, as with a plate or a ruler: {BASE_ROW_ADVICE}"
        )

    if _pile_continues_below_base(image, pile, margins, grain_px):
        warnings.append(
            f"{DOUBTFUL}: below the base of the pile the picture has the pile's "
            f"colour, not that of a plate: {BASE_ROW_ADVICE}"
        )

    shadow_fraction = finding.compute_shadow_fraction(image, pile.mask)
    if shadow_fraction > LARGEST_SHADOW_FRACTION:
        warnings.append(
            f"{DOUBTFUL}: {100 * shadow_fraction:.0f} % of the pile is darker "
            "background, as with a shadow on what stands behind"
        )
    return warnings


def _count_upright_rows(margin: np.ndarray) -> int:
    """Count the rows in which a pile nearly reaches its outermost end on one side.

    At the end of a pile of grains there are only few such rows. Many of them mean that
    the end is an upright edge.

    Parameters
    ----------
    margin : ndarray
        Number of pixels (N,) between the pile and the border of the picture on one
        side, for each row of the pile.

    Returns
    -------
    int
        The number of rows.
    """
    return int((margin <= margin.min() + END_PX).sum())


def _pile_continues_below_base(
    image: np.ndarray, pile: Segmentation, margins: _Margins, grain_px: float
) -> bool:
    """Tell whether the pile seems to continue below the base, so the base is too high.

    The colour below the middle of the foot is compared with the colour of the grains,
    and with the colour beside the foot in the same rows.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR, or (H, W).
    pile : Segmentation
        The pile found in it.
    margins : _Margins
        Widths of the background on both sides of the pile.
    grain_px : float
        Height of a grain in pixels.

    Returns
    -------
    bool
        True if the colour below the base clearly differs from the colour beside the
        foot, and is closer to the colour of the grains.
    """
    # Select a strip below the base. It is about a grain high, and begins 2 rows below
    # the base, away from the edge of the pile.
    channels = image.reshape(*image.shape[:2], -1)  # (H, W, 1) or (H, W, 3)
    first_row = math.ceil(pile.base_row) + 2
    n_rows = max(SMALLEST_STRIP_PX, round(grain_px))
    strip = channels[first_row : first_row + n_rows]

    # Select the parts of the strip that do not lie below the pile.
    left_part = strip[:, : margins.left.min()]
    right_part = strip[:, strip.shape[1] - margins.right.min() :]
    beside_foot = np.concatenate([left_part, right_part], axis=1)
    if beside_foot.size == 0:
        return False

    # Select the middle third of the columns of the pile in a row at two thirds of its
    # height from the top, and the grains of the lower half in these columns.
    rows = margins.rows
    low_row = rows[0] + 2 * len(rows) // 3
    columns = np.flatnonzero(pile.mask[low_row])
    middle = slice(columns[len(columns) // 3], columns[2 * len(columns) // 3] + 1)
    grains = channels[rows[len(rows) // 2] : rows[-1], middle]

    # If the pile stands on a plate, the strip has the colour of the plate beside it,
    # and not that of the grains.
    colour_below = np.median(strip[:, middle], axis=(0, 1))
    colour_beside = np.median(beside_foot, axis=(0, 1))
    grain_colour = np.median(grains, axis=(0, 1))
    difference_from_sides = np.abs(colour_below - colour_beside).max()
    difference_from_grains = np.abs(colour_below - grain_colour).max()
    return bool(
        difference_from_grains < difference_from_sides
        and difference_from_sides > LARGEST_PLATE_DIFFERENCE
    )
