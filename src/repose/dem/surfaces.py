"""Walls as a user states them: planes, cones and cylinders, rounded ring edges, meshes, at rest or moving."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import trimesh

from .checks import array, mapping, name_of, not_negative, number
from .checks import direction as _direction
from .checks import positive as _positive
from .checks import vector as _vector
from .errors import InputError
from .kernels.features import split

ORIGIN = (0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)
Vector = Sequence[float] | np.ndarray


@dataclass(frozen=True)
class Motion:
    """Rigid motion of a wall: velocity of the pivot [m/s], angular velocity [rad/s], pivot (moves along) [m].

    Raises ValueError naming the value that is not three finite numbers.
    """

    velocity_m_s: Vector = ORIGIN
    angular_velocity_rad_s: Vector = ORIGIN
    pivot_m: Vector = ORIGIN

    def __post_init__(self):
        self.row()

    def row(self) -> np.ndarray:
        """Velocity, angular velocity and pivot as the kernels take them (9,)."""
        return np.concatenate(
            [
                _vector("velocity_m_s", self.velocity_m_s),
                _vector("angular_velocity_rad_s", self.angular_velocity_rad_s),
                _vector("pivot_m", self.pivot_m),
            ]
        )


STILL = Motion()


def _check_common(surface):
    """ValueError unless a wall's material is a name and its motion a `Motion`."""
    name_of("material", surface.material)
    if not isinstance(surface.motion, Motion):
        raise ValueError(f"motion is {surface.motion!r}; allowed: a Motion")


@dataclass(frozen=True)
class Plane:
    """A plane, or a disc of it: its middle [m], normal towards the bodies, radius [m].

    Raises ValueError naming the value and what is allowed.
    """

    point_m: Vector
    normal: Vector
    material: str
    radius_m: float = math.inf
    motion: Motion = STILL

    def __post_init__(self):
        _check_common(self)
        self.row()

    def row(self):
        """The plane as the kernels take it: its normal points into the wall there."""
        if self.radius_m != math.inf:
            _positive("radius_m", self.radius_m)
        return np.concatenate(
            [_vector("point_m", self.point_m), -_direction("normal", self.normal), [self.radius_m]]
        )


@dataclass(frozen=True)
class Cone:
    """The inside of a cone about an axis, given by its line in the half plane (r, z) of its own frame.

    line: m_r, m_z (unit normal from the inside into the wall), offset k with m.(r, z) = k, first and last place along
    the line, e_r, e_z (unit vector up along the line). origin_m, axis: of the frame. See `between`.
    Raises ValueError naming the value and what is allowed.
    """

    line: Vector
    material: str
    origin_m: Vector = ORIGIN
    axis: Vector = UP
    motion: Motion = STILL

    def __post_init__(self):
        _check_common(self)
        m_r, m_z, _offset, first, last, e_r, e_z = _vector("line", self.line, 7)
        if max(abs(math.hypot(m_r, m_z) - 1.0), abs(math.hypot(e_r, e_z) - 1.0)) > 1e-6 or not first < last:
            raise ValueError(
                f"line is {self.line!r}; allowed: unit vectors (m_r, m_z) and (e_r, e_z), first below last place"
            )
        frame_of(self)

    @classmethod
    def between(
        cls,
        base_m: Vector,
        axis: Vector,
        height_m: float,
        base_radius_m: float,
        top_radius_m: float,
        material: str,
        motion: Motion = STILL,
    ) -> "Cone":
        """The inside of a cone between two circles: the middle of the first, height and radii [m].

        One of the radii may be 0. Raises ValueError naming the value and what is allowed.
        """
        _vector("base_m", base_m)
        height = _positive("height_m", height_m)
        not_negative("base_radius_m", base_radius_m)
        not_negative("top_radius_m", top_radius_m)
        if base_radius_m == top_radius_m == 0.0:
            raise ValueError("base_radius_m and top_radius_m are 0; allowed: at most one of them")
        length = math.hypot(height, top_radius_m - base_radius_m)
        e_r, e_z = (top_radius_m - base_radius_m) / length, height / length
        line = (
            e_z,
            -e_r,
            e_z * base_radius_m,
            e_r * base_radius_m,
            e_r * top_radius_m + e_z * height,
            e_r,
            e_z,
        )
        return cls(line, material, base_m, axis, motion)

    def row(self):
        """The cone as the kernels take it, in its own frame."""
        return np.array([*self.line, 0.0], float)


