"""Simulated bodies seen from the side: their outlines, filled into a picture that is measured like a photograph.

Rows count downwards from the picture's top; a pixel's centre has whole coordinates, as in OpenCV.
"""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import ArrayLike

from repose.common.errors import require
from repose.dem.rotations import rotation_matrices
from repose.measure.saved_pours import Arrays

# Simulations run side by side, one a core: OpenCV's own threads would only compete with them.
cv2.setNumThreads(1)

OUTLINE_DIRECTIONS = (
    64  # a grain's outline as a polygon: at most 0.03 mm inside the smooth one
)
SUBPIXEL_BITS = 8
MARGIN_PX = 8
PILE_TONE, BACKGROUND_TONE = 40, 255
MOST_PIXELS = 1e9
Extent = tuple[float, float, float]


class ConvexBody(Protocol):
    """A body with support points, symmetric about its centre, or of spheres `spheres_m` (M, 4): centre, radius [m]."""

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Points (..., 3) in m at which tangent planes touch the body; `n` are unit normals in the body's frame."""


@dataclass
class Grains:
    """N bodies of one shape at their places."""

    centres_m: np.ndarray  # (N, 3)
    quaternions: np.ndarray  # (N, 4): w, x, y, z
    particle: ConvexBody
    scales: Any = 1.0  # ndarray (N,), sizes over the particle's

    def __post_init__(self) -> None:
        self.centres_m, self.quaternions = (
            np.asarray(self.centres_m, float),
            np.asarray(self.quaternions, float),
        )
        self.scales = np.broadcast_to(
            np.asarray(self.scales, float), len(self.centres_m)
        )

    @classmethod
    def of(cls, arrays: Arrays, particle: ConvexBody) -> "Grains":
        """Give the grains of a pour from its arrays ``position``, ``quaternion`` and perhaps ``scale``."""
        return cls(
            arrays["position"], arrays["quaternion"], particle, arrays.get("scale", 1.0)
        )

    def __getitem__(self, kept: np.ndarray) -> "Grains":
        """Give the grains of a mask."""
        return Grains(
            self.centres_m[kept],
            self.quaternions[kept],
            self.particle,
            self.scales[kept],
        )


def outlines(
    grains: Grains, azimuths_deg: ArrayLike, inset_m: float = 0.0
) -> np.ndarray:
    """Outline polygons of bodies in orthographic side views: (views, N, OUTLINE_DIRECTIONS, 2), (u, z) in m.

    The view from azimuth a shows u = x cos a + y sin a to the right and z up. A convex body's outline is the curve of
    its support points in the directions of the picture plane, so each vertex is exact; its second half is the first,
    turned by 180 degrees. `inset_m` moves the outlines inwards.
    """
    azimuth = np.radians(np.asarray(azimuths_deg, dtype=float))
    right = np.stack(
        [np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=-1
    )
    turn = np.arange(OUTLINE_DIRECTIONS) * (2 * math.pi / OUTLINE_DIRECTIONS)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    spheres = spheres_of(grains)
    if spheres is not None:
        middles = np.stack(
            np.broadcast_arrays(right @ spheres[:, :3].T, spheres[:, 2]), axis=-1
        )
        return middles[:, :, None, :] + (spheres[:, 3, None, None] - inset_m) * circle
    rotation = rotation_matrices(grains.quaternions)
    up_body = rotation[:, 2, :]
    cos, sin = np.split(circle[: OUTLINE_DIRECTIONS // 2], 2, axis=1)
    points = np.empty((len(right), len(rotation), *circle.shape))
    for view, direction in zip(points, right, strict=True):
        right_body = np.einsum("nij,i->nj", rotation, direction)
        n = cos * right_body[:, None, :] + sin * up_body[:, None, :]
        touching = grains.particle.support_point(n.reshape(-1, 3)).reshape(n.shape)
        half = grains.scales[:, None, None] * (
            touching @ np.stack([right_body, up_body], axis=-1)
        )
        view[:] = np.concatenate([half, -half], axis=1) - inset_m * circle
        view[..., 0] += (grains.centres_m @ direction)[:, None]
        view[..., 1] += grains.centres_m[:, 2, None]
    return points


def spheres_of(grains: Grains) -> np.ndarray | None:
    """Centre and radius in m, (N * M, 4), of the spheres of N bodies; None for a body that is not made of spheres."""
    own: Any = getattr(grains.particle, "spheres_m", ())
    scales = grains.scales[:, None]
    if not len(own):
        return None
    away = np.einsum("nij,mj->nmi", rotation_matrices(grains.quaternions), own[:, :3])
    places = grains.centres_m[:, None, :] + scales[..., None] * away
    return np.concatenate([places, (scales * own[:, 3])[..., None]], axis=-1).reshape(
        -1, 4
    )


def top_of(grains: Grains) -> float:
    """Height in m of the highest point of bodies over z = 0; exact, from the bodies themselves."""
    up_body = rotation_matrices(grains.quaternions)[:, 2, :]
    reach = (grains.particle.support_point(up_body) * up_body).sum(axis=1)
    return float((grains.centres_m[:, 2] + grains.scales * reach).max())


def paint(polygons_m: np.ndarray, mm_per_pixel: float, extent: Extent) -> np.ndarray:
    """One view's outlines (u, z), filled into a picture (H, W): pile dark on light, z = 0 at its lower border.

    OpenCV fills every pixel that an outline touches, half a pixel too many all around, so the outlines must lie half a
    pixel inside the body; a filled disc then has its true area and extents to 0.03 pixel (tested).
    """
    left_m, right_m, top_m = extent
    pixel_m = mm_per_pixel * 1e-3
    width = math.ceil((right_m - left_m) / pixel_m)
    height = math.ceil(top_m / pixel_m)
    allowed = f"at most {MOST_PIXELS:g}: positions are in m, and a larger measure.mm_per_pixel needs fewer"
    require(
        width * height <= MOST_PIXELS,
        "picture of the pile",
        "pixels",
        f"{width:g} x {height:g}",
        allowed,
    )
    image = np.full((height, width), BACKGROUND_TONE, dtype=np.uint8)
    pixels = np.empty_like(polygons_m)
    pixels[..., 0] = (polygons_m[..., 0] - left_m) / pixel_m - 0.5
    pixels[..., 1] = height - polygons_m[..., 1] / pixel_m - 0.5
    for outline in np.rint(pixels * (1 << SUBPIXEL_BITS)).astype(np.int32):
        cv2.fillConvexPoly(image, outline, PILE_TONE, shift=SUBPIXEL_BITS)
    return image


def frame(polygons_m: np.ndarray, mm_per_pixel: float) -> Extent:
    """Left, right and top in m of the view that holds all outlines and a margin of background."""
    margin = MARGIN_PX * mm_per_pixel * 1e-3
    (left, _), (right, top) = (
        end(polygons_m, axis=(0, 1)).tolist() for end in (np.min, np.max)
    )
    return left - margin, right + margin, max(top, 0.0) + margin


def silhouette(
    grains: Grains,
    azimuth_deg: float = 0.0,
    mm_per_pixel: float = 0.25,
    extent: Extent | None = None,
) -> np.ndarray:
    """Exact orthographic side view (H, W) of bodies on the plate z = 0, the pile dark on a light background."""
    polygons = outlines(grains, [azimuth_deg], mm_per_pixel * 0.5e-3)[0]
    return paint(polygons, mm_per_pixel, extent or frame(polygons, mm_per_pixel))
