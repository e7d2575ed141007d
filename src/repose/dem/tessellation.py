"""Bodies and walls as triangles, for pictures and for files that other programs draw."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from .rotations import rotation_matrices
from .shapes import Clump
from .walls import Cone, Plane, RingEdge

SECTORS = 48  # of a full turn of a wall
TUBE_SECTORS = 24  # of a full turn about a rounded edge


def tessellate(
    body: Any, rings: int = 18, sectors: int = 36
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points [m] (V, 3), unit normals (V, 3) and triangles (T, 3) of a surface, anticlockwise seen from outside.

    The grid has latitudes and longitudes about the body's first axis; V and T are the same for all bodies. A body is
    any object with `support` and `support_point`. Of a clump only the surface that is visible from its centre of mass
    is made.
    """
    latitudes, longitudes = (
        np.linspace(0, math.pi, rings + 1),
        np.linspace(0, 2 * math.pi, sectors, endpoint=False),
    )
    polar, turn = np.meshgrid(latitudes, longitudes, indexing="ij")
    sphere = np.stack(
        [np.cos(polar), np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn)],
        axis=-1,
    )
    # Normals are spread evenly over the surface and not over the directions, so a slim body has well resolved tips.
    normals = (sphere / np.array([body.support(axis) for axis in np.eye(3)])).reshape(
        -1, 3
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    if isinstance(body, Clump):
        return *_seen_from_inside(body, normals), _grid_triangles(rings, sectors)
    return body.support_point(normals), normals, _grid_triangles(rings, sectors)


def _seen_from_inside(clump: Clump, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find a clump's farthest points along unit vectors (V, 3) from its origin, and the normals there."""
    centres, radii = clump.spheres_m[:, :3], clump.spheres_m[:, 3]
    along = rays @ centres.T
    square = along**2 - np.sum(centres**2, axis=1) + radii**2
    reach = np.where(square >= 0.0, along + np.sqrt(np.maximum(square, 0.0)), 0.0)
    farthest = np.argmax(reach, axis=1)
    distance = np.maximum(reach[np.arange(len(rays)), farthest], 0.0)
    points = distance[:, None] * rays
    return points, np.where(
        distance[:, None] > 0.0,
        (points - centres[farthest]) / radii[farthest, None],
        rays,
    )


def _grid_triangles(rows: int, columns: int) -> np.ndarray:
    """Triangulate a grid of points (rows + 1, columns) that closes on itself along its rows."""
    here, there = np.meshgrid(
        np.arange(rows) * columns, np.arange(columns), indexing="ij"
    )
    after = (there + 1) % columns
    a, b, c, d = (
        here + there,
        here + after,
        here + columns + there,
        here + columns + after,
    )
    return np.concatenate(
        [np.stack([a, c, b], -1).reshape(-1, 3), np.stack([b, c, d], -1).reshape(-1, 3)]
    )


def plane_polygon(
    plane: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    others: Sequence[np.ndarray] | np.ndarray = (),
) -> np.ndarray:
    """Corners (M, 3) [m] of the visible part of a plane, anticlockwise seen from the bodies.

    A disc is a polygon of `SECTORS` corners. An endless plane ends at the box and at the `others`, endless planes
    beyond which there are no bodies. Planes are rows (7,) of `Simulation.walls`.
    """
    point, inwards, radius = plane[:3], -plane[3:6], plane[6]
    u = np.cross(np.eye(3)[np.argmin(np.abs(inwards))], inwards)
    u /= np.linalg.norm(u)
    w = np.cross(inwards, u)
    if math.isfinite(radius):
        around = 2.0 * math.pi * np.arange(SECTORS) / SECTORS
        return point + radius * (
            np.cos(around)[:, None] * u + np.sin(around)[:, None] * w
        )
    size = np.linalg.norm(upper - lower)
    centre = 0.5 * (lower + upper)
    middle = centre + ((point - centre) @ inwards) * inwards
    square = np.array(
        [
            middle + size * (a * u + b * w)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
    )
    # a plane that misses the box by no more than the thickness of a wall is shown
    slack = 0.02 * size
    sides = [
        (n, n @ corner + slack * (abs(n @ inwards) > 0.999))
        for n, corner in _box_sides(lower, upper)
    ]
    sides += [(other[3:6], other[3:6] @ other[:3]) for other in others]
    for normal, offset in sides:
        square = _clipped(square, normal, offset)
    return square


def _box_sides(
    lower: np.ndarray, upper: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the outward normals of a box, each with a corner on its side."""
    for axis in np.eye(3):
        yield axis, upper
        yield -axis, lower


def _clipped(polygon: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """Cut a convex polygon (M, 3) to normal.x at most an offset (Sutherland and Hodgman 1974)."""
    beyond = polygon @ normal - offset
    corners = []
    for here, there, a, b in zip(
        polygon, np.roll(polygon, -1, 0), beyond, np.roll(beyond, -1), strict=True
    ):
        if a <= 0.0:
            corners.append(here)
        if a * b < 0.0:
            corners.append(here + a / (a - b) * (there - here))
    return np.array(corners).reshape(-1, 3)


def endless(planes: np.ndarray) -> np.ndarray:
    """Whether each plane, a row (P, 7) of `Simulation.walls`, has no edge."""
    return np.isinf(planes[:, 6])


def visible_polygon(simulation: Any, k: int) -> np.ndarray:
    """`plane_polygon` of plane number k within the simulation's box and its other endless planes."""
    planes = simulation.walls.planes
    others = planes[endless(planes) & (np.arange(len(planes)) != k)]
    return plane_polygon(planes[k], simulation.lower, simulation.upper, others)


def cone_circles(line: Sequence[float] | np.ndarray) -> np.ndarray:
    """Radius and height [m] of the circles at both ends of a cone with this line, in its own frame (2, 2)."""
    m_r, m_z, offset, first, last, e_r, e_z = line
    return np.array(
        [[m_r * offset + e_r * s, m_z * offset + e_z * s] for s in (first, last)]
    )


def _revolved(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turn a profile (M, 2) of radius and height about the axis: points, and triangles that face inwards."""
    around = 2.0 * math.pi * np.arange(SECTORS) / SECTORS
    r, z = profile[:, 0, None], profile[:, 1, None]
    points = np.stack(
        np.broadcast_arrays(r * np.cos(around), r * np.sin(around), z), axis=-1
    )
    return points.reshape(-1, 3), _grid_triangles(len(profile) - 1, SECTORS)


def _edge_profile(ring: RingEdge) -> np.ndarray:
    """Compute radius and height (M, 2) of the part of a `RingEdge` that bodies can touch, in its own frame [m]."""
    angle = (
        2.0
        * math.pi
        * (np.arange(TUBE_SECTORS + 1) - 0.5 * TUBE_SECTORS)
        / TUBE_SECTORS
    )
    open_to = np.ones(TUBE_SECTORS, bool)
    middle = 0.5 * (angle[1:] + angle[:-1])
    for g_r, g_z in ring.gates:
        # the contact normal runs from the body into the edge, against the outward one
        open_to &= -(np.cos(middle) * g_r + np.sin(middle) * g_z) >= -1e-12
    first = int(np.argmax(open_to & ~np.roll(open_to, 1)))
    turn = (
        angle[first] + 2.0 * math.pi * np.arange(int(open_to.sum()) + 1) / TUBE_SECTORS
    )
    edge = ring.edge_radius_m
    return np.column_stack(
        [ring.radius_m + edge * np.cos(turn), ring.height_m + edge * np.sin(turn)]
    )


def in_world(frame: np.ndarray, points: np.ndarray) -> np.ndarray:
    """World coordinates of points (M, 3) of a frame (12,), see `repose.dem.walls.frame_of`."""
    return frame[:3] + points @ frame[3:].reshape(3, 3).T


def triangulated_walls(simulation: Any) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Points (V, 3) [m] and triangles (T, 3) of each wall where it is now, by its name.

    Endless planes end at the box of the simulation and at each other.
    """
    names, planes = simulation.wall_set.names, simulation.walls.planes
    found = {}
    for name, surface in simulation.wall_set.surfaces.items():
        k = names.index(name)
        if isinstance(surface, Plane):
            points = visible_polygon(simulation, k)
            corner = np.arange(1, max(len(points) - 1, 1))
            triangles = np.column_stack([np.zeros_like(corner), corner, corner + 1])
        elif isinstance(surface, Cone | RingEdge):
            profile = (
                cone_circles(surface.line)
                if isinstance(surface, Cone)
                else _edge_profile(surface)[::-1]
            )
            points, triangles = _revolved(profile)
            points = in_world(simulation.walls.frames[k - len(planes)], points)
        else:
            points = in_world(
                simulation.walls.frames[k - len(planes)], surface.vertices_m
            )
            triangles = surface.faces
        found[name] = points, triangles
    return found


def _all_spheres(
    clump: Clump, rings: int, sectors: int
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate every sphere of a clump: points (V, 3) m, triangles (T, 3)."""
    unit = Clump(np.array([[0.0, 0.0, 0.0, 1.0]]), 1.0, np.ones(3), "any")
    ball, _normals, triangles = tessellate(unit, rings, sectors)
    points = clump.spheres_m[:, None, :3] + clump.spheres_m[:, None, 3:] * ball
    first = len(ball) * np.arange(len(points))
    return points.reshape(-1, 3), (first[:, None, None] + triangles).reshape(-1, 3)


def triangulated_bodies(
    simulation: Any, rings: int = 8, sectors: int = 16
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (V, 3) [m] and triangles (T, 3) of all present bodies, and the body of each triangle (T,).

    Clumps have all their spheres, also where these lie inside each other.
    """
    here = np.flatnonzero(simulation.present)
    turn = rotation_matrices(simulation.quaternions[here])
    made = [
        _all_spheres(shape, rings, sectors)
        if isinstance(shape, Clump)
        else tessellate(shape, rings, sectors)[::2]
        for shape in simulation.shapes.values()
    ]
    surfaces = []
    for k, i in enumerate(here):
        corners, faces = made[simulation.shape_ids[i]]
        surfaces.append(
            (
                simulation.positions[i] + simulation.scales[i] * corners @ turn[k].T,
                faces,
            )
        )
    return joined(surfaces, here)


def joined(
    surfaces: Iterable[tuple[np.ndarray, np.ndarray]],
    numbers: Sequence[int] | np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Join surfaces of points (V, 3) and triangles (T, 3); returns the number of its surface for each triangle, too."""
    points, triangles, n = [np.zeros((0, 3))], [np.zeros((0, 3), int)], 0
    for corners, faces in surfaces:
        points.append(corners)
        triangles.append(faces + n)
        n += len(corners)
    counts = np.array([len(faces) for faces in triangles[1:]], int)
    return np.concatenate(points), np.concatenate(triangles), np.repeat(numbers, counts)
