"""Calibrate the camera of a photograph with the sheet, and compute the upright view.

Coordinates of the world are in mm: x to the right along the sheet, y away from the
camera, z up. The origin is the sheet's lower left corner, and z = 0 is the plate. The
side view lies in the vertical plane through the pile's axis that faces the camera, so
the sheet need not face the camera exactly. The matrix of a camera has its focal length
and the middle of the picture in pixels. The coefficients k1 and k2 describe the radial
distortion by the lens.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from repose.common.errors import NoFlankError
from repose.measure.photographs.sheet import SheetCorners, compute_size_mm

# Notes on a camera whose photographs show too few corners for a calibration
NO_DISTORTION = "lens not corrected: the sheet is seen in too few places"
NO_FOCAL_LENGTH = (
    "lens not corrected, focal length {origin}: the sheet is seen in too few places"
)
# Origins of the focal length for this note: it fits the corners, but is not determined
# by them; the camera states it; it is that of a phone
UNCERTAIN_FOCAL_ORIGIN = "uncertain"
STATED_FOCAL_ORIGIN = "as the camera states it"
PHONE_FOCAL_ORIGIN = (
    "assumed (with a zoom from 5 m the angle reads 0.3 degrees too steep)"
)

# Focal lengths, in units of the picture's longer side
PHONE_FOCAL = 0.75  # the main camera of most phones
CALIBRATED_FOCALS = (0.3, 10)  # plausible results of a calibration
TRIAL_FOCALS = np.geomspace(0.5, 16.0, 41)

# OpenCV's flags for the coefficients of distortion that stay 0, in fits of two
# coefficients, of one, and of none
FIXED_COEFFICIENTS = (0, cv2.CALIB_FIX_K2, cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2)

# Limits of a calibration that is used
# Largest relative change of a point's distance from the centre by the error of a
# coefficient of distortion, if this distance is half the longer side
LARGEST_LENS_ERROR = 0.004
LARGEST_FOCAL_ERROR = 0.05  # relative standard error of the focal length
# Factor between the focal lengths with and without distortion
LARGEST_FOCAL_CHANGE = 1.6
# OpenCV reports an error of nearly 0 if a fit is singular. The relative error of the
# focal length must be larger than this.
MIN_FOCAL_ERROR = 1e-6
# An assumed focal length is kept if it lies within this number of standard errors of
# the best one.
KEPT_STANDARD_ERRORS = 3

# Limits of the pose of a camera
# Rms distance of the corners from those of a flat sheet, over the picture's longer side
LARGEST_RESIDUAL = 1.5e-3
LARGEST_TILT_DEG = 25.0
LARGEST_LOOK_DOWN_DEG = 8.0

# If a pixel of a view is larger than this, in pixels of the photograph, the photograph
# is blurred before the view is drawn.
SMALLEST_BLURRED_REDUCTION = 1.5
BLUR_FRACTION = 0.4  # standard deviation of the blur, in pixels of the view

STRIP_BELOW_PLATE_MM = 3.0  # height of the strip below the plate in a side view
POINTS_PER_BORDER = 9  # on each border of a photograph, to find what it shows
# Width of a strip around the sheet that also counts as hidden, in widths of the sheet
SHEET_MARGIN_FRACTION = 0.02
# Width of this strip below the sheet, over its width on the other sides
LOWER_MARGIN_FACTOR = 2
# OpenCV solves for a sheet in the plane of its first two axes: (x, y, z) of the world
# is (x, z, -y) there.
WORLD_TO_SHEET = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@dataclass(frozen=True)
class Camera:
    """A camera, calibrated from its photographs of the sheet."""

    matrix: np.ndarray  # (3, 3), focal length and middle of the picture in pixels
    distortion: np.ndarray  # (5,), in OpenCV's order; all but k1 and k2 are 0
    note: str  # corrections that are missing for lack of corners; may be empty


@dataclass(frozen=True)
class SideView:
    """The upright, metric view (H, W) of a pile."""

    image: np.ndarray  # (H, W, 3), BGR
    hidden: np.ndarray  # (H, W), True outside the photograph and on the printed sheet
    mm_per_pixel: float
    base_row: float  # row of the plate
    left_mm: float  # distance of the left border from the axis; negative


class Extent(NamedTuple):
    """Borders of a side view in mm, from the axis and from the plate.

    There is no lower border, because each view ends `STRIP_BELOW_PLATE_MM` below the
    plate.
    """

    left: float
    right: float
    top: float


class _PixelGrid(NamedTuple):
    """The pixels of a side view, and their positions in its plane."""

    n_rows: int
    n_columns: int
    mm_per_pixel: float
    base_row: float  # row of the plate
    left_mm: float  # distance of the first column from the origin of the plane

    @property
    def along_mm(self) -> np.ndarray:
        """Distance (W,) of each column from the origin of the plane, to the right."""
        return self.left_mm + self.mm_per_pixel * np.arange(self.n_columns)

    @property
    def up_mm(self) -> np.ndarray:
        """Height (H,) of each row over the plate."""
        return self.mm_per_pixel * (self.base_row - np.arange(self.n_rows))

    def convert_to_pixels(self, points_mm: np.ndarray) -> np.ndarray:
        """Convert positions (N, 2), along the plane and up, to columns and rows."""
        columns = (points_mm[:, 0] - self.left_mm) / self.mm_per_pixel
        rows = self.base_row - points_mm[:, 1] / self.mm_per_pixel
        return np.column_stack([columns, rows])


class Plane(NamedTuple):
    """A vertical plane of the world."""

    origin: np.ndarray  # (3,), a point on the plate
    right: np.ndarray  # (3,), level unit vector

    def compute_points(self, along: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Compute the points (H, W, 3) of a grid in the plane.

        Parameters
        ----------
        along : ndarray
            Distances (W,) in mm from the origin, to the right.
        up : ndarray
            Heights (H,) in mm over the plate.

        Returns
        -------
        ndarray
            The points of the world in mm, a row of the grid for each height.
        """
        vertical = np.array([0, 0, 1.0])
        return (
            self.origin
            + along[None, :, None] * self.right
            + up[:, None, None] * vertical
        )


