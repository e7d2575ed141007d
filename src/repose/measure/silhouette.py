"""Where a pile ends and the background begins: projected from simulated bodies, or segmented from a picture.

Both give the same thing to `repose.measure.pile`: which pixels are pile, to a fraction of a pixel. Rows count
downwards from the picture's top; a pixel's centre has whole coordinates, as in OpenCV.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import ArrayLike

from repose.core.errors import InputError, NoFlankError
from repose.dem.rotations import rotation_matrices

# Simulations run side by side, one a core: OpenCV's own threads would only fight over them.
cv2.setNumThreads(1)

OUTLINE_DIRECTIONS = 64  # a berry's outline as a polygon: at most 0.03 mm inside the smooth one
SUBPIXEL_BITS = 8
MARGIN_PX = 8
PILE_TONE, BACKGROUND_TONE = 40, 255
Extent = tuple[float, float, float]


class ConvexBody(Protocol):
    """A body by its support points; a body that is made of spheres also has `spheres_m`, (M, 4)."""

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Touching points (..., 3) in m for unit vectors (..., 3) in the body frame."""
        ...


@dataclass(frozen=True)
class Segmentation:
    """A picture split into pile and background.

    Attributes
    ----------
    grey : numpy.ndarray of uint8, (H, W)
    contrast : numpy.ndarray of float32, (H, W)
        Distance of each pixel from the background, in tone or colour.
    level : float
        The contrast at which the pile begins (Otsu).
    mask : numpy.ndarray of uint8, (H, W)
        1 where the pile is; holes are filled, the plate is left out.
    base_row : float
        Row of the pile's lower edge.
    pile_is : str
        "darker" or "brighter" than the background.
    """

    grey: np.ndarray
    contrast: np.ndarray
    level: float
    mask: np.ndarray
    base_row: float
    pile_is: str


def outlines(
    centres_m: np.ndarray,
    quaternions: np.ndarray,
    particle: ConvexBody,
    azimuths_deg: ArrayLike,
    inset_m: float = 0.0,
    scales: np.ndarray | None = None,
) -> np.ndarray:
    """Outline polygons of bodies in orthographic side views.

    The view from azimuth a shows u = x cos a + y sin a to the right and z up. A convex body's outline is the
    curve of its support points in the directions of the picture plane, so each vertex is exact. A body of M
    spheres (`particle.spheres_m`) has M outlines, a circle each.

    Parameters
    ----------
    centres_m : numpy.ndarray, (N, 3)
    quaternions : numpy.ndarray, (N, 4)
        w, x, y, z, from the body to the world.
    particle : ConvexBody
    azimuths_deg : array_like, (views,)
    inset_m : float, optional
        Moves the outlines inwards along their normals.
    scales : numpy.ndarray, (N,), optional
        Sizes of the bodies relative to the particle; 1 without it.

    Returns
    -------
    numpy.ndarray, (views, N or N * M, OUTLINE_DIRECTIONS, 2)
        Metres (u, z).
    """
    azimuth = np.radians(np.asarray(azimuths_deg, dtype=float))
    right = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=-1)
    turn = np.arange(OUTLINE_DIRECTIONS) * (2 * math.pi / OUTLINE_DIRECTIONS)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    centres = np.asarray(centres_m, dtype=float)
    sizes = np.ones(len(centres)) if scales is None else np.asarray(scales, dtype=float)
    spheres = spheres_of(centres, quaternions, particle, sizes)
    if spheres is not None:
        middles = np.stack(np.broadcast_arrays(right @ spheres[:, :3].T, spheres[:, 2]), axis=-1)
        return middles[:, :, None, :] + (spheres[:, 3, None, None] - inset_m) * circle
    rotation = rotation_matrices(quaternions)
    right_body = np.einsum("nij,vi->vnj", rotation, right)
    up_body = np.broadcast_to(rotation[:, 2, :], right_body.shape)
    cos, sin = circle[:, :1], circle[:, 1:]
    touching = particle.support_point(cos * right_body[:, :, None, :] + sin * up_body[:, :, None, :])
    points = sizes[:, None, None] * (touching @ np.stack([right_body, up_body], axis=-1))
    points[..., 0] += (right @ centres.T)[:, :, None]
    points[..., 1] += centres[:, 2][None, :, None]
    return points - inset_m * circle


