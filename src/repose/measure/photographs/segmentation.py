"""The boundary between pile and background of a picture, to a fraction of a pixel.

Rows count downwards from the picture's top; a pixel's centre has whole coordinates, as in OpenCV.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from repose.common.errors import NoFlankError, require, require_flank

# Simulations run side by side, one a core: OpenCV's own threads would only compete with them.
cv2.setNumThreads(1)

SMALLEST = 20  # pixels that a picture has at least, each way
SECOND = 0.4  # height of a second heap over that of the highest part
HIGHEST_CENTROID = (
    0.55  # over the base, relative to the height of the pile; a rectangle has 0.5
)


@dataclass(frozen=True)
class Segmentation:
    """A picture split into pile and background."""

    grey: np.ndarray  # uint8 (H, W)
    contrast: (
        np.ndarray
    )  # float32 (H, W), distance of each pixel from the background, in tone or colour
    level: float  # the contrast at which the pile begins (Otsu)
    mask: (
        np.ndarray
    )  # uint8 (H, W), 1 in the pile; holes are filled, the plate is left out
    base_row: float  # row of the pile's lower edge
    pile_is: str  # "darker" or "brighter" than the background
    beside: bool = False  # whether another heap stands beside it

    @property
    def contour(self) -> np.ndarray:
        """Column and row (M, 2) of the pixels on the pile's boundary."""
        return np.concatenate(_contours(self.mask))[:, 0, :]


def segment(
    image: np.ndarray, largest_pile_only: bool = True, base_row: float | None = None
) -> Segmentation:
    """Split a picture, BGR or grey, into pile and background; NoFlankError if the picture shows no pile.

    The border strip (the upper edge and both sides) shows background, from which the pile differs in tone or colour,
    darker or brighter. The background is a quadratic surface for each channel, fitted to that strip with outliers
    trimmed: tilted light and vignetting are removed. Then follow median and Gaussian filters, Otsu's threshold on the
    distance from the background, and the filling of holes (highlights). A picture of two tones needs neither fit nor
    filters, which would round its corners.

    The base is `base_row`, if given. Otherwise rows that are "pile" from border to border are a plate in the fruit's
    tone, and the pile stands on the first of them; without a plate the base is the pile's lowest row.
    """
    image = checked(image)
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    contrast = two_tone_contrast(image) if image.ndim == 2 else None
    noisy = contrast is None
    if contrast is None:
        contrast = background_contrast(
            cv2.GaussianBlur(cv2.medianBlur(image, 3), (0, 0), 1.0)
        )
    level, mask = threshold(contrast)
    if noisy:
        mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    if base_row is None:
        base_row = plate_row(mask)
    if base_row is not None:
        require(
            0 < base_row <= mask.shape[0],
            "picture",
            "base_row",
            base_row,
            f"above 0, at most {mask.shape[0]}",
        )
        mask[math.ceil(base_row) :] = 0
    beside = largest_pile_only and another_heap(mask)
    mask = pile_component(mask, largest_pile_only)
    if base_row is None:
        base_row = lower_edge(mask, contrast, level)
    pile_is = (
        "darker"
        if cv2.mean(grey, mask)[0] < grey[border(grey.shape)].mean()
        else "brighter"
    )
    return Segmentation(grey, contrast, level, mask, float(base_row), pile_is, beside)


def of_silhouette(
    picture: np.ndarray, pile_tone: int, background: int, largest_only: bool
) -> Segmentation:
    """Give what `segment` gives for a simulated pile's picture (H, W): its two tones and its base are known."""
    seen = (picture == pile_tone).view(np.uint8)
    contrast = seen * np.float32(abs(background - pile_tone))
    count = cv2.countNonZero(seen)
    # half-way as `threshold` has it, to the last bit: OpenCV's mean is the sum times 1 / count
    level = 0.5 * (255.0 * count * (1.0 / count)) * float(contrast.max()) / 255.0
    mask = pile_component(seen, largest_only)
    pile_is = "darker" if pile_tone < background else "brighter"
    return Segmentation(picture, contrast, level, mask, picture.shape[0] - 0.5, pile_is)


