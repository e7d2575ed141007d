"""Measure photographs of a turning drum or drawdown box, whose size gives the scale."""

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
# Twice the area [px2] of three points that count as lying on a line.
COLLINEAR_AREA = 1e-6
# Share of the drum's radius within which a bed is looked for; the rim has other colours.
INNER_SHARE = 0.97
# Share of the radius above which the drum is empty.
EMPTY_SHARE = 0.6
# Share of a chamber's half width that is left out at a wall.
MARGIN_SHARE = 0.02
# Longest side of a redrawn picture.
LONGEST_SIDE_PX = 1600
# Smallest side of a drum or a chamber in the photograph.
SMALLEST_SIDE_PX = 100


@dataclass
class PhotographResult:
    """Result of one photograph."""

    path: Path
    views: list[np.ndarray]  # redrawn pictures with the lines found, BGR
    values: dict[str, float] = field(default_factory=dict)  # by response
    refused: str = ""  # why it cannot be measured; empty if it was
    mask: np.ndarray | None = None  # of a bed in a drum, (H, W)


class View(NamedTuple):
    """A rectangle of a photograph, drawn anew so that it is level and has a scale."""

    image: np.ndarray  # (H, W, 3), BGR
    mm_per_pixel: float


def measure_all(
    paths: Sequence[Path],
    points_px: Sequence[float],
    settings: SceneSettings,
    bench: str,
    pile_settings: MeasureSettings,
) -> list[PhotographResult]:
    """Measure photographs by one camera on a tripod.

    The points of the apparatus are the same in all of them. A photograph that cannot be
    measured has the reason in its result.

    Parameters
    ----------
    paths : sequence of path
        The photographs.
    points_px : sequence of float
        Column and row of each point, one after the other; see `POINTS`.
    settings : SceneSettings
        Sections of the configuration, with the measures of the apparatus.
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
        # A large photograph is read at a smaller size, and the points go with it.
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
            # There is no flank, or the bed is too narrow.
            result = PhotographResult(path, [image], refused=str(error))
        result.path = path
        results.append(result)
    return results


def _check_points(points_px: Sequence[float], bench: str) -> np.ndarray:
    """Read the points of an apparatus, and check them.

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
        If they cannot be the points of this apparatus.
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
        # Three points on a line span no triangle and lie on no circle.
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
    """Measure the surface of the bed in a photograph of a drum.

    Parameters
    ----------
    image : array
        The photograph (H, W, 3), BGR.
    rim_px : array
        Columns and rows of three points (3, 2) of the drum's inner rim.
    section : Rotating
        Measures of the drum.

    Returns
    -------
    PhotographResult
        The angle, and the redrawn picture with the surface. The angle is positive: the
        bed is taken to be carried to the side on which it is higher.
    """
    # Redraw the square around the rim. Rows are counted downwards, so its lower left
    # corner has a larger row than the centre.
    centre_px, radius_px = _fit_circle(rim_px)
    view = _redraw(
        image,
        corner_px=centre_px - [radius_px, -radius_px],
        along=np.array([1.0, 0.0]),
        size_px=(2 * radius_px, 2 * radius_px),
        mm_per_pixel=1e3 * Drum.of(section).radius_m / radius_px,
    )
    picture = view.image
    mask = _find_bed(picture)
    # The redrawn square has a whole number of pixels, and its radius goes with them.
    radius_m = 0.5e-3 * view.mm_per_pixel * len(picture)

    def find_surface(bed_mask: np.ndarray) -> bed.Surface:
        return bed.surface_of(
            bed_mask > 0, radius_m, view.mm_per_pixel, section.fit_share
        )

    surface = find_surface(mask)
    if surface.angle_deg < 0:
        # Mirror a drum that turns the other way.
        mask = mask[:, ::-1]
        picture = picture[:, ::-1]
        surface = find_surface(mask)
    drawn = _draw_surface(picture, surface, radius_m, view.mm_per_pixel)
    return PhotographResult(
        path=Path(),  # set by `measure_all`
        views=[drawn],
        values={"turning_deg": surface.angle_deg},
        mask=mask,
    )


