"""Measure or reject photographs of repeated piles.

The printed sheet (`repose.measure.photographs.sheet`) gives the scale, the tilt, the
lens and the plate. Without it, the photograph must be level and free of distortion, and
the background must be plain. If no length is known either, only angles are measured.

A photograph with a sign that it does not show a single pile is measured, but has a
warning (`repose.measure.photographs.plausibility`). So has a photograph of a pile whose
two sides have very different angles. Worse signs reject a photograph. The setting
`berry_height_mm` is the height of a grain of any crop.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from PIL import Image

from repose.common.errors import InputError, NoFlankError
from repose.measure.image_files import read_image
from repose.measure.photographs import camera, finding, sheet
from repose.measure.photographs.perspective import Viewpoint, remove_perspective
from repose.measure.photographs.plausibility import (
    DOUBTFUL,
    estimate_grain_mm,
    list_base_warnings,
    list_pile_warnings,
    make_sides_warning,
    require_visible_foot,
)
from repose.measure.photographs.segmentation import (
    Segmentation,
    require_upright,
    segment,
)
from repose.measure.pile import measure_segmented, with_response
from repose.measure.results import Measurement
from repose.measure.settings import MeasureSettings

# Limits of a level line of known length, which gives the scale
SHORTEST_LENGTH_PX = 10
LARGEST_LEVEL_DEG = 25.0

# Longer sides of pictures, in pixels
LARGEST_PX = 4000  # of a photograph; a larger one is reduced
COARSE_PX = 700  # of the view in which a pile is found
FINE_PX = 1200  # of the view in which its boundary is found
# Largest height of a grain in a view in which roughness is measured. The inside of a
# larger grain would look smooth.
LARGEST_ROUGH_GRAIN_PX = 8

LARGEST_FAINT_FRACTION = 0.2  # of the upper boundary
SIDE_MARGIN = 1.3  # half the width of the fine view over the pile's
TOP_MARGIN = 1.6  # height of the fine view over the pile's
# Largest number of hidden pixels next to the pile, over the number of rows. A few are
# allowed, because the boundary of the pile is noisy.
LARGEST_HIDDEN_FRACTION = 0.03

NO_SHEET_REASON = (
    "the printed sheet is not seen, and neither --mm-per-pixel nor --length is given"
)
NO_LENGTH_NOTE = (
    "no length is known, so there are angles alone, without Height and secant; the "
    "printed sheet, --mm-per-pixel or --length gives one. The photograph must be level"
)
# Entries of a photograph's EXIF data
EXIF_CAMERA = 0x8769
EXIF_FOCAL_LENGTH_35MM = 0xA405
FILM_WIDTH_MM = 36
# Hardly any lens lies outside these limits. A camera may write 0 if it does not know
# the focal length.
PLAUSIBLE_FOCALS_MM = (5, 1000)

Paths = Sequence[Path]
Size = tuple[int, int]  # width and height of a photograph in pixels


@dataclass(frozen=True)
class Scale:
    """Scale of photographs.

    Attributes
    ----------
    square_mm : float
        Side of a square of the printed sheet. For a photograph that shows the sheet,
        the other fields are not used.
    mm_per_pixel : float, optional
        Scale of a photograph without the sheet; None if the user gives none.
    base_row : float, optional
        Row of the plate; None if it is to be found in the photograph.
    level_deg : float
        Angle by which a level line rises to the right in the photograph.
    ends : tuple of float
        Column and row of the left end of that line, then of its right end; empty if the
        user gives no line.
    """

    square_mm: float = sheet.SQUARE_MM
    mm_per_pixel: float | None = None
    base_row: float | None = None
    level_deg: float = 0.0
    ends: tuple[float, ...] = ()


@dataclass
class Photograph:
    """Result of one photograph.

    Attributes
    ----------
    path : Path
        The file.
    view : ndarray
        The measured picture, (H, W) or BGR (H, W, 3).
    pile : Segmentation, optional
        The part taken for the pile; None if nothing was found.
    measurement : Measurement, optional
        The measurement of the pile; None if the photograph was rejected.
    rejection_reason : str
        The reason why the pile was rejected; empty if it was not.
    lacks_scale : bool
        Whether the photograph was rejected and has no scale, because the printed sheet
        is not seen and the user gave no scale.
    geometry : dict
        The scale ``mm_per_pixel``, if it is known. A photograph with a sheet also has
        ``tilt_deg`` and ``look_down_deg``.
    note : str
        A warning about the numbers; may be empty.
    warnings : sequence of str
        Signs that the photograph does not show a single pile. By default, a photograph
        with such a warning does not count in the mean.
    sides_warning : str
        A warning if the angles of the pile's two sides differ too much, else empty. It
        does not exclude the photograph from the mean, because simulated views of this
        kind count, too.
    """

    path: Path
    view: np.ndarray
    pile: Segmentation | None = None
    measurement: Measurement | None = None
    rejection_reason: str = ""
    lacks_scale: bool = False
    geometry: dict[str, float] = field(default_factory=dict)
    note: str = ""
    warnings: Sequence[str] = ()
    sides_warning: str = ""

    @property
    def mm_per_pixel(self) -> float:
        """Its scale. If this is unknown, it is 1, so that lengths are in pixels."""
        return self.geometry.get("mm_per_pixel", 1.0)

    @property
    def all_rejection_reasons(self) -> list[str]:
        """The reasons why the photograph was rejected, a missing scale first."""
        reasons = [NO_SHEET_REASON if self.lacks_scale else "", self.rejection_reason]
        return [reason for reason in reasons if reason]

    @property
    def doubts(self) -> list[str]:
        """All warnings. A photograph that has any is called doubtful."""
        return [doubt for doubt in (*self.warnings, self.sides_warning) if doubt]

    @property
    def remarks(self) -> str:
        """Note and warnings in one line."""
        return "; ".join(remark for remark in (self.note, *self.doubts) if remark)


class _Location(NamedTuple):
    """The pile in the coarse view."""

    crest_mm: float  # distance of the crest from the sheet's left edge
    height_mm: float
    half_width_mm: float  # half the width of a fine view, the pile with a margin


def measure_level_length(
    length_mm: float, x1: float, y1: float, x2: float, y2: float
) -> tuple[float, float] | None:
    """Compute the scale and the slope of a photograph from a level line of known length.

    Parameters
    ----------
    length_mm : float
        Length of the line.
    x1, y1, x2, y2 : float
        Column and row of its left end, then of its right end.

    Returns
    -------
    tuple or None
        The scale [mm per pixel] and the rise to the right [degrees]. None if the ends
        are too close together, or if the slope is too large.
    """
    length_px = math.hypot(x2 - x1, y2 - y1)
    level_deg = math.degrees(math.atan2(y1 - y2, x2 - x1))
    if length_px < SHORTEST_LENGTH_PX or abs(level_deg) > LARGEST_LEVEL_DEG:
        return None
    return length_mm / length_px, level_deg


def read_photograph(path: Path) -> tuple[np.ndarray, float]:
    """Read a photograph, and reduce it if a side is longer than `LARGEST_PX`.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    tuple
        The photograph (H, W, 3), BGR, and the factor by which it was reduced, at least
        1.
    """
    image = read_image(path)
    reduction = max(1.0, max(image.shape[:2]) / LARGEST_PX)
    if reduction > 1:
        rows, columns = image.shape[:2]
        size = (round(columns / reduction), round(rows / reduction))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return image, reduction


def split_readable(paths: Paths) -> tuple[list[Path], list[InputError]]:
    """Find out which photographs can be read, and collect the errors of the others.

    Parameters
    ----------
    paths : sequence of Path
        The photographs.

    Returns
    -------
    readable_paths : list of Path
        The photographs that can be read.
    errors : list of InputError
        The error of each of the other photographs.
    """
    readable_paths = []
    errors = []
    for path in paths:
        try:
            read_image(path)
        except InputError as error:
            errors.append(error)
        else:
            readable_paths.append(path)
    return readable_paths, errors


def calibrate_cameras(
    paths: Paths, square_mm: float
) -> tuple[dict[Path, sheet.SheetCorners | None], dict[Size, camera.Camera]]:
    """Find the sheet in photographs, and calibrate their cameras.

    Photographs of the same size are assumed to come from the same camera. The focal
    length that this camera states is read from the EXIF data of the first photograph
    that shows the sheet.

    Parameters
    ----------
    paths : sequence of Path
        The photographs.
    square_mm : float
        Side of a square of the sheet.

    Returns
    -------
    sheets : dict
        The corners of the sheet by path of the photograph; None if it is not found.
    cameras : dict
        The cameras by width and height of their photographs in pixels, as
        `read_photograph` returns these.
    """
    sheets: dict[Path, sheet.SheetCorners | None] = {}
    views_by_size: dict[Size, list[sheet.SheetCorners]] = {}
    focal_by_size: dict[Size, float | None] = {}
    for path in paths:
        image, _ = read_photograph(path)
        size = (image.shape[1], image.shape[0])
        corners = sheet.find_sheet(image, square_mm)
        sheets[path] = corners
        if corners is not None:
            views_by_size.setdefault(size, []).append(corners)
            # Take the stated focal length from the first photograph of each size.
            if size not in focal_by_size:
                focal_by_size[size] = _read_focal_length_px(path, max(size))
    cameras = {
        size: camera.calibrate_camera(views, size, focal_by_size[size])
        for size, views in views_by_size.items()
    }
    return sheets, cameras


def measure_photographs(
    paths: Paths, settings: MeasureSettings, scale: Scale, lens_paths: Paths = ()
) -> list[Photograph]:
    """Measure photographs of piles, with or without the printed sheet.

    If the user gives a scale, no sheet is searched for. Otherwise, if any photograph
    shows the sheet, the sheet gives the scale, the tilt and the lens, and photographs
    without the sheet are rejected. The result of a rejected photograph contains the
    reason.

    Parameters
    ----------
    paths : sequence of Path
        The photographs.
    settings : MeasureSettings
        Settings of the measurement.
    scale : Scale
        The scale and the row of the plate, as far as the user gives them.
    lens_paths : sequence of Path
        Photographs of the sheet alone, taken with the same camera. They are used only
        to calibrate the camera.

    Returns
    -------
    list of Photograph
        The results in the order of the photographs.

    Raises
    ------
    InputError
        If a photograph of `lens_paths` does not show the sheet. Also if the user gives
        the row of the plate although a photograph shows the sheet, because the sheet
        already determines this row.
    """
    if scale.mm_per_pixel is not None:
        return [measure_without_sheet(path, settings, scale) for path in paths]

    sheets, cameras = calibrate_cameras([*paths, *lens_paths], scale.square_mm)
    _require_sheets(lens_paths, sheets)
    # If no camera was calibrated, no photograph shows the sheet.
    if not cameras:
        return [measure_without_sheet(path, settings, scale) for path in paths]
    if scale.base_row is not None:
        raise InputError(
            "command line",
            key="--base-row",
            value=scale.base_row,
            allowed="nothing, as the printed sheet shows the plate",
        )
    results = []
    for path in paths:
        image, _ = read_photograph(path)
        corners = sheets[path]
        if corners is None:
            result = Photograph(path, image, lacks_scale=True)
        else:
            size = (image.shape[1], image.shape[0])
            result = _measure_with_sheet(path, image, corners, cameras[size], settings)
        results.append(result)
    return results


def _require_sheets(
    paths: Paths, sheets: Mapping[Path, sheet.SheetCorners | None]
) -> None:
    """Raise InputError if the sheet was not found in one of these photographs.

    Parameters
    ----------
    paths : sequence of Path
        The photographs.
    sheets : mapping
        The sheet by photograph, from `calibrate_cameras`.
    """
    for path in paths:
        if sheets[path] is None:
            raise InputError(
                path,
                key="sheet",
                value="not seen",
                allowed="a photograph that shows the printed sheet",
            )


def _measure_with_sheet(
    path: Path,
    image: np.ndarray,
    corners: sheet.SheetCorners,
    calibrated_camera: camera.Camera,
    settings: MeasureSettings,
) -> Photograph:
    """Measure a photograph that shows the sheet.

    The pile is found by its colour. If the background has nearly the same colours, it
    is found by its roughness instead. The result by roughness is returned only if it
    has no warnings. Otherwise, the photograph is rejected for the reason that was found
    by colour.

    Parameters
    ----------
    path : Path
        The file.
    image : ndarray
        The photograph (H, W, 3), BGR.
    corners : SheetCorners
        The sheet in the photograph.
    calibrated_camera : Camera
        The camera of the photograph.
    settings : MeasureSettings
        Settings of the measurement.

    Returns
    -------
    Photograph
        The result, or the reason why it was rejected.
    """
    size = (image.shape[1], image.shape[0])
    try:
        pose = camera.Pose(calibrated_camera, corners, size)
    except NoFlankError as error:
        return Photograph(path, image, rejection_reason=error.reason)

    # The function `_measure_in_pose` sets the attributes of the photograph.
    by_colour = Photograph(path, image, note=calibrated_camera.note)
    try:
        _measure_in_pose(by_colour, pose, settings, by_roughness=False)
        return by_colour
    except NoFlankError as error:
        by_colour.rejection_reason = error.reason
        # Roughness can help only if the colours do not show the pile.
        if not isinstance(error, finding.NotPlainError):
            return by_colour

    by_roughness = Photograph(path, image, note=calibrated_camera.note)
    try:
        _measure_in_pose(by_roughness, pose, settings, by_roughness=True)
    except NoFlankError:
        return by_colour
    return by_colour if by_roughness.doubts else by_roughness


def _measure_in_pose(
    photograph: Photograph,
    pose: camera.Pose,
    settings: MeasureSettings,
    *,
    by_roughness: bool,
) -> None:
    """Find and measure the pile in a photograph whose camera has a known pose.

    Parameters
    ----------
    photograph : Photograph
        The photograph. Its attributes are set step by step, so that after a
        NoFlankError they contain everything that was found before.
    pose : Pose
        Position and direction of its camera.
    settings : MeasureSettings
        Settings of the measurement.
    by_roughness : bool
        Whether roughness takes the place of brightness in finding the pile.

    Raises
    ------
    NoFlankError
        If the pile cannot be measured. It is a `NotPlainError` if pile and background
        look too much alike.
    """
    image = photograph.view

    # Find the pile in a coarse view of the sheet's plane.
    coarse = camera.rectify_photograph(
        image, pose, axis_mm=None, longest_side_px=COARSE_PX
    )
    photograph.view = coarse.image
    photograph.geometry = {
        "mm_per_pixel": coarse.mm_per_pixel,
        "tilt_deg": pose.tilt_deg,
    }
    coarse_mask, has_neighbour = finding.find_pile(coarse, by_roughness)
    location = _locate_pile(coarse_mask, coarse)
    look_down_deg = pose.compute_look_down_deg(location.crest_mm, location.height_mm)
    photograph.geometry["look_down_deg"] = look_down_deg

    # Find its boundary in a fine view of the plane through its axis.
    grain_mm = settings.berry_height_mm
    if grain_mm is None:
        grain_mm = estimate_grain_mm(location.height_mm)
    fine = _rectify_fine_view(image, pose, location, grain_mm if by_roughness else None)
    photograph.view = fine.image
    photograph.geometry["mm_per_pixel"] = fine.mm_per_pixel
    fine_mask = _resample_mask(coarse_mask, coarse, fine, location.crest_mm)
    grain_px = grain_mm / fine.mm_per_pixel
    pile, faint_fraction = finding.refine_pile(fine, fine_mask, grain_px, by_roughness)
    # These checks come after the pile was found, so that the overlay of a rejected
    # photograph shows the pile.
    photograph.pile = pile
    _require_camera_at_crest(look_down_deg)
    _require_complete(pile.mask, fine.hidden)

    photograph.view, pile = _remove_perspective(
        photograph, pose, location, fine, settings
    )
    pile = replace(pile, has_neighbour=has_neighbour)
    photograph.pile = pile

    # Measure the pile, and look for signs that it is not a single pile.
    measurement = _measure_found_pile(photograph, settings)
    warnings = list_pile_warnings(pile, measurement, grain_mm, fine.mm_per_pixel)
    warnings += _list_boundary_warnings(faint_fraction)
    photograph.measurement = measurement
    photograph.warnings = warnings
    photograph.sides_warning = make_sides_warning(measurement)


def _require_camera_at_crest(look_down_deg: float) -> None:
    """Raise NoFlankError if the camera is much higher or lower than the crest.

    `look_down_deg` is the angle at which the camera looks down on the crest.
    """
    if abs(look_down_deg) > camera.LARGEST_LOOK_DOWN_DEG:
        raise NoFlankError(
            f"the camera looks at the crest from {look_down_deg:.0f} degrees above: "
            "the flanks look flatter than they are; hold the lens as high as the crest, "
            f"to within {camera.LARGEST_LOOK_DOWN_DEG:g} degrees"
        )


def _list_boundary_warnings(faint_fraction: float) -> list[str]:
    """List the warnings about a boundary at which pile and background look alike.

    Parameters
    ----------
    faint_fraction : float
        Fraction of the upper boundary at which both sides hardly differ.

    Returns
    -------
    list of str
        One sentence; the list is empty if the fraction is small.

    Raises
    ------
    NotPlainError
        If the fraction is too large for a measurement.
    """
    if faint_fraction > LARGEST_FAINT_FRACTION:
        raise finding.NotPlainError(
            "the pile hardly differs from its background along its boundary: the "
            "background is not plain"
        )
    if faint_fraction <= LARGEST_FAINT_FRACTION / 2:
        return []
    return [
        f"{DOUBTFUL}: the pile hardly differs from its background along "
        f"{100 * faint_fraction:.0f} % of its boundary"
    ]


def _remove_perspective(
    photograph: Photograph,
    pose: camera.Pose,
    location: _Location,
    fine: camera.SideView,
    settings: MeasureSettings,
) -> tuple[np.ndarray, Segmentation]:
    """Redraw the view and the pile without perspective, as if seen from far away.

    The new view depends on the angles of both sides of the pile, which are measured in
    the old view first.

    Parameters
    ----------
    photograph : Photograph
        The photograph, with the pile that was found in its view.
    pose : Pose
        Position and direction of its camera.
    location : _Location
        Crest and height of the pile.
    fine : SideView
        The view in which the pile was found.
    settings : MeasureSettings
        Settings of the measurement.

    Returns
    -------
    view : ndarray
        The redrawn view.
    pile : Segmentation
        The pile in it.
    """
    assert photograph.pile is not None
    angle = _measure_found_pile(photograph, settings).angle
    x, y, z = pose.position_mm
    viewpoint = Viewpoint(
        axis_px=-fine.left_mm / fine.mm_per_pixel,
        distance_px=math.hypot(x - location.crest_mm, y) / fine.mm_per_pixel,
        height_px=z / fine.mm_per_pixel,
    )
    return remove_perspective(
        photograph.view,
        photograph.pile,
        viewpoint,
        angles_deg=(angle.left_deg, angle.right_deg),
        pile_height_px=location.height_mm / fine.mm_per_pixel,
    )


def _locate_pile(mask: np.ndarray, view: camera.SideView) -> _Location:
    """Return crest, height and width of the pile, by its mask in the coarse view.

    The mask (H, W) is in the pixels of the view. The crest is the middle of the highest
    row of the pile.
    """
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))
    crest = float(np.median(np.flatnonzero(mask[rows[0]])))
    half_width = max(crest - columns[0], columns[-1] - crest)
    return _Location(
        crest_mm=view.left_mm + view.mm_per_pixel * crest,
        height_mm=(view.base_row - rows[0]) * view.mm_per_pixel,
        half_width_mm=SIDE_MARGIN * view.mm_per_pixel * half_width,
    )


def _rectify_fine_view(
    image: np.ndarray, pose: camera.Pose, location: _Location, grain_mm: float | None
) -> camera.SideView:
    """Compute the upright view of the plane through the pile's axis, near the pile.

    Parameters
    ----------
    image : ndarray
        The photograph (H, W, 3), BGR.
    pose : Pose
        Position and direction of its camera.
    location : _Location
        Crest, height and width of the pile.
    grain_mm : float or None
        Height of a grain, if roughness will be measured in the view. The resolution is
        then reduced, so that a grain is at most `LARGEST_ROUGH_GRAIN_PX` pixels high.
        If it is None, the view is as fine as `FINE_PX` allows.

    Returns
    -------
    SideView
        The view.
    """
    top_mm = TOP_MARGIN * location.height_mm
    half_width_mm = location.half_width_mm
    longest_side_px = FINE_PX
    if grain_mm is not None:
        # The longer one of width and height of the view decides its resolution.
        longest_side_mm = max(2 * half_width_mm, top_mm)
        rough_side_px = round(LARGEST_ROUGH_GRAIN_PX * longest_side_mm / grain_mm)
        longest_side_px = min(FINE_PX, rough_side_px)
    crop = camera.Extent(left=-half_width_mm, right=half_width_mm, top=top_mm)
    return camera.rectify_photograph(
        image, pose, location.crest_mm, longest_side_px, crop
    )


def _measure_found_pile(
    photograph: Photograph, settings: MeasureSettings
) -> Measurement:
    """Measure the pile that was found in a photograph; the photograph is not changed.

    Parameters
    ----------
    photograph : Photograph
        The photograph. Its attribute `pile` must be set.
    settings : MeasureSettings
        Settings of the measurement. Their scale is replaced by that of the photograph.

    Returns
    -------
    Measurement
        The angles and the height of the pile.

    Raises
    ------
    NoFlankError
        If the response cannot be measured.
    """
    assert photograph.pile is not None
    scaled_settings = settings.with_scale(photograph.mm_per_pixel)
    return with_response(measure_segmented(photograph.pile, scaled_settings))


def _resample_mask(
    mask: np.ndarray, coarse: camera.SideView, fine: camera.SideView, axis_mm: float
) -> np.ndarray:
    """Convert a mask of the coarse view to the pixels of the fine view.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile in the coarse view.
    coarse : SideView
        The view of the sheet's plane. Its `left_mm` is the distance from the sheet's
        left edge.
    fine : SideView
        The view of the plane through the pile's axis. Its `left_mm` is the distance
        from this axis.
    axis_mm : float
        Distance of the axis from the sheet's left edge, positive to the right.

    Returns
    -------
    ndarray
        Mask of the pile in the fine view, in the shape of this view.
    """
    n_rows, n_columns = fine.image.shape[:2]
    # Find the column of the coarse view that each column of the fine view shows. For
    # this, express both as distances from the sheet's left edge.
    fine_left_from_sheet_mm = axis_mm + fine.left_mm
    x_mm = fine_left_from_sheet_mm + fine.mm_per_pixel * np.arange(n_columns)
    source_columns = (x_mm - coarse.left_mm) / coarse.mm_per_pixel

    # Find the row from the height over the plate. Rows are counted downwards.
    height_mm = (fine.base_row - np.arange(n_rows)) * fine.mm_per_pixel
    source_rows = coarse.base_row - height_mm / coarse.mm_per_pixel
    column_map, row_map = np.meshgrid(
        source_columns.astype(np.float32), source_rows.astype(np.float32)
    )
    return cv2.remap(mask, column_map, row_map, cv2.INTER_NEAREST)


def _require_complete(mask: np.ndarray, hidden: np.ndarray) -> None:
    """Raise NoFlankError if the pile touches a border of the view or hidden pixels."""
    # Count the hidden pixels within two pixels of the pile.
    grown = cv2.dilate(mask, np.ones((5, 5), np.uint8)) > 0
    n_hidden = (grown & hidden[: len(mask)]).sum()
    touches_border = mask[:, :2].any() or mask[:, -2:].any()
    if n_hidden > LARGEST_HIDDEN_FRACTION * len(mask) or touches_border:
        raise NoFlankError(
            "the pile runs out of the picture, or the sheet hides a part of it"
        )


def measure_without_sheet(
    path: Path, settings: MeasureSettings, scale: Scale
) -> Photograph:
    """Measure a photograph that does not show the sheet, or a silhouette.

    Parameters
    ----------
    path : Path
        The photograph.
    settings : MeasureSettings
        Settings of the measurement.
    scale : Scale
        The scale, a level line and the row of the plate, as far as the user gives them.
        Without `mm_per_pixel`, only the angles that need no length are measured.

    Returns
    -------
    Photograph
        The result, or the reason why it was rejected.
    """
    image, reduction = read_photograph(path)
    rows, columns = image.shape[:2]
    original_size = (round(columns * reduction), round(rows * reduction))
    # The user gives the row of the plate in the original photograph. Convert it to a
    # row of the reduced picture, and then to a row of the rotated picture.
    reduced_row = None if scale.base_row is None else scale.base_row / reduction
    level_image, level_row = _make_level(image, scale.level_deg, reduced_row)

    photograph = Photograph(path, level_image)
    usable_settings = settings
    if scale.mm_per_pixel is None:
        # All lengths are in pixels, so a height of a grain in mm cannot be used.
        usable_settings = settings.model_copy(update={"berry_height_mm": None})
        photograph.note = NO_LENGTH_NOTE
    else:
        # A pixel of the reduced picture shows more millimetres than one of the
        # original.
        photograph.geometry["mm_per_pixel"] = scale.mm_per_pixel * reduction
    try:
        _require_ends_inside(scale.ends, original_size)
        _measure_level_photograph(photograph, usable_settings, level_row)
    # An InputError is possible, too, for example if the base lies below the picture.
    except (NoFlankError, InputError) as error:
        photograph.rejection_reason = str(error)
        photograph.lacks_scale = scale.mm_per_pixel is None
    # Remove a height in pixels, which users would mistake for millimetres.
    if photograph.measurement is not None and scale.mm_per_pixel is None:
        photograph.measurement = replace(photograph.measurement, height_mm=math.nan)
    return photograph


def _require_ends_inside(ends: Sequence[float], size: tuple[int, int]) -> None:
    """Raise InputError if an end of the level line lies outside the picture.

    Parameters
    ----------
    ends : sequence of float
        Column and row of one end, then of the other; empty if there is no line.
    size : tuple of int
        Width and height of the picture.
    """
    width, height = size
    columns_are_inside = all(0 <= column <= width for column in ends[0::2])
    rows_are_inside = all(0 <= row <= height for row in ends[1::2])
    if not (columns_are_inside and rows_are_inside):
        raise InputError(
            "command line",
            key="--length",
            value=tuple(ends),
            allowed=f"ends inside the picture, of {width} x {height} pixels",
        )


def _measure_level_photograph(
    photograph: Photograph, settings: MeasureSettings, base_row: float | None
) -> None:
    """Find and measure the pile in a level photograph with a plain background.

    Parameters
    ----------
    photograph : Photograph
        The photograph. The function sets its pile, its measurement and its warnings. If
        the pile cannot be measured, only the pile is set, which the overlay shows.
    settings : MeasureSettings
        Settings of the measurement.
    base_row : float or None
        Row of the plate, if the user has given it. If it is None, the base is found in
        the picture and checked. The warnings then include those about the base.

    Raises
    ------
    NoFlankError
        If there is no pile, or if the pile cannot be measured.
    InputError
        If `base_row` lies outside the picture.
    """
    image = photograph.view
    mm_per_pixel = photograph.mm_per_pixel
    grain_mm = settings.berry_height_mm
    # Find the pile. If the base was found in the picture, check that it is the foot.
    pile = segment(image, settings.largest_pile_only, base_row)
    photograph.pile = pile
    require_upright(pile.mask)
    if base_row is None:
        require_visible_foot(image, pile, grain_mm, mm_per_pixel)

    # Measure the pile, and look for signs that it is not a single pile.
    measurement = _measure_found_pile(photograph, settings)
    if grain_mm is None:
        grain_mm = estimate_grain_mm(measurement.height_mm)
    warnings = list_pile_warnings(pile, measurement, grain_mm, mm_per_pixel)
    if base_row is None:
        warnings += list_base_warnings(image, pile, grain_mm / mm_per_pixel)
    photograph.measurement = measurement
    photograph.warnings = warnings
    photograph.sides_warning = make_sides_warning(measurement)


def _make_level(
    image: np.ndarray, slope_deg: float, base_row: float | None
) -> tuple[np.ndarray, float | None]:
    """Rotate a photograph about its middle so that a sloping line becomes level.

    Parameters
    ----------
    image : ndarray
        The photograph (H, W, 3).
    slope_deg : float
        Angle by which the line rises to the right.
    base_row : float or None
        Row of the plate in the middle column, if it is known. In another column, the
        row would differ, because the plate slopes like the line.

    Returns
    -------
    level_image : ndarray
        The rotated photograph, of the same size.
    level_row : float or None
        The row of the plate in it; None if it is unknown.
    """
    if slope_deg == 0:
        return image, base_row
    rows, columns = image.shape[:2]
    middle_row = (rows - 1) / 2
    middle_column = (columns - 1) / 2
    # OpenCV counts angles counterclockwise. A line that rises to the right is turned
    # clockwise.
    rotation = cv2.getRotationMatrix2D(
        (middle_column, middle_row), angle=-slope_deg, scale=1.0
    )
    level_image = cv2.warpAffine(
        image,
        rotation,
        (columns, rows),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    if base_row is None:
        return level_image, None
    # The plate is parallel to the line. So its distance from the middle of the picture
    # is the distance along the middle column, times the cosine of the slope.
    distance = base_row - middle_row
    level_row = middle_row + distance * math.cos(math.radians(slope_deg))
    return level_image, level_row


def _read_focal_length_px(path: Path, longer_side: float) -> float | None:
    """Read the focal length in pixels from a photograph's EXIF data.

    The EXIF data contain the equivalent focal length in mm. This is the focal length of
    a film camera with the same angle of view, whose film is `FILM_WIDTH_MM` wide.

    Parameters
    ----------
    path : Path
        The photograph.
    longer_side : float
        Its longer side in pixels.

    Returns
    -------
    float or None
        The focal length; None if the EXIF data contain no plausible value.
    """
    try:
        with Image.open(path) as picture:
            camera_data = picture.getexif().get_ifd(EXIF_CAMERA)
            equivalent_mm = float(camera_data.get(EXIF_FOCAL_LENGTH_35MM, 0))
    # Pillow raises a SyntaxError for some damaged files.
    except (OSError, ValueError, TypeError, SyntaxError):
        return None
    shortest_mm, longest_mm = PLAUSIBLE_FOCALS_MM
    if not shortest_mm < equivalent_mm < longest_mm:
        return None
    return equivalent_mm / FILM_WIDTH_MM * longer_side
