"""Draw the silhouettes of simulated grains: outlines and pictures from the side.

The outlines are filled, so that the picture can be measured like a photograph. In a
view, u is the distance to the right and z the height. Rows count downwards from the
picture's top. The centre of a pixel has whole coordinates, as in OpenCV.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from repose.common.errors import InputError
from repose.dem.rotations import rotation_matrices
from repose.measure.saved_pours import Arrays

# Number of vertices of a grain's outline, an even number. With it, the polygon lies at
# most 0.03 mm inside the smooth outline.
OUTLINE_DIRECTIONS = 64
# OpenCV takes coordinates as whole numbers, here in units of 1/2^8 of a pixel.
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
    """Position, orientation and size of N grains of one shape."""

    centres_m: np.ndarray  # (N, 3)
    quaternions: np.ndarray  # (N, 4): w, x, y, z
    particle: ConvexBody  # the shape, in the size of a grain with the scale 1
    scales: Any = 1.0  # ndarray (N,), sizes relative to the particle, or one for all

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
    """Compute the outlines of grains in orthographic side views, as polygons.

    The view from azimuth a shows u = x cos a + y sin a to the right and z up. A support
    point of a body is the point at which a plane of a given direction touches it. The
    outline of a convex body consists of its support points for all directions in the
    plane of the picture, so each vertex of the polygon is exact.

    Parameters
    ----------
    grains : Grains
        N grains.
    azimuths_deg : array_like
        Azimuth of each view (V,).
    inset_m : float
        Distance by which the outlines are moved inwards.

    Returns
    -------
    ndarray
        Polygons (V, N, OUTLINE_DIRECTIONS, 2), u and z in m. If a grain consists of M
        spheres, each sphere has a polygon, and there are N * M polygons in a view.
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
    for view, right in enumerate(rights):
        outlines = _compute_convex_outlines(grains, rotations, right, circle)
        outlines -= inset_m * circle
        # Move the outlines to the centres of their grains.
        outlines[..., 0] += (grains.centres_m @ right)[:, None]
        outlines[..., 1] += grains.centres_m[:, 2, None]
        polygons[view] = outlines
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
    """Compute the outlines of N convex grains about their centres in one view.

    The grains are symmetric about their centres. The second half of an outline is
    therefore the first half, turned by 180 degrees.

    Parameters
    ----------
    grains : Grains
        The grains.
    rotations : ndarray
        Rotation matrices (N, 3, 3) from the grains' frames to the world's.
    right : ndarray
        Direction (3,) of the world that points to the right in the picture. The z axis
        of the world points up in it.
    circle : ndarray
        Directions (K, 2) in the picture in which the outline is computed, to the right
        and up. They must be spread evenly over a full turn, with K equal to
        `OUTLINE_DIRECTIONS`.

    Returns
    -------
    ndarray
        Polygons (N, K, 2), to the right and up in m.
    """
    # Express the axes of the picture in the frame of each grain, by the transposes of
    # the rotation matrices. For the z axis, this is the third row of each matrix.
    body_right = np.einsum("nij,i->nj", rotations, right)
    body_up = rotations[:, 2, :]
    # For each direction in the picture, take the plane perpendicular to it that touches
    # the grain. The point at which it touches is a point of the outline.
    half_circle = circle[: OUTLINE_DIRECTIONS // 2]
    cos, sin = np.split(half_circle, 2, axis=1)
    normals = cos * body_right[:, None, :] + sin * body_up[:, None, :]
    points = grains.support_points(normals)
    # Project the points to the axes of the picture.
    picture_axes = np.stack([body_right, body_up], axis=-1)
    half_outline = grains.scales[:, None, None] * (points @ picture_axes)
    return np.concatenate([half_outline, -half_outline], axis=1)


def place_spheres(grains: Grains) -> np.ndarray | None:
    """Compute the positions and radii of all spheres of which grains consist.

    Parameters
    ----------
    grains : Grains
        N grains. Only some shapes consist of spheres; they have an attribute
        `spheres_m` (M, 4), see `ConvexBody`.

    Returns
    -------
    ndarray or None
        Centres and radii (N * M, 4) in m; the spheres of a grain follow each other.
        None if the grains do not consist of spheres.
    """
    spheres: Any = getattr(grains.particle, "spheres_m", ())
    if len(spheres) == 0:
        return None
    # Turn the spheres with their grain, scale them, and move them to its centre.
    scales = grains.scales[:, None]
    rotations = rotation_matrices(grains.quaternions)
    offsets = np.einsum("nij,mj->nmi", rotations, spheres[:, :3])
    centres = grains.centres_m[:, None, :] + scales[..., None] * offsets
    radii = (scales * spheres[:, 3])[..., None]
    return np.concatenate([centres, radii], axis=-1).reshape(-1, 4)


def find_top(grains: Grains) -> float:
    """Compute the height in m of the highest point of grains over z = 0.

    It is exact, because it is computed from the grains and not from a picture.
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
    """Fill the outlines of the grains in one view with a dark tone, on a light picture.

    OpenCV fills every pixel that an outline touches, which is half a pixel too much on
    all sides. The caller must therefore move the outlines inwards by half a pixel (the
    parameter `inset_m` of `compute_outlines`). A filled disc then has its true area and
    extents to 0.03 pixel (tested).

    Parameters
    ----------
    polygons_m : ndarray
        Outlines (N, K, 2) of the grains, u and z. They must be convex.
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
    # Convert the outlines to columns and rows. The upper left corner of the picture has
    # the column -1/2 and the row -1/2, because the centre of the first pixel is (0, 0).
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
    """Compute the part of a side view that contains all outlines and a margin.

    Parameters
    ----------
    polygons_m : ndarray
        Outlines (N, K, 2) of the grains, u and z.
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
    """Draw the exact orthographic side view of grains on the plate z = 0.

    Parameters
    ----------
    grains : Grains
        The grains.
    azimuth_deg : float
        Direction of the view about the z axis, as in `compute_outlines`.
    mm_per_pixel : float
        Scale of the picture.
    extent : Extent, optional
        Part of the view that is drawn; the default contains all grains.

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
