"""Draw the silhouettes of simulated bodies: outlines and pictures from the side.

Their outlines are filled into a picture that is measured like a photograph. Rows count
downwards from the picture's top. The centre of a pixel has whole coordinates, as in
OpenCV.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from repose.common.errors import InputError
from repose.dem.rotations import rotation_matrices
from repose.measure.saved_pours import Arrays

# Vertices of a grain's outline: the polygon lies at most 0.03 mm inside the smooth one.
OUTLINE_DIRECTIONS = 64
# OpenCV takes coordinates in units of 1/256 of a pixel.
SUBPIXEL_BITS = 8
MARGIN_PX = 8
# Dark grains before a white background, as in a photograph.
PILE_TONE = 40
BACKGROUND_TONE = 255
MAX_PIXELS = 1e9


class Extent(NamedTuple):
    """Borders of a side view in m; the lower border is the plate, z = 0."""

    left: float
    right: float
    top: float


class ConvexBody(Protocol):
    """A body with support points.

    It is symmetric about its centre, or has an attribute `spheres_m` (M, 4): centre and
    radius of its spheres in m.
    """

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Compute the points (..., 3) in m at which tangent planes touch the body.

        The unit normals `n` (..., 3) of the planes are in the body's frame.
        """


class SolidBody(ConvexBody, Protocol):
    """A body whose volume is known."""

    @property
    def volume_m3(self) -> float:
        """Volume in m³."""


@dataclass
class Grains:
    """Position, orientation and size of N bodies of one shape."""

    centres_m: np.ndarray  # (N, 3)
    quaternions: np.ndarray  # (N, 4): w, x, y, z
    particle: ConvexBody
    scales: Any = 1.0  # ndarray (N,), sizes over the particle's, or one for all

    def __post_init__(self) -> None:
        self.centres_m = np.asarray(self.centres_m, float)
        self.quaternions = np.asarray(self.quaternions, float)
        scales = np.asarray(self.scales, float)
        self.scales = np.broadcast_to(scales, len(self.centres_m))

    @classmethod
    def of(cls, arrays: Arrays, particle: ConvexBody) -> "Grains":
        """Make the grains of a pour from its saved arrays.

        The arrays are ``position``, ``quaternion`` and, if sizes differ, ``scale``.
        """
        scales = arrays.get("scale", 1.0)
        return cls(arrays["position"], arrays["quaternion"], particle, scales)

    def support_points(self, normals: np.ndarray) -> np.ndarray:
        """Compute the points at which tangent planes touch the bodies, at scale 1.

        Parameters
        ----------
        normals : ndarray, (N, K, 3)
            Unit normals of K planes for each body, in its own frame.

        Returns
        -------
        ndarray, (N, K, 3)
            Points in m, in the frame of each body.
        """
        points = self.particle.support_point(normals.reshape(-1, 3))
        return points.reshape(normals.shape)

    def __getitem__(self, selected: np.ndarray) -> "Grains":
        """Select grains by a mask (N,)."""
        return Grains(
            centres_m=self.centres_m[selected],
            quaternions=self.quaternions[selected],
            particle=self.particle,
            scales=self.scales[selected],
        )


def compute_outlines(
    grains: Grains, azimuths_deg: ArrayLike, inset_m: float = 0.0
) -> np.ndarray:
    """Compute the outlines of bodies in orthographic side views, as polygons.

    The view from azimuth a shows u = x cos a + y sin a to the right and z up. A convex
    body's outline is the curve of its support points in the directions of the picture
    plane, so each vertex is exact.

    Parameters
    ----------
    grains : Grains
        The bodies.
    azimuths_deg : array_like
        Azimuth of each view (V,).
    inset_m : float
        Distance by which the outlines are moved inwards.

    Returns
    -------
    ndarray
        Polygons (V, N, OUTLINE_DIRECTIONS, 2), u and z in m. A body of M spheres has M
        polygons.
    """
    # In each view, a direction (3,) of the world points to the right.
    azimuths = np.radians(np.asarray(azimuths_deg, dtype=float))
    rights = np.stack(
        [np.cos(azimuths), np.sin(azimuths), np.zeros_like(azimuths)], axis=-1
    )
    # The outlines are computed in directions (K, 2) in the plane of the picture.
    angles = np.arange(OUTLINE_DIRECTIONS) * (2 * math.pi / OUTLINE_DIRECTIONS)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])

    spheres = place_spheres(grains)
    if spheres is not None:
        return _compute_sphere_outlines(spheres, rights, circle, inset_m)

    rotations = rotation_matrices(grains.quaternions)
    polygons = np.empty((len(rights), len(rotations), *circle.shape))
    for polygon, right in zip(polygons, rights, strict=True):
        polygon[:] = _compute_convex_outlines(grains, rotations, right, circle)
        polygon -= inset_m * circle
        # Move the outlines to the centres of their bodies.
        polygon[..., 0] += (grains.centres_m @ right)[:, None]
        polygon[..., 1] += grains.centres_m[:, 2, None]
    return polygons


