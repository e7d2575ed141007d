"""Triangulate bodies and walls, for pictures and files."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .rotations import rotation_matrices
from .shapes import Clump
from .walls import Cone, Mesh, Plane, RingEdge

if TYPE_CHECKING:
    from .observables import Observables

SECTORS = 48  # of a full turn about the axis of a wall
TUBE_SECTORS = 24  # of a full turn about the core circle of a rounded edge
# Thickness of a wall, over the size of the box. A plane that is parallel to a side of
# the box is still shown up to this distance outside.
WALL_THICKNESS = 0.02
PARALLEL_COSINE = 0.999  # cosine of the angle of two planes that count as parallel
GATE_TOLERANCE = 1e-12  # rounding error of the product of two unit vectors


def tessellate(
    body: Any, rings: int = 18, sectors: int = 36
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangulate the surface of a body on a grid of latitudes and longitudes.

    The poles of the grid lie on the body's first axis.

    Parameters
    ----------
    body : Shape or Clump
        Any object with `support` and `support_point`. Of a clump, only the outer
        surface is made: along each ray from its centre of mass, the last point on a
        sphere.
    rings, sectors : int
        Number of latitudes and of longitudes.

    Returns
    -------
    points : ndarray (V, 3)
        Points of the surface [m].
    normals : ndarray (V, 3)
        Unit normals there.
    triangles : ndarray (T, 3)
        Indices of the corners of each triangle, anticlockwise when viewed from outside.
        V and T are the same for all bodies.
    """
    # Points of the unit sphere, on circles around the x axis
    polar_angles = np.linspace(0, math.pi, rings + 1)
    azimuths = np.linspace(0, 2 * math.pi, sectors, endpoint=False)
    polar, azimuth = np.meshgrid(polar_angles, azimuths, indexing="ij")
    x = np.cos(polar)
    y = np.sin(polar) * np.cos(azimuth)
    z = np.sin(polar) * np.sin(azimuth)
    sphere_points = np.stack([x, y, z], axis=-1)

    # The normals are those of an ellipsoid with the extents of the body, so that the
    # tips of a slim body are well resolved. They are in the order of the grid points,
    # to which the triangles refer.
    extents = np.array([body.support(axis) for axis in np.eye(3)])
    normals = (sphere_points / extents).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)

    # A convex body has one surface point for each normal, but points in the dents of a
    # clump cannot be found by their normals. The surface of a clump is therefore found
    # by rays in these directions, and gets its own normals.
    triangles = _list_grid_triangles(rings, sectors)
    if isinstance(body, Clump):
        points, normals = _find_visible_points(body, normals)
        return points, normals, triangles
    return body.support_point(normals), normals, triangles


