"""List doubts about a measured photograph: signs that it does not show a single heap.

A sign that leaves the measurement possible is a doubt. A doubt is a sentence for the
user, and the photograph then does not count in the mean. Other signs raise NoFlankError,
which refuses the photograph.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from repose.common.errors import NoFlankError
from repose.measure.photographs import finding
from repose.measure.photographs.segmentation import Segmentation
from repose.measure.pile import find_profile
from repose.measure.results import Measurement

DOUBT = "doubtful"  # begins each doubt
BASE_ROW_ADVICE = "give --base-row, the row of the plate, or show the printed sheet"
LOW_BASE_REASON = (
    "its lowest row lies {depth:.1%} of its height below its {part}: a shadow at the "
    "foot, or the camera looks down on it or is rolled (--length makes a line level); "
    f"{BASE_ROW_ADVICE}"
)

MIN_HEIGHT_PX = 80  # of a pile: with fewer pixels its angle is off by up to 1.5 degrees

# Limits of the pile's shape, in heights of a grain and in heights of the pile
LOWEST_PILE_GRAINS = 1.5  # below it is a layer
LARGEST_RISE_GRAINS = 1.5  # of the outline, away from the crest
LARGEST_RISE_SHARE = 0.12
LARGEST_DROP_GRAINS = 2.0  # of the outline within half a grain
LARGEST_DROP_SHARE = 0.2
LOWEST_MEETING = 0.7  # of the lines of both flanks, in heights of the pile
HIGHEST_MEETING = 1.3

# Limits of a base that was found without the sheet
LARGEST_SHADOW_GRAINS = 0.3  # rows of shadow below the grains
LARGEST_UNDERSIDE_GRAINS = 0.6  # rows below the widest one
# Round grains have upright ends of less than 0.75 of their height.
LARGEST_UPRIGHT_GRAINS = 0.75
LARGEST_UPRIGHT_PX = 12
SMALLEST_STEP = 30  # tones between what lies below the pile and beside it: no plate
LARGEST_SHADOW_SHARE = 0.03  # of a pile of another colour than the background's


class _Size(NamedTuple):
    """Size of a pile."""

    height_mm: float
    grain_mm: float  # height of a grain
    mm_per_pixel: float


class _Foot(NamedTuple):
    """Rows of a pile and its distance from both borders of the picture."""

    rows: np.ndarray  # (N,), from the crest to the lowest row
    left: np.ndarray  # (N,), pixels between the picture's left border and the pile
    right: np.ndarray  # (N,), pixels between the pile and the right border


def estimate_grain_mm(height_mm: float) -> float:
    """Estimate the height of a grain, if it is not known, from that of a pile."""
    return height_mm / 8


def list_doubts_of_pile(
    pile: Segmentation, measurement: Measurement, grain_mm: float, mm_per_pixel: float
) -> list[str]:
    """List the doubts that a pile is a single heap and has enough pixels.

    Parameters
    ----------
    pile : Segmentation
        The pile in the photograph.
    measurement : Measurement
        Its result.
    grain_mm : float
        Height of a grain.
    mm_per_pixel : float
        Scale of the photograph.

    Returns
    -------
    list of str
        A sentence for each doubt. The list is empty if there is none.

    Raises
    ------
    NoFlankError
        For a layer of grains.
    """
    height_mm = measurement.height_mm
    if height_mm < LOWEST_PILE_GRAINS * grain_mm:
        raise NoFlankError(
            f"it is {height_mm / grain_mm:.1f} grains high, less than "
            f"{LOWEST_PILE_GRAINS:g}: a layer, no pile"
        )

    # The heights of each side, from the crest outwards
    profile, crest = find_profile(pile)
    sides = (profile[: crest + 1][::-1], profile[crest:])
    size = _Size(height_mm, grain_mm, mm_per_pixel)
    doubts = [
        _check_rise(sides, size),
        _check_drop(sides, size),
        _check_flanks(measurement, pile.base_row, mm_per_pixel),
    ]
    if pile.has_neighbour:
        doubts.append(f"{DOUBT}: another heap stands beside it")
    doubts.append(_check_resolution(measurement, mm_per_pixel))
    return [doubt for doubt in doubts if doubt]


def _check_rise(sides: Sequence[np.ndarray], size: _Size) -> str:
    """Write a doubt if the outline rises again on its way from the crest.

    Parameters
    ----------
    sides : sequence of ndarray
        For each side the heights in pixels, from the crest outwards.
    size : _Size
        Size of the pile.

    Returns
    -------
    str
        The doubt. The text is empty if there is none.
    """
    # The rise at a place is its height over the lowest place between it and the crest.
    rises = [float((side - np.minimum.accumulate(side)).max()) for side in sides]
    rise_mm = size.mm_per_pixel * max(rises)
    limit_mm = max(
        LARGEST_RISE_GRAINS * size.grain_mm, LARGEST_RISE_SHARE * size.height_mm
    )
    if rise_mm <= limit_mm:
        return ""
    return (
        f"{DOUBT}: away from its crest the outline rises by "
        f"{rise_mm / size.height_mm:.0%} of the Height, as of two heaps"
    )


def _check_drop(sides: Sequence[np.ndarray], size: _Size) -> str:
    """Write a doubt if the outline of the pile falls steeply within half a grain.

    Parameters
    ----------
    sides : sequence of ndarray
        For each side the heights in pixels, from the crest outwards.
    size : _Size
        Size of the pile.

    Returns
    -------
    str
        The doubt. The text is empty if there is none.
    """
    half_grain_px = max(1, round(0.5 * size.grain_mm / size.mm_per_pixel))
    drops_px = []
    for side in sides:
        falls = side[:-half_grain_px] - side[half_grain_px:]
        drops_px.append(float(falls.max(initial=0.0)))
    drop_mm = size.mm_per_pixel * max(drops_px)
    limit_mm = max(
        LARGEST_DROP_GRAINS * size.grain_mm, LARGEST_DROP_SHARE * size.height_mm
    )
    if drop_mm <= limit_mm:
        return ""
    return (
        f"{DOUBT}: the outline falls by {drop_mm / size.height_mm:.0%} of the Height at "
        "once, as of a box behind the heap"
    )


def _check_flanks(
    measurement: Measurement, base_row: float, mm_per_pixel: float
) -> str:
    """Write a doubt if the lines of both flanks do not meet near the crest.

    Parameters
    ----------
    measurement : Measurement
        Result of the photograph.
    base_row : float
        Row of the plate.
    mm_per_pixel : float
        Scale of the photograph.

    Returns
    -------
    str
        The doubt. The text is empty if they meet near the crest, or if there are no
        lines.
    """
    flank = measurement.angles.get("flank")
    if flank is None:
        return ""
    # The lines of a cone meet at its crest. If the top is level, they meet above it.
    height_mm = measurement.height_mm
    meeting_mm = _compute_meeting_height(flank.lines, base_row) * mm_per_pixel
    if LOWEST_MEETING * height_mm < meeting_mm < HIGHEST_MEETING * height_mm:
        return ""
    if meeting_mm > height_mm:
        cause = "its top is level"
    else:
        cause = "something else stands behind it"
    return (
        f"{DOUBT}: the lines of its flanks meet at {meeting_mm / height_mm:.0%} of the "
        f"Height: {cause}"
    )


def _check_resolution(measurement: Measurement, mm_per_pixel: float) -> str:
    """Write a doubt if the pile has too few pixels, else an empty text."""
    height_px = math.floor(measurement.height_mm / mm_per_pixel)
    if height_px >= MIN_HEIGHT_PX:
        return ""
    angle_error = _compute_angle_error(measurement)
    return (
        f"{DOUBT}: the photograph is too coarse: the pile is {height_px} pixels high, "
        f"{MIN_HEIGHT_PX} are needed; the angle may be off by {angle_error:.1f} "
        "degrees, the Height by 2 pixels"
    )


def _compute_angle_error(measurement: Measurement) -> float:
    """Compute the angle's error in degrees if an end of a line is off by a pixel."""
    (_, lower_row), (_, upper_row) = measurement.angle.lines[0]
    sine = math.sin(2 * math.radians(measurement.aor_deg))
    return math.degrees(sine / abs(lower_row - upper_row))


