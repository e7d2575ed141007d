"""Pictures of the measurement: boundary, lines and Height, drawn into the measured picture (Figure 6)."""

from dataclasses import replace

import cv2
import numpy as np

from repose.measure.photographs.segmentation import Segmentation, segment
from repose.measure.pile import (
    Measurement,
    MeasureSettings,
    measure_segmented,
    with_response,
)

FAR = 1e6  # pixels: the ends of a nearly level line lie beyond what OpenCV draws
RED, GREEN, YELLOW, BLUE = (
    (40, 40, 230),
    (60, 170, 40),
    (0, 200, 255),
    (220, 120, 20),
)  # BGR


def overlay(image: np.ndarray, measurement: Measurement) -> np.ndarray:
    """Draw boundary, left line red, right line green, base and Height into the picture, as in Figure 6; BGR."""
    picture, thick = _outlined(image, measurement.contour)
    right_end, base = picture.shape[1] - 1, measurement.base_row
    column, top = measurement.top
    draw_line(
        picture, (0, base - thick / 2), (right_end, base - thick / 2), BLUE, thick
    )
    draw_line(picture, (column, base), (column, top), BLUE, thick)
    draw_line(
        picture, (column - 12 * thick, top), (column + 12 * thick, top), BLUE, thick
    )
    for (below, above), colour in zip(
        measurement.angle.lines, (RED, GREEN), strict=True
    ):
        draw_line(picture, below, above, colour, 2 * thick)
    return picture


def overlay_of_refused(image: np.ndarray, pile: Segmentation | None) -> np.ndarray:
    """Draw the refused picture with base and boundary of the part taken for the pile; None: no part was found."""
    if pile is None:
        return _outlined(image, np.empty((0, 2), int))[0]
    picture, thick = _outlined(image, pile.contour)
    draw_line(
        picture, (0, pile.base_row), (picture.shape[1] - 1, pile.base_row), BLUE, thick
    )
    return picture


def _outlined(image: np.ndarray, contour: np.ndarray) -> tuple[np.ndarray, int]:
    """Draw a boundary into a copy of the picture in colours; also return the thickness of its lines."""
    picture = (
        cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    )
    thick = max(1, round(max(picture.shape) / 500))
    outline = np.zeros(picture.shape[:2], np.uint8)
    outline[contour[:, 1], contour[:, 0]] = 1
    picture[cv2.dilate(outline, np.ones((thick, thick), np.uint8)) > 0] = YELLOW
    return picture, thick


def draw_line(
    picture: np.ndarray, start: tuple, end: tuple, colour: tuple, thickness: int
) -> None:
    """Draw a smooth line between sub-pixel points (column, row) into the picture; colours are BGR."""
    a, b = (
        tuple(round(256 * min(max(value, -FAR), FAR)) for value in point)
        for point in (start, end)
    )
    cv2.line(picture, a, b, colour, thickness, cv2.LINE_AA, 8)


def process_panels(
    image: np.ndarray,
    mm_per_pixel: float,
    settings: MeasureSettings | None = None,
    *,
    base_row: float | None = None,
) -> dict[str, np.ndarray]:
    """Draw the method's steps, in order: ``grey``, ``binary``, ``edge`` and ``boundary``, the overlay."""
    settings = replace(settings or MeasureSettings(), mm_per_pixel=mm_per_pixel)
    pile = segment(image, settings.largest_pile_only, base_row)
    measurement = with_response(measure_segmented(pile, settings))
    binary = pile.mask * np.uint8(255)
    edge = cv2.Canny(binary, 50, 150)
    return {
        "grey": pile.grey,
        "binary": binary,
        "edge": edge,
        "boundary": overlay(image, measurement),
    }
