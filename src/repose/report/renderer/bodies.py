"""The bodies of a picture as triangles: each is tessellated by its support points, whose normals are known."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from repose.dem.rotations import rotation_matrices
from repose.dem.tessellation import tessellate


class Drawable(Protocol):
    """A shape that can be drawn; a shape of spheres also has `spheres_m` (M, 4), centre and radius in m."""

    @property
    def bounding_radius_m(self) -> float:
        """Distance of its farthest point from its centre in m."""

    def support(self, n: np.ndarray) -> np.ndarray:
        """Give the support function: distance (...,) in m of the tangent plane with normal `n` from the centre."""

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Give the farthest points (..., 3) in m of the body in the unit directions `n` of the body's frame."""


@dataclass(frozen=True)
class Bodies:
    """The N bodies to be drawn, of S shapes with V points and T triangles each."""

    normals: np.ndarray  # (S, V, 3), unit normals at the points of each shape
    triangles: (
        np.ndarray
    )  # int (T, 3), numbers of their points, the same for all shapes
    shape_ids: np.ndarray  # int (N,), number of each body's shape
    turn: np.ndarray  # (N, 3, 3), rotation, body to world
    vertices: np.ndarray  # (N, V, 3), points of each body in the world, in m
    owner: (
        np.ndarray
    )  # int (N,), the body to which a part belongs; itself for a body of one part
    largest_m: (
        float  # bounding radius of the largest body, or of the first shape without any
    )


class _Ball:
    """A sphere of radius 1, the part of bodies that are made of spheres."""

    bounding_radius_m = 1.0

    def support(self, n: np.ndarray) -> np.ndarray:
        return np.ones(np.shape(n)[:-1])

    def support_point(self, n: np.ndarray) -> np.ndarray:
        return n


def place_bodies(
    centres: np.ndarray,
    quaternions: np.ndarray,
    shapes: Sequence[Drawable],
    shape_ids: np.ndarray,
    scales: np.ndarray,
) -> Bodies:
    """Give the bodies at their places as triangles; each sphere of a body of spheres is a part of its own."""
    turn = rotation_matrices(quaternions)
    drawn, parts = [*shapes, _Ball()], []
    for kind, shape in enumerate(shapes):
        members, spheres = (
            np.flatnonzero(shape_ids == kind),
            getattr(shape, "spheres_m", ()),
        )
        if not len(spheres):
            parts.append(
                (
                    centres[members],
                    scales[members],
                    np.full(len(members), kind),
                    members,
                )
            )
            continue
        drawn[kind] = _Ball()
        own, owner = (
            np.tile(spheres, (len(members), 1)),
            np.repeat(members, len(spheres)),
        )
        places = centres[owner] + scales[owner, None] * np.einsum(
            "nij,nj->ni", turn[owner], own[:, :3]
        )
        parts.append(
            (places, scales[owner] * own[:, 3], np.full(len(owner), len(shapes)), owner)
        )
    places, sizes, ids, owner = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    tessellated = [tessellate(shape) for shape in drawn]
    points, normals = (np.array([body[k] for body in tessellated]) for k in range(2))
    vertices = places[:, None, :] + np.einsum(
        "nij,nvj->nvi", turn[owner], sizes[:, None, None] * points[ids]
    )
    radii = np.array([shape.bounding_radius_m for shape in shapes])
    largest = float((radii[shape_ids] * scales).max(initial=0.0)) or float(radii[0])
    return Bodies(
        normals, tessellated[0][2], ids, turn[owner], vertices, owner, largest
    )
