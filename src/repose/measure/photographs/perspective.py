"""Remove the perspective of a camera from the view of a pile.

A near camera does not see the outline of a pile exactly as wide and steep as it is. The
old view, which contains this error, is redrawn as a new view without it.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from repose.measure.photographs.segmentation import Segmentation


class Viewpoint(NamedTuple):
    """Position of a camera relative to a pile, in pixels of its side view."""

    axis_px: float  # column of the pile's axis
    distance_px: float  # from the axis
    height_px: float  # over the plate


class _SourcePixels(NamedTuple):
    """For each pixel of the new view, the position in the old view that it shows."""

    column: np.ndarray  # (H, W), float32
    row: np.ndarray  # (H, W), float32

    def redraw(self, picture: np.ndarray) -> np.ndarray:
        """Convert a picture of the old view to the new view.

        The picture may lack rows at the bottom. The result then lacks them, too.
        """
        return cv2.remap(
            picture,
            self.column[: len(picture)],
            self.row[: len(picture)],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )


def remove_perspective(
    view: np.ndarray,
    pile: Segmentation,
    viewpoint: Viewpoint,
    angles_deg: Sequence[float],
    pile_height_px: float,
) -> tuple[np.ndarray, Segmentation]:
    """Redraw a side view without perspective: as seen horizontally from far away.

    The points that a near camera sees as the outline of a pile do not lie in the plane
    through the pile's axis, for which the scale is correct. They lie behind it if the
    camera looks down on the pile. To find these points, the pile is treated as a cone.

    Parameters
    ----------
    view : ndarray
        The side view (H, W, 3) or (H, W).
    pile : Segmentation
        The pile in the view. Its arrays may lack the rows below the plate.
    viewpoint : Viewpoint
        Position of the camera.
    angles_deg : sequence of float
        Angles of the left and the right side above the horizontal, in the old view.
    pile_height_px : float
        Height of the pile in pixels.

    Returns
    -------
    view : ndarray
        The redrawn view.
    pile : Segmentation
        The pile in it.
    """
    # Compute the tangent of the angle at which the camera looks down on the apex. It is
    # negative if the camera is lower than the apex.
    tan_down = (viewpoint.height_px - pile_height_px) / viewpoint.distance_px
    source_pixels = _find_source_pixels(
        view.shape[:2],
        base_row=pile.base_row,
        viewpoint=viewpoint,
        turn_sines=_compute_turn_sines(angles_deg, tan_down),
    )

    # A redrawn pixel belongs to the pile if the pile fills at least half of it.
    pile_fraction = source_pixels.redraw(pile.mask.astype(np.float32))
    is_pile = pile_fraction >= 0.5
    if tan_down > 0:
        # The lowest grains are round, so the outline ends in their undersides and not
        # in the edge of a cone. The model of a cone would make the foot too wide. The
        # old view shows its true width, so keep only the columns of the old pile.
        is_pile &= _find_columns_of_pile(pile)
    redrawn_pile = replace(
        pile,
        grey=source_pixels.redraw(pile.grey),
        contrast=source_pixels.redraw(pile.contrast),
        mask=is_pile.astype(np.uint8),
    )
    return source_pixels.redraw(view), redrawn_pile


def _compute_turn_sines(angles_deg: Sequence[float], tan_down: float) -> np.ndarray:
    """Compute how far the outline of a cone is turned out of the plane of the side view.

    Each side of the outline is a line from the apex to the foot of the cone. If the
    camera looks down on the cone, this line lies behind the plane of the side view: it
    is turned about the cone's axis, away from the camera. The sine of the angle of this
    turn is tan(angle at which the camera looks down) / tan(angle of the cone). This is
    exact at any distance.

    Parameters
    ----------
    angles_deg : sequence of float
        Apparent angles of the left and the right side above the horizontal.
    tan_down : float
        Tangent of the angle at which the camera looks down; negative if it looks up.

    Returns
    -------
    ndarray, (2,)
        Sines of the turns of the left and the right side; negative if the camera looks
        up.
    """
    tan_seen = np.tan(np.radians(angles_deg))
    # The cone is steeper than the camera sees it.
    tan_cone = np.hypot(tan_seen, tan_down)
    return tan_down / tan_cone


def _find_source_pixels(
    shape: tuple[int, int],
    base_row: float,
    viewpoint: Viewpoint,
    turn_sines: np.ndarray,
) -> _SourcePixels:
    """Find the pixels of the old view that a new view of the same shape shows.

    On each side of the pile, the outline lies in a vertical plane through the axis,
    which is turned out of the plane of the old view. A pixel of the new view shows a
    point in this turned plane. The ray from the camera to this point meets the plane of
    the old view at the source pixel.

    Parameters
    ----------
    shape : tuple of int
        Number of rows and columns of the view.
    base_row : float
        Row of the plate.
    viewpoint : Viewpoint
        Position of the camera.
    turn_sines : ndarray, (2,)
        Sines of the angles between both planes on the left and the right side of the
        pile, from `_compute_turn_sines`.

    Returns
    -------
    _SourcePixels
        Column and row in the old view for each pixel of the new view.
    """
    n_rows, n_columns = shape
    # Each column of the new view belongs to the left or the right side of the pile.
    axis_offset = np.arange(n_columns) - viewpoint.axis_px
    left_sine, right_sine = turn_sines
    sine = np.where(axis_offset > 0, right_sine, left_sine)
    cosine = np.sqrt(1 - sine**2)

    # The depth of a point behind the plane of the old view is negative in front of it.
    # A point at a greater distance from the camera appears smaller by the ratio of the
    # distances: it moves towards the point of the plane opposite the camera.
    depth = np.abs(axis_offset) * sine
    reduction = viewpoint.distance_px / (viewpoint.distance_px + depth)
    column = viewpoint.axis_px + axis_offset * cosine * reduction

    height = base_row - np.arange(n_rows)[:, None]
    source_height = viewpoint.height_px + (height - viewpoint.height_px) * reduction
    return _SourcePixels(
        column=np.tile(column, (n_rows, 1)).astype(np.float32),
        row=(base_row - source_height).astype(np.float32),
    )


def _find_columns_of_pile(pile: Segmentation) -> np.ndarray:
    """Tell which columns (W,) lie between the left and the right end of the pile."""
    columns = np.arange(pile.mask.shape[1])
    pile_columns = np.flatnonzero(pile.mask.any(axis=0))
    return (columns >= pile_columns[0]) & (columns <= pile_columns[-1])
