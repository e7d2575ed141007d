"""Divide the inner surface of the funnel into triangles, for other programs."""

import math
from itertools import pairwise

import numpy as np

from repose.bench.funnel import Funnel
from repose.export.decks import join_numbers

# Number of facets around the axis.
N_FACETS = 36
# Largest angle of a facet along a rounded edge [deg].
LARGEST_ARC_DEG = 30.0
# Largest length of a facet along the profile of the funnel.
LONGEST_FACET_M = 0.024


def compute_profile(funnel: Funnel) -> np.ndarray:
    """Compute the inner profile of the funnel in the half plane (r, z).

    The profile is a line along the cone, the rounded edge at the neck (where the cone
    ends), the tube if there is one, and the rounded edge of the outlet.

    Parameters
    ----------
    funnel : Funnel
        The funnel.

    Returns
    -------
    ndarray
        Points (N, 2) [m] from the inlet to the underside of the outlet's edge. The
        columns are the distance from the axis and the height.
    """
    # Both edges have the same radius, and the centres of their arcs are at the same
    # distance from the axis.
    edge_radius = funnel.rim_radius_m
    centre_r = 0.5 * funnel.outlet_diameter_m + edge_radius

    def make_arc(
        centre_z: float, start_deg: float, end_deg: float
    ) -> list[list[float]]:
        """List points (r, z) on a rounded edge between two angles.

        The edge is an arc of a circle with the radius `edge_radius`, whose centre is at
        the distance `centre_r` from the axis. The point at 0 degrees is farthest from
        the axis. The circle is highest at 90 degrees, nearest to the axis at 180
        degrees, and lowest at 270 degrees.

        Parameters
        ----------
        centre_z : float
            Height of the centre of the circle in m.
        start_deg, end_deg : float
            Angles of the first and the last point. The second one is larger.

        Returns
        -------
        list
            The points in m.
        """
        n_points = 1 + math.ceil((end_deg - start_deg) / LARGEST_ARC_DEG)
        angles = np.radians(np.linspace(start_deg, end_deg, n_points))
        points = []
        for angle in angles:
            r = centre_r + edge_radius * math.cos(angle)
            z = centre_z + edge_radius * math.sin(angle)
            points.append([r, z])
        return points

    inlet = [0.5 * funnel.inlet_diameter_m, funnel.inlet_height_m]
    # The arc of the neck begins where it touches the cone, and ends where the wall is
    # vertical. The conversion to radians and back rounds the angle as the engine does,
    # which computes with radians. Without it, points may differ in their last bits.
    touching_deg = 90.0 + math.degrees(math.radians(funnel.cone_angle_deg))
    neck_edge = make_arc(funnel.neck_height_m, touching_deg, 180.0)
    outlet_edge = make_arc(funnel.outlet_height_m, 180.0, 270.0)
    if not funnel.tube_length_m:
        # Without a tube, neck and outlet have the same height, and the second arc
        # begins at the last point of the first one. Keep this point once.
        outlet_edge = outlet_edge[1:]
    # Divide the long straight pieces, so that no facet is much longer than wide.
    return _divide_line(np.array([inlet, *neck_edge, *outlet_edge]))


def _divide_line(points: np.ndarray) -> np.ndarray:
    """Divide the segments of a line into pieces of at most `LONGEST_FACET_M`.

    Parameters
    ----------
    points : ndarray
        Points (N, 2) of the line in m.

    Returns
    -------
    ndarray
        The given points and the points between them (M, 2).
    """
    divided = [points[:1]]
    for start, end in pairwise(points):
        length_m = np.linalg.norm(end - start)
        n_pieces = max(1, math.ceil(length_m / LONGEST_FACET_M))
        piece_numbers = np.arange(1, n_pieces + 1)[:, None]
        divided.append(start + (end - start) * piece_numbers / n_pieces)
    return np.concatenate(divided)


def divide_surface(funnel: Funnel) -> np.ndarray:
    """Divide the inner surface of the funnel into triangles.

    Parameters
    ----------
    funnel : Funnel
        The funnel.

    Returns
    -------
    ndarray
        Corners (T, 3, 3) of T triangles [m], counterclockwise as seen from the axis.
    """
    # Rotate the profile about the axis: each of its N points becomes a ring of points.
    profile = compute_profile(funnel)
    radii = profile[:, :1]
    heights = profile[:, 1:]
    angles = 2.0 * math.pi * np.arange(N_FACETS) / N_FACETS
    x = radii * np.cos(angles)
    y = radii * np.sin(angles)
    z = np.broadcast_to(heights, x.shape)
    rings = np.stack([x, y, z], axis=-1)  # (N, N_FACETS, 3)

    # Two neighbours on a ring and the two points below them are the corners of a
    # quadrilateral. Divide each quadrilateral into two triangles. The order of their
    # corners makes them counterclockwise as seen from the axis. Rolling a ring by one
    # point puts the neighbour of each point in the place of the point.
    upper = rings[:-1]
    lower = rings[1:]
    next_upper = np.roll(upper, -1, axis=1)
    next_lower = np.roll(lower, -1, axis=1)
    first = np.stack([upper, next_upper, lower], axis=2)
    second = np.stack([next_upper, next_lower, lower], axis=2)
    return np.concatenate([first.reshape(-1, 3, 3), second.reshape(-1, 3, 3)])


def write_stl(funnel: Funnel) -> str:
    """Write the inner surface of the funnel as a text STL file, in metres.

    Parameters
    ----------
    funnel : Funnel
        The funnel.

    Returns
    -------
    str
        The contents of the file.
    """
    # The normal of a facet is the unit vector perpendicular to two of its edges.
    facets = divide_surface(funnel)
    first_edges = facets[:, 1] - facets[:, 0]
    second_edges = facets[:, 2] - facets[:, 0]
    normals = np.cross(first_edges, second_edges)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)

    lines = ["solid funnel"]
    for normal, facet in zip(normals, facets, strict=True):
        lines.append(f"facet normal {join_numbers(normal)}")
        lines.append("outer loop")
        lines += [f"vertex {join_numbers(corner)}" for corner in facet]
        lines.append("endloop")
        lines.append("endfacet")
    return "\n".join([*lines, "endsolid funnel", ""])
