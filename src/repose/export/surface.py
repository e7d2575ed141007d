"""The inner surface of the funnel as triangles."""

import math
from itertools import pairwise

import numpy as np

from repose.bench.funnel import Funnel
from repose.export.decks import numbers

# Facets around the axis.
AROUND = 36
# Largest angle of a facet along a rounded edge.
ARC_DEG = 30.0
# Largest length of a facet along the funnel's line.
LONGEST_ROW_M = 0.024


def profile(funnel: Funnel) -> np.ndarray:
    """Compute the line of the funnel in the half plane (r, z).

    Returns
    -------
    array
        Points (N, 2) [m] from the inlet to the underside of the outlet's rounded edge.
    """
    edge = funnel.rim_radius_m
    core = 0.5 * funnel.outlet_diameter_m + edge

    def arc(height: float, start_deg: float, end_deg: float) -> list[list[float]]:
        n_points = 1 + math.ceil((end_deg - start_deg) / ARC_DEG)
        angles = np.radians(np.linspace(start_deg, end_deg, n_points))
        return [
            [core + edge * math.cos(angle), height + edge * math.sin(angle)]
            for angle in angles
        ]

    inlet = [0.5 * funnel.inlet_diameter_m, funnel.inlet_height_m]
    tangent_deg = 90.0 + math.degrees(math.radians(funnel.cone_angle_deg))
    neck = arc(funnel.neck_height_m, tangent_deg, 180.0)
    lip = arc(funnel.outlet_height_m, 180.0, 270.0)
    if not funnel.tube_length_m:
        # One arc goes on where the other ends.
        lip = lip[1:]
    return _divided(np.array([inlet, *neck, *lip]))


def _divided(points: np.ndarray) -> np.ndarray:
    """Divide a line of points (N, 2) into pieces of at most `LONGEST_ROW_M`."""
    line = [points[:1]]
    for start, end in pairwise(points):
        length = np.linalg.norm(end - start)
        n_pieces = max(1, math.ceil(length / LONGEST_ROW_M))
        numbers_of_pieces = np.arange(1, n_pieces + 1)[:, None]
        line.append(start + (end - start) * numbers_of_pieces / n_pieces)
    return np.concatenate(line)


def triangles(funnel: Funnel) -> np.ndarray:
    """Divide the funnel's surface into triangles.

    Returns
    -------
    array
        Corners (T, 3, 3) [m], counterclockwise as seen from the axis.
    """
    line = profile(funnel)
    angles = 2.0 * math.pi * np.arange(AROUND) / AROUND
    x = line[:, :1] * np.cos(angles)
    y = line[:, :1] * np.sin(angles)
    rings = np.stack([x, y, np.broadcast_to(line[:, 1:], x.shape)], axis=-1)
    upper = rings[:-1]
    lower = rings[1:]
    next_upper = np.roll(upper, -1, axis=1)
    next_lower = np.roll(lower, -1, axis=1)
    first = np.stack([upper, next_upper, lower], axis=2)
    second = np.stack([next_upper, next_lower, lower], axis=2)
    return np.concatenate([first.reshape(-1, 3, 3), second.reshape(-1, 3, 3)])


def stl(funnel: Funnel) -> str:
    """Write the funnel's surface as the text of an STL file in metres."""
    corners = triangles(funnel)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lines = ["solid funnel"]
    for normal, triangle in zip(normals, corners, strict=True):
        lines.append(f"facet normal {numbers(normal)}")
        lines.append("outer loop")
        lines += [f"vertex {numbers(corner)}" for corner in triangle]
        lines.append("endloop")
        lines.append("endfacet")
    return "\n".join([*lines, "endsolid funnel", ""])