def _draw_surface(
    picture: np.ndarray, surface: bed.Surface, radius_m: float, mm_per_pixel: float
) -> np.ndarray:
    """Draw the edge of a bed and the line through it into the picture of the drum.

    Parameters
    ----------
    picture : array
        The square picture (H, H, 3) of the drum, BGR.
    surface : bed.Surface
        The surface in m from the axis, z up; rows of the picture are counted downwards.
    radius_m : float
        Inner radius of the drum.
    mm_per_pixel : float
        Scale of the picture.

    Returns
    -------
    array
        The picture with the drawing.
    """
    drawn = np.ascontiguousarray(picture)
    thickness_px = max(1, len(drawn) // 400)
    # Pixels are counted from the upper left corner, to the right and downwards.
    px_per_m = np.array([1e3, -1e3]) / mm_per_pixel
    upper_left_m = (-radius_m, radius_m)
    edge_px = (surface.profile_m - upper_left_m) * px_per_m
    start_px, end_px = (surface.line_m - upper_left_m) * px_per_m
    cv2.polylines(
        drawn, [edge_px.astype(np.int32)], False, drawing.YELLOW, thickness_px
    )
    drawing.draw_line(drawn, tuple(start_px), tuple(end_px), drawing.RED, thickness_px)
    return drawn


def _fit_circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Compute the circle through three points (3, 2) that are not on a line.

    Returns
    -------
    centre : array
        Its centre (2,).
    radius : float
        Its radius.
    """
    first, second, third = points
    # The centre is as far from the first point as from the two others. The difference
    # of two squared distances is linear in the centre.
    matrix = 2 * np.array([second - first, third - first])
    right_side = [second @ second - first @ first, third @ third - first @ first]
    centre = np.linalg.solve(matrix, right_side)
    return centre, float(np.hypot(*(first - centre)))


def _find_bed(picture: np.ndarray) -> np.ndarray:
    """Mark the bed in a square picture of the drum.

    It is the largest part that differs in colour from the drum's upper part, which is
    empty.

    Parameters
    ----------
    picture : array
        The picture (H, H, 3), BGR; the rim touches its borders.

    Returns
    -------
    array
        Mask (H, H) of the bed, uint8.
    """
    # Coordinates from -1 to 1 over the picture, so that the rim has the radius 1
    size = len(picture)
    coordinates = (np.arange(size) + 0.5) / (0.5 * size) - 1
    x, y = np.meshgrid(coordinates, coordinates)
    is_inside = np.hypot(x, y) < INNER_SHARE
    # y grows downwards, so the upper part has negative ones.
    is_empty = is_inside & (y < -EMPTY_SHARE)

    smooth = cv2.GaussianBlur(cv2.medianBlur(picture, 3), (0, 0), 1.0)
    colours = smooth.astype(np.float32).reshape(size, size, -1)
    background = np.median(colours[is_empty], axis=0)
    contrast = np.linalg.norm(colours - background, axis=-1)
    # The threshold splits the pixels of the drum into bed and background.
    level, _ = threshold(contrast[is_inside][:, np.newaxis])
    is_bed = (contrast > level) & is_inside
    return pile_component(is_bed.astype(np.uint8), True)


# --- the box --------------------------------------------------------------------------


class _BoxPicture:
    """A photograph of a drawdown box, located by its lower inner corners.

    x is the distance from the middle of the box, z the height above its lower floor.
    """

    def __init__(self, image: np.ndarray, corners_px: np.ndarray, box: Box) -> None:
        """Find direction and scale of the box in a photograph.

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
        self.left_px, right_px = corners_px
        self.half_lower_m = box.half_lower
        # The base is the line between the corners, and has the width of the lower
        # chamber. It gives the direction and the scale of the box.
        base_px = right_px - self.left_px
        width_px = np.hypot(*base_px)
        self.along = base_px / width_px
        self.mm_per_pixel = 2e3 * box.half_lower / width_px
        # Height of the picture's upper border above the lower corners, less 1 %
        rows_per_m = self.along[0] * width_px / (2 * box.half_lower)
        self.top_m = 0.99 * min(self.left_px[1], right_px[1]) / rows_per_m

    def redraw_part(self, x_m: tuple[float, float], z_m: tuple[float, float]) -> View:
        """Redraw a rectangular part of the box.

        Parameters
        ----------
        x_m : tuple of float
            Its left and right end.
        z_m : tuple of float
            Its lower and upper end.
        """
        left_m, right_m = x_m
        lower_m, upper_m = z_m
        # From the lower left corner of the box to that of the part
        up = np.array([self.along[1], -self.along[0]])
        steps_along = (left_m + self.half_lower_m) * 1e3 / self.mm_per_pixel
        steps_up = lower_m * 1e3 / self.mm_per_pixel
        corner_px = self.left_px + steps_along * self.along + steps_up * up
        return _redraw(
            self.image,
            corner_px=corner_px,
            along=self.along,
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
    """Measure both slopes in a photograph of a drawdown box.

    Parameters
    ----------
    image : array
        The photograph (H, W, 3), BGR.
    corners_px : array
        Columns and rows of the lower inner corners (2, 2), the left one first.
    section : DrawdownSettings
        Measures of the box.
    pile_settings : MeasureSettings
        Settings of the measurement of a pile.

    Returns
    -------
    PhotographResult
        The angles above and below, with a picture of each.

    Raises
    ------
    NoFlankError
        If a slope cannot be measured.
    """
    box = Box.of(section)
    picture = _BoxPicture(image, corners_px, box)
    half_lower = box.half_lower * (1 - MARGIN_SHARE)
    below = picture.redraw_part((-half_lower, half_lower), (0.0, box.gate))
    above = _cut_wedges(picture, box)

    # The wedges need not touch, so both parts count as the pile.
    wedge_settings = pile_settings.model_copy(
        update={"mm_per_pixel": above.mm_per_pixel, "largest_pile_only": False}
    )
    below_settings = pile_settings.with_scale(below.mm_per_pixel)
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
    """Measure the pile in a redrawn part of the box.

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


def _cut_wedges(picture: "_BoxPicture", box: Box) -> View:
    """Cut out the wedges in the upper chamber, and put them back to back.

    Together they have the shape of a pile, see `drawdown.back_to_back`.

    Parameters
    ----------
    picture : _BoxPicture
        The photograph with the measures of the box in it.
    box : Box
        Sizes of the box.

    Returns
    -------
    View
        The right half of the chamber on the left, and the left half beside it.
    """
    # The picture need not show all of the upper chamber.
    heights_m = (box.floor, min(box.top, picture.top_m))
    half_width_m = box.half_width * (1 - MARGIN_SHARE)
    left = picture.redraw_part((-half_width_m, 0.0), heights_m)
    right = picture.redraw_part((0.0, half_width_m), heights_m)
    # By rounding, the left half may be a pixel wider than the right one.
    n_columns = right.image.shape[1]
    swapped = np.hstack([right.image, left.image[:, -n_columns:]])
    return View(np.ascontiguousarray(swapped), left.mm_per_pixel)


def _redraw(
    image: np.ndarray,
    corner_px: np.ndarray,
    along: np.ndarray,
    size_px: tuple[float, float],
    mm_per_pixel: float,
) -> View:
    """Redraw a rectangle of a photograph level, at most `LONGEST_SIDE_PX` large.

    Parameters
    ----------
    image : array
        The photograph (H, W, 3).
    corner_px : array
        Column and row of the lower left corner of the rectangle.
    along : array
        Unit vector (2,) along its base.
    size_px : tuple of float
        Its width and height.
    mm_per_pixel : float
        Scale of the photograph.

    Returns
    -------
    View
        The picture of the rectangle, with its scale.

    Raises
    ------
    NoFlankError
        If the rectangle is too small, or runs out of the picture.
    """
    if min(size_px) < SMALLEST_SIDE_PX:
        raise NoFlankError(
            f"it is {min(size_px):.0f} pixels wide in the picture; {SMALLEST_SIDE_PX} are needed"
        )
    reduction = min(1.0, LONGEST_SIDE_PX / max(size_px))
    width, height = (round(reduction * length) for length in size_px)

    # The affine map takes (column, row, 1) of a pixel of the view to its middle in the
    # photograph. The first pixel of the view is the upper left one.
    up = np.array([along[1], -along[0]])
    step_x, step_y = np.array(size_px) / (width, height)
    first_pixel = corner_px + 0.5 * step_x * along + (size_px[1] - 0.5 * step_y) * up
    affine = np.column_stack([step_x * along, -step_y * up, first_pixel])
    if _runs_out(image, affine, (width, height)):
        raise NoFlankError("the drum or the box runs out of the picture")

    # Smooth before pixels are left out, against aliasing.
    smooth = image
    if reduction < 1:
        smooth = cv2.GaussianBlur(image, (0, 0), 0.5 / reduction)
    redrawn = cv2.warpAffine(
        smooth,
        affine,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return View(redrawn, mm_per_pixel * step_x)


def _runs_out(image: np.ndarray, affine: np.ndarray, size: tuple[int, int]) -> bool:
    """Return whether a view lies more than a pixel outside its photograph.

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


def tables(results: Sequence[PhotographResult], bench: str) -> Tables:
    """Make a table with a row for each photograph, and a summary of its columns.

    Parameters
    ----------
    results : sequence of PhotographResult
        The results, of which at least one was not refused.
    bench : str
        The bench test: ``turning`` or ``drawdown``.

    Returns
    -------
    Tables
        Both tables. The response of a refused photograph is missing, and its row has
        the reason.
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


def describe(results: Sequence[PhotographResult], made: Tables, out: Path) -> str:
    """Write the text that the command prints.

    Parameters
    ----------
    results : sequence of PhotographResult
        The results.
    made : Tables
        Their tables.
    out : Path
        The folder of the files.
    """
    lines = [f"{result.path.name}  {_describe_result(result)}" for result in results]
    lines.append("mean, standard deviation, number of photographs:")
    for row in made.summary.itertuples():
        # A single photograph has no standard deviation.
        sd = "not known" if np.isnan(row.sd) else f"{row.sd:.2f}"
        lines.append(f"{row.response}: {row.value:.2f}, {sd}, {row.repetitions}")
    lines.append(
        f"look at the overlays in {out}; the targets of a study: {out / 'targets.yaml'}"
    )
    return "\n".join(lines)


def _describe_result(result: PhotographResult) -> str:
    """Write the responses of a photograph, or why it was refused."""
    if result.refused:
        return f"refused: {result.refused}"
    return ", ".join(f"{name} {value:.2f}" for name, value in result.values.items())


def profile(results: Sequence[PhotographResult], section: Rotating) -> pd.DataFrame:
    """Find the surface below which the bed lies in half of the photographs of a drum.

    Parameters
    ----------
    results : sequence of PhotographResult
        The results, of which at least one was not refused.
    section : Rotating
        Measures of the drum.

    Returns
    -------
    DataFrame
        Distances ``x_mm`` and heights ``z_mm`` from the axis, as a target that is a
        profile has them.
    """
    masks = [
        result.mask
        for result in results
        if result.mask is not None and not result.refused
    ]
    # Bring all masks to the size of the first, which is given as (width, height).
    radius_m = Drum.of(section).radius_m
    mm_per_pixel = 2e3 * radius_m / len(masks[0])
    height_px, width_px = masks[0].shape
    resized = [
        cv2.resize(mask, (width_px, height_px), interpolation=cv2.INTER_NEAREST) > 0
        for mask in masks
    ]
    # The share of the photographs in which the bed covers a pixel
    covered_share = np.mean(resized, axis=0)
    # The surface is read in the middle 80 % of the drum, where it meets no wall.
    x_m = np.arange(-0.8, 0.81, 0.05) * radius_m
    z_m = bed.surface_heights(covered_share, 0.5, x_m, radius_m, mm_per_pixel)
    return pd.DataFrame({"x_mm": 1e3 * x_m, "z_mm": 1e3 * z_m}).round(3)


def stacked(views: Sequence[np.ndarray]) -> np.ndarray:
    """Put pictures below each other; narrower ones are filled up with black."""
    width = max(view.shape[1] for view in views)
    padded = [
        cv2.copyMakeBorder(view, 0, 0, 0, width - view.shape[1], cv2.BORDER_CONSTANT)
        for view in views
    ]
    return np.vstack(padded)