class _LensFit(NamedTuple):
    """Result of OpenCV's calibration, with standard errors."""

    matrix: np.ndarray  # (3, 3), focal length and middle of the picture in pixels
    distortion: np.ndarray  # (5,), in OpenCV's order
    focal_error: float  # pixels
    k1_error: float
    k2_error: float


def calibrate_camera(
    views: Sequence[SheetCorners], size: tuple[int, int], focal_px: float | None = None
) -> Camera:
    """Estimate the focal length and distortion of a camera from photographs of the sheet.

    The model assumes that the lens is centred on the picture, that the pixels are
    square, and that the distortion is radial. It has as many coefficients of distortion
    as the corners determine (`_is_reliable`): two, one or none. If the corners do not
    even determine the focal length, `_estimate_focal` provides it. It then equals
    `focal_px`, unless the corners clearly contradict this.

    Parameters
    ----------
    views : sequence of SheetCorners
        The sheet in each photograph.
    size : tuple of int
        Width and height of the photographs in pixels.
    focal_px : float, optional
        The focal length in pixels that the camera states. The default is that of a
        phone.

    Returns
    -------
    Camera
        The camera. Its note tells the user if the distortion or the focal length is
        unknown.

    References
    ----------
    Zhang, Z. (2000). IEEE Trans. Pattern Anal. Mach. Intell. 22, 1330-1334.
    """
    longer_side = max(size)
    assumed_focal = PHONE_FOCAL * longer_side if focal_px is None else focal_px
    focal = _estimate_focal(views, assumed_focal, size)
    initial_matrix = _make_camera_matrix(focal, size)
    # Fit two coefficients of distortion, then one, then none, until the fit is
    # reliable.
    for fixed_coefficients in FIXED_COEFFICIENTS:
        fit = _fit_lens(views, size, initial_matrix, fixed_coefficients)
        if fit is not None and _is_reliable(fit, focal, longer_side):
            # If k1 stays 0, so does k2.
            is_k1_fixed = bool(fixed_coefficients & cv2.CALIB_FIX_K1)
            note = NO_DISTORTION if is_k1_fixed else ""
            return Camera(fit.matrix, fit.distortion, note)

    # No fit is reliable. Keep the initial matrix, and note where its focal length comes
    # from. `_estimate_focal` returns the assumed value itself if it accepts it.
    if focal != assumed_focal:
        origin = UNCERTAIN_FOCAL_ORIGIN
    elif focal_px is not None:
        origin = STATED_FOCAL_ORIGIN
    else:
        origin = PHONE_FOCAL_ORIGIN
    return Camera(initial_matrix, np.zeros(5), NO_FOCAL_LENGTH.format(origin=origin))