def checked(image: np.ndarray) -> np.ndarray:
    """Give the picture as contiguous bytes, of one channel if its three are the same; InputError if it is unusable."""
    image = np.asarray(image)
    require(image.dtype == np.uint8, "picture", "pixel type", str(image.dtype), "uint8")
    allowed = f"(H, W) or (H, W, 3), at least {SMALLEST} by {SMALLEST} pixels"
    picture = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    require(
        picture and min(image.shape[:2]) >= SMALLEST,
        "picture",
        "shape",
        image.shape,
        allowed,
    )
    if image.ndim == 3 and (image == image[..., :1]).all():
        image = image[..., 0]
    return np.ascontiguousarray(image)


def border(shape: tuple[int, ...]) -> np.ndarray:
    """Mask (H, W) of the strip that shows background: upper edge and both sides, 3 % of the picture wide."""
    strip = max(2, round(0.03 * min(shape)))
    where = np.zeros(shape[:2], dtype=bool)
    where[:strip] = where[:, :strip] = where[:, -strip:] = True
    return where


def two_tone_contrast(grey: np.ndarray) -> np.ndarray | None:
    """Distance (H, W) from the background's tone in a picture of at most two tones; None for a picture with more."""
    if not ((grey == grey.min()) | (grey == grey.max())).all():
        return None
    background = np.bincount(grey[border(grey.shape)], minlength=256).argmax()
    return cv2.absdiff(grey, np.full_like(grey, background)).astype(np.float32)


def background_contrast(image: np.ndarray) -> np.ndarray:
    """Distance (H, W) in tones from the background surface that is fitted to the border strip."""
    rows, columns = image.shape[:2]
    y, x = (
        np.linspace(-1, 1, rows, dtype=np.float32)[:, None],
        np.linspace(-1, 1, columns, dtype=np.float32),
    )
    where = border(image.shape)
    strip_y, strip_x = y[where.nonzero()[0], 0], x[where.nonzero()[1]]
    terms = (
        np.ones_like(strip_x),
        strip_x,
        strip_x**2,
        strip_y,
        strip_y**2,
        strip_x * strip_y,
    )
    strip_terms = np.stack(terms, axis=1).astype(float)
    squares = np.zeros((rows, columns), np.float32)
    for channel in image.reshape(rows, columns, -1).transpose(2, 0, 1):
        seen = channel[where].astype(float)
        kept = np.ones(seen.size, dtype=bool)
        # A plate or a stray grain in the strip is a minority: start from the median tone, then trim the
        # outliers.
        centre = np.full(seen.size, np.median(seen))
        for _ in range(4):
            miss = np.abs(seen - centre)
            kept = miss <= max(3 * 1.4826 * np.median(miss), 2.0)
            weights = np.linalg.lstsq(strip_terms[kept], seen[kept], rcond=None)[0]
            centre = strip_terms @ weights
        w = weights.astype(np.float32)
        surface = (
            (w[0] + w[1] * x + w[2] * x * x) + (w[3] * y + w[4] * y * y) + w[5] * y * x
        )
        squares += (channel - surface) ** 2
    return np.sqrt(squares)


