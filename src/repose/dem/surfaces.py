"""Walls as a user states them: planes, insides of cones and cylinders, rounded ring edges, at rest or moving."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

ORIGIN = (0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)


def _vector(name, value):
    """Three finite numbers as an array, or ValueError."""
    vector = np.asarray(value, float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ValueError(f"{name} is {value!r}; allowed: three finite numbers")
    return vector


def _direction(name, value):
    """A unit vector along three numbers, or ValueError."""
    vector = _vector(name, value)
    length = np.linalg.norm(vector)
    if not length > 0.0:
        raise ValueError(f"{name} is {value!r}; allowed: a vector that is not zero")
    return vector / length


def _positive(name, value):
    """A number above zero, or ValueError."""
    if not value > 0.0:
        raise ValueError(f"{name} is {value!r}; allowed: above 0")
    return float(value)


@dataclass(frozen=True)
class Motion:
    """Rigid motion of a wall: velocity of the pivot [m/s], angular velocity [rad/s], pivot (moves along) [m]."""

    velocity_m_s: tuple = ORIGIN
    angular_velocity_rad_s: tuple = ORIGIN
    pivot_m: tuple = ORIGIN

    def row(self):
        """Velocity, angular velocity and pivot as the kernels take them (9,)."""
        return np.concatenate(
            [
                _vector("velocity_m_s", self.velocity_m_s),
                _vector("angular_velocity_rad_s", self.angular_velocity_rad_s),
                _vector("pivot_m", self.pivot_m),
            ]
        )


STILL = Motion()


@dataclass(frozen=True)
class Plane:
    """A plane, or a disc of it: its middle [m], normal towards the bodies, radius [m]."""

    point_m: tuple
    normal: tuple
    material: str
    radius_m: float = math.inf
    motion: Motion = STILL

    def row(self):
        """The plane as the kernels take it: its normal points into the wall there."""
        _positive("radius_m", self.radius_m)
        return np.concatenate(
            [_vector("point_m", self.point_m), -_direction("normal", self.normal), [self.radius_m]]
        )


@dataclass(frozen=True)
class Cone:
    """The inside of a cone about an axis, given by its line in the half plane (r, z) of its own frame.

    line: m_r, m_z (unit normal from the inside into the wall), offset k with m.(r, z) = k, first and last place along
    the line, e_r, e_z (unit vector up along the line). origin_m, axis: of the frame. See `between`.
    """

    line: tuple
    material: str
    origin_m: tuple = ORIGIN
    axis: tuple = UP
    motion: Motion = STILL

    @classmethod
    def between(cls, base_m, axis, height_m, base_radius_m, top_radius_m, material, motion=STILL):
        """The inside of a cone between two circles: the middle of the first, height and radii [m]."""
        height = _positive("height_m", height_m)
        for name, radius in (("base_radius_m", base_radius_m), ("top_radius_m", top_radius_m)):
            if not radius >= 0.0:
                raise ValueError(f"{name} is {radius!r}; allowed: 0 or more")
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


def Cylinder(base_m, axis, height_m, radius_m, material, motion=STILL):
    """The inside of a cylinder: the middle of its first end, axis, height and radius [m]."""
    _positive("radius_m", radius_m)
    return Cone.between(base_m, axis, height_m, radius_m, radius_m, material, motion)


@dataclass(frozen=True)
class RingEdge:
    """A rounded circular edge, a torus: radius of its core circle and of the edge [m], about an axis.

    gates: two directions (g_r, g_z) of the half plane (r, z); a contact normal, seen from the body, that opposes one
    of them would lie behind the walls that meet at the edge and is no contact. Zeros leave the whole torus open.
    """

    radius_m: float
    edge_radius_m: float
    material: str
    gates: tuple = ((0.0, 0.0), (0.0, 0.0))
    height_m: float = 0.0
    origin_m: tuple = ORIGIN
    axis: tuple = UP
    motion: Motion = STILL

    def row(self):
        """The ring as the kernels take it, in its own frame."""
        _positive("edge_radius_m", self.edge_radius_m)
        if not self.radius_m > self.edge_radius_m:
            raise ValueError(
                f"radius_m is {self.radius_m!r}; allowed: above edge_radius_m, {self.edge_radius_m}"
            )
        return np.array(
            [self.radius_m, self.height_m, self.edge_radius_m, *self.gates[0], *self.gates[1]], float
        )


def frame_of(surface):
    """Origin and rotation (frame to world, by rows) of a curved surface as the kernels take them (12,)."""
    z = _direction("axis", surface.axis)
    frame = np.eye(3)
    if not np.array_equal(z, UP):
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        frame = np.column_stack([x, np.cross(z, x), z])
    return np.concatenate([_vector("origin_m", surface.origin_m), frame.ravel()])


@dataclass
class WallSet:
    """Named walls, sorted into the order of the kernels: planes, cones, rings."""

    surfaces: dict = field(default_factory=dict)

    def __post_init__(self):
        kinds = (Plane, Cone, RingEdge)
        for name, surface in self.surfaces.items():
            if not isinstance(surface, kinds):
                raise ValueError(f"wall {name!r} is {surface!r}; allowed: Plane, Cone, Cylinder, RingEdge")
        self.names = [
            n for kind in kinds for n, surface in self.surfaces.items() if isinstance(surface, kind)
        ]

    def of(self, kind):
        """The walls of a kind, in order."""
        return [self.surfaces[n] for n in self.names if isinstance(self.surfaces[n], kind)]

    def with_motion(self, name, motion):
        """The same walls, one of them with another motion."""
        if name not in self.surfaces:
            raise ValueError(
                f"wall is {name!r}; allowed: {', '.join(self.names) or 'none, there are no walls'}"
            )
        return WallSet({**self.surfaces, name: replace(self.surfaces[name], motion=motion)})
