"""Remove the perspective of a camera from the view of a pile."""

import math
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


def remove_perspective(
    view: np.ndarray,
    pile: Segmentation,
    viewpoint: Viewpoint,
    angles_deg: Sequence[float],
    pile_height_px: float,
) -> tuple[np.ndarray, Segmentation]:
    """Redraw a side view as a camera at the plate's height sees it from far away.

    The outline of a cone that is seen from above or below is a line from its apex to
    its foot, but not in the plane of the side view, which faces the camera. It lies in
    a half-plane that is turned about the axis by t, with sin(t) = tan(look down) /
    tan(angle of the cone), away from a camera that looks down. This is exact at any
    distance. Below the widest place of the foot the outline is the underside of the
    foot's grains, which a camera at the plate's height does not see.

    Parameters
    ----------
    view : ndarray
        The side view (H, W, 3) or (H, W).
    pile : Segmentation
        The pile in the view; its arrays may lack the rows below the plate.
    viewpoint : Viewpoint
        Position of the camera.
    angles_deg : sequence of float
        Angles of the left and the right side in the view.
    pile_height_px : float
        Height of the pile in pixels.

    Returns
    -------
    tuple
        The view and the pile, redrawn.
    """
    # Angle of the cone that is seen at the measured angle, and turn of its outline
    n_rows, n_columns = view.shape[:2]
    camera_height = viewpoint.height_px
    tan_down = (camera_height - pile_height_px) / viewpoint.distance_px
    tan_angles = np.hypot(np.tan(np.radians(angles_deg)), tan_down)
    sines = tan_down / tan_angles

    # Each column of the new view belongs to one side of the pile, 0 left or 1 right.
    offset = np.arange(n_columns) - viewpoint.axis_px
    side = (offset > 0).astype(int)
    distance = np.abs(offset)
    sine = sines[side]

    # Each pixel of the new view shows a point of the turned half-plane. The ray from the
    # camera to this point meets the plane of the old view in the source pixel.
    share = viewpoint.distance_px / (viewpoint.distance_px + distance * sine)
    source_column = viewpoint.axis_px + offset * np.sqrt(1 - sine**2) * share
    height = pile.base_row - np.arange(n_rows)[:, None]
    source_height = camera_height + (height - camera_height) * share
    source_x = np.tile(source_column, (n_rows, 1)).astype(np.float32)
    source_y = (pile.base_row - source_height).astype(np.float32)

    def redraw(picture: np.ndarray) -> np.ndarray:
        """Redraw a picture, which may lack rows at the bottom of the view."""
        return cv2.remap(
            picture,
            source_x[: len(picture)],
            source_y[: len(picture)],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )

    # From above, the foot is not wider than in the old view.
    pile_offset = np.flatnonzero(pile.mask.any(axis=0)) - viewpoint.axis_px
    if tan_down > 0:
        largest_distance = np.array([-pile_offset.min(), pile_offset.max()])
    else:
        largest_distance = np.full(2, math.inf)
    is_pile = redraw(pile.mask.astype(np.float32)) >= 0.5
    mask = is_pile & (distance <= largest_distance[side])
    redrawn_pile = replace(
        pile,
        grey=redraw(pile.grey),
        contrast=redraw(pile.contrast),
        mask=mask.astype(np.uint8),
    )
    return redraw(view), redrawn_pile
