"""Split a picture into pile and background, with an accuracy of a fraction of a pixel.

Rows are counted downwards from the top of the picture. As in OpenCV, the centre of a
pixel has integer coordinates.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from repose.common.errors import InputError, NoFlankError

# Simulations run in parallel, one on each core, so threads of OpenCV would only compete
# with them.
cv2.setNumThreads(1)

MIN_SIDE_PX = 20  # smallest height and width of a picture
MIN_PEAK = 8  # smallest contrast, in tones, that a pile must reach somewhere
BORDER_FRACTION = 0.03  # width of the border strip over the picture's shorter side
SECOND_PILE_FRACTION = 0.4  # height of a second pile over that of the largest part
# Largest height of a pile's centroid above its lowest row, over the height of the pile.
# It is 0.5 for a rectangle, and 1/3 for a triangle that stands on a side.
HIGHEST_CENTROID = 0.55
SMALLEST_PART = 0.01  # area of a part of the pile over that of the largest part
# A plate covers more than the first fraction of a row. In the row that lies
# `ROWS_ABOVE_PLATE` rows above the plate, less than the second fraction is covered.
PLATE_FRACTION = 0.97
ROWS_ABOVE_PLATE = 4
FRACTION_ABOVE_PLATE = 0.9
# Largest difference between the lowest rows of a second pile and of the largest part,
# over the height of the largest part
LARGEST_BASE_DIFFERENCE = 0.1
# A plate reaches into the first and into the last columns of a picture, this number of
# columns on each side.
EDGE_COLUMNS = 3

# The background is fitted several times, each time without the outliers of the previous
# fit.
N_BACKGROUND_FITS = 4
OUTLIER_DEVIATIONS = 3.0  # distance of an outlier, in standard deviations
SMALLEST_OUTLIER_TONES = 2.0  # a pixel closer to the background is never an outlier
# Standard deviation over the median of the absolute deviations, in a normal
# distribution
SD_OVER_MEDIAN_DEVIATION = 1.4826


@dataclass(frozen=True)
class Segmentation:
    """A picture split into pile and background."""

    grey: np.ndarray  # uint8 (H, W)
    contrast: np.ndarray  # float32 (H, W), difference from the background
    level: float  # the contrast at which the pile begins
    mask: np.ndarray  # uint8 (H, W), 1 in the pile and in its holes, 0 in the plate
    base_row: float  # row of the pile's lower edge
    is_darker: bool  # whether the pile is darker than the background
    has_neighbour: bool = False  # whether another pile stands beside it

    @property
    def contour(self) -> np.ndarray:
        """Column and row (M, 2) of the pixels on the pile's boundary."""
        return np.concatenate(_find_contours(self.mask))[:, 0, :]


def segment(
    image: np.ndarray, largest_pile_only: bool = True, base_row: float | None = None
) -> Segmentation:
    """Split a picture into pile and background.

    The upper edge of the picture and both sides must show background. The pile may be
    darker or brighter than the background, or have another colour. A pixel belongs to
    the pile if it differs from the background by more than Otsu's threshold. Holes in
    the pile, such as highlights, are filled.

    The picture is smoothed first. The background may vary smoothly over the picture, as
    it does in uneven light. A picture with only two tones, such as a silhouette, is not
    smoothed, because this would round the corners of the pile.

    Parameters
    ----------
    image : ndarray
        The picture, uint8: BGR (H, W, 3) or grey (H, W).
    largest_pile_only : bool
        Whether only the largest part counts as the pile, without loose grains.
    base_row : float, optional
        Row of the plate. By default, `find_plate_row` looks for a plate. If there is
        none, the base is the lowest row of the pile.

    Returns
    -------
    Segmentation
        The pile in the picture.

    Raises
    ------
    NoFlankError
        If the picture shows no pile.
    InputError
        If the picture is unusable, or if `base_row` lies outside it.
    """
    picture = prepare_picture(image)
    # The contrast is the difference of each pixel from the background. The mask has the
    # pixels whose contrast is above the level.
    contrast, level, mask = _separate_from_background(picture)

    # Leave out the plate, if its row is given or can be found. This must come first,
    # because a plate would connect the parts of the mask.
    plate_row = find_plate_row(mask) if base_row is None else base_row
    if plate_row is not None:
        mask = _cut_off_plate(mask, plate_row)

    # Select the pile among the parts of the mask.
    has_neighbour = largest_pile_only and has_second_pile(mask)
    pile_mask = pile_component(mask, largest_pile_only)
    if plate_row is None:
        lower_edge_row = find_lower_edge(pile_mask, contrast, level)
    else:
        lower_edge_row = plate_row

    grey = picture
    if picture.ndim == 3:
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    pile_tone = cv2.mean(grey, pile_mask)[0]
    background_tone = grey[mark_border(grey.shape)].mean()
    return Segmentation(
        grey=grey,
        contrast=contrast,
        level=level,
        mask=pile_mask,
        base_row=float(lower_edge_row),
        is_darker=bool(pile_tone < background_tone),
        has_neighbour=has_neighbour,
    )