def spheres_of(
    centres_m: np.ndarray, quaternions: np.ndarray, particle: ConvexBody, scales: np.ndarray
) -> np.ndarray | None:
    """Spheres (N * M, 4), centre and radius in m, of N bodies of M spheres each; None for a body of none."""
    own = getattr(particle, "spheres_m", None)
    if own is None or not len(own):
        return None
    away = np.einsum("nij,mj->nmi", rotation_matrices(quaternions), own[:, :3])
    places = np.asarray(centres_m)[:, None, :] + scales[:, None, None] * away
    radii = scales[:, None] * own[:, 3]
    return np.concatenate([places, radii[..., None]], axis=-1).reshape(-1, 4)


def top_of(
    centres_m: np.ndarray, quaternions: np.ndarray, particle: ConvexBody, scales: np.ndarray | None = None
) -> float:
    """Height (m) of the highest point of N bodies over z = 0; exact, from the bodies themselves. Arguments as in
    `silhouette`."""
    up_body = rotation_matrices(quaternions)[:, 2, :]
    reach = (particle.support_point(up_body) * up_body).sum(axis=1)
    return float(
        (np.asarray(centres_m)[:, 2] + (1.0 if scales is None else np.asarray(scales)) * reach).max()
    )


def paint(polygons_m: np.ndarray, mm_per_pixel: float, extent: Extent) -> np.ndarray:
    """One view's outlines, filled into a picture: pile dark on light.

    OpenCV fills every pixel that an outline touches, half a pixel too many all around. The outlines are
    therefore expected half a pixel inside the body; a filled disc then has its true area and extents to 0.03
    pixel (tested).

    Parameters
    ----------
    polygons_m : numpy.ndarray, (N, M, 2)
        Metres (u, z).
    mm_per_pixel : float
    extent : (float, float, float)
        Left, right and top of the view in metres.

    Returns
    -------
    numpy.ndarray of uint8, (H, W)
    """
    left_m, right_m, top_m = extent
    pixel_m = mm_per_pixel * 1e-3
    width = math.ceil((right_m - left_m) / pixel_m)
    height = math.ceil(top_m / pixel_m)
    image = np.full((height, width), BACKGROUND_TONE, dtype=np.uint8)
    pixels = np.empty_like(polygons_m)
    pixels[..., 0] = (polygons_m[..., 0] - left_m) / pixel_m - 0.5
    pixels[..., 1] = height - polygons_m[..., 1] / pixel_m - 0.5
    for outline in np.rint(pixels * (1 << SUBPIXEL_BITS)).astype(np.int32):
        cv2.fillConvexPoly(image, outline, PILE_TONE, shift=SUBPIXEL_BITS)
    return image


def frame(polygons_m: np.ndarray, mm_per_pixel: float) -> Extent:
    """The extent (left_m, right_m, top_m) that holds all outlines (..., 2) with a margin of background around them."""
    margin = MARGIN_PX * mm_per_pixel * 1e-3
    return (
        float(polygons_m[..., 0].min()) - margin,
        float(polygons_m[..., 0].max()) + margin,
        max(float(polygons_m[..., 1].max()), 0.0) + margin,
    )


def silhouette(
    centres_m: np.ndarray,
    quaternions: np.ndarray,
    particle: ConvexBody,
    azimuth_deg: float = 0.0,
    mm_per_pixel: float = 0.25,
    extent: Extent | None = None,
    scales: np.ndarray | None = None,
) -> np.ndarray:
    """Exact orthographic side view of bodies on the plate z = 0, the pile dark on a light background.

    Parameters
    ----------
    centres_m : numpy.ndarray, (N, 3)
        z is up.
    quaternions : numpy.ndarray, (N, 4)
        w, x, y, z, from the body to the world.
    particle : ConvexBody
        Anything with `support_point`.
    azimuth_deg, mm_per_pixel : float, optional
    extent : (float, float, float), optional
        Left, right and top of the view in metres; all bodies and a margin without it.
    scales : numpy.ndarray, (N,), optional
        Sizes of the bodies relative to the particle; 1 without it.

    Returns
    -------
    numpy.ndarray of uint8, (H, W)
        Its lower border is the plate.
    """
    polygons = outlines(centres_m, quaternions, particle, [azimuth_deg], mm_per_pixel * 0.5e-3, scales)[0]
    return paint(polygons, mm_per_pixel, extent or frame(polygons, mm_per_pixel))