def _find_visible_points(
    clump: Clump, rays: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the points where rays from a clump's centre of mass leave the clump.

    Parameters
    ----------
    clump : Clump
        The clump of M spheres.
    rays : ndarray (V, 3)
        Unit vectors in the frame of the clump.

    Returns
    -------
    points : ndarray (V, 3)
        The points [m]. The point of a ray that meets no sphere is the centre of mass.
    normals : ndarray (V, 3)
        The unit normals at the points. The normal of a ray that meets no sphere is the
        ray itself.
    """
    centres = clump.spheres_m[:, :3]
    radii = clump.spheres_m[:, 3]
    # The distance t at which a ray leaves a sphere is the larger root of the quadratic
    # equation |t ray - centre|^2 = radius^2. If there is no root, the ray misses the
    # sphere. The arrays (V, M) have a value for each ray and sphere.
    middles = rays @ centres.T  # the mean of both roots
    discriminants = middles**2 - np.sum(centres**2, axis=1) + radii**2
    half_chords = np.sqrt(np.maximum(discriminants, 0.0))
    distances = np.where(discriminants >= 0.0, middles + half_chords, 0.0)

    # The sphere that a ray leaves last is the visible one.
    last_sphere = np.argmax(distances, axis=1)
    last_distance = np.maximum(distances.max(axis=1), 0.0)[:, None]
    points = last_distance * rays
    normals = (points - centres[last_sphere]) / radii[last_sphere, None]
    return points, np.where(last_distance > 0.0, normals, rays)


def _list_grid_triangles(rows: int, columns: int) -> np.ndarray:
    """Triangulate a grid of points whose rows are closed loops.

    Parameters
    ----------
    rows, columns : int
        The grid has (rows + 1, columns) points, which are numbered row by row.

    Returns
    -------
    ndarray of int (2 * rows * columns, 3)
        Numbers of the corners of each triangle.
    """
    # For each cell (rows, columns): the number of the first point of its row, and its
    # column
    row_starts = np.arange(rows) * columns
    row_start, column = np.meshgrid(row_starts, np.arange(columns), indexing="ij")
    next_column = (column + 1) % columns  # the first one after the last one
    # The corners of each cell of the grid:  a  b
    #                                        c  d
    a = row_start + column
    b = row_start + next_column
    c = a + columns
    d = b + columns
    upper = np.stack([a, c, b], -1).reshape(-1, 3)
    lower = np.stack([b, c, d], -1).reshape(-1, 3)
    return np.concatenate([upper, lower])


def find_plane_polygon(
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
        Two corners of the box at which an infinite plane ends [m].
    others : sequence of ndarray (7,)
        Other infinite planes. The polygon also ends at these, since there are no bodies
        beyond them.

    Returns
    -------
    ndarray (M, 3)
        The corners, anticlockwise when viewed from the bodies [m].
    """
    # A row is a point, the normal and the radius of the disc. The engine's normals
    # point into the wall; here the normal points to the bodies.
    point = plane[:3]
    normal = -plane[3:6]
    radius = plane[6]
    u, w = _find_tangents(normal)
    # A disc becomes a polygon about its centre. u and w are perpendicular unit vectors
    # in the plane.
    if math.isfinite(radius):
        angles = 2.0 * math.pi * np.arange(SECTORS) / SECTORS
        directions = np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * w
        return point + radius * directions

    # Begin with a square of the plane that is larger than the box. Its middle is the
    # point of the plane nearest to the centre of the box.
    box_size = np.linalg.norm(upper - lower)
    box_centre = 0.5 * (lower + upper)
    middle = box_centre + ((point - box_centre) @ normal) * normal
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    polygon = np.array([middle + box_size * (a * u + b * w) for a, b in signs])

    # Cut it by the sides of the box and by the other planes.
    for side_normal, corner in _list_box_sides(lower, upper):
        # A plane that is parallel to a side may lie slightly outside the box. Move such
        # a side outwards by the thickness of a wall, so that the plane is still shown.
        is_parallel = abs(side_normal @ normal) > PARALLEL_COSINE
        shift = WALL_THICKNESS * box_size * is_parallel
        polygon = _cut_polygon(polygon, side_normal, side_normal @ corner + shift)
    for other in others:
        # Here the normal points into the other wall, out of the half space that is
        # kept.
        other_point = other[:3]
        other_normal = other[3:6]
        polygon = _cut_polygon(polygon, other_normal, other_normal @ other_point)
    return polygon


def _find_tangents(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find two unit vectors u and w that make (u, w, normal) a right-handed frame."""
    # the axis of the world that is the least parallel to the normal
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(axis, normal)
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u)


def _list_box_sides(
    lower: np.ndarray, upper: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the outward normal of each side of a box, with a corner on this side."""
    for axis in np.eye(3):
        yield axis, upper
        yield -axis, lower


def _cut_polygon(polygon: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """Clip a convex polygon to the half space normal.x <= offset.

    Parameters
    ----------
    polygon : ndarray (M, 3)
        The corners in order around the polygon [m].
    normal : ndarray (3,)
        Normal of the clipping plane, which points out of the half space.
    offset : float
        Offset of this plane from the origin [m].

    Returns
    -------
    ndarray (L, 3)
        The corners of the part inside the half space; none if there is no such part.

    Notes
    -----
    The method is that of Sutherland and Hodgman, Commun. ACM 17 (1974) 32.
    """
    distances = polygon @ normal - offset  # positive outside the half space
    corners = []
    for k in range(len(polygon)):
        next_k = (k + 1) % len(polygon)
        corner, next_corner = polygon[k], polygon[next_k]
        distance, next_distance = distances[k], distances[next_k]
        # A corner inside the half space, or on the plane, stays.
        if distance <= 0.0:
            corners.append(corner)
        # If the side from this corner to the next crosses the plane, add a corner
        # there, at the fraction `share` of the side.
        if distance * next_distance < 0.0:
            share = distance / (distance - next_distance)
            corners.append(corner + share * (next_corner - corner))
    return np.array(corners).reshape(-1, 3)


def are_endless(planes: np.ndarray) -> np.ndarray:
    """Return which planes (P, 7) of `walls.planes` are endless instead of discs (P,)."""
    return np.isinf(planes[:, 6])


def find_visible_polygon(simulation: "Observables", k: int) -> np.ndarray:
    """Find the corners (M, 3) of the visible part of plane number k of a simulation.

    The part ends at the simulation's box and at the other endless planes, see
    `find_plane_polygon`.
    """
    planes = simulation.walls.planes
    is_other = np.arange(len(planes)) != k
    others = planes[are_endless(planes) & is_other]
    return find_plane_polygon(planes[k], simulation.lower, simulation.upper, others)


def compute_cone_circles(line: Sequence[float] | np.ndarray) -> np.ndarray:
    """Compute radius and height [m] of the circles at both ends of a cone (2, 2).

    The heights are in the cone's own frame. `line` is that of `walls.Cone`.
    """
    m_r, m_z, offset, first, last, e_r, e_z = line
    return np.array(
        [[m_r * offset + e_r * s, m_z * offset + e_z * s] for s in (first, last)]
    )


def _revolve_profile(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Revolve a profile about the axis of a wall.

    Parameters
    ----------
    profile : ndarray (M, 2)
        Radius and height of the points of the profile [m].

    Returns
    -------
    points : ndarray (V, 3)
        Points of the surface in the frame of the wall [m].
    triangles : ndarray of int (T, 3)
        Indices of the corners of each triangle. The triangles face the axis if the
        profile goes up.
    """
    angles = 2.0 * math.pi * np.arange(SECTORS) / SECTORS
    r, z = profile[:, 0, None], profile[:, 1, None]
    coordinates = np.broadcast_arrays(r * np.cos(angles), r * np.sin(angles), z)
    points = np.stack(coordinates, axis=-1).reshape(-1, 3)
    return points, _list_grid_triangles(len(profile) - 1, SECTORS)


def _compute_edge_profile(ring: RingEdge) -> np.ndarray:
    """Compute the profile of the part of a rounded edge that bodies can touch.

    A rounded edge is a torus. A half plane through its axis cuts it in a circle. Part
    of this circle is behind the walls that adjoin the edge. The profile is the rest,
    the open arc. The edge has two vectors (r, z) called gates. A point is open if the
    contact normal there, which points into the edge, has no negative component along
    either gate.

    Parameters
    ----------
    ring : RingEdge
        The edge.

    Returns
    -------
    ndarray (M, 2)
        Radius and height of the points of the arc, in the ring's own frame [m].
    """
    # Divide the circle into sectors, from -pi to pi.
    border_numbers = np.arange(TUBE_SECTORS + 1) - 0.5 * TUBE_SECTORS
    border_angles = 2.0 * math.pi * border_numbers / TUBE_SECTORS
    middle_angles = 0.5 * (border_angles[1:] + border_angles[:-1])

    # The contact normal of a sector is opposite to the outward direction of the circle.
    # GATE_TOLERANCE allows for rounding.
    outward_r = np.cos(middle_angles)
    outward_z = np.sin(middle_angles)
    is_open = np.ones(TUBE_SECTORS, bool)
    for gate_r, gate_z in ring.gates:
        is_open &= -(outward_r * gate_r + outward_z * gate_z) >= -GATE_TOLERANCE

    # The open sectors are one arc of at least one sector. The first of them follows a
    # closed one. If all are open, `argmax` returns 0, and the circle begins at -pi.
    is_first = is_open & ~np.roll(is_open, 1)
    first_angle = border_angles[int(np.argmax(is_first))]
    n_open = int(is_open.sum())
    arc_angles = first_angle + 2.0 * math.pi * np.arange(n_open + 1) / TUBE_SECTORS
    radii = ring.radius_m + ring.edge_radius_m * np.cos(arc_angles)
    heights = ring.height_m + ring.edge_radius_m * np.sin(arc_angles)
    return np.column_stack([radii, heights])


def transform_to_world(frame: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Transform points (M, 3) from a frame (12,) of `walls.compute_frame` to the world."""
    return frame[:3] + points @ frame[3:].reshape(3, 3).T


def triangulate_walls(
    simulation: "Observables",
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Triangulate all walls in their present positions.

    Infinite planes end at the box of the simulation and at each other.

    Parameters
    ----------
    simulation : Simulation
        The simulation.

    Returns
    -------
    dict of str to (ndarray, ndarray)
        Points (V, 3) [m] and triangles (T, 3) of each wall by its name, in the order of
        `wall_set.surfaces`.
    """
    n_planes = len(simulation.walls.planes)
    triangulated = {}
    for name, surface in simulation.wall_set.surfaces.items():
        # The index of the wall in the arrays of the kernels. Planes come first, and
        # only the other walls have frames.
        number = simulation.wall_set.names.index(name)
        if isinstance(surface, Plane):
            corners = find_visible_polygon(simulation, number)
            triangulated[name] = _triangulate_polygon(corners)
        else:
            points, triangles = _triangulate_in_frame(surface)
            frame = simulation.walls.frames[number - n_planes]
            triangulated[name] = transform_to_world(frame, points), triangles
    return triangulated


def _triangulate_polygon(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split a convex polygon (M, 3) into triangles that share its first corner."""
    second = np.arange(1, max(len(corners) - 1, 1))
    return corners, np.column_stack([np.zeros_like(second), second, second + 1])


def _triangulate_in_frame(
    surface: Cone | RingEdge | Mesh,
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate a curved wall or a mesh in its own frame."""
    if isinstance(surface, Mesh):
        return surface.vertices_m, surface.faces
    if isinstance(surface, Cone):
        return _revolve_profile(compute_cone_circles(surface.line))
    return _revolve_profile(_compute_edge_profile(surface)[::-1])


def _triangulate_spheres(
    clump: Clump, rings: int, sectors: int
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate every sphere of a clump.

    Parameters
    ----------
    clump : Clump
        The clump.
    rings, sectors : int
        Number of latitudes and of longitudes of each sphere.

    Returns
    -------
    points : ndarray (V, 3)
        Points of all spheres in the frame of the clump [m].
    triangles : ndarray of int (T, 3)
        Indices of their points.
    """
    # A sphere of radius 1 about the origin. Its mass (1), its moments of inertia (three
    # ones) and its material ("any") do not matter here.
    unit_sphere = Clump(np.array([[0.0, 0.0, 0.0, 1.0]]), 1.0, np.ones(3), "any")
    sphere_points, _, sphere_triangles = tessellate(unit_sphere, rings, sectors)
    surfaces = []
    for row in clump.spheres_m:
        centre = row[:3]
        radius = row[3]
        surfaces.append((centre + radius * sphere_points, sphere_triangles))
    points, triangles, _ = join_surfaces(surfaces, np.arange(len(surfaces)))
    return points, triangles


def triangulate_bodies(
    simulation: "Observables", rings: int = 8, sectors: int = 16
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangulate all bodies that are present.

    Each sphere of a clump is triangulated completely, including parts inside other
    spheres. More rings and sectors give a finer surface.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    rings, sectors : int
        Number of latitudes and of longitudes of each body, or of each sphere.

    Returns
    -------
    points : ndarray (V, 3)
        Points of all bodies in the frame of the world [m].
    triangles : ndarray (T, 3)
        Indices of the corners of each triangle.
    body : ndarray (T,)
        Index of the body to which each triangle belongs.
    """
    # Each shape is triangulated once, in the frame of a body of scale 1. `shape_ids`
    # count the shapes in this order.
    shape_surfaces = []
    for shape in simulation.shapes.values():
        if isinstance(shape, Clump):
            shape_surfaces.append(_triangulate_spheres(shape, rings, sectors))
        else:
            points, _, triangles = tessellate(shape, rings, sectors)
            shape_surfaces.append((points, triangles))

    # Each body gets a copy that is scaled, rotated and moved to its position.
    bodies = np.flatnonzero(simulation.present)
    rotations = rotation_matrices(simulation.quaternions[bodies])
    surfaces = []
    for body, rotation in zip(bodies, rotations, strict=True):
        points, triangles = shape_surfaces[simulation.shape_ids[body]]
        position = simulation.positions[body]
        world_points = position + simulation.scales[body] * points @ rotation.T
        surfaces.append((world_points, triangles))
    return join_surfaces(surfaces, bodies)


def join_surfaces(
    surfaces: Iterable[tuple[np.ndarray, np.ndarray]],
    numbers: Sequence[int] | np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Join several surfaces into one.

    Parameters
    ----------
    surfaces : iterable of (ndarray, ndarray)
        Points (V, 3) of each surface, and its triangles (T, 3): indices of the points
        of this surface.
    numbers : sequence of int
        A number for each surface, such as the index of a body.

    Returns
    -------
    points, triangles : ndarray
        Points and triangles of all surfaces together.
    number : ndarray (T,)
        Number of the surface to which each triangle belongs.
    """
    # With these empty arrays, the result is valid even if there is no surface.
    point_arrays = [np.zeros((0, 3))]
    triangle_arrays = [np.zeros((0, 3), int)]
    triangle_counts = []
    n_points_before = 0
    for points, triangles in surfaces:
        point_arrays.append(points)
        # The points of this surface come after those of the previous surfaces.
        triangle_arrays.append(triangles + n_points_before)
        triangle_counts.append(len(triangles))
        n_points_before += len(points)
    number = np.repeat(numbers, np.array(triangle_counts, int))
    return np.concatenate(point_arrays), np.concatenate(triangle_arrays), number
