"""Convert the bodies of a picture to triangles with normals at their corners."""

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
        """Distance of the farthest point of the shape from its centre in m."""

    def support(self, n: np.ndarray) -> np.ndarray:
        """Return the distances (...,) in m of tangent planes with the unit normals `n`."""

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Return the farthest points (..., 3) in m along the unit directions `n`."""


@dataclass(frozen=True)
class Bodies:
    """N parts to be drawn, which have S shapes with V points and T triangles each.

    A part is either a whole body or one sphere of a clump, a body made of spheres.

    Attributes
    ----------
    normals : array (S, V, 3)
        Unit normals at the points of each shape.
    triangles : array (T, 3) of int
        Indices of the points of each triangle, the same for all shapes.
    shape_ids : array (N,) of int
        Index of the shape of each part.
    rotations : array (N, 3, 3)
        Rotation of each part to the world.
    vertices : array (N, V, 3)
        Points of each part in the world, in m.
    body_of_part : array (N,) of int
        Index of the body to which each part belongs.
    largest_m : float
        Bounding radius of the largest body, or of the first shape if there are no
        bodies.
    """

    normals: np.ndarray
    triangles: np.ndarray
    shape_ids: np.ndarray
    rotations: np.ndarray
    vertices: np.ndarray
    body_of_part: np.ndarray
    largest_m: float


class _UnitSphere:
    """A sphere of radius 1, as a `Drawable`."""

    bounding_radius_m = 1.0

    def support(self, n: np.ndarray) -> np.ndarray:
        return np.ones(np.shape(n)[:-1])

    def support_point(self, n: np.ndarray) -> np.ndarray:
        return n


class _Parts(NamedTuple):
    """The M parts that are drawn: whole bodies, and spheres of clumps.

    They are sorted by the shapes of the bodies, so their order is not that of the
    bodies.
    """

    centres: np.ndarray  # (M, 3), in m
    scales: np.ndarray  # (M,), size of each part as a multiple of its shape
    shape_ids: np.ndarray  # (M,) of int, index of the shape of each part
    body_of_part: np.ndarray  # (M,) of int, index of the body of each part


def place_bodies(
    centres: np.ndarray,
    quaternions: np.ndarray,
    shapes: Sequence[Drawable],
    shape_ids: np.ndarray,
    scales: np.ndarray,
) -> Bodies:
    """Place bodies in the world, as triangles.

    A body made of spheres becomes several parts, one for each sphere.

    Parameters
    ----------
    centres : array (N, 3)
        Centres in m.
    quaternions : array (N, 4)
        Orientations w, x, y, z, from the body to the world.
    shapes : sequence
        The S shapes.
    shape_ids : array (N,) of int
        Index of the shape of each body.
    scales : array (N,)
        Size of each body as a multiple of its shape.

    Returns
    -------
    Bodies
        The parts of the bodies, with the meshes of S + 1 shapes. The last shape is the
        unit sphere.
    """
    rotations = rotation_matrices(quaternions)
    # The unit sphere follows the other shapes, so its index is the number of shapes.
    parts = _split_into_parts(
        centres,
        rotations=rotations,
        shapes=shapes,
        shape_ids=shape_ids,
        scales=scales,
        sphere_id=len(shapes),
    )
    points, normals, triangles = _tessellate_shapes(shapes)

    # Scale and rotate the points of each part, and move them to its centre.
    rotations_of_parts = rotations[parts.body_of_part]
    scaled_points = parts.scales[:, None, None] * points[parts.shape_ids]
    vertices = parts.centres[:, None, :] + np.einsum(
        "nij,nvj->nvi", rotations_of_parts, scaled_points
    )
    radii = np.array([shape.bounding_radius_m for shape in shapes])
    largest_radius_m = float((radii[shape_ids] * scales).max(initial=0.0))
    return Bodies(
        normals=normals,
        triangles=triangles,
        shape_ids=parts.shape_ids,
        rotations=rotations_of_parts,
        vertices=vertices,
        body_of_part=parts.body_of_part,
        # Without bodies, the radius is 0. Shadows need a length, so use that of a
        # shape.
        largest_m=largest_radius_m or float(radii[0]),
    )


def _tessellate_shapes(
    shapes: Sequence[Drawable],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make a mesh of each shape, and one of the unit sphere.

    Parameters
    ----------
    shapes : sequence of Drawable
        The S shapes.

    Returns
    -------
    points : array (S + 1, V, 3)
        Points of each mesh in m. The last mesh is the unit sphere.
    normals : array (S + 1, V, 3)
        Unit normals at these points.
    triangles : array (T, 3) of int
        Indices of the points of each triangle, the same for all meshes.
    """
    # The mesh of a clump is never drawn, because its spheres are. But each shape needs
    # a mesh, so that its index is the index of its mesh. A sphere takes its place.
    meshed_shapes = [
        _UnitSphere() if len(_read_spheres(shape)) else shape for shape in shapes
    ]
    meshed_shapes.append(_UnitSphere())
    meshes = [tessellate(shape) for shape in meshed_shapes]
    points = np.array([points for points, _, _ in meshes])
    normals = np.array([normals for _, normals, _ in meshes])
    # `tessellate` gives all shapes the same triangles.
    _, _, triangles = meshes[0]
    return points, normals, triangles


