"""Describe walls and their motion, and make their arrays for the kernels.

A wall is a plane, a cone or a cylinder, a rounded ring edge, or a mesh.
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from .checks import (
    check_array,
    check_direction,
    check_mapping,
    check_name,
    check_not_negative,
    check_number,
    check_positive,
    check_vector,
)
from .errors import InputError
from .kernels import state
from .kernels.features import find_features

ORIGIN = (0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)
# Origin and rotation of a frame that coincides with the world's
WORLD_FRAME = np.concatenate([np.zeros(3), np.eye(3).ravel()])
Vector = Sequence[float] | np.ndarray

UNIT_TOLERANCE = 1e-6  # error of the length of a user's unit vector
SMALLEST_AREA = 1e-12  # twice the area of a triangle over the squared size of its mesh
PARALLEL_TOLERANCE = 1e-12  # relative error of an angular velocity's part along an axis
AXIS_TOLERANCE = 1e-9  # distance of a pivot from an axis, over the size of the box


@dataclass(frozen=True)
class Motion:
    """Rigid motion of a wall.

    Parameters
    ----------
    velocity_m_s : array_like (3,)
        Velocity of the pivot [m/s].
    angular_velocity_rad_s : array_like (3,)
        Angular velocity about the pivot [rad/s].
    pivot_m : array_like (3,)
        The pivot at the beginning [m]. It moves along with the wall.

    Raises
    ------
    ValueError
        If a value is not three finite numbers. The message names it.
    """

    velocity_m_s: Vector = ORIGIN
    angular_velocity_rad_s: Vector = ORIGIN
    pivot_m: Vector = ORIGIN

    def __post_init__(self) -> None:
        self.row()  # checks the values

    def row(self) -> np.ndarray:
        """Return velocity, angular velocity and pivot for the kernels (9,)."""
        vectors = [
            check_vector(field.name, getattr(self, field.name))
            for field in fields(self)
        ]
        return np.concatenate(vectors)


STILL = Motion()


def _check_material_and_motion(surface: "Wall") -> None:
    """Raise ValueError unless a wall's material is a name and its motion a `Motion`."""
    check_name("material", surface.material)
    if not isinstance(surface.motion, Motion):
        raise ValueError(f"motion is {surface.motion!r}; expected a Motion")


@dataclass(frozen=True)
class Plane:
    """A plane, or a disc of it.

    Parameters
    ----------
    point_m : array_like (3,)
        A point of the plane, or the centre of a disc [m].
    normal : array_like (3,)
        Normal towards the bodies, of any length but 0.
    material : str
        Name of a material of the simulation.
    radius_m : float
        Radius of a disc, above 0 [m]. By default, the plane is endless.
    motion : Motion
        How the wall moves; by default it rests.

    Raises
    ------
    ValueError
        If a value is not allowed. The message names it and what is allowed.
    """

    point_m: Vector
    normal: Vector
    material: str
    radius_m: float = math.inf
    motion: Motion = STILL

    def __post_init__(self) -> None:
        _check_material_and_motion(self)
        self.row()  # checks the values

    def row(self) -> np.ndarray:
        """Return point, normal and radius for the kernels (7,).

        In the kernels, the normal points into the wall.
        """
        if self.radius_m != math.inf:
            check_positive("radius_m", self.radius_m)
        point = check_vector("point_m", self.point_m)
        normal_into_wall = -check_direction("normal", self.normal)
        return np.concatenate([point, normal_into_wall, [self.radius_m]])


