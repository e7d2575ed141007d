"""Draw a measurement into its picture: boundary, lines and height of the pile."""

import cv2
import numpy as np

from repose.measure.photographs.segmentation import Segmentation, segment
from repose.measure.pile import measure_segmented, with_response
from repose.measure.results import Measurement
from repose.measure.settings import MeasureSettings

# Ends of a nearly level line may lie beyond the coordinates that OpenCV draws.
LARGEST_COORDINATE = 1e6  # pixels
# OpenCV takes coordinates as whole numbers, here in units of 1/2^SUBPIXEL_BITS of a
# pixel.
SUBPIXEL_BITS = 8
# Longer side of a picture over the width of a line that is drawn in it
PICTURE_TO_LINE_RATIO = 500
HALF_BAR = 12  # half the length of the bar at the crest, over the width of a line
# Thresholds of the gradient in Canny's method, which draws the step ``edge``
CANNY_THRESHOLDS = (50, 150)
# Colours, BGR
RED = (40, 40, 230)
GREEN = (60, 170, 40)
YELLOW = (0, 200, 255)
BLUE = (220, 120, 20)


def overlay(image: np.ndarray, measurement: Measurement) -> np.ndarray:
    """Draw a measurement into its picture, as in Figure 6 of the paper.

    The boundary is yellow, the left line red and the right line green. The base and the
    height of the pile are blue.

    Parameters
    ----------
    image : ndarray
        The measured picture, (H, W) or BGR (H, W, 3).
    measurement : Measurement
        The measurement of this picture.

    Returns
    -------
    ndarray
        The picture (H, W, 3), BGR.
    """
    picture, thickness = _draw_outline(image, measurement.contour)
    # Draw the base over the whole width, just above the plate.
    last_column = picture.shape[1] - 1
    base_row = measurement.base_row
    line_row = base_row - thickness / 2
    draw_line(picture, (0, line_row), (last_column, line_row), BLUE, thickness)
    # Draw the height of the pile as a vertical line with a bar at the crest.
    column, top_row = measurement.top
    draw_line(picture, (column, base_row), (column, top_row), BLUE, thickness)
    half_bar = HALF_BAR * thickness
    bar_start = (column - half_bar, top_row)
    bar_end = (column + half_bar, top_row)
    draw_line(picture, bar_start, bar_end, BLUE, thickness)
    # Draw the lines through both sides.
    left_line, right_line = measurement.angle.lines
    for (lower_end, upper_end), colour in ((left_line, RED), (right_line, GREEN)):
        draw_line(picture, lower_end, upper_end, colour, 2 * thickness)
    return picture


def draw_rejected_overlay(image: np.ndarray, pile: Segmentation | None) -> np.ndarray:
    """Draw into a rejected picture what was taken for the pile: its boundary and base.

    Parameters
    ----------
    image : ndarray
        The picture, (H, W) or BGR (H, W, 3).
    pile : Segmentation or None
        The part of the picture that was taken for the pile. If there is none, nothing
        is drawn.

    Returns
    -------
    ndarray
        The picture (H, W, 3), BGR.
    """
    if pile is None:
        return _copy_as_bgr(image)
    picture, thickness = _draw_outline(image, pile.contour)
    base_start = (0, pile.base_row)
    base_end = (picture.shape[1] - 1, pile.base_row)
    draw_line(picture, base_start, base_end, BLUE, thickness)
    return picture


def _copy_as_bgr(image: np.ndarray) -> np.ndarray:
    """Copy a picture, (H, W) or BGR (H, W, 3), as BGR (H, W, 3)."""
    if image.ndim == 2:
        return cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    return image.copy()


def _draw_outline(image: np.ndarray, contour: np.ndarray) -> tuple[np.ndarray, int]:
    """Copy a picture as BGR, and draw the boundary of a pile into the copy.

    The width of lines depends on the size of the picture. It is returned for the lines
    that the caller draws into the same picture.

    Parameters
    ----------
    image : ndarray
        The picture, (H, W) or BGR (H, W, 3).
    contour : ndarray
        Columns and rows (N, 2) of the pixels of the boundary.

    Returns
    -------
    picture : ndarray
        The copy (H, W, 3), BGR, with the boundary.
    thickness : int
        Width of lines in pixels.
    """
    picture = _copy_as_bgr(image)
    longer_side = max(picture.shape[:2])
    thickness = max(1, round(longer_side / PICTURE_TO_LINE_RATIO))
    outline = np.zeros(picture.shape[:2], np.uint8)
    outline[contour[:, 1], contour[:, 0]] = 1
    # Thicken the outline to the width of a line.
    pen = np.ones((thickness, thickness), np.uint8)
    picture[cv2.dilate(outline, pen) > 0] = YELLOW
    return picture, thickness


def draw_line(
    picture: np.ndarray, start: tuple, end: tuple, colour: tuple, thickness: int
) -> None:
    """Draw a smooth line into a picture; its ends may lie between pixels.

    Parameters
    ----------
    picture : ndarray
        The picture (H, W, 3), BGR, which is changed.
    start, end : tuple
        Column and row of each end.
    colour : tuple
        Blue, green and red, each from 0 to 255.
    thickness : int
        Width of the line in pixels.
    """
    cv2.line(
        picture,
        _convert_to_fixed_point(start),
        _convert_to_fixed_point(end),
        colour,
        thickness,
        cv2.LINE_AA,
        shift=SUBPIXEL_BITS,
    )


def _convert_to_fixed_point(point: tuple) -> tuple[int, ...]:
    """Convert a point (column, row) to the whole numbers that OpenCV expects."""
    limit = LARGEST_COORDINATE
    scale = 1 << SUBPIXEL_BITS
    return tuple(round(scale * min(max(value, -limit), limit)) for value in point)


def draw_steps(
    image: np.ndarray,
    mm_per_pixel: float,
    settings: MeasureSettings | None = None,
    *,
    base_row: float | None = None,
) -> dict[str, np.ndarray]:
    """Draw the steps of the measurement of a picture.

    Parameters
    ----------
    image : ndarray
        The picture, (H, W) or BGR (H, W, 3).
    mm_per_pixel : float
        Scale of the picture.
    settings : MeasureSettings, optional
        Settings of the lines. By default, the default settings are used.
    base_row : float, optional
        Row of the plate. By default, it is found in the picture (`segment`).

    Returns
    -------
    dict
        Pictures by name, in this order: ``grey``, ``binary`` (the pile is white),
        ``edge`` and ``boundary`` (the overlay).
    """
    settings = settings or MeasureSettings.with_defaults()
    settings = settings.with_scale(mm_per_pixel)
    pile = segment(image, settings.largest_pile_only, base_row)
    measurement = with_response(measure_segmented(pile, settings))
    binary = pile.mask * np.uint8(255)
    return {
        "grey": pile.grey,
        "binary": binary,
        "edge": cv2.Canny(binary, *CANNY_THRESHOLDS),
        "boundary": overlay(image, measurement),
    }
