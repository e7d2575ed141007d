"""Write the data of one body into the arrays of the kernels."""

from typing import Any, NamedTuple

import numpy as np

from .kernels import state as st
from .kernels.rigid import place_shape
from .rotations import rotation_matrix
from .shapes import Clump, Shape


class Body(NamedTuple):
    """A body as a user describes it."""

    kind: Shape | Clump
    position: np.ndarray  # of the centre of mass [m]
    quaternion: np.ndarray  # (w, x, y, z), body to world, of length 1
    velocity: np.ndarray  # in the world frame [m/s]
    angular_velocity: np.ndarray  # in the world frame [rad/s]
    scale: float  # of its lengths, over those of its kind


def write_body(
    bodies: Any, i: int, body: Body, parts: int, scratch: np.ndarray
) -> None:
    """Write a body into the arrays of the bodies.

    Parameters
    ----------
    bodies : repose.dem.kernels.state.Bodies
        The arrays.
    i : int
        Index of the body.
    body : Body
        Its data.
    parts : int
        See `shapes.parts_of`.
    scratch : ndarray
        Scratch tile of bodies, which is overwritten.
    """
    # Mass goes with the third power of the lengths, moments of inertia with the fifth.
    mass = body.kind.mass_kg * body.scale**3
    inertia = body.kind.inertia_kg_m2 * body.scale**5

    row = bodies.rows[i]
    row[st.POSITION : st.POSITION + 3] = body.position
    row[st.VELOCITY : st.VELOCITY + 3] = body.velocity
    row[st.ANGULAR_VELOCITY : st.ANGULAR_VELOCITY + 3] = body.angular_velocity
    row[st.INVERSE_MASS] = 1.0 / mass

    # The moments of inertia are about the axes of the body.
    turn = rotation_matrix(body.quaternion)
    body_velocity = turn.T @ body.angular_velocity
    angular_momentum = turn @ (inertia * body_velocity)
    radius = body.kind.bounding_radius_m * body.scale

    # What moves the body is in a tile of LANES bodies, in which the numbers of one body
    # are LANES apart (`kernels.rows`).
    motion = bodies.motion[i // st.LANES]
    lane = motion[i % st.LANES :: st.LANES]
    _write_rows(lane, st.QUATERNION, body.quaternion)
    _write_rows(lane, st.ANGULAR_MOMENTUM, angular_momentum)
    _write_rows(lane, st.INVERSE_MOMENTS, 1.0 / inertia)
    _write_rows(lane, st.SQUARES, _squared_axes(body))
    _write_rows(lane, st.RADIUS, np.array([radius]))
    place_shape(bodies, i, parts, scratch)


def _write_rows(lane: np.ndarray, place: int, values: np.ndarray) -> None:
    """Write values to the rows of a lane; `place` is where the first row begins."""
    first = place // st.LANES
    lane[first : first + len(values)] = values


def _squared_axes(body: Body) -> np.ndarray:
    """Square the half axes of a smooth body's parts.

    Zeros for unused parts and for clumps.
    """
    squares = np.zeros(3 * st.MOST_PARTS)
    if isinstance(body.kind, Shape):
        semi_axes = body.kind.semi_axes_m
        squares[: semi_axes.size] = ((semi_axes * body.scale) ** 2).ravel()
    return squares
