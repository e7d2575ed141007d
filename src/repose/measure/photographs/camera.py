"""From a photograph that shows the sheet to the upright, metric side view of the pile.

World: x to the right along the sheet, y away from the camera, z up, in mm, from the sheet's lower left corner; z = 0 is
the plate. The side view lies in the vertical plane through the pile's axis that faces the camera, so the sheet need not
face the camera exactly.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from repose.common.errors import NoFlankError
from repose.measure.photographs.sheet import Seen, size_mm

FROM_AFAR = "assumed (with a zoom from 5 m the angle reads 0.3 degrees too steep)"
PHONE_FOCAL = 0.75  # of the longer side: the main camera of most phones
LARGEST_LENS_ERROR = (
    0.004  # share of the distance from the picture's middle, at half its longer side
)
LARGEST_FOCAL_ERROR = 0.05
LARGEST_CHANGE = 1.6  # of the focal length, by the distortion
FOCALS = 0.5, 16.0, 41  # of the longer side: shortest, longest, number that are tried
LARGEST_MISS = (
    1.5e-3  # of the longer side: distance of a corner from its place on a flat sheet
)
LARGEST_TILT_DEG = 25.0
LARGEST_LOOK_DOWN_DEG = 8.0
BELOW_MM = 3.0  # shown below the plate


@dataclass(frozen=True)
class Camera:
    """A camera, calibrated from its photographs of the sheet."""

    matrix: np.ndarray  # (3, 3), focal length and middle in pixels
    lens: np.ndarray  # (5,), distortion in OpenCV's order; only k1 and k2 are used
    note: str  # corrections that lacked corners; may be empty


@dataclass(frozen=True)
class SideView:
    """The upright, metric view (H, W) of a pile."""

    image: np.ndarray  # (H, W, 3), BGR
    hidden: np.ndarray  # True outside the photograph and on the printed sheet
    mm_per_pixel: float
    base_row: float  # row of the plate
    left_mm: float  # place of the left border, from the axis


def calibrate(
    views: Sequence[Seen], size: tuple[int, int], focal_px: float | None = None
) -> Camera:
    """Focal length and distortion from the sheet in several photographs of one camera (Zhang 2000).

    The centre of the picture is the lens's centre, pixels are square, and the distortion is radial. A coefficient is
    used if its standard error moves a point at half the picture's longer side by less than 0.4 % of that distance.
    Without enough corners the focal length is `focal_px` (None: a phone's), or the best fit if the corners exclude that
    value. `size` is (width, height).

    Zhang, Z. (2000). IEEE Trans. Pattern Anal. Mach. Intell. 22, 1330-1334.
    """
    long_side = max(size)
    assumed = focal_px or PHONE_FOCAL * long_side
    found = _focal(views, assumed, size)
    guess = _matrix(found, size)
    places = [view.flat_mm.astype(np.float32) for view in views]
    pixels = [view.pixels.astype(np.float32) for view in views]
    shared = (
        cv2.CALIB_USE_INTRINSIC_GUESS
        | cv2.CALIB_FIX_PRINCIPAL_POINT
        | cv2.CALIB_FIX_ASPECT_RATIO
    )
    shared |= cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3
    for fixed in (0, cv2.CALIB_FIX_K2, cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2):
        try:
            _, matrix, lens, _, _, errors, *_ = cv2.calibrateCameraExtended(
                places, pixels, size, guess.copy(), np.zeros(5), flags=shared | fixed
            )
        except cv2.error:  # too few corners for this number of unknowns
            continue
        focal, (k1, k2) = matrix[0, 0], errors.ravel()[4:6]
        focal_error = errors.ravel()[:2].max()
        away = 0.5 * long_side / focal
        # A singular fit has an error of 0, or leaves the focal length that fits best without distortion.
        sane = (
            focal_error > 1e-6 * focal
            and 1 / LARGEST_CHANGE < focal / found < LARGEST_CHANGE
        )
        sure = (
            sane
            and focal_error < LARGEST_FOCAL_ERROR * focal
            and 0.3 < focal / long_side < 10
        )
        if (
            sure
            and k1 * away**2 < LARGEST_LENS_ERROR
            and k2 * away**4 < LARGEST_LENS_ERROR
        ):
            note = (
                "lens not corrected: the sheet is seen in too few places"
                if fixed & cv2.CALIB_FIX_K1
                else ""
            )
            return Camera(matrix, lens.ravel()[:5], note)
    how = (
        "uncertain"
        if found != assumed
        else "as the camera states it"
        if focal_px
        else FROM_AFAR
    )
    note = (
        f"lens not corrected, focal length {how}: the sheet is seen in too few places"
    )
    return Camera(guess, np.zeros(5), note)


def _focal(views: Sequence[Seen], assumed: float, size: tuple[int, int]) -> float:
    """Find the focal length [px] that fits the corners best; keep the assumed one if it lies within three errors."""
    tried = np.append(max(size) * np.geomspace(*FOCALS), assumed)
    misses = np.array([_squares(views, _matrix(focal, size)) for focal in tried])
    scatter = misses.min() / (
        2 * sum(len(view.pixels) for view in views) - 6 * len(views) - 1
    )
    return float(
        tried[-1] if misses[-1] - misses.min() < 9 * scatter else tried[misses.argmin()]
    )


def _matrix(focal: float, size: tuple[int, int]) -> np.ndarray:
    """Make the matrix of a camera whose lens has its centre in the middle of the picture."""
    return np.array(
        [[focal, 0, size[0] / 2 - 0.5], [0, focal, size[1] / 2 - 0.5], [0, 0, 1.0]]
    )


def _squares(views: Sequence[Seen], matrix: np.ndarray) -> float:
    """Sum the squared distances [px] between the corners and the corners of flat sheets, without distortion."""
    total, lens = 0.0, np.zeros(5)
    for view in views:
        seen = (
            cv2.projectPoints(view.flat_mm, *pose, matrix, lens)[0]
            for pose in _poses(view, matrix, lens)
        )
        total += min(
            float(((corners[:, 0] - view.pixels) ** 2).sum()) for corners in seen
        )
    return total


def _poses(
    view: Seen, matrix: np.ndarray, lens: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Find both poses (rotation, translation) of a flat sheet that its corners allow; from afar they are alike."""
    known = view.flat_mm, view.pixels, matrix, lens
    found = cv2.solvePnPGeneric(*known, flags=cv2.SOLVEPNP_IPPE)
    return [
        cv2.solvePnPRefineLM(*known, *pose) for pose in zip(*found[1:3], strict=True)
    ]


class Pose:
    """Position and direction of a camera, from the sheet in one photograph; `size` is (width, height) in pixels."""

    def __init__(self, camera: Camera, sheet: Seen, size: tuple[int, int]) -> None:
        self.camera, self.size, self.paper_mm = camera, size, size_mm(sheet.square_mm)
        # The planar solver wants z = 0 on the sheet: solve in (x, z, -y), then turn.
        turn, self.shift = _poses(sheet, camera.matrix, camera.lens)[
            0
        ]  # the one that fits better
        self.turn = cv2.Rodrigues(turn)[0] @ np.array(
            [[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]
        )
        self.eye = (-self.turn.T @ self.shift).ravel()
        world = np.insert(sheet.places_mm, 1, 0.0, axis=1)
        miss = np.sqrt(((self.pixels_of(world) - sheet.pixels) ** 2).sum(axis=1).mean())
        if miss > LARGEST_MISS * max(size):
            off = f"the corners of the sheet lie {miss:.1f} pixels from those of a flat one"
            raise NoFlankError(f"{off}: it is bent, or not sharp")

    def pixels_of(self, world: np.ndarray) -> np.ndarray:
        """Column and row (..., 2) in the photograph of points of the world (..., 3) in mm."""
        ahead = world @ self.turn.T + self.shift.ravel()
        x, y = ahead[..., 0] / ahead[..., 2], ahead[..., 1] / ahead[..., 2]
        square = x * x + y * y
        bend = 1 + self.camera.lens[0] * square + self.camera.lens[1] * square**2
        matrix = self.camera.matrix
        return np.stack(
            [
                matrix[0, 0] * x * bend + matrix[0, 2],
                matrix[1, 1] * y * bend + matrix[1, 2],
            ],
            axis=-1,
        )

    def facing(self, axis_mm: float) -> np.ndarray:
        """Level unit vector (3,) to the right, in the plane through (axis, 0) that faces the camera."""
        away = np.array([axis_mm - self.eye[0], -self.eye[1], 0.0])
        return np.array([away[1], -away[0], 0.0]) / np.linalg.norm(away)

    def look_down_deg(self, axis_mm: float, height_mm: float) -> float:
        """Angle below the horizontal at which the camera looks at a crest; negative if it looks up."""
        return math.degrees(
            math.atan2(
                self.eye[2] - height_mm, math.hypot(self.eye[0] - axis_mm, self.eye[1])
            )
        )

    @property
    def tilt_deg(self) -> float:
        """The larger of the camera's roll and pitch; a camera that looks level has none, wherever the pile stands."""
        roll = math.degrees(
            math.atan2(self.turn[0][2], -self.turn[1][2])
        )  # 180 where it is upside down
        return max(
            abs(roll), abs(math.degrees(math.asin(np.clip(self.turn[2][2], -1, 1))))
        )


def side_view(
    image: np.ndarray,
    pose: Pose,
    axis_mm: float | None,
    longest: int,
    part: tuple[float, float, float] | None = None,
) -> SideView:
    """Draw the upright view of the plane through the pile's axis.

    `axis_mm` None means the plane of the sheet, from its lower left corner. `part` is left, right and top in mm from
    the axis and the plate; None means all.
    """
    origin = np.array([axis_mm or 0.0, 0.0, 0.0])
    right = np.array([1.0, 0, 0]) if axis_mm is None else pose.facing(axis_mm)
    if pose.tilt_deg > LARGEST_TILT_DEG or pose.eye[1] >= 0:
        tilted = (
            f"the camera is tilted by {pose.tilt_deg:.0f} degrees (180: upside down)"
        )
        raise NoFlankError(f"{tilted}; {LARGEST_TILT_DEG:.0f} can be corrected")
    low, high, top = _extent(pose, origin, right)
    if part is not None:
        low, high, top = max(low, part[0]), min(high, part[1]), min(top, part[2])
    fine = float(
        np.linalg.norm(
            np.diff(pose.pixels_of(origin + np.outer([0, 1.0], right)), axis=0)
        )
    )
    scale = float(max(1 / fine, (high - low) / longest, (top + BELOW_MM) / longest))
    columns, rows = math.ceil((high - low) / scale), math.ceil((top + BELOW_MM) / scale)
    base = rows - 1 - BELOW_MM / scale
    u = low + scale * np.arange(columns)
    z = scale * (base - np.arange(rows))
    world = origin + u[None, :, None] * right + z[:, None, None] * np.array([0, 0, 1.0])
    pixels = pose.pixels_of(world).astype(np.float32)
    # A coarser view averages the pixels that fall into one of its own.
    if scale * fine > 1.5:
        image = cv2.GaussianBlur(image, (0, 0), 0.4 * scale * fine)
    shown = cv2.remap(
        image,
        pixels[..., 0],
        pixels[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    width, height = pose.size
    hidden = (
        (pixels <= 0).any(-1)
        | (pixels[..., 0] >= width - 1)
        | (pixels[..., 1] >= height - 1)
    )
    # The sheet stands in its own plane: mark the part of the view that it hides.
    wide, tall = pose.paper_mm
    edge = 0.02 * wide
    left, beyond, bottom, top = -edge, wide + edge, -2 * edge, tall + edge
    corners = np.array(
        [[left, 0, bottom], [beyond, 0, bottom], [beyond, 0, top], [left, 0, top]]
    )
    on_view = _meet(pose.eye, corners - pose.eye, origin, right)[1]
    polygon = np.column_stack(
        [(on_view[:, 0] - low) / scale, base - on_view[:, 1] / scale]
    )
    on_sheet = np.zeros(hidden.shape, np.uint8)
    cv2.fillPoly(on_sheet, [np.rint(polygon).astype(np.int32)], 1)
    return SideView(shown, hidden | (on_sheet > 0), scale, base, low)


def _extent(
    pose: Pose, origin: np.ndarray, right: np.ndarray
) -> tuple[float, float, float]:
    """Return left, right and top [mm] of the part of a plane that a photograph shows."""
    side = np.linspace(0, 1, 9)
    edge = np.array(
        [(u, v) for u in side for v in side if not {u, v}.isdisjoint((0, 1))]
    ) * np.subtract(pose.size, 1)
    ahead = cv2.undistortPoints(edge[:, None], pose.camera.matrix, pose.camera.lens)[
        :, 0
    ]
    far, at = _meet(
        pose.eye,
        np.column_stack([ahead, np.ones(len(ahead))]) @ pose.turn,
        origin,
        right,
    )
    if (far <= 0).any():
        raise NoFlankError(
            "the camera looks past the sheet: a part of the photograph shows nothing in its plane"
        )
    along, up = at.T
    if up.max() <= 0:
        raise NoFlankError("nothing above the plate is in the photograph")
    return float(along.min()), float(along.max()), float(up.max())


def _meet(
    eye: np.ndarray, ways: np.ndarray, origin: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How far along its way (N, 3) from the camera each ray meets a plane, and where: (N, 2), along and up, in mm."""
    normal = np.cross(right, [0, 0, 1.0])
    far = (origin - eye) @ normal / (ways @ normal)
    at = eye + far[:, None] * ways - origin
    return far, np.column_stack([at @ right, at[:, 2]])
