"""Find and draw the printed sheet, which gives a photograph scale, tilt and lens.

The sheet is a target for calibrating cameras: a chessboard with markers (ChArUco) and a
white margin. It stands upright with its lower edge on the plate, in the plane of the
pile's crest, and faces the camera. Positions on it are (x, z) in millimetres from the
lower left corner of its margin.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

SQUARE_MM = 20.0
COLUMNS = 6
ROWS = 8
MARKER_FRACTION = 0.75  # side of a marker over the side of a square
MARGIN_FRACTION = 0.5  # width of the white margin over the side of a square
MIN_CORNERS = 8  # fewest corners from which the pose of a camera is computed
# The corners found must extend over this number of squares in width and in height.
MIN_SPAN_SQUARES = 2
PAGE_MM = (210.0, 297.0)  # A4
MM_PER_INCH = 25.4
WHITE = 255

# Layout of the page: distances in mm from its lower edge
SHEET_BOTTOM_MM = 60.0
CUTTING_TEXT_MM = 54.0
CHECK_TEXT_MM = 43.0
CHECK_LINE_MM = 40.0
TITLE_ABOVE_SHEET_MM = 4.0  # from the upper edge of the sheet
# Length of the check line, which shows whether the printer has scaled the page
CHECK_MM = 100.0


@dataclass(frozen=True)
class SheetCorners:
    """Corners of squares of the sheet, found in one photograph."""

    positions_mm: np.ndarray  # (N, 2), x and z on the sheet
    pixels: np.ndarray  # (N, 2), column and row of the same corners
    square_mm: float = SQUARE_MM

    @property
    def object_points_mm(self) -> np.ndarray:
        """The corners (N, 3) as OpenCV expects them, with 0 as the third coordinate."""
        third = np.zeros(len(self.positions_mm))
        return np.column_stack([self.positions_mm, third])


def compute_size_mm(square_mm: float = SQUARE_MM) -> tuple[float, float]:
    """Compute width and height of the cut-out sheet from the side of its squares."""
    width = (COLUMNS + 2 * MARGIN_FRACTION) * square_mm
    height = (ROWS + 2 * MARGIN_FRACTION) * square_mm
    return width, height


def find_sheet(image: np.ndarray, square_mm: float = SQUARE_MM) -> SheetCorners | None:
    """Find the sheet in a photograph.

    Parameters
    ----------
    image : ndarray
        The photograph (H, W, 3), BGR, or (H, W).
    square_mm : float
        Side of a printed square.

    Returns
    -------
    SheetCorners or None
        The visible corners of squares. None if there are fewer than `MIN_CORNERS`, or
        if they lie close to one row or one column of the board.
    """
    board = _make_board(square_mm)
    parameters = cv2.aruco.CharucoParameters()
    # With this check, OpenCV would reject the whole board if it mistook a pattern in
    # the background for a marker. Wrong corners are detected later, from the camera's
    # pose.
    parameters.checkMarkers = False
    detector = cv2.aruco.CharucoDetector(board, parameters)
    corners, indices = detector.detectBoard(image)[:2]
    if indices is None or len(indices) < MIN_CORNERS:
        return None
    board_corners = np.asarray(board.getChessboardCorners())[indices.ravel(), :2]
    # Corners in one row or column would not determine the pose of the camera.
    width_and_height = np.ptp(board_corners, axis=0)
    if width_and_height.min() < MIN_SPAN_SQUARES * square_mm:
        return None
    # Convert positions on the board, whose y points down from its upper left corner, to
    # those on the sheet, whose z points up from the lower left corner of its margin.
    margin = MARGIN_FRACTION * square_mm
    x = margin + board_corners[:, 0]
    z = margin + ROWS * square_mm - board_corners[:, 1]
    pixels = corners.reshape(-1, 2).astype(float)
    return SheetCorners(np.column_stack([x, z]), pixels, square_mm)


def draw_sheet(square_mm: float = SQUARE_MM, pixels_per_mm: int = 8) -> np.ndarray:
    """Draw the sheet, with the white margin around its squares, as a grey picture.

    Parameters
    ----------
    square_mm : float
        Side of a square.
    pixels_per_mm : int
        Resolution of the picture.

    Returns
    -------
    ndarray
        The picture (H, W), uint8.
    """
    # The size includes the margin. The board fills the rest, and OpenCV draws it
    # without a margin of its own.
    width_mm, height_mm = compute_size_mm(square_mm)
    width_px = round(width_mm * pixels_per_mm)
    height_px = round(height_mm * pixels_per_mm)
    margin_px = round(MARGIN_FRACTION * square_mm * pixels_per_mm)
    board_size = (width_px - 2 * margin_px, height_px - 2 * margin_px)
    board = _make_board(square_mm).generateImage(board_size)
    return np.pad(board, margin_px, constant_values=WHITE)


def make_pdf(square_mm: float = SQUARE_MM) -> bytes:
    """Draw the sheet as a PDF page (A4) with a cutting line and a line of known length.

    Parameters
    ----------
    square_mm : float
        Side of a square. Squares of up to 25 mm fit on the page.

    Returns
    -------
    bytes
        The contents of the file.
    """
    import io

    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    page_width, page_height = PAGE_MM
    width, height = compute_size_mm(square_mm)
    left = (page_width - width) / 2
    top = SHEET_BOTTOM_MM + height

    # Use axes whose coordinates are millimetres of the page.
    figure = Figure(figsize=(page_width / MM_PER_INCH, page_height / MM_PER_INCH))
    axes: Any = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")

    # Draw the sheet itself.
    axes.imshow(
        draw_sheet(square_mm),
        extent=(left, left + width, SHEET_BOTTOM_MM, top),
        cmap="gray",
        vmin=0,
        vmax=255,
        interpolation="none",
        aspect="auto",
    )
    cutting_line = Rectangle(
        (left, SHEET_BOTTOM_MM),
        width,
        height,
        fill=False,
        linewidth=0.3,
        edgecolor="0.5",
    )
    axes.add_patch(cutting_line)
    axes.set(xlim=(0, page_width), ylim=(0, page_height))

    # Draw the line of known length.
    middle = page_width / 2
    ends = [middle - CHECK_MM / 2, middle + CHECK_MM / 2]
    axes.plot(ends, [CHECK_LINE_MM, CHECK_LINE_MM], "k|-", linewidth=0.7)

    # Write the instructions.
    def write(text: str, height_on_page: float) -> None:
        axes.text(middle, height_on_page, text, ha="center", fontsize=8)

    write(
        f"{CHECK_MM:g} mm: check this line with a ruler. If its length is different, "
        "print at 100 % or give --square-mm",
        CHECK_TEXT_MM,
    )
    write(
        "cut along this line: this edge stands on the plate, beside the pile, level "
        "with its crest",
        CUTTING_TEXT_MM,
    )
    write(
        f"repose: squares of {square_mm:g} mm; glue the sheet to a flat board",
        top + TITLE_ABOVE_SHEET_MM,
    )

    # Without a date in it, the file is the same in each call.
    stream = io.BytesIO()
    figure.savefig(stream, format="pdf", metadata={"CreationDate": None})
    return stream.getvalue()


def _make_board(square_mm: float) -> cv2.aruco.CharucoBoard:
    """Make OpenCV's model of the chessboard with markers."""
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    marker_mm = MARKER_FRACTION * square_mm
    return cv2.aruco.CharucoBoard((COLUMNS, ROWS), square_mm, marker_mm, markers)
