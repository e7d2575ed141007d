"""Walls as a user states them: planes, cones and cylinders, rounded ring edges, and named sets of walls."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .checks import array, mapping, name_of, not_negative, number
from .checks import direction as _direction
from .checks import positive as _positive
from .checks import vector as _vector
from .mesh_wall import Mesh
from .motion import ORIGIN, STILL, UP, Motion, Vector


def _check_common(surface):
    """ValueError unless a wall's material is a name and its motion a `Motion`."""
    name_of("material", surface.material)
    if not isinstance(surface.motion, Motion):
        raise ValueError(f"motion is {surface.motion!r}; allowed: a Motion")


@dataclass(frozen=True)
class Plane:
    """A plane, or a disc of it.

    Parameters
    ----------
    point_m : array_like (3,)
        A point of the plane, the middle of a disc [m].
    normal : array_like (3,)
        Normal towards the bodies, of any length but 0.
    material : str
        A name that the simulation knows.
    radius_m : float
        Radius of a disc, above 0 [m]; a plane without end by default.
    motion : Motion
        How the wall moves; by default it rests.

    Raises
    ------
    ValueError
        Naming the value and what is allowed.
    """

    point_m: Vector
    normal: Vector
    material: str
    radius_m: float = math.inf
    motion: Motion = STILL

    def __post_init__(self):
        _check_common(self)
        self.row()

    def row(self) -> np.ndarray:
        """The plane as the kernels take it: its normal points into the wall there."""
        if self.radius_m != math.inf:
            _positive("radius_m", self.radius_m)
        return np.concatenate(
            [_vector("point_m", self.point_m), -_direction("normal", self.normal), [self.radius_m]]
        )


@dataclass(frozen=True)
class Cone:
    """The inside of a cone about an axis, given by its line in the half plane (r, z) of its own frame.

    `between` makes one of two circles.

    Parameters
    ----------
    line : array_like (7,)
        m_r, m_z (unit normal from the inside into the wall), offset k with m.(r, z) = k [m], first and last place along
        the line [m], e_r, e_z (unit vector up along the line).
    material : str
        A name that the simulation knows.
    origin_m : array_like (3,)
        Origin of the wall's own frame [m].
    axis : array_like (3,)
        Direction of the frame's z axis, of any length but 0.
    motion : Motion
        How the wall moves; by default it rests.

    Raises
    ------
    ValueError
        Naming the value and what is allowed.
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
        """The inside of a cone between two circles.

        Parameters
        ----------
        base_m : array_like (3,)
            The middle of the first circle [m].
        axis : array_like (3,)
            Direction from the first circle to the second, of any length but 0.
        height_m : float
            Distance of the circles, above 0 [m].
        base_radius_m, top_radius_m : float
            Radii of the first and of the second circle [m]. One of them may be 0.
        material : str
            A name that the simulation knows.
        motion : Motion
            How the wall moves; by default it rests.

        Returns
        -------
        Cone
            The wall.

        Raises
        ------
        ValueError
            Naming the value and what is allowed.
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

    def row(self) -> np.ndarray:
        """The cone as the kernels take it, in its own frame."""
        return np.array([*self.line, 0.0], float)


def Cylinder(
    base_m: Vector, axis: Vector, height_m: float, radius_m: float, material: str, motion: Motion = STILL
) -> Cone:
    """The inside of a cylinder.

    Parameters
    ----------
    base_m : array_like (3,)
        The middle of its first end [m].
    axis : array_like (3,)
        Direction from the first end to the other, of any length but 0.
    height_m : float
        Distance of the ends, above 0 [m].
    radius_m : float
        Radius, above 0 [m].
    material : str
        A name that the simulation knows.
    motion : Motion
        How the wall moves; by default it rests.

    Returns
    -------
    Cone
        The wall, a cone of two equal radii.

    Raises
    ------
    ValueError
        Naming the value and what is allowed.
    """
    _positive("radius_m", radius_m)
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
        A name that the simulation knows.
    gates : array_like (2, 2)
        Two directions (g_r, g_z) of the half plane (r, z). A contact whose normal, seen from the body, opposes one of
        them lies behind the walls that meet at the edge, and is none. Zeros leave the whole torus open.
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
        Naming the value and what is allowed.
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

    def row(self) -> np.ndarray:
        """The ring as the kernels take it, in its own frame."""
        return np.array(
            [self.radius_m, self.height_m, self.edge_radius_m, *self.gates[0], *self.gates[1]], float
        )


def frame_of(surface: Any) -> np.ndarray:
    """Origin and rotation of a curved surface as the kernels take them.

    Parameters
    ----------
    surface : Cone, RingEdge or Mesh
        With an axis and an origin.

    Returns
    -------
    numpy.ndarray, (12,)
        Origin in m, and the rotation from frame to world by rows.
    """
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
    """Named walls, sorted into the order of the kernels: planes, cones, rings, meshes.

    Parameters
    ----------
    surfaces : mapping, optional
        From name to Plane, Cone, RingEdge or Mesh.

    Raises
    ------
    ValueError
        If a name or a wall is something else.
    """

    surfaces: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        kinds = (Plane, Cone, RingEdge, Mesh)
        self.surfaces = mapping("walls", self.surfaces, kinds, "Plane, Cone, Cylinder, RingEdge or Mesh")
        self.names = [
            n for kind in kinds for n, surface in self.surfaces.items() if isinstance(surface, kind)
        ]

    def of(self, kind: type) -> list:
        """The walls of a kind, in order.

        Parameters
        ----------
        kind : type
            Plane, Cone, RingEdge or Mesh.

        Returns
        -------
        list
            Of that type.
        """
        return [self.surfaces[n] for n in self.names if isinstance(self.surfaces[n], kind)]

    def with_motion(self, name: str, motion: Motion) -> "WallSet":
        """The same walls, one of them with another motion.

        Parameters
        ----------
        name : str
            Of the wall.
        motion : Motion
            Its new motion.

        Returns
        -------
        WallSet
            A new one.

        Raises
        ------
        ValueError
            If no wall has this name.
        """
        if name not in self.surfaces:
            raise ValueError(
                f"wall is {name!r}; allowed: {', '.join(self.names) or 'none, there are no walls'}"
            )
        return WallSet({**self.surfaces, name: replace(self.surfaces[name], motion=motion)})
