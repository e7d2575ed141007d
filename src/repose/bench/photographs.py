"""Measure photographs of a turning drum or a drawdown box.

The known size of the apparatus gives the scale.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pandas as pd

from repose.bench.drawdown import Box, DrawdownSettings
from repose.bench.drum import Drum
from repose.bench.settings import Rotating, SceneSettings
from repose.bench.turning import TurningSettings
from repose.common.errors import InputError, NoFlankError
from repose.measure import bed
from repose.measure.photographs import drawing
from repose.measure.photographs.photograph import read_photograph
from repose.measure.photographs.segmentation import pile_component, segment, threshold
from repose.measure.photographs.tables import Tables, summarise_columns
from repose.measure.pile import Measurement, measure_segmented, with_response
from repose.measure.settings import MeasureSettings

TURNING = "turning"
DRAWDOWN = "drawdown"
# Responses that a photograph gives, by the bench test.
RESPONSES = {
    TURNING: ("turning_deg",),
    DRAWDOWN: ("drawdown_above_deg", "drawdown_below_deg"),
}


class PointsRule(NamedTuple):
    """The points by which the user locates an apparatus in a photograph."""

    n_points: int
    smallest_distance_px: float
    description: str


POINTS = {
    TURNING: PointsRule(
        3,
        50,
        "column and row of three points of the drum's inner rim, at least 50 pixels "
        "apart",
    ),
    DRAWDOWN: PointsRule(
        2,
        200,
        "column and row of the left and of the right lower inner corner of the box, "
        "200 pixels apart",
    ),
}
# Three points count as collinear if twice the area of their triangle [px2] is below
# this.
COLLINEAR_AREA = 1e-6
# The bed is searched for within this fraction of the drum's radius, which leaves out
# the rim and its colours.
INNER_SHARE = 0.97
# The drum is assumed to be empty higher above its axis than this fraction of its
# radius.
EMPTY_SHARE = 0.6
# Fraction of a chamber's half width that is left out at a wall.
MARGIN_SHARE = 0.02
# Fraction of the height between the lower corners of a box and the upper border of the
# photograph that is used. The rest leaves room for rounding.
HEIGHT_SHARE = 0.99
# Longest side of a picture that is cut out of a photograph.
LONGEST_SIDE_PX = 1600
# Smallest side of a drum or a chamber in the photograph.
SMALLEST_SIDE_PX = 100
# Lines are drawn one pixel thick for every so many pixels of the picture's side.
PIXELS_PER_THICKNESS = 400
# Positions, in radii of the drum, at which a profile is read. They leave out the ends
# of the surface, where it meets the wall.
PROFILE_POSITIONS = np.arange(-0.8, 0.81, 0.05)


@dataclass
class PhotographResult:
    """Result of one photograph."""

    path: Path
    views: list[np.ndarray]  # pictures with the measured lines, BGR
    values: dict[str, float] = field(default_factory=dict)  # by response
    refused: str = ""  # why it could not be measured; empty if it was
    mask: np.ndarray | None = None  # of a bed in a drum, (H, W)


class View(NamedTuple):
    """A level rectangle that was cut out of a photograph, with its scale."""

    image: np.ndarray  # (H, W, 3), BGR
    mm_per_pixel: float


def measure_all(
    paths: Sequence[Path],
    points_px: Sequence[float],
    settings: SceneSettings,
    bench: str,
    pile_settings: MeasureSettings,
) -> list[PhotographResult]:
    """Measure photographs that were taken with one camera on a tripod.

    The camera did not move, so the points that locate the apparatus are the same in all
    photographs. If a photograph cannot be measured, its result has the reason instead
    of the responses.

    Parameters
    ----------
    paths : sequence of path
        The photographs.
    points_px : sequence of float
        Column and row of each point, one after the other; see `POINTS`.
    settings : SceneSettings
        Sections of the configuration, with the dimensions of the apparatus.
    bench : str
        The bench test: ``turning`` or ``drawdown``.
    pile_settings : MeasureSettings
        Settings of the measurement of a pile.

    Returns
    -------
    list of PhotographResult
        The results in the order of the photographs.

    Raises
    ------
    InputError
        If the points cannot be those of the apparatus.
    """
    points = _check_points(points_px, bench)
    results = []
    for path in paths:
        # A large photograph is reduced in size when it is read, so scale the points
        # too.
        image, reduction = read_photograph(path)
        image_points = points / reduction
        try:
            if bench == TURNING:
                drum = settings.section(TURNING, TurningSettings)
                result = measure_drum(image, image_points, drum)
            else:
                box = settings.section(DRAWDOWN, DrawdownSettings)
                result = measure_box(image, image_points, box, pile_settings)
        except ValueError as error:
            # For example, the pile has no flank, or the bed is too narrow. The errors
            # of the measurement are subclasses of ValueError.
            result = PhotographResult(path, [image], refused=str(error))
        # The functions for a single photograph do not know its path.
        result.path = path
        results.append(result)
    return results


def _check_points(points_px: Sequence[float], bench: str) -> np.ndarray:
    """Arrange the points that locate an apparatus in rows, and check them.

    Parameters
    ----------
    points_px : sequence of float
        Column and row of each point, one after the other.
    bench : str
        The bench test: ``turning`` or ``drawdown``.

    Returns
    -------
    array
        Columns and rows (n_points, 2).

    Raises
    ------
    InputError
        If these points cannot belong to the apparatus.
    """
    rule = POINTS[bench]
    numbers = np.array(points_px, float)

    def make_error(allowed: str) -> InputError:
        return InputError("command line", "--points", list(points_px), allowed)

    has_all_numbers = numbers.size == 2 * rule.n_points
    if not has_all_numbers or not np.isfinite(numbers).all():
        raise make_error(rule.description)
    points = numbers.reshape(rule.n_points, 2)
    if _smallest_distance(points) < rule.smallest_distance_px:
        raise make_error(rule.description)
    if bench == DRAWDOWN:
        left_column, right_column = points[:, 0]
        if left_column > right_column:
            raise make_error(rule.description)
    if bench == TURNING:
        # Three points on a line do not define a circle. The triangle between them has
        # no area.
        doubled_area = abs(np.linalg.det(points[1:] - points[0]))
        if doubled_area < COLLINEAR_AREA:
            raise make_error("three points that are not on a line")
    return points


def _smallest_distance(points: np.ndarray) -> float:
    """Compute the smallest distance between any two of N points (N, 2)."""
    return min(np.hypot(*(first - second)) for first, second in combinations(points, 2))


# --- the drum -------------------------------------------------------------------------


def measure_drum(
    image: np.ndarray, rim_px: np.ndarray, section: Rotating
) -> PhotographResult:
    """Measure the angle of the bed's surface in a photograph of a drum.

    Parameters
    ----------
    image : array
        The photograph (H, W, 3), BGR.
    rim_px : array
        Columns and rows of three points (3, 2) of the drum's inner rim.
    section : Rotating
        The settings with the dimensions of the drum.

    Returns
    -------
    PhotographResult
        The angle, the mask of the bed, and a picture of the drum with the surface drawn
        into it. The angle is positive, whichever way the drum turns.
    """
    # Cut out the square around the rim. Its lower left corner lies one radius to the
    # left of the centre and one radius below it. Rows are counted downwards, so the
    # corner has the larger row.
    centre_px, radius_px = _fit_circle(rim_px)
    view = _redraw_rectangle(
        image,
        corner_px=centre_px - [radius_px, -radius_px],
        along=np.array([1.0, 0.0]),
        size_px=(2 * radius_px, 2 * radius_px),
        mm_per_pixel=1e3 * Drum.of(section).radius_m / radius_px,
    )
    picture = view.image
    mask = _find_bed(picture)
    # The redrawn square has a whole number of pixels, which may change the radius a
    # little.
    radius_m = 0.5e-3 * view.mm_per_pixel * len(picture)

    def find_surface(bed_mask: np.ndarray) -> bed.Surface:
        return bed.surface_of(
            bed_mask > 0, radius_m, view.mm_per_pixel, section.fit_share
        )

    surface = find_surface(mask)
    if surface.angle_deg < 0:
        # The drum turns the other way. Mirror the mask and the picture, and measure
        # again.
        mask = mask[:, ::-1]
        picture = picture[:, ::-1]
        surface = find_surface(mask)
    drawing_of_surface = _draw_surface(picture, surface, radius_m, view.mm_per_pixel)
    return PhotographResult(
        path=Path(),  # `measure_all` sets the path
        views=[drawing_of_surface],
        values={"turning_deg": surface.angle_deg},
        mask=mask,
    )


def _draw_surface(
    picture: np.ndarray, surface: bed.Surface, radius_m: float, mm_per_pixel: float
) -> np.ndarray:
    """Draw the edge of a bed and the line through it on the picture of the drum.

    The drawing may change the given picture. Pass a copy if it is needed afterwards.

    Parameters
    ----------
    picture : array
        The square picture (H, H, 3) of the drum, BGR. It is changed in place if its
        memory is contiguous.
    surface : bed.Surface
        The surface, in coordinates (x, z) in m from the axis, with z upwards.
    radius_m : float
        Inner radius of the drum.
    mm_per_pixel : float
        Scale of the picture.

    Returns
    -------
    array
        The picture with the drawing.
    """
    # OpenCV draws only into contiguous arrays. A mirrored picture is copied here.
    canvas = np.ascontiguousarray(picture)
    thickness_px = max(1, len(canvas) // PIXELS_PER_THICKNESS)
    # Pixels are counted rightwards and downwards from the upper left corner, so the
    # sign of z changes.
    px_per_m = np.array([1e3, -1e3]) / mm_per_pixel
    upper_left_m = (-radius_m, radius_m)
    edge_px = (surface.profile_m - upper_left_m) * px_per_m
    start_px, end_px = (surface.line_m - upper_left_m) * px_per_m
    cv2.polylines(
        canvas, [edge_px.astype(np.int32)], False, drawing.YELLOW, thickness_px
    )
    drawing.draw_line(canvas, tuple(start_px), tuple(end_px), drawing.RED, thickness_px)
    return canvas


def _fit_circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Compute the circle through three points (3, 2) that are not on a line.

    Returns
    -------
    centre : array
        The centre (2,) of the circle.
    radius : float
        The radius of the circle.
    """
    first, second, third = points
    # The centre c has the same distance from the points p and q, so
    # 2 (q - p) c = q^2 - p^2. Two pairs of points give two such equations.
    matrix = 2 * np.array([second - first, third - first])
    right_side = [second @ second - first @ first, third @ third - first @ first]
    centre = np.linalg.solve(matrix, right_side)
    return centre, float(np.hypot(*(first - centre)))