def threshold(contrast: np.ndarray) -> tuple[float, np.ndarray]:
    """Otsu's level of the contrast, and the mask (H, W) of the pixels above it; NoFlankError without contrast.

    Otsu, N. (1979). IEEE Trans. Syst. Man Cybern. 9, 62-66.
    """
    peak = float(contrast.max())
    require_flank(peak >= 8, "nothing in the picture differs from its background")
    scaled = cv2.convertScaleAbs(contrast, alpha=255.0 / peak)
    binary = cv2.threshold(scaled, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[1]
    # Otsu's optimum lies half-way between the means of its two classes. Where the histogram has a gap every
    # level in it is as good and OpenCV returns the lowest, which would put the sub-pixel edge half a pixel
    # too far out.
    level = (
        cv2.mean(scaled, mask=1 - binary)[0] + cv2.mean(scaled, mask=binary)[0]
    ) / 2
    return level * peak / 255.0, cv2.threshold(
        scaled, math.floor(level), 1, cv2.THRESH_BINARY
    )[1]


def plate_row(mask: np.ndarray) -> float | None:
    """Upper edge, between two rows, of a plate that counts as "pile" from border to border; None without a plate.

    Above a plate the mask narrows abruptly, but not above the foot of a pile that the picture cuts off.
    """
    share = mask.mean(axis=1)
    from_border_to_border = (
        mask[:, :3].any(axis=1) & mask[:, -3:].any(axis=1) & (share > 0.97)
    )
    if not from_border_to_border.any():
        return None
    first = int(from_border_to_border.argmax())
    return first - 0.5 if first >= 4 and share[first - 4] < 0.9 else None


def pile_component(mask: np.ndarray, largest_only: bool) -> np.ndarray:
    """Find the pile of a mask, with holes filled: the largest part, or all parts of at least 1 % of its area."""
    contours = _contours(mask)
    require_flank(contours, "the picture shows no pile above its base")
    areas = np.array([cv2.contourArea(contour) for contour in contours])
    kept = (
        [int(areas.argmax())]
        if largest_only
        else np.flatnonzero(areas >= 0.01 * areas.max()).tolist()
    )
    filled = np.zeros_like(mask)
    cv2.drawContours(filled, [contours[i] for i in kept], -1, 1, cv2.FILLED)
    return filled


def _contours(mask: np.ndarray) -> Sequence[np.ndarray]:
    """Find the outer boundary of each part of a mask, pixel by pixel."""
    return cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]


def another_heap(mask: np.ndarray) -> bool:
    """Whether a part of the mask beside the largest stands as low, is wider than high, and `SECOND` as high."""
    boxes = cv2.connectedComponentsWithStats(mask)[2][1:]
    if len(boxes) < 2:
        return False
    _, tops, wide, high, areas = boxes.T
    k = int(areas.argmax())
    low = np.abs(tops + high - (tops[k] + high[k])) <= 0.1 * high[k]
    return bool((low & (wide > high) & (high >= SECOND * high[k])).sum() > 1)


def require_upright(mask: np.ndarray) -> None:
    """Raise NoFlankError if the pile touches the upper border of the picture, or stands on its top.

    The centroid of a pile that widens downward lies below the middle of its height.
    """
    require_flank(
        not mask[0].any(),
        "the pile runs out of the picture at the top: its crest is not seen",
    )
    rows = np.flatnonzero(mask.any(axis=1))
    centroid = np.average(np.arange(len(mask)), weights=mask.sum(axis=1, dtype=float))
    if (rows[-1] - centroid) > HIGHEST_CENTROID * (rows[-1] - rows[0]):
        raise NoFlankError(
            "most of the pile lies in its upper half: the picture is upside down, or shows no pile"
        )


def upper_edge(mask: np.ndarray, contrast: np.ndarray, level: float) -> np.ndarray:
    """Upper row of the pile in each column (W,), between pixels by linear interpolation; NaN without pile."""
    top = (
        cv2.transpose(mask).view(bool).argmax(axis=1)
    )  # in contiguous memory three times as fast
    column = np.arange(mask.shape[1])
    inner = contrast[top, column]
    outer = np.where(top > 0, contrast[np.maximum(top - 1, 0), column], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.where(inner > outer, (inner - level) / (inner - outer), 0.5)
    return np.where(mask[top, column] > 0, top - np.clip(step, 0.0, 1.0), np.nan)


def lower_edge(mask: np.ndarray, contrast: np.ndarray, level: float) -> float:
    """Row of the pile's lowest point, between pixels; the lower border of a picture that cuts the pile off."""
    if mask[-1].any():
        return mask.shape[0] - 0.5
    return (
        mask.shape[0]
        - 1
        - float(np.nanmin(upper_edge(mask[::-1], contrast[::-1], level)))
    )