def _separate_from_background(
    picture: np.ndarray,
) -> tuple[np.ndarray, float, np.ndarray]:
    """Find the pixels that differ from the background.

    Parameters
    ----------
    picture : ndarray
        The picture, uint8: BGR (H, W, 3) or grey (H, W).

    Returns
    -------
    contrast : ndarray
        Difference (H, W) of each pixel from the background, in tones.
    level : float
        The contrast above which a pixel belongs to the pile or to another object.
    mask : ndarray
        Mask (H, W), uint8, of these pixels.
    """
    # A silhouette has only two tones, and is not smoothed.
    if picture.ndim == 2:
        two_tone_contrast = compute_two_tone_contrast(picture)
        if two_tone_contrast is not None:
            level, mask = threshold(two_tone_contrast)
            return two_tone_contrast, level, mask

    # Remove the noise of single pixels before comparing them with the background.
    smooth = cv2.GaussianBlur(cv2.medianBlur(picture, 3), (0, 0), 1.0)
    contrast = compute_background_contrast(smooth)
    level, mask = threshold(contrast)
    # Close gaps of a pixel between grains.
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return contrast, level, closed


def _cut_off_plate(mask: np.ndarray, plate_row: float) -> np.ndarray:
    """Return a copy of a mask (H, W) without the plate and everything below it.

    Raises InputError if the row of the plate lies outside the picture.
    """
    n_rows = len(mask)
    if not 0 < plate_row <= n_rows:
        raise InputError(
            "picture",
            key="base_row",
            value=plate_row,
            allowed=f"above 0, at most {n_rows}",
        )
    above_plate = mask.copy()
    above_plate[math.ceil(plate_row) :] = 0
    return above_plate


def segment_silhouette(
    picture: np.ndarray, pile_tone: int, background: int, largest_only: bool
) -> Segmentation:
    """Split the silhouette of a simulated pile, whose two tones and base are known.

    This is faster than `segment`, and the result is the same to the last bit.

    Parameters
    ----------
    picture : ndarray
        The picture (H, W), uint8; its lower border is the plate.
    pile_tone, background : int
        The tones of the pile and of the background.
    largest_only : bool
        Whether only the largest part counts as the pile, without loose grains.

    Returns
    -------
    Segmentation
        The pile in the picture.
    """
    is_pile = (picture == pile_tone).view(np.uint8)
    contrast = is_pile * np.float32(abs(background - pile_tone))
    # Compute the level half-way between the two tones with the same rounding as in
    # `threshold`, where OpenCV computes a mean as the sum times 1 / count.
    count = cv2.countNonZero(is_pile)
    level = 0.5 * (255.0 * count * (1.0 / count)) * float(contrast.max()) / 255.0
    return Segmentation(
        grey=picture,
        contrast=contrast,
        level=level,
        mask=pile_component(is_pile, largest_only),
        base_row=picture.shape[0] - 0.5,
        is_darker=pile_tone < background,
    )


def prepare_picture(image: np.ndarray) -> np.ndarray:
    """Check a picture, and return it in contiguous memory, as OpenCV requires.

    Parameters
    ----------
    image : ndarray
        The picture, (H, W, 3) or (H, W).

    Returns
    -------
    ndarray
        The picture. If its three channels are equal, it is grey and has the shape (H,
        W).

    Raises
    ------
    InputError
        If the picture is unusable.
    """
    image = np.asarray(image)
    if image.dtype != np.uint8:
        raise InputError(
            "picture", key="pixel type", value=str(image.dtype), allowed="uint8"
        )
    is_picture = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    if not is_picture or min(image.shape[:2]) < MIN_SIDE_PX:
        raise InputError(
            "picture",
            key="shape",
            value=image.shape,
            allowed=f"(H, W) or (H, W, 3), at least {MIN_SIDE_PX} by {MIN_SIDE_PX} pixels",
        )
    if image.ndim == 3 and (image == image[..., :1]).all():
        image = image[..., 0]
    return np.ascontiguousarray(image)