def _fit_lens(
    views: Sequence[SheetCorners],
    size: tuple[int, int],
    initial_matrix: np.ndarray,
    fixed_coefficients: int,
) -> _LensFit | None:
    """Fit the focal length and the radial distortion of a lens to views of the sheet.

    OpenCV moves a point at the distance r from the centre, in focal lengths, to the
    distance r (1 + k1 r² + k2 r⁴). The coefficients k1 and k2 are fitted, unless they
    are fixed.

    Parameters
    ----------
    views : sequence of SheetCorners
        The sheet in each photograph.
    size : tuple of int
        Width and height of the photographs in pixels.
    initial_matrix : ndarray
        Camera matrix (3, 3) from which the fit begins.
    fixed_coefficients : int
        OpenCV's flags for the coefficients that stay 0, one of `FIXED_COEFFICIENTS`.

    Returns
    -------
    _LensFit or None
        The fit; None if OpenCV finds none, because there are too few corners.
    """
    object_points = [view.object_points_mm.astype(np.float32) for view in views]
    image_points = [view.pixels.astype(np.float32) for view in views]
    flags = (
        cv2.CALIB_USE_INTRINSIC_GUESS
        | cv2.CALIB_FIX_PRINCIPAL_POINT  # the lens is centred on the picture
        | cv2.CALIB_FIX_ASPECT_RATIO  # pixels are square
        | cv2.CALIB_ZERO_TANGENT_DIST  # the distortion is radial
        | cv2.CALIB_FIX_K3  # the distortion has no third coefficient
        | fixed_coefficients
    )
    try:
        _, matrix, distortion, _, _, errors, *_ = cv2.calibrateCameraExtended(
            object_points,
            image_points,
            size,
            initial_matrix.copy(),  # OpenCV overwrites it
            np.zeros(5),
            flags=flags,
        )
    except cv2.error:
        return None
    # OpenCV lists the errors of both focal lengths, of both coordinates of the centre,
    # of k1, of k2, and of coefficients that are fixed here.
    focal_x_error, focal_y_error, _, _, k1_error, k2_error, *_ = errors.ravel()
    return _LensFit(
        matrix=matrix,
        distortion=distortion.ravel()[:5],
        focal_error=float(np.maximum(focal_x_error, focal_y_error)),
        k1_error=float(k1_error),
        k2_error=float(k2_error),
    )