def _read_spheres(shape: Drawable) -> np.ndarray:
    """Return the spheres (M, 4) of a shape; empty if it is not made of spheres."""
    return np.asarray(getattr(shape, "spheres_m", ()))


def _split_into_parts(
    centres: np.ndarray,
    rotations: np.ndarray,
    shapes: Sequence[Drawable],
    shape_ids: np.ndarray,
    scales: np.ndarray,
    sphere_id: int,
) -> _Parts:
    """Split the bodies into parts: each sphere of a clump, and each other body whole.

    Parameters
    ----------
    centres, shapes, shape_ids, scales
        The bodies, as for `place_bodies`. There is at least one shape.
    rotations : array (N, 3, 3)
        Rotations of the bodies to the world.
    sphere_id : int
        Index of the unit sphere among the shapes, for the spheres of clumps.

    Returns
    -------
    _Parts
        The parts of all bodies, sorted by the shapes of the bodies.
    """
    parts_by_shape = []
    for shape_id, shape in enumerate(shapes):
        body_indices = np.flatnonzero(shape_ids == shape_id)
        spheres = _read_spheres(shape)
        if len(spheres):
            parts = _place_spheres(
                body_indices,
                spheres,
                centres=centres,
                rotations=rotations,
                scales=scales,
                sphere_id=sphere_id,
            )
        else:
            parts = _Parts(
                centres[body_indices],
                scales[body_indices],
                shape_ids=np.full(len(body_indices), shape_id),
                body_of_part=body_indices,
            )
        parts_by_shape.append(parts)
    return _Parts(
        centres=np.concatenate([parts.centres for parts in parts_by_shape]),
        scales=np.concatenate([parts.scales for parts in parts_by_shape]),
        shape_ids=np.concatenate([parts.shape_ids for parts in parts_by_shape]),
        body_of_part=np.concatenate([parts.body_of_part for parts in parts_by_shape]),
    )


def _place_spheres(
    body_indices: np.ndarray,
    spheres: np.ndarray,
    centres: np.ndarray,
    rotations: np.ndarray,
    scales: np.ndarray,
    sphere_id: int,
) -> _Parts:
    """Place the spheres of several clumps of one shape, each as a part.

    Parameters
    ----------
    body_indices : array (M,) of int
        Indices of the clumps among all bodies.
    spheres : array (S, 4)
        Centres and radii of the spheres of their shape in m.
    centres, rotations, scales
        Values of all bodies, as for `_split_into_parts`.
    sphere_id : int
        Index of the unit sphere among the shapes.

    Returns
    -------
    _Parts
        M * S parts, in which the spheres of a clump follow each other.
    """
    body_of_part = np.repeat(body_indices, len(spheres))
    spheres_of_bodies = np.tile(spheres, (len(body_indices), 1))
    radii = spheres_of_bodies[:, 3]
    # Rotate the centre of each sphere with its clump.
    offsets = np.einsum("nij,nj->ni", rotations[body_of_part], spheres_of_bodies[:, :3])
    return _Parts(
        centres[body_of_part] + scales[body_of_part, None] * offsets,
        scales[body_of_part] * radii,
        shape_ids=np.full(len(body_of_part), sphere_id),
        body_of_part=body_of_part,
    )