def mark_border(shape: tuple[int, ...]) -> np.ndarray:
    """Mark the strip of a picture that shows background: the upper edge and both sides.

    Parameters
    ----------
    shape : tuple of int
        Shape of the picture, (H, W) or (H, W, 3).

    Returns
    -------
    ndarray
        Mask (H, W) of the strip.
    """
    width = max(2, round(BORDER_FRACTION * min(shape)))
    strip = np.zeros(shape[:2], dtype=bool)
    strip[:width] = True
    strip[:, :width] = True
    strip[:, -width:] = True
    return strip


def compute_two_tone_contrast(grey: np.ndarray) -> np.ndarray | None:
    """Compute how much pixels differ from the background in a picture of two tones.

    Parameters
    ----------
    grey : ndarray
        The picture (H, W).

    Returns
    -------
    ndarray or None
        Differences (H, W) in tones, or None if the picture has more than two tones.
    """
    if not ((grey == grey.min()) | (grey == grey.max())).all():
        return None
    # The background has the tone that is most frequent in the border strip.
    background = np.bincount(grey[mark_border(grey.shape)], minlength=256).argmax()
    return cv2.absdiff(grey, np.full_like(grey, background)).astype(np.float32)


def compute_background_contrast(image: np.ndarray) -> np.ndarray:
    """Compute how much each pixel differs in tone from a smooth background.

    The background of each channel is a quadratic surface over the picture, fitted to
    the border strip.

    Parameters
    ----------
    image : ndarray
        The picture (H, W, 3) or (H, W).

    Returns
    -------
    ndarray
        Distances (H, W) in tones: the root of the sum of squares over all channels.
    """
    # Coordinates go from -1 to 1 over the picture, so that all terms have a similar
    # magnitude.
    n_rows, n_columns = image.shape[:2]
    y = np.linspace(-1, 1, n_rows, dtype=np.float32)[:, None]
    x = np.linspace(-1, 1, n_columns, dtype=np.float32)
    is_strip = mark_border(image.shape)
    strip_rows, strip_columns = is_strip.nonzero()
    strip_terms = _compute_quadratic_terms(x[strip_columns], y[strip_rows, 0])

    # Add up the squared distances of all channels from their surfaces.
    squared_distance = np.zeros((n_rows, n_columns), np.float32)
    for channel in image.reshape(n_rows, n_columns, -1).transpose(2, 0, 1):
        strip_tones = channel[is_strip].astype(float)
        coefficients = _fit_without_outliers(strip_terms, strip_tones)
        # Compute the surface at all pixels. Sums over one row and one column are much
        # faster than the terms of each pixel. The coefficients have the order of
        # `_compute_quadratic_terms`.
        constant, x1, x2, y1, y2, xy = coefficients.astype(np.float32)
        along_row = constant + x1 * x + x2 * x * x
        along_column = y1 * y + y2 * y * y
        surface = along_row + along_column + xy * y * x
        squared_distance += (channel - surface) ** 2
    return np.sqrt(squared_distance)