def Cylinder(
    base_m: Vector, axis: Vector, height_m: float, radius_m: float, material: str, motion: Motion = STILL
) -> Cone:
    """The inside of a cylinder: the middle of its first end, axis, height and radius [m].

    Raises ValueError naming the value and what is allowed.
    """
    _positive("radius_m", radius_m)
    return Cone.between(base_m, axis, height_m, radius_m, radius_m, material, motion)


@dataclass(frozen=True)
class RingEdge:
    """A rounded circular edge, a torus: radius of its core circle and of the edge [m], about an axis.

    gates: two directions (g_r, g_z) of the half plane (r, z); a contact normal, seen from the body, that opposes one
    of them would lie behind the walls that meet at the edge and is no contact. Zeros leave the whole torus open.
    Raises ValueError naming the value and what is allowed.
    """

    radius_m: float
    edge_radius_m: float
    material: str
    gates: tuple = ((0.0, 0.0), (0.0, 0.0))
    height_m: float = 0.0
    origin_m: Vector = ORIGIN
    axis: Vector = UP
    motion: Motion = STILL

    def __post_init__(self):
        _check_common(self)
        edge = _positive("edge_radius_m", self.edge_radius_m)
        number("radius_m", self.radius_m, f"above edge_radius_m, {edge}", lambda radius: radius > edge)
        number("height_m", self.height_m, "a finite number", lambda _height: True)
        array("gates", self.gates, (2, 2), "two directions of two finite numbers")
        frame_of(self)

    def row(self):
        """The ring as the kernels take it, in its own frame."""
        return np.array(
            [self.radius_m, self.height_m, self.edge_radius_m, *self.gates[0], *self.gates[1]], float
        )


@dataclass(frozen=True, eq=False)
class Mesh:
    """A wall of triangles, touched from the side of their outward normals: the surface of a solid obstacle.

    vertices_m (V, 3) [m]; faces (F, 3): indices of a triangle's vertices, counter-clockwise seen from the bodies;
    edge_radius_m: convex edges and vertices are rounded with it, tangent to the faces, which stay where they are, and
    so are open borders. It must leave every triangle some room. Bodies that come from behind a face pass through it.
    Of faces that meet in a concave kink below 20 degrees a body touches the one that it overlaps most.
    Raises ValueError naming the argument and what is allowed: no degenerate triangle, at most two triangles at an edge,
    wound alike.
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
        """A mesh from an STL file (or what else trimesh reads); scale: metres of one unit of the file.

        Raises InputError, a ValueError, naming the file and what is wrong with it.
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


def frame_of(surface: Any) -> np.ndarray:
    """Origin and rotation (frame to world, by rows) of a curved surface as the kernels take them (12,)."""
    z = _direction("axis", surface.axis)
    frame = np.eye(3)
    if not np.array_equal(z, UP):
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        frame = np.column_stack([x, np.cross(z, x), z])
    return np.concatenate([_vector("origin_m", surface.origin_m), frame.ravel()])


Wall = Plane | Cone | RingEdge | Mesh


@dataclass
class WallSet:
    """Named walls, sorted into the order of the kernels: planes, cones, rings, meshes."""

    surfaces: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        kinds = (Plane, Cone, RingEdge, Mesh)
        self.surfaces = mapping("walls", self.surfaces, kinds, "Plane, Cone, Cylinder, RingEdge or Mesh")
        self.names = [
            n for kind in kinds for n, surface in self.surfaces.items() if isinstance(surface, kind)
        ]

    def of(self, kind: type) -> list:
        """The walls of a kind, in order."""
        return [self.surfaces[n] for n in self.names if isinstance(self.surfaces[n], kind)]

    def with_motion(self, name: str, motion: Motion) -> "WallSet":
        """The same walls, one of them with another motion."""
        if name not in self.surfaces:
            raise ValueError(
                f"wall is {name!r}; allowed: {', '.join(self.names) or 'none, there are no walls'}"
            )
        return WallSet({**self.surfaces, name: replace(self.surfaces[name], motion=motion)})
