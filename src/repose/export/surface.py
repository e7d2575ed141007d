"""The inner surface of the funnel as triangles."""

import math
from itertools import pairwise

import numpy as np

from repose.bench.funnel import Funnel
from repose.export.template import numbers

AROUND = 36
ARC_DEG = 30.0
LONGEST_ROW_M = 0.024


def profile(funnel: Funnel) -> np.ndarray:
    """Draw the line (N, 2) of r, z [m] from the funnel's inlet to the underside of the outlet's rounded edge."""
    slope, edge = math.radians(funnel.cone_angle_deg), funnel.rim_radius_m
    core = 0.5 * funnel.outlet_diameter_m + edge
    neck, outlet = funnel.neck_height_m, funnel.outlet_height_m

    def arc(height: float, begin: float, end: float) -> list[tuple[float, float]]:
        angles = np.radians(
            np.linspace(begin, end, 1 + math.ceil((end - begin) / ARC_DEG))
        )
        return [
            (core + edge * math.cos(a), height + edge * math.sin(a)) for a in angles
        ]

    top = (0.5 * funnel.inlet_diameter_m, funnel.inlet_height_m)
    tangent = 90.0 + math.degrees(slope)
    lip = arc(outlet, 180.0, 270.0)
    # without a tube one arc goes on where the other ends
    return _divided(
        np.array(
            [
                top,
                *arc(neck, tangent, 180.0),
                *(lip if funnel.tube_length_m else lip[1:]),
            ]
        )
    )


def _divided(points: np.ndarray) -> np.ndarray:
    """Divide a line into pieces of at most `LONGEST_ROW_M`."""
    line = [points[:1]]
    for a, b in pairwise(points):
        pieces = max(1, math.ceil(np.linalg.norm(b - a) / LONGEST_ROW_M))
        line.append(a + (b - a) * np.arange(1, pieces + 1)[:, None] / pieces)
    return np.concatenate(line)


def triangles(funnel: Funnel) -> np.ndarray:
    """Divide the funnel's surface into triangles (T, 3, 3): corners [m], counterclockwise seen from the axis."""
    line = profile(funnel)
    angles = 2.0 * math.pi * np.arange(AROUND) / AROUND
    x, y = line[:, :1] * np.cos(angles), line[:, :1] * np.sin(angles)
    rings = np.stack([x, y, np.broadcast_to(line[:, 1:], x.shape)], axis=-1)
    upper, lower = rings[:-1], rings[1:]
    next_upper, next_lower = np.roll(upper, -1, axis=1), np.roll(lower, -1, axis=1)
    first = np.stack([upper, next_upper, lower], axis=2)
    second = np.stack([next_upper, next_lower, lower], axis=2)
    return np.concatenate([first.reshape(-1, 3, 3), second.reshape(-1, 3, 3)])


def stl(funnel: Funnel) -> str:
    """Write the funnel's surface as the text of an STL file in metres."""
    corners = triangles(funnel)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lines = ["solid funnel"]
    for normal, three in zip(normals, corners, strict=True):
        lines.append(f"facet normal {numbers(normal)}")
        lines += [
            "outer loop",
            *(f"vertex {numbers(corner)}" for corner in three),
            "endloop",
            "endfacet",
        ]
    return "\n".join([*lines, "endsolid funnel", ""])