def _find_bed(picture: np.ndarray) -> np.ndarray:
    """Mark the bed in a square picture of the drum.

    The upper part of the drum is empty and shows the background. The bed is the largest
    connected region whose colour differs from the background.

    Parameters
    ----------
    picture : array
        The picture (H, H, 3), BGR; the rim touches its borders.

    Returns
    -------
    array
        Mask (H, H) of the bed, uint8.
    """
    # The coordinates go from -1 to 1, so that the rim has the radius 1.
    size = len(picture)
    coordinates = (np.arange(size) + 0.5) / (0.5 * size) - 1
    x, y = np.meshgrid(coordinates, coordinates)
    is_inside = np.hypot(x, y) < INNER_SHARE
    # y grows downwards, so it is negative in the upper part.
    is_empty = is_inside & (y < -EMPTY_SHARE)

    # Remove noise: first single wrong pixels by a median, then finer noise by a blur.
    smooth = cv2.GaussianBlur(cv2.medianBlur(picture, 3), (0, 0), 1.0)
    colours = smooth.astype(np.float32).reshape(size, size, -1)
    background = np.median(colours[is_empty], axis=0)
    contrast = np.linalg.norm(colours - background, axis=-1)
    # Otsu's threshold of the contrast divides the pixels of the drum into background
    # and bed. `threshold` needs a picture, so the pixels are passed as a single column.
    bed_contrast, _ = threshold(contrast[is_inside][:, np.newaxis])
    is_bed = (contrast > bed_contrast) & is_inside
    # True selects the largest region only.
    return pile_component(is_bed.astype(np.uint8), True)