def _compute_quadratic_terms(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Compute the terms (N, 6) of a quadratic surface at N points (x, y).

    The terms are 1, x, x², y, y² and xy. `compute_background_contrast` depends on this
    order.
    """
    terms = (np.ones_like(x), x, x**2, y, y**2, x * y)
    return np.stack(terms, axis=1).astype(float)


def _fit_without_outliers(terms: np.ndarray, tones: np.ndarray) -> np.ndarray:
    """Fit the coefficients of a surface to the tones (grey values) of the border strip.

    A plate or a loose grain covers only a small part of the strip. Its pixels are
    outliers, which the fits leave out. The first fit leaves out pixels far from the
    median tone, and each further fit leaves out pixels far from the previous fit.

    Parameters
    ----------
    terms : ndarray
        Terms (N, K) of the surface at the pixels of the strip.
    tones : ndarray
        Tones (N,) of these pixels.

    Returns
    -------
    ndarray
        The coefficients (K,).
    """
    surface = np.full(tones.size, np.median(tones))
    for _ in range(N_BACKGROUND_FITS):
        distances = np.abs(tones - surface)
        standard_deviation = SD_OVER_MEDIAN_DEVIATION * np.median(distances)
        limit = max(OUTLIER_DEVIATIONS * standard_deviation, SMALLEST_OUTLIER_TONES)
        is_kept = distances <= limit
        coefficients, *_ = np.linalg.lstsq(terms[is_kept], tones[is_kept], rcond=None)
        surface = terms @ coefficients
    return coefficients


def threshold(contrast: np.ndarray) -> tuple[float, np.ndarray]:
    """Find Otsu's threshold for a contrast, and the pixels above this threshold.

    Parameters
    ----------
    contrast : ndarray
        Difference (H, W) of a picture from its background.

    Returns
    -------
    level : float
        The threshold: the contrast that separates pile and background.
    mask : ndarray
        Mask (H, W) of the pixels above it, uint8.

    Raises
    ------
    NoFlankError
        If nothing in the picture stands out from the background.

    References
    ----------
    Otsu, N. (1979). IEEE Trans. Syst. Man Cybern. 9, 62-66.
    """
    peak = float(contrast.max())
    if peak < MIN_PEAK:
        raise NoFlankError("nothing in the picture differs from its background")
    # OpenCV finds Otsu's level only among the whole numbers up to 255.
    scaled = cv2.convertScaleAbs(contrast, alpha=255.0 / peak)
    _, binary = cv2.threshold(scaled, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    # If the histogram has a gap, all levels in the gap split the pixels in the same
    # way, and OpenCV returns the lowest of them. The edge would then lie up to half a
    # pixel too far out. Use the middle between the means of the two classes instead.
    lower_mean = cv2.mean(scaled, mask=1 - binary)[0]
    upper_mean = cv2.mean(scaled, mask=binary)[0]
    scaled_level = (lower_mean + upper_mean) / 2
    # The scaled contrasts are whole numbers. Such a number is above the level exactly
    # if it is above its whole part.
    _, mask = cv2.threshold(scaled, math.floor(scaled_level), 1, cv2.THRESH_BINARY)
    return scaled_level * peak / 255.0, mask


def find_plate_row(mask: np.ndarray) -> float | None:
    """Find the upper edge of a plate that is as dark or bright as the pile.

    Such a plate is a part of the mask. It extends from the left border of the picture
    to the right one, and a few rows above it the mask is clearly narrower. If a pile
    extends beyond both sides of the picture, its foot is not mistaken for a plate,
    because the pile becomes narrower only slowly.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of pile and plate, 0 or 1.

    Returns
    -------
    float or None
        The edge between the highest row of the plate and the row above it, which lies
        half a pixel above the centre of the former; None if there is no plate.
    """
    covered_fraction = mask.mean(axis=1)
    reaches_left = mask[:, :EDGE_COLUMNS].any(axis=1)
    reaches_right = mask[:, -EDGE_COLUMNS:].any(axis=1)
    is_across = reaches_left & reaches_right & (covered_fraction > PLATE_FRACTION)
    if not is_across.any():
        return None
    first_row = int(is_across.argmax())
    row_above = first_row - ROWS_ABOVE_PLATE
    if row_above < 0 or covered_fraction[row_above] >= FRACTION_ABOVE_PLATE:
        return None
    return first_row - 0.5


def pile_component(mask: np.ndarray, largest_only: bool) -> np.ndarray:
    """Select the pile among the parts of a mask, and fill its holes.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W), uint8, of everything that differs from the background.
    largest_only : bool
        Whether only the largest part counts as the pile. Otherwise, the pile consists
        of all parts whose area is at least the fraction `SMALLEST_PART` of the largest.

    Returns
    -------
    ndarray
        Mask (H, W), uint8, of the pile.

    Raises
    ------
    NoFlankError
        If the mask is empty.
    """
    contours = _find_contours(mask)
    if not contours:
        raise NoFlankError("the picture shows no pile above its base")
    areas = np.array([cv2.contourArea(contour) for contour in contours])
    if largest_only:
        selected = [contours[int(areas.argmax())]]
    else:
        is_large = areas >= SMALLEST_PART * areas.max()
        selected = [contours[index] for index in np.flatnonzero(is_large).tolist()]
    # Fill the outer boundary of each part, which also fills its holes.
    filled = np.zeros_like(mask)
    cv2.drawContours(filled, selected, -1, 1, cv2.FILLED)
    return filled


def _find_contours(mask: np.ndarray) -> Sequence[np.ndarray]:
    """Find the outer boundary of each part of a mask, as a sequence of pixels."""
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return contours


def has_second_pile(mask: np.ndarray) -> bool:
    """Tell whether a second pile stands beside the largest part of a mask.

    A part counts as a pile if its base is about as low as that of the largest part, if
    it is wider than high, and if its height is at least the fraction
    `SECOND_PILE_FRACTION` of the largest part's height.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W), uint8, of everything that differs from the background.

    Returns
    -------
    bool
        True if there are at least two piles.
    """
    # OpenCV returns the bounding box and the area of each part.
    _, _, statistics, _ = cv2.connectedComponentsWithStats(mask)
    parts = statistics[1:]  # without the background
    if len(parts) < 2:
        return False
    _, tops, widths, heights, areas = parts.T
    largest = int(areas.argmax())
    bottoms = tops + heights  # rows count downwards
    base_difference = np.abs(bottoms - bottoms[largest])
    has_same_base = base_difference <= LARGEST_BASE_DIFFERENCE * heights[largest]
    is_high = heights >= SECOND_PILE_FRACTION * heights[largest]
    is_pile = has_same_base & (widths > heights) & is_high
    # The largest part itself may be one of these piles.
    return bool(is_pile.sum() > 1)


def require_upright(mask: np.ndarray) -> None:
    """Raise NoFlankError if the pile touches the upper border or is upside down.

    The centroid of a pile that widens downwards lies below the middle of its height.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile, which is not empty.
    """
    if mask[0].any():
        raise NoFlankError(
            "the pile runs out of the picture at the top: its crest is not seen"
        )
    rows = np.flatnonzero(mask.any(axis=1))
    top = rows[0]
    bottom = rows[-1]
    row_widths = mask.sum(axis=1, dtype=float)
    centroid_row = np.average(np.arange(len(mask)), weights=row_widths)
    if bottom - centroid_row > HIGHEST_CENTROID * (bottom - top):
        raise NoFlankError(
            "most of the pile lies in its upper half: the picture is upside down, or "
            "shows no pile"
        )


def find_upper_edge(mask: np.ndarray, contrast: np.ndarray, level: float) -> np.ndarray:
    """Find the upper edge of the pile in each column, to a fraction of a pixel.

    The edge is where the contrast, interpolated between the highest pixel of the pile
    and the pixel above it, equals the level.

    Parameters
    ----------
    mask : ndarray
        Mask (H, W) of the pile, uint8 with the values 0 and 1.
    contrast : ndarray
        Contrast (H, W) between the picture and its background.
    level : float
        Contrast at the edge.

    Returns
    -------
    ndarray
        Row (W,) of the edge in each column; NaN in a column without pile.
    """
    # Find the highest pixel of each column. The columns of the transpose lie in
    # contiguous memory, which makes the search three times as fast. The view as bool
    # needs values 0 and 1. In a column without pile, the result is row 0, which is
    # replaced below.
    top_rows = cv2.transpose(mask).view(bool).argmax(axis=1)
    columns = np.arange(mask.shape[1])
    inner_contrast = contrast[top_rows, columns]
    # Above the first row of the picture, the contrast counts as 0.
    rows_above = np.maximum(top_rows - 1, 0)
    outer_contrast = np.where(top_rows > 0, contrast[rows_above, columns], 0.0)
    # Find the distance from the highest pixel up to the edge. If the contrast does not
    # decrease from the inner to the outer pixel, place the edge half-way between them.
    decrease = inner_contrast - outer_contrast
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(decrease > 0, (inner_contrast - level) / decrease, 0.5)
    edge = top_rows - np.clip(distance, 0.0, 1.0)
    has_pile = mask[top_rows, columns] > 0
    return np.where(has_pile, edge, np.nan)


def find_lower_edge(mask: np.ndarray, contrast: np.ndarray, level: float) -> float:
    """Find the row of the pile's lowest point, to a fraction of a pixel.

    If the pile extends beyond the lower border of the picture, this border is returned.
    The parameters are those of `find_upper_edge`.
    """
    n_rows = len(mask)
    if mask[-1].any():
        return n_rows - 0.5
    # The lower edge is the upper edge of the picture upside down.
    edge_from_below = find_upper_edge(mask[::-1], contrast[::-1], level)
    return n_rows - 1 - float(np.nanmin(edge_from_below))