@dataclass(frozen=True)
class Cone:
    """The inside of a cone about an axis.

    The cone is given by its line in the half plane (r, z) of its own frame. The method
    `between` makes a cone from two circles.

    Parameters
    ----------
    line : array_like (7,)
        The unit normal (m_r, m_z) from the inside into the wall; the offset k of the
        line m.(r, z) = k [m]; the first and last place along the line [m]; and the unit
        vector (e_r, e_z) upwards along the line.
    material : str
        Name of a material of the simulation.
    origin_m : array_like (3,)
        Origin of the wall's own frame [m].
    axis : array_like (3,)
        Direction of the frame's z axis, of any length but 0.
    motion : Motion
        How the wall moves; by default it rests.

    Raises
    ------
    ValueError
        If a value is not allowed. The message names it and what is allowed.
    """

    line: Vector
    material: str
    origin_m: Vector = ORIGIN
    axis: Vector = UP
    motion: Motion = STILL

    def __post_init__(self) -> None:
        _check_material_and_motion(self)
        m_r, m_z, _offset, first, last, e_r, e_z = check_vector("line", self.line, 7)
        # Deviations of both unit vectors from length 1
        normal_error = abs(math.hypot(m_r, m_z) - 1.0)
        direction_error = abs(math.hypot(e_r, e_z) - 1.0)
        if max(normal_error, direction_error) > UNIT_TOLERANCE or not first < last:
            raise ValueError(
                f"line is {self.line!r}; expected unit vectors (m_r, m_z) and "
                "(e_r, e_z), first below last place"
            )
        compute_frame(self)  # checks origin and axis

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
        """Make the wall of a cone between two circles; bodies touch it from inside.

        Parameters
        ----------
        base_m : array_like (3,)
            Centre of the first circle [m].
        axis : array_like (3,)
            Direction from the first circle to the second, of any length but 0.
        height_m : float
            Distance between the circles, above 0 [m].
        base_radius_m, top_radius_m : float
            Radii of the first and of the second circle [m]. At most one of them may be
            0.
        material : str
            Name of a material of the simulation.
        motion : Motion
            How the wall moves; by default it rests.

        Returns
        -------
        Cone
            The wall.

        Raises
        ------
        ValueError
            If a value is not allowed. The message names it and what is allowed.
        """
        check_vector("base_m", base_m)
        height = check_positive("height_m", height_m)
        check_not_negative("base_radius_m", base_radius_m)
        check_not_negative("top_radius_m", top_radius_m)
        if base_radius_m == top_radius_m == 0.0:
            raise ValueError(
                "base_radius_m and top_radius_m are both 0; "
                "expected at most one of them to be 0"
            )

        # In the half plane (r, z) the cone is a line from the first circle, at z = 0,
        # to the second. The unit vector e points along this line. The unit normal m is
        # perpendicular to e and points into the wall, away from the axis.
        length = math.hypot(height, top_radius_m - base_radius_m)
        e_r = (top_radius_m - base_radius_m) / length
        e_z = height / length
        m_r, m_z = e_z, -e_r
        # Distance of the line from the origin, and positions of both circles along it
        offset = m_r * base_radius_m
        first = e_r * base_radius_m
        last = e_r * top_radius_m + e_z * height
        # The order is that of the columns of `kernels.state.Walls.cones`.
        line = (m_r, m_z, offset, first, last, e_r, e_z)
        # The class checks the axis and the other arguments.
        return cls(line, material, base_m, axis, motion)

    def row(self) -> np.ndarray:
        """Return the line for the kernels, in the wall's own frame.

        The last column is unused.
        """
        return np.array([*self.line, 0.0], float)


def Cylinder(
    base_m: Vector,
    axis: Vector,
    height_m: float,
    radius_m: float,
    material: str,
    motion: Motion = STILL,
) -> Cone:
    """Make the inside of a cylinder.

    Parameters
    ----------
    base_m : array_like (3,)
        Centre of the first end [m].
    axis : array_like (3,)
        Direction from the first end to the other, of any length but 0.
    height_m : float
        Distance between the ends, above 0 [m].
    radius_m : float
        Radius, above 0 [m].
    material : str
        Name of a material of the simulation.
    motion : Motion
        How the wall moves; by default it rests.

    Returns
    -------
    Cone
        The wall, a cone with two equal radii.

    Raises
    ------
    ValueError
        If a value is not allowed. The message names it and what is allowed.
    """
    check_positive("radius_m", radius_m)
    return Cone.between(base_m, axis, height_m, radius_m, radius_m, material, motion)