# --- the box --------------------------------------------------------------------------


class _BoxPhotograph:
    """A photograph of a drawdown box whose lower inner corners have been located.

    The coordinate x is the distance from the middle of the box to the right, and z is
    the height above the lower floor.
    """

    def __init__(self, image: np.ndarray, corners_px: np.ndarray, box: Box) -> None:
        """Store a photograph, and find the direction and the scale of its box.

        Parameters
        ----------
        image : array
            The photograph (H, W, 3), BGR.
        corners_px : array
            Columns and rows of the lower inner corners (2, 2), the left one first.
        box : Box
            Sizes of the box.
        """
        self.image = image
        self.left_corner_px, right_corner_px = corners_px
        self.half_width_m = box.half_lower_width  # of the lower chamber
        # The line between the corners is the base of the lower chamber, which is twice
        # `half_width_m` long. It gives the direction and the scale of the box.
        base_px = right_corner_px - self.left_corner_px
        width_px = np.hypot(*base_px)
        self.base_direction = base_px / width_px
        self.mm_per_pixel = 2e3 * self.half_width_m / width_px
        # Compute how far above the lower corners the photograph extends. If the box is
        # tilted in the photograph, less of it is visible above the corner in the
        # smaller row. A height of 1 m covers `rows_per_m` rows: 1 m in pixels, times
        # the cosine of the tilt. The factor `HEIGHT_SHARE` leaves room for rounding.
        upper_corner_row = min(self.left_corner_px[1], right_corner_px[1])
        rows_per_m = self.base_direction[0] * width_px / (2 * self.half_width_m)
        self.top_m = HEIGHT_SHARE * upper_corner_row / rows_per_m

    def redraw_part(self, x_m: tuple[float, float], z_m: tuple[float, float]) -> View:
        """Cut out a rectangular part of the box, and turn it so that it is level.

        Lengths are given in m as coordinates x and z of the box, see the class.

        Parameters
        ----------
        x_m : tuple of float
            Left and right end of the part, measured from the middle of the box.
        z_m : tuple of float
            Lower and upper end of the part, measured from the lower floor.

        Returns
        -------
        View
            The picture of the part, with its scale.
        """
        left_m, right_m = x_m
        lower_m, upper_m = z_m
        # Go from the lower left corner of the box to that of the part. The corner of
        # the box has the coordinates x = -half_width_m and z = 0. Rows are counted
        # downwards, so `up` has a negative component along the rows.
        along = self.base_direction
        up = np.array([along[1], -along[0]])
        distance_along_px = (left_m + self.half_width_m) * 1e3 / self.mm_per_pixel
        distance_up_px = lower_m * 1e3 / self.mm_per_pixel
        corner_px = (
            self.left_corner_px + distance_along_px * along + distance_up_px * up
        )
        return _redraw_rectangle(
            self.image,
            corner_px=corner_px,
            along=along,
            size_px=(
                (right_m - left_m) * 1e3 / self.mm_per_pixel,
                (upper_m - lower_m) * 1e3 / self.mm_per_pixel,
            ),
            mm_per_pixel=self.mm_per_pixel,
        )


