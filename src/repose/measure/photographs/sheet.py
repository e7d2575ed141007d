"""The printed sheet for scale, tilt and lens: chessboard and markers (ChArUco), upright on the plate.

Its lower edge stands on the plate, in the plane of the pile's crest, and its face is towards the camera. Places on it
are (x, z) in millimetres from its lower left corner.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

SQUARE_MM = 20.0
COLUMNS, ROWS = 6, 8
MARKER_SHARE = 0.75  # of a square
MARGIN_SHARE = 0.5  # white around the board, of a square
MIN_CORNERS = 8
PAGE_MM = (210.0, 297.0)  # A4
CHECK_MM = 100.0  # length of the line that shows whether the printer scaled the page


@dataclass(frozen=True)
class Seen:
    """Corners of squares of the sheet, found in one photograph."""

    places_mm: (
        np.ndarray
    )  # (N, 2), x to the right and z up, from the lower left corner of the sheet
    pixels: np.ndarray  # (N, 2), column and row of the same corners
    square_mm: float = SQUARE_MM

    @property
    def flat_mm(self) -> np.ndarray:
        """The corners in the plane of the sheet, (N, 3), with the third coordinate 0."""
        return np.column_stack([self.places_mm, np.zeros(len(self.places_mm))])


def size_mm(square_mm: float = SQUARE_MM) -> tuple[float, float]:
    """Width and height of the sheet, cut out; `square_mm` is the side of a square as printed."""
    return (COLUMNS + 2 * MARGIN_SHARE) * square_mm, (
        ROWS + 2 * MARGIN_SHARE
    ) * square_mm


def find(image: np.ndarray, square_mm: float = SQUARE_MM) -> Seen | None:
    """Find the sheet in a photograph; None if fewer than 8 corners are seen, or all of them in one line."""
    choices = cv2.aruco.CharucoParameters()
    # One pattern of the background taken for a marker would refuse the whole board; the pose detects a wrong corner.
    choices.checkMarkers = False
    corners, numbers = cv2.aruco.CharucoDetector(
        _board(square_mm), choices
    ).detectBoard(image)[:2]
    if numbers is None or len(numbers) < MIN_CORNERS:
        return None
    on_board = np.asarray(_board(square_mm).getChessboardCorners())[numbers.ravel(), :2]
    if np.ptp(on_board, axis=0).min() < 2 * square_mm:
        return None
    margin = MARGIN_SHARE * square_mm
    places = np.column_stack(
        [margin + on_board[:, 0], margin + ROWS * square_mm - on_board[:, 1]]
    )
    return Seen(places, corners.reshape(-1, 2).astype(float), square_mm)


def drawing(
    square_mm: float = SQUARE_MM, pixels_per_mm: int = 8
) -> tuple[np.ndarray, int]:
    """Draw the sheet as a grey picture (H, W), white margin included, and its pixels per mm."""
    width, height = (round(side * pixels_per_mm) for side in size_mm(square_mm))
    margin = round(MARGIN_SHARE * square_mm * pixels_per_mm)
    picture = np.full((height, width), 255, np.uint8)
    inner = (width - 2 * margin, height - 2 * margin)
    picture[margin : height - margin, margin : width - margin] = _board(
        square_mm
    ).generateImage(inner)
    return picture, pixels_per_mm


def pdf(square_mm: float = SQUARE_MM) -> bytes:
    """Draw the sheet as a PDF on A4, with a cutting line and a line of known length; squares up to 25 mm fit."""
    import io

    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    wide, high = size_mm(square_mm)
    left, bottom = (PAGE_MM[0] - wide) / 2, 60.0
    figure = Figure(figsize=(PAGE_MM[0] / 25.4, PAGE_MM[1] / 25.4))
    axes: Any = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    extent = (left, left + wide, bottom, bottom + high)
    look: Any = {
        "cmap": "gray",
        "vmin": 0,
        "vmax": 255,
        "interpolation": "none",
        "aspect": "auto",
    }
    axes.imshow(drawing(square_mm)[0], extent=extent, **look)
    axes.add_patch(
        Rectangle(
            (left, bottom), wide, high, fill=False, linewidth=0.3, edgecolor="0.5"
        )
    )
    axes.set(xlim=(0, PAGE_MM[0]), ylim=(0, PAGE_MM[1]))
    middle = PAGE_MM[0] / 2
    axes.plot(
        [middle - CHECK_MM / 2, middle + CHECK_MM / 2], [40, 40], "k|-", linewidth=0.7
    )
    text = (
        (
            43,
            f"{CHECK_MM:g} mm: check with a ruler. If it is not, print at 100 % or give --square-mm",
        ),
        (
            54,
            "cut along this line: this edge stands on the plate, beside the pile, level with its crest",
        ),
        (
            bottom + high + 4,
            f"repose: squares of {square_mm:g} mm; glue it to a flat board",
        ),
    )
    for height, words in text:
        axes.text(middle, height, words, ha="center", fontsize=8)
    stream = io.BytesIO()
    figure.savefig(stream, format="pdf", metadata={"CreationDate": None})
    return stream.getvalue()


def _board(square_mm: float) -> cv2.aruco.CharucoBoard:
    """Make OpenCV's board."""
    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return cv2.aruco.CharucoBoard(
        (COLUMNS, ROWS), square_mm, MARKER_SHARE * square_mm, words
    )
