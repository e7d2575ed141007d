"""Angle of repose and Height of a pile, from a photograph or from a simulation seen from the side.

The steps are the paper's (section 2.3, Figure 6): grey, threshold, edge, boundary, a straight line through
the left and one through the right flank; the angle of repose is the mean of the two arctangents, the Height
that of the highest point over the base. A simulation is projected to a silhouette first and then goes the
same way.

What the paper leaves open is which points of a lumpy boundary the line goes through. There are three rules,
each followed by the regression of height on distance; `FLANK_RULES` names them and can take another:

levels   at every height in the band, the middle of the outermost and the innermost place where the boundary
         crosses it. The heights are not scattered, so the ends of the band bend nothing.
rows     the outermost crossing alone.
columns  the top of every pixel column that lies in the band: the plain reading of a linear fit to the boundary,
         and the default. Lumps cut off at the ends of the band, and the regression on a scattered distance,
         both flatten the line.

Bias (and root mean square error of one pile), degrees, over piles of 15, 20 ... 45 degrees, band 10 to 80 %
(30 strewn and 8 filled piles an angle):

                                                          levels        rows          columns
    discs of 10-20 mm strewn along a triangle, one view   -0.56 (1.55)  -0.78 (1.67)  -1.37 (2.18)
    500 ellipsoids filling a cone, 18 views               +0.56 (0.86)  +0.86 (1.09)  -1.55 (1.65)

Total least squares, distance on height, and bands cut at a mean crossing were tried on four kinds of drawn
pile: none was better than levels on all of them. Poured piles (48, ellipsoids) have bent flanks and no true
angle: there levels reads 0.8 to 1.0 degrees above columns, rows in between, with about the same scatter from
seed to seed. Numbers from different rules must not be compared; the default is
the rule that other people's line fits are most likely to have used, not the one of least bias.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from repose.errors import InputError
from repose.silhouette import (
    NoFlankError,
    frame,
    outlines,
    paint,
    segment,
    silhouette,
    top_of,
    upper_edge,
)

__all__ = [
    "FLANK_RULES",
    "MeasureSettings",
    "Measurement",
    "NoFlankError",
    "PileResult",
    "flank_angle",
    "measure_image",
    "measure_pile",
    "overlay",
    "process_panels",
    "read_image",
    "silhouette",
]

MIN_LEVELS = 12  # pixel rows in the band: fewer carry no angle
LOWEST_PILE_BERRIES = 1.5  # in equivalent diameters: 20 mm for the mean berry; below, a layer and not a pile
RED, GREEN, YELLOW, BLUE = (40, 40, 230), (60, 170, 40), (0, 200, 255), (220, 120, 20)  # BGR


@dataclass(frozen=True)
class MeasureSettings:
    """How a pile is measured. `views` side views evenly over half a turn (the other half mirrors them);
    `fit_from` and `fit_to` bound the flank as fractions of the pile's height; `flank` names the rule. Raises
    InputError."""

    views: int = 18
    mm_per_pixel: float = 0.25
    fit_from: float = 0.1
    fit_to: float = 0.8
    largest_pile_only: bool = True
    flank: str = "columns"

    def __post_init__(self):
        if isinstance(self.views, bool) or not isinstance(self.views, int) or not 1 <= self.views <= 360:
            raise InputError("measure", "views", self.views, "a whole number from 1 to 360")
        if not isinstance(self.largest_pile_only, bool):
            raise InputError("measure", "largest_pile_only", self.largest_pile_only, "true or false")
        check_fit(self.mm_per_pixel, self.fit_from, self.fit_to, self.flank)


@dataclass(frozen=True)
class Measurement:
    """One picture's result. `lines` is (left, right), each ((column, row) below, (column, row) above) in
    pixels; `contour` (M, 2) the boundary's pixels (column, row); `base_row` the plate's row and `top` the
    highest point's (column, row); `pile_is` "darker" or "brighter" than the background."""

    left_deg: float
    right_deg: float
    aor_deg: float
    height_mm: float
    base_row: float
    top: tuple
    lines: tuple
    contour: np.ndarray
    pile_is: str


@dataclass(frozen=True)
class PileResult:
    """A simulated pile: means over the views, and each view's left and right angle and silhouette height. A
    view without a flank is NaN; `height_mm` is exact, from the bodies themselves."""

    aor_deg: float
    height_mm: float
    left_deg: np.ndarray
    right_deg: np.ndarray
    view_height_mm: np.ndarray