def measure_box(
    image: np.ndarray,
    corners_px: np.ndarray,
    section: DrawdownSettings,
    pile_settings: MeasureSettings,
) -> PhotographResult:
    """Measure the slopes in both chambers of a drawdown box in a photograph.

    The grains that stayed in the upper chamber form two wedges beside the slot. Those
    in the lower chamber form a pile.

    Parameters
    ----------
    image : array
        The photograph (H, W, 3), BGR.
    corners_px : array
        Columns and rows of the lower inner corners (2, 2), the left one first.
    section : DrawdownSettings
        Dimensions of the box.
    pile_settings : MeasureSettings
        Settings of the measurement of a pile.

    Returns
    -------
    PhotographResult
        The angles in the upper and in the lower chamber, with a picture of each.

    Raises
    ------
    NoFlankError
        If a slope cannot be measured.
    """
    box = Box.of(section)
    photograph = _BoxPhotograph(image, corners_px, box)
    # Leave out a strip at each side wall.
    half_width_m = box.half_lower_width * (1 - MARGIN_SHARE)
    below = photograph.redraw_part(
        (-half_width_m, half_width_m), (0.0, box.gate_height)
    )
    above = _join_wedges(photograph, box)

    # There may be a gap between the two wedges. So the upper chamber is measured with
    # all its regions, not only with the largest one. For the lower chamber, only the
    # scale differs from the given settings.
    wedge_settings = pile_settings.model_copy(
        update={"mm_per_pixel": above.mm_per_pixel, "largest_pile_only": False}
    )
    below_settings = pile_settings.with_scale(below.mm_per_pixel)
    # `RESPONSES` lists the upper chamber first.
    above_name, below_name = RESPONSES[DRAWDOWN]
    result = PhotographResult(path=Path(), views=[])  # `measure_all` sets the path
    for name, view_image, settings in (
        (above_name, above.image, wedge_settings),
        (below_name, below.image, below_settings),
    ):
        try:
            measurement = _measure_slope(view_image, settings)
        except NoFlankError as error:
            raise NoFlankError(f"{name}: {error.reason}") from None
        result.values[name] = measurement.aor_deg
        result.views.append(drawing.overlay(view_image, measurement))
    return result


