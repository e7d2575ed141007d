"""The data of one body, written into the arrays of the kernels."""

from typing import Any, NamedTuple

import numpy as np

from .kernels import state as st
from .kernels.rigid import place_shape
from .rotations import rotation_matrix
from .shapes import Clump, Shape


class Body(NamedTuple):
    """A body in the world frame; its quaternion (w, x, y, z), body to world, has length 1."""

    kind: Shape | Clump
    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    scale: float  # of its lengths, over those of its kind


def write_body(bodies: Any, i: int, body: Body, parts: int, tile: np.ndarray) -> None:
    """Write body number i into the arrays of the bodies; parts: see `shapes.parts_of`; tile: scratch."""
    kind, scale = body.kind, body.scale
    row = bodies.rows[i]
    row[st.POSITION : st.POSITION + 3] = body.position
    row[st.VELOCITY : st.VELOCITY + 3] = body.velocity
    row[st.ANGULAR_VELOCITY : st.ANGULAR_VELOCITY + 3] = body.angular_velocity
    row[st.INVERSE_MASS] = 1.0 / (kind.mass_kg * scale**3)
    inertia = kind.inertia_kg_m2 * scale**5
    turn = rotation_matrix(body.quaternion)
    spin = turn @ (
        inertia * (turn.T @ row[st.ANGULAR_VELOCITY : st.ANGULAR_VELOCITY + 3])
    )
    squares = np.zeros(3 * st.MOST_PARTS)
    if isinstance(kind, Shape):
        squares[: kind.semi_axes_m.size] = ((kind.semi_axes_m * scale) ** 2).ravel()
    lanes = bodies.motion[i // st.LANES, i % st.LANES :: st.LANES]
    for first, values in (
        (st.QUATERNION, body.quaternion),
        (st.ANGULAR_MOMENTUM, spin),
        (st.INVERSE_MOMENTS, 1.0 / inertia),
        (st.SQUARES, squares),
        (st.RADIUS, [kind.bounding_radius_m * scale]),
    ):
        lanes[first // st.LANES : first // st.LANES + len(values)] = values
    place_shape(bodies, i, parts, tile)