def check_fit(mm_per_pixel, fit_from, fit_to, flank):
    """InputError unless the scale, the band and the rule can be used."""
    if not (isinstance(mm_per_pixel, int | float) and 0 < mm_per_pixel < math.inf):
        raise InputError("measure", "mm_per_pixel", mm_per_pixel, "a positive number")
    if not (isinstance(fit_from, int | float) and 0 <= fit_from <= 0.9):
        raise InputError("measure", "fit_from", fit_from, "from 0 to 0.9")
    if not (isinstance(fit_to, int | float) and fit_from + 0.1 <= fit_to <= 1):
        raise InputError("measure", "fit_to", fit_to, "at least fit_from + 0.1, at most 1")
    if flank not in FLANK_RULES:
        raise InputError("measure", "flank", flank, "one of " + ", ".join(FLANK_RULES))


# --- the flank: profile -> line -------------------------------------------------------------------


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


def flank_angle(profile, low, high, flank="columns"):
    """Angle (degrees) and line of one flank.

    profile : (M,) heights over the base from outside the foot to the crest, one a pixel column, in pixels,
    beginning below `low`. low, high : the band, in pixels. Returns angle, slope, intercept of height = slope
    * index + intercept. Raises NoFlankError.
    """
    if levels_between(low, high).size < MIN_LEVELS:
        raise NoFlankError(f"the flank is only {high - low:.0f} pixels high, {MIN_LEVELS} are needed")
    if profile[0] >= low:
        raise NoFlankError("the pile runs out of the picture sideways: its foot is not seen")
    distance, height = FLANK_RULES[flank](profile, low, high)
    spread = distance - distance.mean() if distance.size else distance
    if distance.size < MIN_LEVELS or np.abs(spread).max() < 1.0:
        raise NoFlankError("too few boundary points on the flank, it is a wall")
    slope = float(spread @ (height - height.mean()) / (spread @ spread))
    if slope <= 0:
        raise NoFlankError("the boundary does not rise towards the crest")
    return math.degrees(math.atan(slope)), slope, float(height.mean() - slope * distance.mean())


# --- one picture ----------------------------------------------------------------------------------


def measure_image(
    image, mm_per_pixel, fit_from=0.1, fit_to=0.8, largest_pile_only=True, *, base_row=None, flank="columns"
):
    """Measure the pile in a picture (section 2.3).

    image : (H, W) or (H, W, 3; BGR) uint8, a photograph from the side or a silhouette; the pile may be darker
    or brighter than the background (see `repose.silhouette.segment`). base_row : the plate's row where the
    pile's lowest row is not it. Returns a Measurement. Raises InputError (arguments) and NoFlankError
    (nothing to fit).
    """
    check_fit(mm_per_pixel, fit_from, fit_to, flank)
    return measure_segmented(
        segment(image, largest_pile_only, base_row), mm_per_pixel, fit_from, fit_to, flank
    )