def _measure_slope(view_image: np.ndarray, settings: MeasureSettings) -> Measurement:
    """Measure the slope of the pile in the picture of a part of the box.

    Parameters
    ----------
    view_image : array
        The picture (H, W, 3), BGR; its lower border is the base of the pile.
    settings : MeasureSettings
        Settings of the measurement, with the scale of the picture.

    Raises
    ------
    NoFlankError
        If the pile has no flank, or reaches the upper border.
    """
    base_row = len(view_image) - 0.5
    pile = segment(view_image, settings.largest_pile_only, base_row)
    if pile.mask[0].any():
        raise NoFlankError("it runs out of the picture at the top")
    return with_response(measure_segmented(pile, settings))


def _join_wedges(photograph: _BoxPhotograph, box: Box) -> View:
    """Cut the two wedges out of the upper chamber, and put them back to back.

    The wedges are highest at the side walls. With the right half of the chamber on the
    left, both side walls meet in the middle, and the wedges look like a pile (see
    `drawdown.move_wedges_back_to_back`).

    Parameters
    ----------
    photograph : _BoxPhotograph
        The photograph, with direction and scale of the box.
    box : Box
        Sizes of the box.

    Returns
    -------
    View
        The picture: first the right half of the chamber, then the left half.
    """
    # The photograph need not show the whole upper chamber.
    heights_m = (box.floor_height, min(box.top_height, photograph.top_m))
    # The sizes of a `Box` are in m. Leave out a strip at each side wall.
    half_width_m = box.half_width * (1 - MARGIN_SHARE)
    left = photograph.redraw_part((-half_width_m, 0.0), heights_m)
    right = photograph.redraw_part((0.0, half_width_m), heights_m)
    # Because of rounding, the left half may be one pixel wider than the right half.
    n_columns = right.image.shape[1]
    swapped = np.hstack([right.image, left.image[:, -n_columns:]])
    return View(np.ascontiguousarray(swapped), left.mm_per_pixel)