def segment(image: np.ndarray, largest_pile_only: bool = True, base_row: float | None = None) -> Segmentation:
    """Split a picture into pile and background.

    Polarity is never assumed. The border strip (the upper edge and both sides) shows background; the pile is
    what differs from it: in tone, or in colour (red fruit on a grey board of the same brightness), darker or
    brighter.

    The background is a quadratic surface for each channel, fitted to that strip with outliers trimmed, which
    takes tilted light and vignetting out. Then follow median and Gaussian filters and Otsu's threshold on the
    distance from the background, and holes (highlights) are filled. A picture of two tones is binary already:
    it skips fitting and filters, which could only round its corners.

    Rows that are "pile" from border to border are a plate or table that differs from the background as the
    fruit does: the pile stands on the first of them. Otherwise the base is the pile's lowest row, or
    `base_row`.

    Parameters
    ----------
    image : numpy.ndarray of uint8, (H, W) or (H, W, 3)
        Colours in the order BGR.
    largest_pile_only : bool, optional
        Whether only the largest connected part counts.
    base_row : float, optional
        Row of the plate, where the caller knows it.

    Returns
    -------
    Segmentation

    Raises
    ------
    InputError
        If the picture or `base_row` cannot be used.
    NoFlankError
        If the picture shows no pile.
    """
    image = checked(image)
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    contrast = two_tone_contrast(image) if image.ndim == 2 else None
    noisy = contrast is None
    if contrast is None:
        smooth = cv2.GaussianBlur(cv2.medianBlur(image, 3), (0, 0), 1.0)
        contrast = background_contrast(smooth)
    level, mask = threshold(contrast)
    if noisy:
        mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    if base_row is None:
        base_row = plate_row(mask)
    if base_row is not None:
        if not 0 < base_row <= mask.shape[0]:
            raise InputError("picture", "base_row", base_row, f"above 0, at most {mask.shape[0]}")
        mask[math.ceil(base_row) :] = 0
    mask = pile_component(mask, largest_pile_only)
    if base_row is None:
        base_row = lower_edge(mask, contrast, level)
    inside = mask > 0
    pile_is = "darker" if grey[inside].mean() < grey[border(grey.shape)].mean() else "brighter"
    return Segmentation(grey, contrast, level, mask, float(base_row), pile_is)


def checked(image: np.ndarray) -> np.ndarray:
    """The picture as contiguous uint8, one channel if its three are the same; InputError if it is no
    picture."""
    image = np.asarray(image)
    if image.dtype != np.uint8:
        raise InputError("picture", "pixel type", str(image.dtype), "uint8")
    if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)) or min(image.shape[:2]) < 20:
        raise InputError("picture", "shape", image.shape, "(H, W) or (H, W, 3), at least 20 by 20 pixels")
    if (
        image.ndim == 3
        and np.array_equal(image[..., 0], image[..., 1])
        and np.array_equal(image[..., 0], image[..., 2])
    ):
        image = image[..., 0]
    return np.ascontiguousarray(image)


def border(shape: tuple[int, ...]) -> np.ndarray:
    """Index of the strip that shows background: the upper edge and both sides, 3 % of the picture wide."""
    strip = max(2, round(0.03 * min(shape)))
    where = np.zeros(shape[:2], dtype=bool)
    where[:strip] = where[:, :strip] = where[:, -strip:] = True
    return where


def two_tone_contrast(grey: np.ndarray) -> np.ndarray | None:
    """Distance from the background's tone where a picture has two tones at most; None where it has more."""
    tones = np.flatnonzero(cv2.calcHist([grey], [0], None, [256], [0, 256]).ravel())
    if tones.size > 2:
        return None
    background = np.bincount(grey[border(grey.shape)], minlength=256).argmax()
    return cv2.absdiff(grey, np.full_like(grey, background)).astype(np.float32)