@dataclass(frozen=True)
class RingEdge:
    """A rounded circular edge about an axis: a torus.

    Parameters
    ----------
    radius_m : float
        Radius of the core circle, above `edge_radius_m` [m].
    edge_radius_m : float
        Radius of the edge, above 0 [m].
    material : str
        Name of a material of the simulation.
    gates : array_like (2, 2)
        Two directions (g_r, g_z) in the half plane (r, z), along the walls that meet at
        the edge. If the contact normal, from the body into the edge, opposes one of
        them, the point lies behind these walls and there is no contact. With zeros, the
        whole torus can be touched.
    height_m : float
        Height of the core circle in the wall's own frame [m].
    origin_m : array_like (3,)
        Origin of the wall's own frame [m].
    axis : array_like (3,)
        Direction of the frame's z axis, of any length but 0.
    motion : Motion
        How the wall moves; by default it rests.

    Raises
    ------
    ValueError
        If a value is not allowed. The message names it and what is allowed.
    """

    radius_m: float
    edge_radius_m: float
    material: str
    gates: tuple = ((0.0, 0.0), (0.0, 0.0))
    height_m: float = 0.0
    origin_m: Vector = ORIGIN
    axis: Vector = UP
    motion: Motion = STILL

    def __post_init__(self) -> None:
        _check_material_and_motion(self)
        edge = check_positive("edge_radius_m", self.edge_radius_m)
        check_number(
            "radius_m",
            self.radius_m,
            allowed=f"above edge_radius_m, {edge}",
            accepts=lambda radius: radius > edge,
        )
        check_number("height_m", self.height_m, "a finite number", lambda _height: True)
        check_array("gates", self.gates, (2, 2), "two directions of two finite numbers")
        compute_frame(self)  # checks origin and axis

    def row(self) -> np.ndarray:
        """Return radius, height, edge radius and gates in the wall's own frame (7,)."""
        first_gate, second_gate = self.gates
        circle = (self.radius_m, self.height_m, self.edge_radius_m)
        return np.array([*circle, *first_gate, *second_gate], float)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A wall of triangles, the surface of a solid obstacle.

    Bodies touch it from the side of the outward normals.

    Parameters
    ----------
    vertices_m : array_like (V, 3)
        Vertices [m].
    faces : array_like of int (F, 3)
        Indices of each triangle's vertices, counter-clockwise when viewed from the
        bodies. No triangle may be degenerate. At most two triangles may meet at an
        edge, and they must have the same orientation.
    material : str
        Name of a material of the simulation.
    edge_radius_m : float
        Radius with which convex edges, vertices and open borders are rounded, above 0
        [m]. The rounding is tangent to the faces, which stay where they are. It must
        leave some room on every triangle.
    motion : Motion
        How the wall moves; by default it rests.

    Raises
    ------
    ValueError
        If an argument is not allowed. The message names it and what is allowed.

    Notes
    -----
    Bodies that come from behind a face pass through it. If faces meet in a concave kink
    of less than 20 degrees, a body touches the face that it overlaps most.
    """

    vertices_m: np.ndarray
    faces: np.ndarray
    material: str
    edge_radius_m: float = 0.0005
    motion: Motion = STILL

    origin_m = ORIGIN
    axis = UP

    def __post_init__(self) -> None:
        _check_material_and_motion(self)
        vertices = check_array(
            "vertices_m", self.vertices_m, (None, 3), "(V, 3) finite numbers"
        )
        edge = check_positive("edge_radius_m", self.edge_radius_m)
        faces = _check_faces(self.faces, vertices)
        object.__setattr__(self, "vertices_m", vertices)
        object.__setattr__(self, "faces", faces)
        # The faces, edges and vertices that bodies can touch, in the form of the
        # kernels
        object.__setattr__(self, "part", find_features(vertices, faces, edge))

    @classmethod
    def from_stl(
        cls,
        path: str | os.PathLike,
        material: str,
        scale: float = 1.0,
        edge_radius_m: float = 0.0005,
        motion: Motion = STILL,
    ) -> "Mesh":
        """Read a mesh from an STL file, or from another file that trimesh can read.

        Parameters
        ----------
        path : path
            The file.
        material : str
            Name of a material of the simulation.
        scale : float
            Length of one unit of the file in metres, above 0.
        edge_radius_m, motion
            See `Mesh`.

        Returns
        -------
        Mesh
            The wall.

        Raises
        ------
        repose.dem.errors.InputError
            If the file cannot be read or has no triangle. This error is a ValueError
            and names the file.
        ValueError
            If the triangles do not make a `Mesh`, or if the scale is not allowed.
        """
        import trimesh  # slow to import, and only needed to read a mesh

        check_positive("scale", scale)
        try:
            # The types of trimesh are incomplete, so the type checker is told to accept
            # anything.
            source: Any = path
            mesh: Any = trimesh.load(source, force="mesh")
        except Exception as error:  # trimesh's readers raise whatever their parsers do
            raise InputError(
                path, "file", str(error), "a mesh that trimesh can read, such as an STL"
            ) from None
        if not len(mesh.faces):
            raise InputError(path, "triangles", 0, "at least one")
        mesh.merge_vertices()
        # If two corners of a triangle were merged, it is a line and has no area. Leave
        # it out.
        is_triangle = [len(set(face)) == 3 for face in mesh.faces.tolist()]
        mesh.update_faces(np.array(is_triangle))
        vertices = scale * mesh.vertices
        try:
            return cls(vertices, np.array(mesh.faces), material, edge_radius_m, motion)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None


def _check_faces(value: Any, vertices: np.ndarray) -> np.ndarray:
    """Check the triangles of a mesh.

    Parameters
    ----------
    value : array_like
        The user's value.
    vertices : ndarray (V, 3)
        Vertices of the mesh [m].

    Returns
    -------
    ndarray of int (F, 3)
        Indices of the vertices of each triangle.

    Raises
    ------
    ValueError
        If the value is not an array (F, 3) of whole numbers, if it refers to a missing
        vertex, or if a triangle has no area.
    """
    faces = np.asarray(value)
    # An array of whole numbers with three columns and at least one row
    has_shape = faces.ndim == 2 and faces.shape[1] == 3 and len(faces) > 0
    if not has_shape or faces.dtype.kind not in "iu":
        raise ValueError(
            f"faces is {value!r}; expected (F, 3) whole numbers, at least one triangle"
        )
    last = len(vertices) - 1
    if faces.min() < 0 or faces.max() > last:
        raise ValueError(
            f"faces has {faces.min()} to {faces.max()}; "
            f"expected 0 to {last}, rows of vertices_m"
        )
    # The length of the cross product of two sides is twice the area. A triangle has no
    # area if this is below a fraction (SMALLEST_AREA) of the squared size of the mesh.
    corners = vertices[faces]
    first_side = corners[:, 1] - corners[:, 0]
    second_side = corners[:, 2] - corners[:, 0]
    double_areas = np.linalg.norm(np.cross(first_side, second_side), axis=1)
    squared_size = np.sum(np.ptp(vertices, axis=0) ** 2)
    degenerate = np.flatnonzero(double_areas <= SMALLEST_AREA * squared_size)
    if len(degenerate):
        raise ValueError(
            f"faces has {faces[degenerate[0]].tolist()}, a triangle without area; "
            "expected triangles with an area"
        )
    return faces.astype(np.int64)


def compute_frame(surface: Any) -> np.ndarray:
    """Compute the frame of a curved wall or a mesh.

    Parameters
    ----------
    surface : Cone, RingEdge or Mesh
        The wall, with `origin_m` and `axis`.

    Returns
    -------
    ndarray (12,)
        The origin of the frame [m], then the rows of its rotation to the world. The z
        axis of the frame is the axis of the wall.

    Raises
    ------
    ValueError
        If origin or axis are not three finite numbers, or the axis is zero.
    """
    origin = check_vector("origin_m", surface.origin_m)
    z = check_direction("axis", surface.axis)
    if np.array_equal(z, UP):
        rotation = np.eye(3)
    else:
        # Curved walls are symmetric about z, so any x axis perpendicular to z will do.
        # It is derived from the axis of the world that is least parallel to z.
        world_axis = np.eye(3)[np.argmin(np.abs(z))]
        x = np.cross(z, world_axis)
        x /= np.linalg.norm(x)
        y = np.cross(z, x)
        rotation = np.column_stack([x, y, z])
    return np.concatenate([origin, rotation.ravel()])


Wall = Plane | Cone | RingEdge | Mesh
WALL_KINDS = (Plane, Cone, RingEdge, Mesh)  # in the order of the kernels


@dataclass
class WallSet:
    """Named walls in the order of the kernels: planes, cones, rings, meshes."""

    surfaces: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.surfaces = check_mapping(
            "walls",
            self.surfaces,
            WALL_KINDS,
            "Plane, Cone, Cylinder, RingEdge or Mesh",
        )
        self.names: list[str] = []
        for kind in WALL_KINDS:
            for name, surface in self.surfaces.items():
                if isinstance(surface, kind):
                    self.names.append(name)

    def list_walls(self, kind: type) -> list:
        """List the walls of a class, in order."""
        walls = [self.surfaces[name] for name in self.names]
        return [wall for wall in walls if isinstance(wall, kind)]

    def with_motion(self, name: str, motion: Motion) -> "WallSet":
        """Return the same walls, one of them with another motion.

        Raises ValueError if no wall has this name.
        """
        if name not in self.surfaces:
            allowed = ", ".join(self.names) or "none, there are no walls"
            raise ValueError(f"wall is {name!r}; expected {allowed}")
        moved = replace(self.surfaces[name], motion=motion)
        return WallSet({**self.surfaces, name: moved})


def make_wall_arrays(
    wall_set: WallSet,
    material_numbers: Mapping[str, int],
    box_size_m: float,
    old_walls: state.Walls | None = None,
    changed_wall: int = -1,
) -> state.Walls:
    """Make the arrays of the walls for the kernels.

    Walls are numbered by kind: planes, cones, rings, meshes. Planes are stored as
    points and normals. All other walls have a frame, whose motion moves them.

    Parameters
    ----------
    wall_set : WallSet
        The walls.
    material_numbers : mapping
        Number of each material by its name.
    box_size_m : float
        Size of the box in which the bodies stay [m].
    old_walls : Walls, optional
        Arrays of the same walls in a running simulation. The new arrays take over the
        present positions of all walls, and the motions of all but `changed_wall`. None
        stands for the beginning of a simulation.
    changed_wall : int
        Number of the wall that has another motion than in `old_walls`; -1 for none.

    Returns
    -------
    Walls
        The arrays (`kernels.state.Walls`).
    """
    # Sort the walls by kind. The widths of the rows are those of `kernels.state`: a
    # frame is an origin (3) and a rotation (9), a motion is velocity, angular velocity
    # and pivot (3 each).
    planes, cones, rings, meshes = (wall_set.list_walls(kind) for kind in WALL_KINDS)
    walls_with_frame = [*cones, *rings, *meshes]
    surfaces = [*planes, *walls_with_frame]
    plane_rows = _stack_rows([wall.row() for wall in planes], state.PLANE_COLUMNS)
    frames = _stack_rows([compute_frame(wall) for wall in walls_with_frame], 12)
    motions = _stack_rows([wall.motion.row() for wall in surfaces], 9)
    # The distance by which any wall may have approached a body until now [m]
    path = 0.0
    was_displaced = np.zeros(len(frames), bool)
    if old_walls is not None:
        plane_rows = old_walls.planes.copy()
        frames = old_walls.frames.copy()
        # All walls but the changed one keep their motions, whose pivots have moved
        # along with them. If `changed_wall` is -1, this is all of them.
        is_unchanged = np.arange(len(motions)) != changed_wall
        motions[is_unchanged] = old_walls.motion[is_unchanged]
        path = old_walls.approach[state.WALL_PATH]
        was_displaced = old_walls.displaced > 0

    # A wall moves if one of its velocities, the first six columns, is not zero.
    moves = np.any(motions[:, :6] != 0.0, axis=1)
    # The kernels transform bodies to the frame of a wall only if the wall is displaced.
    # It is displaced if its frame differs from that of the world, has done so before,
    # or will do so because the wall moves. `moves` has the planes first, which have no
    # frame.
    is_elsewhere = np.any(frames != WORLD_FRAME, axis=1)
    is_displaced = is_elsewhere | moves[len(planes) :] | was_displaced

    speeds = _bound_approach_speeds(surfaces, plane_rows, frames, motions, box_size_m)
    materials = [material_numbers[surface.material] for surface in surfaces]
    # `approach` is the path, the speed of the fastest wall and whether any wall moves.
    return state.Walls(
        planes=plane_rows,
        cones=_stack_rows([wall.row() for wall in cones], state.CONE_COLUMNS),
        rings=_stack_rows([wall.row() for wall in rings], state.RING_COLUMNS),
        frames=frames,
        displaced=is_displaced.astype(np.uint8),
        motion=motions,
        moves=moves.astype(np.uint8),
        material=np.array(materials, np.uint8),
        approach=np.array([path, max(speeds, default=0.0), float(moves.any())]),
        loads=np.zeros((0, 6)),
    )


def _bound_approach_speeds(
    surfaces: Sequence[Wall],
    plane_rows: np.ndarray,
    frames: np.ndarray,
    motions: np.ndarray,
    box_size_m: float,
) -> list[float]:
    """Compute an upper bound on the approach speed of each wall.

    The bound of one wall is computed by `_bound_approach_speed`. All arrays have the
    planes first, then the other walls.

    Parameters
    ----------
    surfaces : sequence of Wall
        The N walls: P planes, then C other walls, which have frames.
    plane_rows : ndarray (P, 7)
        Present point (3), normal (3) and radius of each plane.
    frames : ndarray (C, 12)
        Present origin (3) and rotation (9) of the frame of each other wall.
    motions : ndarray (N, 9)
        Velocity, angular velocity and pivot of each wall, three numbers each.
    box_size_m : float
        Size of the box in which the bodies stay [m].

    Returns
    -------
    list of float
        The bounds [m/s].
    """
    normals = plane_rows[:, 3:6]
    # The third column of a rotation is the z axis of the frame, which is the axis of a
    # cone or ring.
    frame_axes = frames[:, 3:].reshape(-1, 3, 3)[:, :, 2]
    axes = [*normals, *frame_axes]
    points = [*plane_rows[:, :3], *frames[:, :3]]
    speeds = []
    for k, surface in enumerate(surfaces):
        speeds.append(
            _bound_approach_speed(surface, axes[k], points[k], motions[k], box_size_m)
        )
    return speeds


def _stack_rows(rows: list[np.ndarray], columns: int) -> np.ndarray:
    """Stack rows into an array (N, columns), even if there are none."""
    return np.array(rows).reshape(-1, columns)


def _bound_approach_speed(
    surface: Wall,
    axis: np.ndarray,
    point: np.ndarray,
    motion: np.ndarray,
    box_size_m: float,
) -> float:
    """Compute an upper bound on the speed of a wall's points towards a body.

    The rotation of a plane, cone or ring about its own axis does not count, because its
    surface then moves along itself.

    Parameters
    ----------
    surface : Plane, Cone, RingEdge or Mesh
        The wall.
    axis : ndarray (3,)
        Normal of a plane. For any other wall, the z axis of its present frame, which is
        the axis of a cone or ring.
    point : ndarray (3,)
        Point of a plane. For any other wall, the origin of its present frame [m].
    motion : ndarray (9,)
        Velocity, angular velocity and pivot of the wall, three numbers each.
    box_size_m : float
        Size of the box in which the bodies stay [m].

    Returns
    -------
    float
        The bound [m/s].
    """
    velocity = motion[:3]
    angular_velocity = motion[3:6]
    pivot = motion[6:]
    speed = float(np.linalg.norm(velocity))
    angular_speed = float(np.linalg.norm(angular_velocity))
    if angular_speed == 0.0:
        return speed

    # The speed of a point is at most the angular speed times its distance from the
    # pivot.
    offset = point - pivot
    distance = np.linalg.norm(offset)
    if isinstance(surface, Mesh):
        # The vertices are given in the frame of the mesh, whose origin is `point`.
        largest_distance = np.linalg.norm(surface.vertices_m, axis=1).max()
        return speed + angular_speed * float(largest_distance + distance)

    # A plane, cone or ring that rotates about its own axis does not approach any body:
    # its axis is parallel to the angular velocity, and the pivot lies on it.
    axial_speed = abs(axis @ angular_velocity)
    is_parallel = abs(axial_speed - angular_speed) < PARALLEL_TOLERANCE * angular_speed
    offset_across_axis = offset - (offset @ axis) * axis
    if is_parallel and np.linalg.norm(offset_across_axis) < AXIS_TOLERANCE * box_size_m:
        return speed
    # Bodies touch other walls only within the box.
    return speed + angular_speed * float(box_size_m + distance)
