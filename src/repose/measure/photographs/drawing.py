"""Pictures of a measurement: boundary, lines and Height in the measured picture."""

import cv2
import numpy as np

from repose.measure.photographs.segmentation import Segmentation, segment
from repose.measure.pile import measure_segmented, with_response
from repose.measure.results import Measurement
from repose.measure.settings import MeasureSettings

# Ends of a nearly level line may lie beyond the coordinates that OpenCV draws.
LARGEST_COORDINATE = 1e6  # pixels
# Colours, BGR
RED = (40, 40, 230)
GREEN = (60, 170, 40)
YELLOW = (0, 200, 255)
BLUE = (220, 120, 20)


def overlay(image: np.ndarray, measurement: Measurement) -> np.ndarray:
    """Draw a measurement into its picture, as in Figure 6 of the paper.

    The boundary is yellow, the left line red, the right line green, base and Height are
    blue.

    Parameters
    ----------
    image : ndarray
        The measured picture, (H, W) or BGR (H, W, 3).
    measurement : Measurement
        Its result.

    Returns
    -------
    ndarray
        The picture (H, W, 3), BGR.
    """
    picture, thickness = _outlined(image, measurement.contour)
    right_end = picture.shape[1] - 1
    base = measurement.base_row
    column, top = measurement.top
    base_line = base - thickness / 2
    draw_line(picture, (0, base_line), (right_end, base_line), BLUE, thickness)
    draw_line(picture, (column, base), (column, top), BLUE, thickness)
    bar = 12 * thickness
    draw_line(picture, (column - bar, top), (column + bar, top), BLUE, thickness)
    left_line, right_line = measurement.angle.lines
    for (lower_end, upper_end), colour in ((left_line, RED), (right_line, GREEN)):
        draw_line(picture, lower_end, upper_end, colour, 2 * thickness)
    return picture


def overlay_of_refused(image: np.ndarray, pile: Segmentation | None) -> np.ndarray:
    """Draw a refused picture with the base and boundary of what was taken for the pile.

    `pile` is None if nothing was.
    """
    if pile is None:
        no_contour = np.empty((0, 2), int)
        return _outlined(image, no_contour)[0]
    picture, thickness = _outlined(image, pile.contour)
    right_end = picture.shape[1] - 1
    draw_line(picture, (0, pile.base_row), (right_end, pile.base_row), BLUE, thickness)
    return picture


def _outlined(image: np.ndarray, contour: np.ndarray) -> tuple[np.ndarray, int]:
    """Draw a boundary into a copy of the picture, and return it with the line width."""
    if image.ndim == 2:
        picture = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    else:
        picture = image.copy()
    thickness = max(1, round(max(picture.shape) / 500))
    outline = np.zeros(picture.shape[:2], np.uint8)
    outline[contour[:, 1], contour[:, 0]] = 1
    pen = np.ones((thickness, thickness), np.uint8)
    picture[cv2.dilate(outline, pen) > 0] = YELLOW
    return picture, thickness


def draw_line(
    picture: np.ndarray, start: tuple, end: tuple, colour: tuple, thickness: int
) -> None:
    """Draw a smooth line between two points (column, row), also between pixels."""
    cv2.line(
        picture,
        _fixed_point(start),
        _fixed_point(end),
        colour,
        thickness,
        cv2.LINE_AA,
        shift=8,
    )


def _fixed_point(point: tuple) -> tuple[int, ...]:
    """Write a point in OpenCV's whole numbers of 1/256 pixel."""
    limit = LARGEST_COORDINATE
    return tuple(round(256 * min(max(value, -limit), limit)) for value in point)


def process_panels(
    image: np.ndarray,
    mm_per_pixel: float,
    settings: MeasureSettings | None = None,
    *,
    base_row: float | None = None,
) -> dict[str, np.ndarray]:
    """Draw the steps of the measurement of a picture.

    Returns
    -------
    dict
        In this order ``grey``, ``binary``, ``edge`` and ``boundary`` (the overlay).
    """
    settings = settings or MeasureSettings.with_defaults()
    settings = settings.with_scale(mm_per_pixel)
    pile = segment(image, settings.largest_pile_only, base_row)
    measurement = with_response(measure_segmented(pile, settings))
    binary = pile.mask * np.uint8(255)
    return {
        "grey": pile.grey,
        "binary": binary,
        "edge": cv2.Canny(binary, 50, 150),
        "boundary": overlay(image, measurement),
    }