def _compute_meeting_height(lines: tuple, base_row: float) -> float:
    """Compute the height over the plate at which the lines of both flanks meet.

    Parameters
    ----------
    lines : tuple
        The left and the right line, each by two ends (column, row).
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
    # Distance of the meeting point from the first end, times the difference of slopes
    offset = row3 - row1 + other_slope * (x1 - x3)
    return base_row - (row1 + slope * offset / (slope - other_slope))


def require_foot(
    image: np.ndarray, pile: Segmentation, grain_mm: float | None, mm_per_pixel: float
) -> None:
    """Check that the lowest rows of a pile are its foot, if no sheet shows the plate.

    Instead of the foot, they may show a shadow, or the near rim of a pile that is seen
    from above.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR, or (H, W).
    pile : Segmentation
        The pile found in it.
    grain_mm : float or None
        Height of a grain. If it is None, `estimate_grain_mm` estimates it.
    mm_per_pixel : float
        Scale of the picture.

    Raises
    ------
    NoFlankError
        If the lowest rows are no foot, or if the picture cuts the pile off.
    """
    if pile.mask[-1].any():
        raise NoFlankError(
            "the pile runs out of the picture at the bottom: its foot is not seen; "
            "give --base-row, the row of the plate"
        )
    widths = pile.mask.sum(axis=1, dtype=int)
    rows = np.flatnonzero(widths)
    if grain_mm is None:
        grain_mm = estimate_grain_mm(rows.size * mm_per_pixel)
    grain_px = grain_mm / mm_per_pixel

    shadow_rows = finding.count_shadow_rows(image, pile.mask)
    if shadow_rows > LARGEST_SHADOW_GRAINS * grain_px:
        part = "grains, with the colour of the background"
        raise NoFlankError(
            LOW_BASE_REASON.format(depth=shadow_rows / rows.size, part=part)
        )

    # The lower rows of a pile that is seen from above show its near rim, which is
    # narrower than the rows over it. Find the lowest of the widest rows.
    is_widest = widths[rows] >= 0.99 * widths.max()
    widest_row = rows[np.flatnonzero(is_widest)[-1]]
    underside_rows = rows[-1] - widest_row
    if underside_rows > LARGEST_UNDERSIDE_GRAINS * grain_px:
        depth = underside_rows / rows.size
        raise NoFlankError(LOW_BASE_REASON.format(depth=depth, part="widest row"))


def list_doubts_of_base(
    image: np.ndarray, pile: Segmentation, grain_px: float
) -> list[str]:
    """List the doubts about a base and flanks that were found without the sheet.

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
        A sentence for each doubt. The list is empty if there is none.
    """
    # In each row, count the columns to the left and to the right of the pile.
    rows = np.flatnonzero(pile.mask.any(axis=1))
    foot = _Foot(
        rows=rows,
        left=pile.mask[rows].argmax(axis=1),
        right=pile.mask[rows, ::-1].argmax(axis=1),
    )
    doubts = []

    upright_px = max(_count_upright_rows(foot.left), _count_upright_rows(foot.right))
    if upright_px > max(LARGEST_UPRIGHT_GRAINS * grain_px, LARGEST_UPRIGHT_PX):
        doubts.append(
            f"{DOUBT}: an end of its foot is upright over {upright_px} pixels, as of a "
            f"plate or a ruler: {BASE_ROW_ADVICE}"
        )

    if _continues_below(image, pile, foot, grain_px):
        doubts.append(
            f"{DOUBT}: below its base the picture has the pile's colour and no "
            f"plate's: {BASE_ROW_ADVICE}"
        )

    shadow_share = finding.compute_shadow_share(image, pile.mask)
    if shadow_share > LARGEST_SHADOW_SHARE:
        doubts.append(
            f"{DOUBT}: {100 * shadow_share:.0f} % of it is darker background, as of a "
            "shadow on what stands behind"
        )
    return doubts


def _count_upright_rows(distance: np.ndarray) -> int:
    """Count the rows in which one side of a pile is at most 2 pixels from its outermost.

    Many such rows are an upright edge, which grains do not have.

    Parameters
    ----------
    distance : ndarray
        Distance (N,) of the pile from the border of the picture on this side, by row.
    """
    return int((distance <= distance.min() + 2).sum())


def _continues_below(
    image: np.ndarray, pile: Segmentation, foot: _Foot, grain_px: float
) -> bool:
    """Tell whether the picture below the base has the pile's colour.

    The colour below the middle of the foot is compared with two others: the colour of
    the grains, and the colour in the same rows beside the foot.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3), BGR, or (H, W).
    pile : Segmentation
        The pile found in it.
    foot : _Foot
        Its distance from both borders of the picture.
    grain_px : float
        Height of a grain in pixels.
    """
    channels = image.reshape(*image.shape[:2], -1)
    # The strip below the base and its parts beside the foot. It is about a grain high,
    # and begins 2 rows below the base to keep away from the edge of the pile.
    first_row = math.ceil(pile.base_row) + 2
    n_rows = max(4, round(grain_px))
    strip = channels[first_row : first_row + n_rows]
    left_part = strip[:, : foot.left.min()]
    right_part = strip[:, strip.shape[1] - foot.right.min() :]
    sides = np.concatenate([left_part, right_part], axis=1)
    if sides.size == 0:
        return False

    # The middle third of the foot, and the grains above it
    rows = foot.rows
    low_row = rows[0] + 2 * len(rows) // 3
    columns = np.flatnonzero(pile.mask[low_row])
    middle = slice(columns[len(columns) // 3], columns[2 * len(columns) // 3] + 1)
    grains = channels[rows[len(rows) // 2] : rows[-1], middle]

    # Under a pile on a plate, the strip has the colour of the plate beside it, and not
    # that of the grains.
    grain_colour = np.median(grains, axis=(0, 1))
    colour_below = np.median(strip[:, middle], axis=(0, 1))
    side_colour = np.median(sides, axis=(0, 1))
    difference_from_sides = np.abs(colour_below - side_colour).max()
    difference_from_grains = np.abs(colour_below - grain_colour).max()
    return bool(
        difference_from_grains < difference_from_sides
        and difference_from_sides > SMALLEST_STEP
    )