def _compute_sphere_outlines(
    spheres: np.ndarray, rights: np.ndarray, circle: np.ndarray, inset_m: float
) -> np.ndarray:
    """Compute the outlines of spheres, which are circles in every view.

    Parameters
    ----------
    spheres : ndarray
        Centres and radii (N, 4) in m.
    rights : ndarray
        Direction (V, 3) of the world that points to the right in each view.
    circle : ndarray
        Directions (K, 2) in the picture in which an outline is computed.
    inset_m : float
        Distance by which the outlines are moved inwards.

    Returns
    -------
    ndarray
        Polygons (V, N, K, 2), to the right and up in m.
    """
    u, z = np.broadcast_arrays(rights @ spheres[:, :3].T, spheres[:, 2])
    centres = np.stack([u, z], axis=-1)
    radii = spheres[:, 3, None, None] - inset_m
    return centres[:, :, None, :] + radii * circle


def _compute_convex_outlines(
    grains: Grains, rotations: np.ndarray, right: np.ndarray, circle: np.ndarray
) -> np.ndarray:
    """Compute the outlines of N convex bodies about their centres in one view.

    The bodies are symmetric about their centres. The second half of an outline is
    therefore the first half, turned by 180 degrees.

    Parameters
    ----------
    grains : Grains
        The bodies.
    rotations : ndarray
        Rotation matrices (N, 3, 3) from the bodies' frames to the world's.
    right : ndarray
        Direction (3,) of the world that points to the right in the picture.
    circle : ndarray
        Directions (K, 2) in the picture in which the outline is computed.

    Returns
    -------
    ndarray
        Polygons (N, K, 2), to the right and up in m.
    """
    # Turn the axes of the picture into the frame of each body.
    body_right = np.einsum("nij,i->nj", rotations, right)
    body_up = rotations[:, 2, :]
    # A point of the outline is where a plane touches the body that is perpendicular to
    # a direction in the picture.
    half_circle = circle[: OUTLINE_DIRECTIONS // 2]
    cos, sin = np.split(half_circle, 2, axis=1)
    normals = cos * body_right[:, None, :] + sin * body_up[:, None, :]
    points = grains.support_points(normals)
    picture_axes = np.stack([body_right, body_up], axis=-1)
    half_outline = grains.scales[:, None, None] * (points @ picture_axes)
    return np.concatenate([half_outline, -half_outline], axis=1)


def place_spheres(grains: Grains) -> np.ndarray | None:
    """Compute where the M spheres of each of N bodies lie in the world.

    Returns
    -------
    ndarray or None
        Centres and radii (N * M, 4) in m. None if the bodies do not consist of spheres.
    """
    spheres: Any = getattr(grains.particle, "spheres_m", ())
    if len(spheres) == 0:
        return None
    # Turn the spheres with their body, scale them, and move them to its centre.
    scales = grains.scales[:, None]
    rotations = rotation_matrices(grains.quaternions)
    offsets = np.einsum("nij,mj->nmi", rotations, spheres[:, :3])
    centres = grains.centres_m[:, None, :] + scales[..., None] * offsets
    radii = (scales * spheres[:, 3])[..., None]
    return np.concatenate([centres, radii], axis=-1).reshape(-1, 4)


def find_top(grains: Grains) -> float:
    """Compute the height in m of the highest point of bodies over z = 0.

    It is exact, because it comes from the bodies and not from a picture.
    """
    # The third row of a rotation matrix is the world's z axis in the body's frame. The
    # highest point of a body is where a level plane touches it from above.
    up_body = rotation_matrices(grains.quaternions)[:, 2, :]
    points = grains.support_points(up_body[:, None])[:, 0]
    support = (points * up_body).sum(axis=1)
    return float((grains.centres_m[:, 2] + grains.scales * support).max())


def paint_outlines(
    polygons_m: np.ndarray, mm_per_pixel: float, extent: Extent
) -> np.ndarray:
    """Paint the outlines of the bodies in one view into a picture, dark on light.

    OpenCV fills every pixel that an outline touches, which is half a pixel too much on
    all sides. The outlines must therefore lie half a pixel inside the body. A filled
    disc then has its true area and extents to 0.03 pixel (tested).

    Parameters
    ----------
    polygons_m : ndarray
        Outlines (N, K, 2) of the bodies, u and z.
    mm_per_pixel : float
        Scale of the picture.
    extent : Extent
        Part of the view that the picture shows; z = 0 is its lower border.

    Returns
    -------
    ndarray
        The picture (H, W), uint8.

    Raises
    ------
    InputError
        If the picture would have too many pixels.
    """
    import cv2  # only where a picture is drawn

    left_m, right_m, top_m = extent
    pixel_m = mm_per_pixel * 1e-3
    width = math.ceil((right_m - left_m) / pixel_m)
    height = math.ceil(top_m / pixel_m)
    if width * height > MAX_PIXELS:
        raise InputError(
            "picture of the pile",
            key="pixels",
            value=f"{width:g} x {height:g}",
            allowed=(
                f"at most {MAX_PIXELS:g}: positions are in m, and a larger "
                "measure.mm_per_pixel needs fewer"
            ),
        )
    # Convert the outlines to columns and rows, counted from the middle of the first
    # pixel.
    pixels = np.empty_like(polygons_m)
    pixels[..., 0] = (polygons_m[..., 0] - left_m) / pixel_m - 0.5
    pixels[..., 1] = height - polygons_m[..., 1] / pixel_m - 0.5
    # OpenCV expects whole numbers, of which the last `SUBPIXEL_BITS` bits are fractions
    # of a pixel.
    subpixels = np.rint(pixels * (1 << SUBPIXEL_BITS)).astype(np.int32)
    image = np.full((height, width), BACKGROUND_TONE, dtype=np.uint8)
    for outline in subpixels:
        cv2.fillConvexPoly(image, outline, PILE_TONE, shift=SUBPIXEL_BITS)
    return image


def find_extent(polygons_m: np.ndarray, mm_per_pixel: float) -> Extent:
    """Compute the part of a side view that holds all outlines and a margin.

    Parameters
    ----------
    polygons_m : ndarray
        Outlines (N, K, 2) of the bodies, u and z.
    mm_per_pixel : float
        Scale of the picture; the margin is `MARGIN_PX` pixels wide.
    """
    margin = MARGIN_PX * mm_per_pixel * 1e-3
    left, _ = np.min(polygons_m, axis=(0, 1)).tolist()
    right, top = np.max(polygons_m, axis=(0, 1)).tolist()
    return Extent(left - margin, right + margin, max(top, 0.0) + margin)


def draw_silhouette(
    grains: Grains,
    azimuth_deg: float = 0.0,
    mm_per_pixel: float = 0.25,
    extent: Extent | None = None,
) -> np.ndarray:
    """Draw the exact orthographic side view of bodies on the plate z = 0.

    Parameters
    ----------
    grains : Grains
        The bodies.
    azimuth_deg : float
        Direction of the view about the z axis, as in `compute_outlines`.
    mm_per_pixel : float
        Scale of the picture.
    extent : Extent, optional
        Part of the view that is drawn; the default holds all bodies.

    Returns
    -------
    ndarray
        The picture (H, W), dark on light.
    """
    inset_m = mm_per_pixel * 0.5e-3  # half a pixel, see `paint_outlines`
    polygons = compute_outlines(grains, [azimuth_deg], inset_m)[0]
    if extent is None:
        extent = find_extent(polygons, mm_per_pixel)
    return paint_outlines(polygons, mm_per_pixel, extent)