def _is_reliable(fit: _LensFit, undistorted_focal: float, longer_side: int) -> bool:
    """Tell whether the corners determine all unknowns of a fit.

    Three conditions must hold: the fit is not singular, the focal length is plausible
    and has a small error, and the errors of the distortion hardly move a point. A fit
    counts as singular if the error of its focal length is nearly 0, or if its focal
    length differs greatly from the one that fits best without distortion.

    Parameters
    ----------
    fit : _LensFit
        The fit.
    undistorted_focal : float
        Focal length [px] that fits best without distortion.
    longer_side : int
        Longer side of the photographs in pixels.

    Returns
    -------
    bool
        True if all three conditions hold.
    """
    focal = fit.matrix[0, 0]
    change = focal / undistorted_focal
    is_not_singular = (
        fit.focal_error > MIN_FOCAL_ERROR * focal
        and 1 / LARGEST_FOCAL_CHANGE < change < LARGEST_FOCAL_CHANGE
    )
    # The limits are in units of the longer side.
    shortest, longest = CALIBRATED_FOCALS
    is_focal_certain = (
        fit.focal_error < LARGEST_FOCAL_ERROR * focal
        and shortest < focal / longer_side < longest
    )
    # Take a point whose distance from the centre is half the longer side, and express
    # this distance in focal lengths.
    distance = 0.5 * longer_side / focal
    is_distortion_certain = (
        fit.k1_error * distance**2 < LARGEST_LENS_ERROR
        and fit.k2_error * distance**4 < LARGEST_LENS_ERROR
    )
    return bool(is_not_singular and is_focal_certain and is_distortion_certain)


def _estimate_focal(
    views: Sequence[SheetCorners], assumed: float, size: tuple[int, int]
) -> float:
    """Estimate the focal length [px] of a lens without distortion.

    Several trial values are compared, and the one that fits the views best is chosen.
    The assumed focal length is preferred if it fits nearly as well.

    Parameters
    ----------
    views : sequence of SheetCorners
        The sheet in each photograph.
    assumed : float
        The assumed focal length [px].
    size : tuple of int
        Width and height of the photographs in pixels.

    Returns
    -------
    float
        The focal length [px]. It is exactly `assumed` if this value is chosen, so that
        a caller can compare both.
    """
    # The assumed value is the last one to be tried.
    trials = np.append(max(size) * TRIAL_FOCALS, assumed)
    residuals = np.array(
        [
            _sum_squared_residuals(views, _make_camera_matrix(focal, size))
            for focal in trials
        ]
    )
    best_residual = residuals.min()
    assumed_residual = residuals[-1]
    # Estimate the variance of a corner's coordinate from the residuals of the best fit.
    n_values = 2 * sum(len(view.pixels) for view in views)
    n_unknowns = 6 * len(views) + 1  # a pose for each view, and the focal length
    variance = best_residual / (n_values - n_unknowns)
    # If a value lies n standard errors from the best value, its sum of squared
    # residuals is larger by n² variances.
    if assumed_residual - best_residual < KEPT_STANDARD_ERRORS**2 * variance:
        return float(assumed)
    return float(trials[residuals.argmin()])


def _make_camera_matrix(focal: float, size: tuple[int, int]) -> np.ndarray:
    """Make the matrix (3, 3) of a camera whose lens is centred on the picture.

    `focal` is its focal length in pixels, `size` the width and height of its pictures.
    """
    middle_column = size[0] / 2 - 0.5
    middle_row = size[1] / 2 - 0.5
    return np.array([[focal, 0, middle_column], [0, focal, middle_row], [0, 0, 1.0]])


def _sum_squared_residuals(views: Sequence[SheetCorners], matrix: np.ndarray) -> float:
    """Sum the squared distances [px²] between the corners seen and those of a model.

    The model is a flat sheet in the pose that fits each view best.

    Parameters
    ----------
    views : sequence of SheetCorners
        The sheet in each photograph.
    matrix : ndarray
        Camera matrix (3, 3), with which the sheet of each view is projected without
        distortion.

    Returns
    -------
    float
        The sum over all corners of all views.
    """
    total = 0.0
    no_distortion = np.zeros(5)
    for view in views:
        # Two poses of a flat sheet may fit its corners. Use the better one.
        residuals = []
        for rotation, translation in _find_poses(view, matrix, no_distortion):
            projected, _ = cv2.projectPoints(
                view.object_points_mm, rotation, translation, matrix, no_distortion
            )
            residuals.append(float(((projected[:, 0] - view.pixels) ** 2).sum()))
        total += min(residuals)
    return total


