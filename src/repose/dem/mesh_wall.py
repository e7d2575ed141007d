"""A wall of triangles."""

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from .errors import InputError
from .kernels.features import split
from .motion import ORIGIN, STILL, UP, Motion


@dataclass(frozen=True, eq=False)
class Mesh:
    """A wall of triangles, touched from the side of their outward normals: the surface of a solid obstacle.

    Parameters
    ----------
    vertices_m : array_like (V, 3)
        Vertices [m].
    faces : array_like of int (F, 3)
        Indices of each triangle's vertices, counter-clockwise seen from the bodies. No triangle may be degenerate; at
        most two triangles, wound alike, may meet at an edge.
    material : str
        A name that the simulation knows.
    edge_radius_m : float
        Convex edges and vertices, and open borders, are rounded with this radius, above 0 [m]. The rounding is tangent
        to the faces, which stay where they are. It must leave every triangle some room.
    motion : Motion
        How the wall moves; by default it rests.

    Raises
    ------
    ValueError
        Naming the argument and what is allowed.

    Notes
    -----
    Bodies that come from behind a face pass through it. Where faces meet in a concave kink below 20 degrees, a body
    touches the face that it overlaps most.
    """

    vertices_m: np.ndarray
    faces: np.ndarray
    material: str
    edge_radius_m: float = 0.0005
    motion: Motion = STILL

    origin_m = ORIGIN
    axis = UP

    def __post_init__(self):
        vertices = np.asarray(self.vertices_m, float)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.all(np.isfinite(vertices)):
            raise ValueError(f"vertices_m is {self.vertices_m!r}; allowed: (V, 3) finite numbers")
        faces = np.asarray(self.faces)
        if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces) or faces.dtype.kind not in "iu":
            raise ValueError(f"faces is {self.faces!r}; allowed: (F, 3) whole numbers, at least one triangle")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(
                f"faces has {faces.min()} to {faces.max()}; allowed: 0 to {len(vertices) - 1}, rows of vertices_m"
            )
        if not (math.isfinite(self.edge_radius_m) and self.edge_radius_m > 0.0):
            raise ValueError(f"edge_radius_m is {self.edge_radius_m!r}; allowed: above 0")
        corners = vertices[faces]
        sides = corners[:, 1:] - corners[:, :1]
        thin = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        thin = np.flatnonzero(thin <= 1e-12 * np.max(np.sum(np.ptp(vertices, axis=0) ** 2)))
        if len(thin):
            raise ValueError(
                f"faces has {faces[thin[0]].tolist()}, a triangle without area; allowed: triangles with an area"
            )
        if not isinstance(self.motion, Motion):
            raise ValueError(f"motion is {self.motion!r}; allowed: a Motion")
        object.__setattr__(self, "vertices_m", vertices)
        object.__setattr__(self, "faces", faces.astype(np.int64))
        object.__setattr__(self, "part", split(vertices, self.faces, float(self.edge_radius_m)))

    @classmethod
    def from_stl(
        cls,
        path: str | os.PathLike,
        material: str,
        scale: float = 1.0,
        edge_radius_m: float = 0.0005,
        motion: Motion = STILL,
    ) -> "Mesh":
        """A mesh from a file.

        Parameters
        ----------
        path : path
            An STL file, or another that trimesh reads.
        material : str
            A name that the simulation knows.
        scale : float
            Metres of one unit of the file, above 0.
        edge_radius_m, motion
            As of `Mesh`.

        Returns
        -------
        Mesh
            The wall.

        Raises
        ------
        repose.dem.errors.InputError
            A ValueError that names the file where it cannot be read or has no triangle.
        ValueError
            Naming the file where its triangles are no `Mesh`, or the scale.
        """
        if not (math.isfinite(scale) and scale > 0.0):
            raise ValueError(f"scale is {scale!r}; allowed: above 0")
        try:
            source: Any = path
            mesh: Any = trimesh.load(source, force="mesh")
        except Exception as error:  # trimesh's readers raise whatever their parsers do
            raise InputError(
                path, "file", str(error), "a mesh that trimesh can read, such as an STL"
            ) from None
        if not len(mesh.faces):
            raise InputError(path, "triangles", 0, "at least one")
        mesh.merge_vertices()
        # corners that fall together when merged leave lines, which are no triangles
        mesh.update_faces(np.array([len(set(face)) == 3 for face in mesh.faces.tolist()]))
        try:
            return cls(scale * mesh.vertices, np.array(mesh.faces), material, edge_radius_m, motion)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