def measure_segmented(pile, mm_per_pixel, fit_from, fit_to, flank):
    """Measurement of a Segmentation: profile, crest, two flanks."""
    edge = upper_edge(pile.mask, pile.contrast, pile.level)
    profile = np.where(np.isnan(edge), 0.0, np.maximum(pile.base_row - edge, 0.0))
    height = float(profile.max())
    highest = np.flatnonzero(profile >= height - 1e-6)
    crest = int(highest[highest.size // 2])
    low, high = fit_from * height, fit_to * height
    angles, lines = [], []
    for side, flank_profile in ((1, profile[: crest + 1]), (-1, profile[crest:][::-1])):
        angle, slope, intercept = flank_angle(flank_profile, low, high, flank)
        angles.append(angle)
        ends = [((z - intercept) / slope, pile.base_row - z) for z in (low, high)]
        lines.append(tuple((u if side == 1 else profile.size - 1 - u, row) for u, row in ends))
    contours = cv2.findContours(pile.mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    return Measurement(
        left_deg=angles[0],
        right_deg=angles[1],
        aor_deg=sum(angles) / 2,
        height_mm=height * mm_per_pixel,
        base_row=pile.base_row,
        top=(float(crest), pile.base_row - height),
        lines=tuple(lines),
        contour=np.concatenate(contours)[:, 0, :],
        pile_is=pile.pile_is,
    )


def read_image(path):
    """Picture file as (H, W, 3) BGR uint8, turned upright as its EXIF says. Raises InputError."""
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "picture", "no such file", "an existing picture file (PNG, JPEG, TIFF, BMP)")
    content = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    if content.size == 0:
        raise InputError(path, "picture", "an empty file", "a picture file (PNG, JPEG, TIFF, BMP)")
    image = cv2.imdecode(content, cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(path, "picture", "not a picture", "a picture file (PNG, JPEG, TIFF, BMP)")
    return image


# --- pictures of the measurement (Figure 6) -------------------------------------------------------


def overlay(image, measurement):
    """The picture (BGR) with boundary, left line red, right line green, base and Height, as in Figure 6."""
    picture = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    thick = max(1, round(max(picture.shape) / 500))
    outline = np.zeros(picture.shape[:2], np.uint8)
    outline[measurement.contour[:, 1], measurement.contour[:, 0]] = 1
    picture[cv2.dilate(outline, np.ones((thick, thick), np.uint8)) > 0] = YELLOW
    right_end, base = picture.shape[1] - 1, measurement.base_row
    column, top = measurement.top
    draw_line(picture, (0, base - thick / 2), (right_end, base - thick / 2), BLUE, thick)
    draw_line(picture, (column, base), (column, top), BLUE, thick)
    draw_line(picture, (column - 12 * thick, top), (column + 12 * thick, top), BLUE, thick)
    for (below, above), colour in zip(measurement.lines, (RED, GREEN), strict=True):
        draw_line(picture, below, above, colour, 2 * thick)
    return picture


def draw_line(picture, start, end, colour, thickness):
    """A smooth line between sub-pixel points (column, row)."""
    a, b = (tuple(round(256 * value) for value in point) for point in (start, end))
    cv2.line(picture, a, b, colour, thickness, cv2.LINE_AA, 8)


def process_panels(
    image, mm_per_pixel, fit_from=0.1, fit_to=0.8, largest_pile_only=True, *, base_row=None, flank="columns"
):
    """The workflow's pictures in order, {"grey", "binary", "edge", "boundary"}: Figure 6. Arguments and
    errors are those of `measure_image`; "boundary" is the overlay, BGR, the others are (H, W) uint8."""
    check_fit(mm_per_pixel, fit_from, fit_to, flank)
    pile = segment(image, largest_pile_only, base_row)
    measurement = measure_segmented(pile, mm_per_pixel, fit_from, fit_to, flank)
    binary = pile.mask * np.uint8(255)
    return {
        "grey": pile.grey,
        "binary": binary,
        "edge": cv2.Canny(binary, 50, 150),
        "boundary": overlay(image, measurement),
    }


# --- a simulated pile -----------------------------------------------------------------------------


def measure_pile(centres_m, quaternions, particle, settings=None, members=None, scales=None):
    """Measure simulated bodies on the plate z = 0 from `settings.views` sides.

    centres_m : (N, 3). quaternions : (N, 4) w, x, y, z, body -> world. members : (N,) bool, the bodies of the
    largest cluster in contact; used when `settings.largest_pile_only`. scales : (N,), by default 1. Without
    members the largest connected part
    of each silhouette is taken, which cannot tell a loose berry in front of the pile from the pile. Returns a
    PileResult. Raises NoFlankError if there is no pile or if more than half of the views have no flank.
    """
    settings = settings or MeasureSettings()
    centres, quaternions = np.asarray(centres_m, dtype=float), np.asarray(quaternions, dtype=float)
    if members is not None and settings.largest_pile_only:
        centres, quaternions = centres[members], quaternions[members]
        scales = None if scales is None else scales[members]
    if len(centres) == 0:
        raise NoFlankError("no berry lies in the pile")
    height_m = top_of(centres, quaternions, particle, scales)
    lowest_m = LOWEST_PILE_BERRIES * equivalent_diameter(particle)
    if height_m < lowest_m:
        raise NoFlankError(f"the pile is {1e3 * height_m:.1f} mm high; a flank needs {1e3 * lowest_m:.1f} mm")
    azimuths = np.arange(settings.views) * 180.0 / settings.views
    inset_m = settings.mm_per_pixel * 0.5e-3
    polygons = outlines(centres, quaternions, particle, azimuths, inset_m, scales)
    left, right, height = np.full((3, settings.views), np.nan)
    reasons = []
    for view, bodies in enumerate(polygons):
        image = paint(bodies, settings.mm_per_pixel, frame(bodies, settings.mm_per_pixel))
        pile = segment(image, settings.largest_pile_only, base_row=image.shape[0] - 0.5)
        try:
            seen = measure_segmented(
                pile, settings.mm_per_pixel, settings.fit_from, settings.fit_to, settings.flank
            )
        except NoFlankError as error:
            reasons.append(error.reason)
            continue
        left[view], right[view], height[view] = seen.left_deg, seen.right_deg, seen.height_mm
    if len(reasons) > settings.views / 2:
        raise NoFlankError(f"{len(reasons)} of {settings.views} views have no flank: {reasons[0]}")
    return PileResult(float(np.nanmean((left + right) / 2)), 1e3 * height_m, left, right, height)


def equivalent_diameter(particle):
    """Eq. 1 on the body's own extents: the cube root of the product of its three axes, m."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    reach = (particle.support_point(axes) * axes).sum(axis=1)
    return float(np.prod(reach[:3] + reach[3:]) ** (1 / 3))