def _find_poses(
    view: SheetCorners, matrix: np.ndarray, distortion: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Find the two poses of a flat sheet that fit its corners.

    From a distance, the sheet looks nearly the same in both poses.

    Parameters
    ----------
    view : SheetCorners
        The sheet in a photograph.
    matrix : ndarray
        Camera matrix (3, 3).
    distortion : ndarray
        Coefficients (5,) of the distortion, in OpenCV's order.

    Returns
    -------
    list of tuple
        The poses, at least one, the better one first. Each consists of a rotation
        vector (3, 1) and a translation (3, 1) in mm.
    """
    points = view.object_points_mm
    _, rotations, translations, _ = cv2.solvePnPGeneric(
        points, view.pixels, matrix, distortion, flags=cv2.SOLVEPNP_IPPE
    )
    return [
        cv2.solvePnPRefineLM(
            points, view.pixels, matrix, distortion, rotation, translation
        )
        for rotation, translation in zip(rotations, translations, strict=True)
    ]


class Pose:
    """Position and direction of a camera, determined from the sheet in a photograph.

    Parameters
    ----------
    camera : Camera
        The calibrated camera.
    sheet : SheetCorners
        The sheet in the photograph.
    size : tuple of int
        Width and height of the photograph in pixels.

    Raises
    ------
    NoFlankError
        If the corners are not those of a flat sheet.
    """

    def __init__(
        self, camera: Camera, sheet: SheetCorners, size: tuple[int, int]
    ) -> None:
        """Find the pose that best fits the corners of the sheet.

        The docstring of the class describes the parameters.
        """
        self.camera = camera
        self.size = size
        self.paper_mm = compute_size_mm(sheet.square_mm)
        # The first of the poses fits best.
        poses = _find_poses(sheet, camera.matrix, camera.distortion)
        rotation_vector, translation = poses[0]
        # OpenCV's pose converts coordinates on the sheet to the frame of the camera.
        # Together with `WORLD_TO_SHEET`, the matrix converts those of the world.
        sheet_to_camera, _ = cv2.Rodrigues(rotation_vector)
        self.rotation = sheet_to_camera @ WORLD_TO_SHEET
        self.translation = translation
        self.position_mm = (-self.rotation.T @ translation).ravel()
        # This check projects the corners, so it needs all attributes.
        self._require_flat(sheet)

    def _require_flat(self, sheet: SheetCorners) -> None:
        """Raise NoFlankError if the corners lie too far from those of a flat sheet."""
        # Insert y = 0 between x and z.
        corners_mm = np.insert(sheet.positions_mm, 1, 0.0, axis=1)
        offsets_px = self.project(corners_mm) - sheet.pixels
        residual = np.sqrt((offsets_px**2).sum(axis=1).mean())
        if residual > LARGEST_RESIDUAL * max(self.size):
            raise NoFlankError(
                f"the corners of the sheet lie {residual:.1f} pixels from those of a "
                "flat one: the sheet is bent, or the photograph is not sharp"
            )

    def project(self, world_points: np.ndarray) -> np.ndarray:
        """Compute where points of the world lie in the photograph.

        The lens may have radial distortion with the coefficients k1 and k2. All other
        coefficients of OpenCV's model are 0, see `Camera`.

        Parameters
        ----------
        world_points : ndarray
            Coordinates (..., 3) of the points in mm.

        Returns
        -------
        ndarray
            Columns and rows (..., 2) in pixels.
        """
        # Coordinates in the frame of the camera, which looks along z
        points = world_points @ self.rotation.T + self.translation.ravel()
        x = points[..., 0] / points[..., 2]
        y = points[..., 1] / points[..., 2]

        # Radial distortion moves a point towards the centre of the picture or away from
        # it, by a factor that depends on its distance r from the centre.
        k1, k2 = self.camera.distortion[:2]
        squared_r = x * x + y * y
        distortion = 1 + k1 * squared_r + k2 * squared_r**2
        # The camera matrix has the focal length on its diagonal, and the middle of the
        # picture in its last column.
        matrix = self.camera.matrix
        column = matrix[0, 0] * x * distortion + matrix[0, 2]
        row = matrix[1, 1] * y * distortion + matrix[1, 2]
        return np.stack([column, row], axis=-1)

    def make_facing_plane(self, axis_mm: float) -> Plane:
        """Make the vertical plane through the pile's axis that faces the camera.

        `axis_mm` is the distance of the axis from the sheet's lower left corner.
        """
        x, y, _ = self.position_mm
        # The level direction from the camera to the axis is perpendicular to the plane.
        # Turned to the right by 90 degrees, it lies in the plane.
        ahead = np.array([axis_mm - x, -y, 0.0])
        to_the_right = np.array([ahead[1], -ahead[0], 0.0])
        right = to_the_right / np.linalg.norm(ahead)
        return Plane(origin=np.array([axis_mm, 0.0, 0.0]), right=right)

    def compute_look_down_deg(self, axis_mm: float, height_mm: float) -> float:
        """Compute the angle below the horizontal at which the camera sees a crest.

        The angle is negative if the camera looks up at the crest.

        Parameters
        ----------
        axis_mm : float
            Distance of the crest from the sheet's lower left corner, along the sheet.
        height_mm : float
            Height of the crest over the plate.

        Returns
        -------
        float
            The angle in degrees.
        """
        x, y, z = self.position_mm
        distance = math.hypot(x - axis_mm, y)
        return math.degrees(math.atan2(z - height_mm, distance))

    @property
    def tilt_deg(self) -> float:
        """The larger of the camera's roll and pitch [degrees]; 180 if upside down."""
        roll = math.degrees(math.atan2(self.rotation[0][2], -self.rotation[1][2]))
        pitch = math.degrees(math.asin(np.clip(self.rotation[2][2], -1, 1)))
        return max(abs(roll), abs(pitch))


def rectify_photograph(
    image: np.ndarray,
    pose: Pose,
    axis_mm: float | None,
    longest_side_px: int,
    crop: Extent | None = None,
) -> SideView:
    """Rectify a photograph: compute the upright view of a vertical plane, to scale.

    The plane goes through the pile's axis and faces the camera. For the first view of a
    photograph, the axis is not known, and the plane is that of the sheet.

    Parameters
    ----------
    image : ndarray
        The photograph (H, W, 3), BGR.
    pose : Pose
        The camera's pose.
    axis_mm : float or None
        Distance of the axis from the sheet's lower left corner. With None, the view
        lies in the plane of the sheet, and distances that are otherwise counted from
        the axis are counted from this corner.
    longest_side_px : int
        Largest number of pixels of a side.
    crop : Extent, optional
        The part of the plane that is drawn, as far as the photograph shows it. By
        default, it is all that the photograph shows.

    Returns
    -------
    SideView
        The view, with its scale and the pixels that do not show the plane.

    Raises
    ------
    NoFlankError
        If the camera is tilted too much, or does not show the plane above the plate.
    """
    _require_upright_camera(pose)
    if axis_mm is None:
        plane = Plane(origin=np.zeros(3), right=np.array([1.0, 0, 0]))
    else:
        plane = pose.make_facing_plane(axis_mm)
    extent = _find_visible_extent(pose, plane)
    if crop is not None:
        extent = Extent(
            left=max(extent.left, crop.left),
            right=min(extent.right, crop.right),
            top=min(extent.top, crop.top),
        )

    pixels_per_mm = _measure_resolution(pose, plane)
    grid = _choose_grid(extent, pixels_per_mm, longest_side_px)

    # Find where the photograph shows each pixel of the view, and take the colour there.
    points = plane.compute_points(grid.along_mm, grid.up_mm)
    source_pixels = pose.project(points).astype(np.float32)
    reduction = grid.mm_per_pixel * pixels_per_mm
    is_outside = _mark_outside(source_pixels, pose.size)
    return SideView(
        image=_take_colours(image, source_pixels, reduction),
        hidden=is_outside | _mark_behind_sheet(pose, plane, grid),
        mm_per_pixel=grid.mm_per_pixel,
        base_row=grid.base_row,
        left_mm=grid.left_mm,
    )


def _choose_grid(
    extent: Extent, pixels_per_mm: float, longest_side_px: int
) -> _PixelGrid:
    """Choose the pixels of a side view.

    The view is as fine as the photograph, unless a side would have too many pixels.

    Parameters
    ----------
    extent : Extent
        Borders of the view.
    pixels_per_mm : float
        Number of pixels of the photograph that show 1 mm.
    longest_side_px : int
        Largest number of pixels of a side.
    """
    width_mm = extent.right - extent.left
    height_mm = extent.top + STRIP_BELOW_PLATE_MM
    mm_per_pixel = float(
        max(1 / pixels_per_mm, width_mm / longest_side_px, height_mm / longest_side_px)
    )
    n_rows = math.ceil(height_mm / mm_per_pixel)
    return _PixelGrid(
        n_rows=n_rows,
        n_columns=math.ceil(width_mm / mm_per_pixel),
        mm_per_pixel=mm_per_pixel,
        # The last row has the number n_rows - 1, and shows the lower end of the strip.
        base_row=n_rows - 1 - STRIP_BELOW_PLATE_MM / mm_per_pixel,
        left_mm=extent.left,
    )


def _require_upright_camera(pose: Pose) -> None:
    """Raise NoFlankError if a camera is tilted too much, or stands behind the sheet."""
    tilt_deg = pose.tilt_deg
    if tilt_deg > LARGEST_TILT_DEG or pose.position_mm[1] >= 0:
        raise NoFlankError(
            f"the camera is tilted by {tilt_deg:.0f} degrees (180: upside down); "
            f"at most {LARGEST_TILT_DEG:.0f} can be corrected"
        )


def _measure_resolution(pose: Pose, plane: Plane) -> float:
    """Compute how many pixels of a photograph show 1 mm of a plane, at its origin."""
    ends_of_1_mm = plane.origin + np.outer([0, 1.0], plane.right)
    return float(np.linalg.norm(np.diff(pose.project(ends_of_1_mm), axis=0)))


def _take_colours(
    image: np.ndarray, pixels: np.ndarray, reduction: float
) -> np.ndarray:
    """Take the colours of a view from a photograph.

    Parameters
    ----------
    image : ndarray
        The photograph, BGR.
    pixels : ndarray
        Column and row (H, W, 2) in the photograph, float32, for each pixel of the view.
    reduction : float
        Side of a pixel of the view, in pixels of the photograph.

    Returns
    -------
    ndarray
        The view (H, W, 3). A pixel of a coarse view is an average over the part of the
        photograph that it covers.
    """
    source = image
    if reduction > SMALLEST_BLURRED_REDUCTION:
        source = cv2.GaussianBlur(image, (0, 0), BLUR_FRACTION * reduction)
    return cv2.remap(
        source,
        pixels[..., 0],
        pixels[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )


def _mark_outside(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Mark the pixels of a view that lie outside a photograph or on its border.

    Parameters
    ----------
    pixels : ndarray
        Column and row (H, W, 2) in the photograph for each pixel of the view.
    size : tuple of int
        Width and height of the photograph in pixels.

    Returns
    -------
    ndarray
        Mask (H, W) of these pixels.
    """
    width, height = size
    return (
        (pixels <= 0).any(-1)
        | (pixels[..., 0] >= width - 1)
        | (pixels[..., 1] >= height - 1)
    )


def _mark_behind_sheet(pose: Pose, plane: Plane, grid: _PixelGrid) -> np.ndarray:
    """Mark the pixels of a view that the sheet and a strip around it hide.

    Parameters
    ----------
    pose : Pose
        The camera's pose.
    plane : Plane
        The plane of the view.
    grid : _PixelGrid
        The pixels of the view.

    Returns
    -------
    ndarray
        Mask (H, W) of these pixels.
    """
    # The sheet stands in the plane y = 0 of the world.
    width, height = pose.paper_mm
    margin = SHEET_MARGIN_FRACTION * width
    left = -margin
    right = width + margin
    bottom = -LOWER_MARGIN_FACTOR * margin
    top = height + margin
    corners = np.array(
        [[left, 0, bottom], [right, 0, bottom], [right, 0, top], [left, 0, top]]
    )
    # Follow the rays from the camera through these corners to the plane of the view,
    # and fill the polygon between them.
    rays = corners - pose.position_mm
    _, points_mm = _intersect(pose.position_mm, rays, plane)
    polygon = np.rint(grid.convert_to_pixels(points_mm)).astype(np.int32)
    mask = np.zeros((grid.n_rows, grid.n_columns), np.uint8)
    cv2.fillPoly(mask, [polygon], 1)
    return mask > 0


def _find_visible_extent(pose: Pose, plane: Plane) -> Extent:
    """Find the part of a plane that a photograph shows.

    Parameters
    ----------
    pose : Pose
        The camera's pose.
    plane : Plane
        The plane of a side view.

    Returns
    -------
    Extent
        The smallest rectangle above the plate that contains the visible part.

    Raises
    ------
    NoFlankError
        If the camera looks past the plane at a border of the photograph, or if
        everything that the photograph shows of the plane lies below the plate.
    """
    # Choose points on the border of the photograph, as fractions of its width and
    # height.
    fractions = np.linspace(0, 1, POINTS_PER_BORDER)
    border = []
    for x_fraction in fractions:
        for y_fraction in fractions:
            if x_fraction in (0, 1) or y_fraction in (0, 1):
                border.append((x_fraction, y_fraction))
    pixels = np.array(border) * np.subtract(pose.size, 1)

    # Find the rays through these points in the frame of the camera, which looks along
    # z. OpenCV expects and returns arrays (N, 1, 2).
    camera = pose.camera
    rays = cv2.undistortPoints(pixels[:, None], camera.matrix, camera.distortion)[:, 0]
    camera_directions = np.column_stack([rays, np.ones(len(rays))])
    # The matrix `rotation` converts vectors of the world to this frame. A product from
    # the right is one with its transpose, which converts them back.
    directions = camera_directions @ pose.rotation

    # The rays meet the plane at the border of the visible part.
    distances, points = _intersect(pose.position_mm, directions, plane)
    if (distances <= 0).any():
        raise NoFlankError(
            "the camera looks past the sheet: a part of the photograph does not "
            "show the plane of the sheet"
        )
    along, up = points.T
    if up.max() <= 0:
        raise NoFlankError("nothing above the plate is in the photograph")
    return Extent(float(along.min()), float(along.max()), float(up.max()))


def _intersect(
    position: np.ndarray, directions: np.ndarray, plane: Plane
) -> tuple[np.ndarray, np.ndarray]:
    """Intersect rays from a camera with a plane.

    Parameters
    ----------
    position : ndarray
        Position (3,) of the camera in mm.
    directions : ndarray
        Directions (N, 3) of the rays.
    plane : Plane
        The plane.

    Returns
    -------
    distances : ndarray
        Distance (N,) of each intersection from the camera, as a multiple of the ray's
        direction vector. It is negative behind the camera.
    positions : ndarray
        Position (N, 2) of each intersection on the plane in mm: distance from its
        origin to the right, and height over the plate.
    """
    normal = np.cross(plane.right, [0, 0, 1.0])
    distances = (plane.origin - position) @ normal / (directions @ normal)
    from_origin = position + distances[:, None] * directions - plane.origin
    positions = np.column_stack([from_origin @ plane.right, from_origin[:, 2]])
    return distances, positions
