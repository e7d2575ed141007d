"""Turn the bodies of a picture into triangles with normals at their corners."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from repose.dem.rotations import rotation_matrices
from repose.dem.tessellation import tessellate


class Drawable(Protocol):
    """A shape that can be drawn.

    A shape of spheres also has `spheres_m` (M, 4), their centres and radii in m.
    """

    @property
    def bounding_radius_m(self) -> float:
        """Distance of its farthest point from its centre in m."""

    def support(self, n: np.ndarray) -> np.ndarray:
        """Return the distance (...,) in m of the tangent plane with normal `n`."""

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Return the farthest points (..., 3) in m in the unit directions `n`."""


@dataclass(frozen=True)
class Bodies:
    """N bodies to be drawn, of S shapes with V points and T triangles each.

    A body of spheres is drawn as its spheres, each a part of its own.

    Attributes
    ----------
    normals : array (S, V, 3)
        Unit normals at the points of each shape.
    triangles : array (T, 3) of int
        Numbers of their points, the same for all shapes.
    shape_ids : array (N,) of int
        Number of the shape of each body or part.
    rotations : array (N, 3, 3)
        Rotation of each body or part to the world.
    vertices : array (N, V, 3)
        Points of each in the world, in m.
    owner : array (N,) of int
        Number of the body to which a part belongs.
    largest_m : float
        Bounding radius of the largest body. Without bodies it is that of the first
        shape.
    """

    normals: np.ndarray
    triangles: np.ndarray
    shape_ids: np.ndarray
    rotations: np.ndarray
    vertices: np.ndarray
    owner: np.ndarray
    largest_m: float


class _Ball:
    """A sphere of radius 1, the part of bodies that are made of spheres."""

    bounding_radius_m = 1.0

    def support(self, n: np.ndarray) -> np.ndarray:
        return np.ones(np.shape(n)[:-1])

    def support_point(self, n: np.ndarray) -> np.ndarray:
        return n


class _Parts(NamedTuple):
    """Parts of bodies: centres (M, 3) in m, scales, shapes and bodies (M,)."""

    centres: np.ndarray
    scales: np.ndarray
    shape_ids: np.ndarray
    owner: np.ndarray


def place_bodies(
    centres: np.ndarray,
    quaternions: np.ndarray,
    shapes: Sequence[Drawable],
    shape_ids: np.ndarray,
    scales: np.ndarray,
) -> Bodies:
    """Place bodies in the world, and return them as triangles.

    Parameters
    ----------
    centres : array (N, 3)
        Centres in m.
    quaternions : array (N, 4)
        Orientations w, x, y, z, from the body to the world.
    shapes : sequence
        The S shapes.
    shape_ids : array (N,) of int
        Number of the shape of each body.
    scales : array (N,)
        Size of each body as a multiple of its shape.
    """
    rotations = rotation_matrices(quaternions)
    parts = _split_into_parts(
        centres, rotations=rotations, shapes=shapes, shape_ids=shape_ids, scales=scales
    )
    # The unit sphere is added as the last shape. It draws each sphere of a clump, so the
    # clump itself is not drawn and any mesh may stand in its place.
    drawn_shapes = [_Ball() if len(_read_spheres(shape)) else shape for shape in shapes]
    drawn_shapes.append(_Ball())
    tessellated = [tessellate(shape) for shape in drawn_shapes]
    points = np.array([points for points, _, _ in tessellated])
    normals = np.array([normals for _, normals, _ in tessellated])
    triangles = tessellated[0][2]

    # Scale the points of each part, turn them, and move them to its centre.
    rotations_of_parts = rotations[parts.owner]
    scaled_points = parts.scales[:, None, None] * points[parts.shape_ids]
    vertices = parts.centres[:, None, :] + np.einsum(
        "nij,nvj->nvi", rotations_of_parts, scaled_points
    )
    radii = np.array([shape.bounding_radius_m for shape in shapes])
    largest = float((radii[shape_ids] * scales).max(initial=0.0))
    return Bodies(
        normals=normals,
        triangles=triangles,
        shape_ids=parts.shape_ids,
        rotations=rotations_of_parts,
        vertices=vertices,
        owner=parts.owner,
        largest_m=largest or float(radii[0]),
    )


def _read_spheres(shape: Drawable) -> np.ndarray:
    """Return the spheres (M, 4) of a shape; empty for a shape of another kind."""
    return np.asarray(getattr(shape, "spheres_m", ()))


def _split_into_parts(
    centres: np.ndarray,
    rotations: np.ndarray,
    shapes: Sequence[Drawable],
    shape_ids: np.ndarray,
    scales: np.ndarray,
) -> _Parts:
    """Split bodies of spheres into their spheres; other bodies are one part each.

    Parameters
    ----------
    centres, shapes, shape_ids, scales
        As in `place_bodies`.
    rotations : array (N, 3, 3)
        Rotations of the bodies to the world.

    Returns
    -------
    _Parts
        The parts. A sphere gets the number of shapes as the number of its shape,
        because the unit sphere follows the other shapes.
    """
    ball_id = len(shapes)
    parts_of_shapes = []
    for shape_id, shape in enumerate(shapes):
        bodies = np.flatnonzero(shape_ids == shape_id)
        spheres = _read_spheres(shape)
        if len(spheres):
            parts = _place_spheres(
                bodies,
                spheres,
                centres=centres,
                rotations=rotations,
                scales=scales,
                ball_id=ball_id,
            )
        else:
            parts = _Parts(
                centres[bodies],
                scales[bodies],
                shape_ids=np.full(len(bodies), shape_id),
                owner=bodies,
            )
        parts_of_shapes.append(parts)
    # Join the parts of all shapes, field by field.
    columns = zip(*parts_of_shapes, strict=True)
    return _Parts(*(np.concatenate(column) for column in columns))


def _place_spheres(
    bodies: np.ndarray,
    spheres: np.ndarray,
    centres: np.ndarray,
    rotations: np.ndarray,
    scales: np.ndarray,
    ball_id: int,
) -> _Parts:
    """Place the spheres of several bodies of one shape, each as a part.

    Parameters
    ----------
    bodies : array (M,) of int
        Numbers of the bodies.
    spheres : array (S, 4)
        Centres and radii of the spheres of their shape in m.
    centres, turn, scales
        Of all bodies, as in `_split_into_parts`.
    ball_id : int
        Number of the shape of a sphere.
    """
    owner = np.repeat(bodies, len(spheres))
    spheres_of_bodies = np.tile(spheres, (len(bodies), 1))
    offsets = np.einsum("nij,nj->ni", rotations[owner], spheres_of_bodies[:, :3])
    return _Parts(
        centres[owner] + scales[owner, None] * offsets,
        scales[owner] * spheres_of_bodies[:, 3],
        shape_ids=np.full(len(owner), ball_id),
        owner=owner,
    )
