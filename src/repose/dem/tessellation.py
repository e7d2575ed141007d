"""Bodies and walls as triangles, for pictures and files."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .rotations import rotation_matrices
from .shapes import Clump
from .walls import Cone, Mesh, Plane, RingEdge

if TYPE_CHECKING:
    from .observables import Observables

SECTORS = 48  # of a full turn of a wall
TUBE_SECTORS = 24  # of a full turn about a rounded edge


def tessellate(
    body: Any, rings: int = 18, sectors: int = 36
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangulate the surface of a body on a grid of latitudes and longitudes.

    The axis of the grid is the body's first one.

    Parameters
    ----------
    body : Shape or Clump
        Any object with `support` and `support_point`. Of a clump only the surface that
        is visible from its centre of mass is made.
    rings, sectors : int
        Number of latitudes and of longitudes.

    Returns
    -------
    points : ndarray (V, 3)
        Points of the surface [m].
    normals : ndarray (V, 3)
        Unit normals there.
    triangles : ndarray (T, 3)
        Indices of their points, anticlockwise seen from outside. V and T are the same
        for all bodies.
    """
    latitudes = np.linspace(0, math.pi, rings + 1)
    longitudes = np.linspace(0, 2 * math.pi, sectors, endpoint=False)
    polar, turn = np.meshgrid(latitudes, longitudes, indexing="ij")
    x = np.cos(polar)
    y = np.sin(polar) * np.cos(turn)
    z = np.sin(polar) * np.sin(turn)
    sphere = np.stack([x, y, z], axis=-1)

    # The normals of a slim body are spread so that its tips are well resolved.
    extents = np.array([body.support(axis) for axis in np.eye(3)])
    normals = (sphere / extents).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)

    triangles = _grid_triangles(rings, sectors)
    if isinstance(body, Clump):
        points, normals = _visible_from_centre(body, normals)
        return points, normals, triangles
    return body.support_point(normals), normals, triangles