def _redraw_rectangle(
    image: np.ndarray,
    corner_px: np.ndarray,
    along: np.ndarray,
    size_px: tuple[float, float],
    mm_per_pixel: float,
) -> View:
    """Cut a rectangle out of a photograph, and turn it so that its base is level.

    The sides of the new picture have at most `LONGEST_SIDE_PX` pixels. A larger
    rectangle is reduced in size.

    Parameters
    ----------
    image : array
        The photograph (H, W, 3).
    corner_px : array
        Column and row of the lower left corner of the rectangle.
    along : array
        Unit vector (2,) along the base of the rectangle, from left to right.
    size_px : tuple of float
        Width and height of the rectangle.
    mm_per_pixel : float
        Scale of the photograph.

    Returns
    -------
    View
        The picture of the rectangle, with its scale.

    Raises
    ------
    NoFlankError
        If the rectangle is too small, or extends beyond the photograph. This error
        means that the photograph cannot be measured.
    """
    if min(size_px) < SMALLEST_SIDE_PX:
        raise NoFlankError(
            f"the drum or the chamber is only {min(size_px):.0f} pixels wide or high in "
            f"the picture; {SMALLEST_SIDE_PX} are needed"
        )
    scale = min(1.0, LONGEST_SIDE_PX / max(size_px))
    width, height = (round(scale * length) for length in size_px)

    # The affine map (2, 3) converts (column, row, 1) of a pixel in the new picture to
    # the position of its middle in the photograph. Its first two columns are the steps
    # from one pixel to the next, measured in pixels of the photograph; the rows of the
    # new picture go down. Its third column is the middle of the first pixel, the upper
    # left one. It lies half a step inside the rectangle.
    up = np.array([along[1], -along[0]])
    step_x, step_y = np.array(size_px) / (width, height)
    first_pixel = corner_px + 0.5 * step_x * along + (size_px[1] - 0.5 * step_y) * up
    affine = np.column_stack([step_x * along, -step_y * up, first_pixel])
    if _is_outside(image, affine, (width, height)):
        raise NoFlankError("the drum or the box runs out of the picture")

    # A reduced picture leaves out pixels, so smooth the photograph first to prevent
    # aliasing.
    smooth = image
    if scale < 1:
        smooth = cv2.GaussianBlur(image, (0, 0), 0.5 / scale)
    redrawn = cv2.warpAffine(
        smooth,
        affine,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return View(redrawn, mm_per_pixel * step_x)


def _is_outside(image: np.ndarray, affine: np.ndarray, size: tuple[int, int]) -> bool:
    """Return whether a view extends more than a pixel beyond its photograph.

    Parameters
    ----------
    image : array
        The photograph (H, W, 3).
    affine : array
        The map (2, 3) from (column, row, 1) of the view to the photograph.
    size : tuple of int
        Width and height of the view.
    """
    width, height = size
    corners = np.array([[0, width, 0, width], [0, 0, height, height], [1, 1, 1, 1]])
    columns, rows = affine @ corners
    n_rows, n_columns = image.shape[:2]
    return bool(
        columns.min() < -1
        or rows.min() < -1
        or columns.max() > n_columns + 1
        or rows.max() > n_rows + 1
    )


# --- tables and texts -----------------------------------------------------------------


def make_tables(results: Sequence[PhotographResult], bench: str) -> Tables:
    """Make a table with a row for each photograph, and a summary of its columns.

    Parameters
    ----------
    results : sequence of PhotographResult
        The results. At least one photograph could be measured.
    bench : str
        The bench test: ``turning`` or ``drawdown``.

    Returns
    -------
    Tables
        Both tables. The row of a photograph that could not be measured has the reason
        and no response.
    """
    response_names = RESPONSES[bench]
    rows = []
    for result in results:
        row: dict[str, str | float | None] = {"photograph": result.path.name}
        for name in response_names:
            row[name] = result.values.get(name)
        row["refused"] = result.refused
        rows.append(row)
    table = pd.DataFrame(rows)
    return Tables(table, summarise_columns(table, response_names))


def describe_results(
    results: Sequence[PhotographResult], tables: Tables, out: Path
) -> str:
    """Make the text that the command prints about its photographs.

    Parameters
    ----------
    results : sequence of PhotographResult
        The results.
    tables : Tables
        The tables of these results, see `make_tables`.
    out : Path
        The folder that holds the files of the results.

    Returns
    -------
    str
        A line for each photograph, a summary of each response, and where the files are.
    """
    lines = [f"{result.path.name}  {_describe_result(result)}" for result in results]
    lines.append("mean, standard deviation, number of photographs:")
    for row in tables.summary.itertuples():
        # A single photograph has no standard deviation.
        sd = "not known" if np.isnan(row.sd) else f"{row.sd:.2f}"
        lines.append(f"{row.response}: {row.value:.2f}, {sd}, {row.repetitions}")
    lines.append(
        f"look at the overlays in {out}; the targets of a study: {out / 'targets.yaml'}"
    )
    return "\n".join(lines)


def _describe_result(result: PhotographResult) -> str:
    """Return the responses of a photograph, or why it could not be measured."""
    if result.refused:
        return f"refused: {result.refused}"
    return ", ".join(f"{name} {value:.2f}" for name, value in result.values.items())


def find_median_profile(
    results: Sequence[PhotographResult], section: Rotating
) -> pd.DataFrame:
    """Find the median surface of the bed in photographs of a drum.

    In at least half of the photographs, the bed covers the points below this surface.

    Parameters
    ----------
    results : sequence of PhotographResult
        The results. At least one photograph could be measured. Each mask is a square
        that the rim of the drum touches, as `measure_drum` makes it.
    section : Rotating
        The settings with the dimensions of the drum.

    Returns
    -------
    DataFrame
        Distances ``x_mm`` and heights ``z_mm`` from the axis: the columns of a target
        that is a profile.
    """
    masks = [
        result.mask
        for result in results
        if result.mask is not None and not result.refused
    ]
    # The photographs may differ in size, so resize all masks to the first one. Its
    # width is the diameter of the drum.
    radius_m = Drum.of(section).radius_m
    mm_per_pixel = 2e3 * radius_m / len(masks[0])
    height_px, width_px = masks[0].shape
    resized_masks = [
        cv2.resize(mask, (width_px, height_px), interpolation=cv2.INTER_NEAREST) > 0
        for mask in masks
    ]
    # For each pixel, compute the fraction of the photographs in which the bed covers
    # it.
    covered_share = np.mean(resized_masks, axis=0)
    x_m = PROFILE_POSITIONS * radius_m
    # At the median surface, the bed covers a point in half of the photographs.
    z_m = bed.surface_heights(covered_share, 0.5, x_m, radius_m, mm_per_pixel)
    return pd.DataFrame({"x_mm": 1e3 * x_m, "z_mm": 1e3 * z_m}).round(3)


def stack_views(views: Sequence[np.ndarray]) -> np.ndarray:
    """Stack pictures vertically. Narrow ones get a black margin on the right."""
    width = max(view.shape[1] for view in views)
    padded_views = [
        cv2.copyMakeBorder(view, 0, 0, 0, width - view.shape[1], cv2.BORDER_CONSTANT)
        for view in views
    ]
    return np.vstack(padded_views)