def background_contrast(image: np.ndarray) -> np.ndarray:
    """Distance (H, W) float32 of each pixel from the background surface fitted to the border strip."""
    rows, columns = image.shape[:2]
    y, x = np.linspace(-1, 1, rows, dtype=np.float32)[:, None], np.linspace(-1, 1, columns, dtype=np.float32)
    where = border(image.shape)
    strip_y, strip_x = y[where.nonzero()[0], 0], x[where.nonzero()[1]]
    strip_terms = np.stack(
        [np.ones_like(strip_x), strip_x, strip_x**2, strip_y, strip_y**2, strip_x * strip_y], axis=1
    ).astype(float)
    squares = np.zeros((rows, columns), np.float32)
    for channel in image.reshape(rows, columns, -1).transpose(2, 0, 1):
        seen = channel[where].astype(float)
        kept = np.ones(seen.size, dtype=bool)
        # A plate or a stray berry in the strip is a minority: start from the median tone, then trim what
        # stands out.
        centre = np.full(seen.size, np.median(seen))
        for _ in range(4):
            miss = np.abs(seen - centre)
            kept = miss <= max(3 * 1.4826 * np.median(miss), 2.0)
            weights = np.linalg.lstsq(strip_terms[kept], seen[kept], rcond=None)[0]
            centre = strip_terms @ weights
        w = weights.astype(np.float32)
        surface = (w[0] + w[1] * x + w[2] * x * x) + (w[3] * y + w[4] * y * y) + w[5] * y * x
        squares += (channel - surface) ** 2
    return np.sqrt(squares)


def threshold(contrast: np.ndarray) -> tuple[float, np.ndarray]:
    """Otsu's level of the contrast and the mask (uint8, 0 or 1) of what lies above it."""
    peak = float(contrast.max())
    if peak < 8:
        raise NoFlankError("nothing in the picture differs from its background")
    scaled = cv2.convertScaleAbs(contrast, alpha=255.0 / peak)
    binary = cv2.threshold(scaled, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[1]
    # Otsu's optimum lies half-way between the means of its two classes. Where the histogram has a gap every
    # level in it is as good and OpenCV returns the lowest, which would put the sub-pixel edge half a pixel
    # too far out.
    level = (cv2.mean(scaled, mask=1 - binary)[0] + cv2.mean(scaled, mask=binary)[0]) / 2
    return level * peak / 255.0, cv2.threshold(scaled, math.floor(level), 1, cv2.THRESH_BINARY)[1]


def plate_row(mask: np.ndarray) -> float | None:
    """Upper edge of a plate that counts as "pile" from border to border; None where the mask has none.

    Above a plate the mask narrows abruptly; above the foot of a pile that the picture cuts off it does not.
    """
    share = mask.mean(axis=1)
    from_border_to_border = mask[:, :3].any(axis=1) & mask[:, -3:].any(axis=1) & (share > 0.97)
    if not from_border_to_border.any():
        return None
    first = int(from_border_to_border.argmax())
    return first - 0.5 if first >= 4 and share[first - 4] < 0.9 else None


def pile_component(mask: np.ndarray, largest_only: bool) -> np.ndarray:
    """The mask with holes filled: its largest connected part, or all but specks below 1 % of that part."""
    contours = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    if not contours:
        raise NoFlankError("the picture shows no pile above its base")
    areas = np.array([cv2.contourArea(contour) for contour in contours])
    kept = [int(areas.argmax())] if largest_only else np.flatnonzero(areas >= 0.01 * areas.max()).tolist()
    filled = np.zeros_like(mask)
    cv2.drawContours(filled, [contours[i] for i in kept], -1, 1, cv2.FILLED)
    return filled


def upper_edge(mask: np.ndarray, contrast: np.ndarray, level: float) -> np.ndarray:
    """Row (W,) at which each column's pile begins, between pixels by linear interpolation; NaN without pile.

    mask, contrast and level as in `Segmentation`.
    """
    top = mask.argmax(axis=0)
    column = np.arange(mask.shape[1])
    inner = contrast[top, column]
    outer = np.where(top > 0, contrast[np.maximum(top - 1, 0), column], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.where(inner > outer, (inner - level) / (inner - outer), 0.5)
    return np.where(mask[top, column] > 0, top - np.clip(step, 0.0, 1.0), np.nan)


def lower_edge(mask: np.ndarray, contrast: np.ndarray, level: float) -> float:
    """Row of the pile's lowest point: the picture's lower border where the pile is cut off by it."""
    if mask[-1].any():
        return mask.shape[0] - 0.5
    return mask.shape[0] - 1 - float(np.nanmin(upper_edge(mask[::-1], contrast[::-1], level)))