def _visible_from_centre(
    clump: Clump, rays: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the points where rays (V, 3) from a clump's origin leave it.

    Returns the points and the normals there, each (V, 3).
    """
    centres, radii = clump.spheres_m[:, :3], clump.spheres_m[:, 3]
    # A ray leaves a sphere where |t ray - centre| = radius; the larger of both t
    # counts.
    along = rays @ centres.T
    square = along**2 - np.sum(centres**2, axis=1) + radii**2
    root = np.sqrt(np.maximum(square, 0.0))
    distances = np.where(square >= 0.0, along + root, 0.0)
    farthest = np.argmax(distances, axis=1)
    distance = np.maximum(distances[np.arange(len(rays)), farthest], 0.0)[:, None]

    points = distance * rays
    normals = (points - centres[farthest]) / radii[farthest, None]
    return points, np.where(distance > 0.0, normals, rays)


def _grid_triangles(rows: int, columns: int) -> np.ndarray:
    """Triangulate a grid of points (rows + 1, columns) whose rows are closed."""
    row_start, column = np.meshgrid(
        np.arange(rows) * columns, np.arange(columns), indexing="ij"
    )
    next_column = (column + 1) % columns
    a = row_start + column
    b = row_start + next_column
    c = a + columns  # below a
    d = b + columns  # below b
    upper = np.stack([a, c, b], -1).reshape(-1, 3)
    lower = np.stack([b, c, d], -1).reshape(-1, 3)
    return np.concatenate([upper, lower])


def plane_polygon(
    plane: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    others: Sequence[np.ndarray] | np.ndarray = (),
) -> np.ndarray:
    """Find the corners of the visible part of a plane.

    Parameters
    ----------
    plane : ndarray (7,)
        A row of `Simulation.walls.planes`. A disc becomes a polygon of `SECTORS`
        corners.
    lower, upper : ndarray (3,)
        The box, at which an endless plane ends [m].
    others : sequence of ndarray (7,)
        Other endless planes, at which it ends, too: beyond them there are no bodies.

    Returns
    -------
    ndarray (M, 3)
        The corners, anticlockwise seen from the bodies [m].
    """
    point, inwards, radius = plane[:3], -plane[3:6], plane[6]
    u = np.cross(np.eye(3)[np.argmin(np.abs(inwards))], inwards)
    u /= np.linalg.norm(u)
    w = np.cross(inwards, u)
    if math.isfinite(radius):
        angles = 2.0 * math.pi * np.arange(SECTORS) / SECTORS
        directions = np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * w
        return point + radius * directions

    # A square that is larger than the box, cut by the sides of the box and by the other
    # planes.
    size = np.linalg.norm(upper - lower)
    centre = 0.5 * (lower + upper)
    middle = centre + ((point - centre) @ inwards) * inwards
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    polygon = np.array([middle + size * (a * u + b * w) for a, b in signs])
    for normal, corner in _box_sides(lower, upper):
        # A plane that misses the box by no more than the thickness of a wall is shown.
        is_parallel = abs(normal @ inwards) > 0.999
        slack = 0.02 * size * is_parallel
        polygon = _cut_polygon(polygon, normal, normal @ corner + slack)
    for other in others:
        normal = other[3:6]
        polygon = _cut_polygon(polygon, normal, normal @ other[:3])
    return polygon


def _box_sides(
    lower: np.ndarray, upper: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the outward normal of each side of a box, with a corner on this side."""
    for axis in np.eye(3):
        yield axis, upper
        yield -axis, lower


def _cut_polygon(polygon: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """Cut a convex polygon (M, 3) to normal.x at most an offset.

    Sutherland and Hodgman, Commun. ACM 17 (1974) 32.
    """
    distances = polygon @ normal - offset
    corners = []
    for k in range(len(polygon)):
        following = (k + 1) % len(polygon)
        a, b = distances[k], distances[following]
        if a <= 0.0:
            corners.append(polygon[k])
        if a * b < 0.0:
            share = a / (a - b)
            corners.append(polygon[k] + share * (polygon[following] - polygon[k]))
    return np.array(corners).reshape(-1, 3)


def endless(planes: np.ndarray) -> np.ndarray:
    """Tell for each plane, a row (P, 7) of `walls.planes`, if it is no disc."""
    return np.isinf(planes[:, 6])


def visible_polygon(simulation: "Observables", k: int) -> np.ndarray:
    """Find `plane_polygon` of plane number k of a simulation.

    It ends at the simulation's box and at its other endless planes.
    """
    planes = simulation.walls.planes
    is_other = np.arange(len(planes)) != k
    others = planes[endless(planes) & is_other]
    return plane_polygon(planes[k], simulation.lower, simulation.upper, others)


def cone_circles(line: Sequence[float] | np.ndarray) -> np.ndarray:
    """Compute radius and height [m] of the circles at both ends of a cone (2, 2).

    They are in the frame of the cone's line.
    """
    m_r, m_z, offset, first, last, e_r, e_z = line
    return np.array(
        [[m_r * offset + e_r * s, m_z * offset + e_z * s] for s in (first, last)]
    )


def _surface_of_revolution(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turn a profile (M, 2) of radius and height about the axis.

    Returns points, and triangles that face inwards.
    """
    angles = 2.0 * math.pi * np.arange(SECTORS) / SECTORS
    r, z = profile[:, 0, None], profile[:, 1, None]
    coordinates = np.broadcast_arrays(r * np.cos(angles), r * np.sin(angles), z)
    points = np.stack(coordinates, axis=-1).reshape(-1, 3)
    return points, _grid_triangles(len(profile) - 1, SECTORS)


def _edge_profile(ring: RingEdge) -> np.ndarray:
    """Compute the profile (M, 2) of the part of a `RingEdge` that bodies can touch.

    Its columns are radius and height in the ring's own frame [m].
    """
    angles = (
        2.0
        * math.pi
        * (np.arange(TUBE_SECTORS + 1) - 0.5 * TUBE_SECTORS)
        / TUBE_SECTORS
    )
    # A sector is open unless its contact normal, which points into the edge, opposes a
    # gate.
    middles = 0.5 * (angles[1:] + angles[:-1])
    is_open = np.ones(TUBE_SECTORS, bool)
    for g_r, g_z in ring.gates:
        is_open &= -(np.cos(middles) * g_r + np.sin(middles) * g_z) >= -1e-12
    begins = is_open & ~np.roll(is_open, 1)
    first = int(np.argmax(begins))
    sectors = np.arange(int(is_open.sum()) + 1)
    turns = angles[first] + 2.0 * math.pi * sectors / TUBE_SECTORS
    radius = ring.radius_m + ring.edge_radius_m * np.cos(turns)
    height = ring.height_m + ring.edge_radius_m * np.sin(turns)
    return np.column_stack([radius, height])


def in_world(frame: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Transform points (M, 3) from a frame (12,) to the world, see `walls.frame_of`."""
    return frame[:3] + points @ frame[3:].reshape(3, 3).T


def triangulated_walls(
    simulation: "Observables",
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Triangulate all walls where they are now.

    Endless planes end at the box of the simulation and at each other.

    Returns
    -------
    dict of str to (ndarray, ndarray)
        Points (V, 3) [m] and triangles (T, 3) of each wall by its name, in the order of
        `wall_set.surfaces`.
    """
    numbers = {name: k for k, name in enumerate(simulation.wall_set.names)}
    n_planes = len(simulation.walls.planes)
    triangulated = {}
    for name, surface in simulation.wall_set.surfaces.items():
        k = numbers[name]
        if isinstance(surface, Plane):
            triangulated[name] = _triangulated_polygon(visible_polygon(simulation, k))
        else:
            points, triangles = _triangulated_in_frame(surface)
            frame = simulation.walls.frames[k - n_planes]
            triangulated[name] = in_world(frame, points), triangles
    return triangulated


def _triangulated_polygon(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split a convex polygon (M, 3) into triangles that share its first corner."""
    second = np.arange(1, max(len(corners) - 1, 1))
    return corners, np.column_stack([np.zeros_like(second), second, second + 1])


def _triangulated_in_frame(
    surface: Cone | RingEdge | Mesh,
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate a curved wall or a mesh in its own frame."""
    if isinstance(surface, Mesh):
        return surface.vertices_m, surface.faces
    if isinstance(surface, Cone):
        return _surface_of_revolution(cone_circles(surface.line))
    return _surface_of_revolution(_edge_profile(surface)[::-1])


def _all_spheres(
    clump: Clump, rings: int, sectors: int
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate every sphere of a clump: points (V, 3) [m] and triangles (T, 3)."""
    unit_sphere = Clump(np.array([[0.0, 0.0, 0.0, 1.0]]), 1.0, np.ones(3), "any")
    sphere_points, _, sphere_triangles = tessellate(unit_sphere, rings, sectors)
    centres = clump.spheres_m[:, None, :3]
    radii = clump.spheres_m[:, None, 3:]
    points = centres + radii * sphere_points
    first_points = len(sphere_points) * np.arange(len(points))
    triangles = first_points[:, None, None] + sphere_triangles
    return points.reshape(-1, 3), triangles.reshape(-1, 3)


def triangulated_bodies(
    simulation: "Observables", rings: int = 8, sectors: int = 16
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangulate all bodies that are present.

    Clumps have all their spheres, also where these lie inside each other.

    Returns
    -------
    points : ndarray (V, 3)
        In the world [m].
    triangles : ndarray (T, 3)
        Indices of their points.
    body : ndarray (T,)
        Index of the body of each triangle.
    """
    surface_of_shape = []
    for shape in simulation.shapes.values():
        if isinstance(shape, Clump):
            surface_of_shape.append(_all_spheres(shape, rings, sectors))
        else:
            points, _, triangles = tessellate(shape, rings, sectors)
            surface_of_shape.append((points, triangles))

    present = np.flatnonzero(simulation.present)
    turns = rotation_matrices(simulation.quaternions[present])
    surfaces = []
    for turn, i in zip(turns, present, strict=True):
        points, triangles = surface_of_shape[simulation.shape_ids[i]]
        in_place = simulation.positions[i] + simulation.scales[i] * points @ turn.T
        surfaces.append((in_place, triangles))
    return joined(surfaces, present)


def joined(
    surfaces: Iterable[tuple[np.ndarray, np.ndarray]],
    numbers: Sequence[int] | np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Join surfaces of points (V, 3) and triangles (T, 3).

    Returns
    -------
    points, triangles : ndarray
        Those of all surfaces together.
    number : ndarray (T,)
        For each triangle the number of its surface, from `numbers`.
    """
    all_points, all_triangles = [np.zeros((0, 3))], [np.zeros((0, 3), int)]
    n_triangles = []
    n_points = 0
    for points, triangles in surfaces:
        all_points.append(points)
        all_triangles.append(triangles + n_points)
        n_triangles.append(len(triangles))
        n_points += len(points)
    number = np.repeat(numbers, np.array(n_triangles, int))
    return np.concatenate(all_points), np.concatenate(all_triangles), number
