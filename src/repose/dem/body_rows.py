"""The rows of one body, as the kernels have them."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .checks import vector
from .kernels import state as st
from .kernels.rigid import place_shape
from .rotations import rotation_matrix
from .shapes import Clump, Shape


class Body(NamedTuple):
    """A body in its place.

    Attributes
    ----------
    kind : Shape or Clump
        What it is.
    position, velocity, angular_velocity : numpy.ndarray, (3,)
        In the world, in m, m/s and rad/s.
    quaternion : numpy.ndarray, (4,)
        w, x, y, z, body to world, of length 1.
    scale : float
        Of its lengths, over those of its kind.
    """

    kind: Shape | Clump
    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    scale: float


def checked_body(
    kind: Shape | Clump,
    position_m: ArrayLike,
    quaternion: ArrayLike,
    velocity_m_s: ArrayLike,
    angular_velocity_rad_s: ArrayLike,
    scale: float,
) -> Body:
    """A body of what a user gives.

    Parameters
    ----------
    kind : Shape or Clump
        What it is.
    position_m : array_like, (3,)
        Its centre of mass.
    quaternion : array_like, (4,)
        w, x, y, z, body to world, of any length above 0.
    velocity_m_s : array_like, (3,)
        Of its centre of mass.
    angular_velocity_rad_s : array_like, (3,)
        In the world.
    scale : float
        Of its lengths.

    Returns
    -------
    Body
        Its quaternion has length 1.

    Raises
    ------
    ValueError
        If one is no vector of finite numbers, or the quaternion is 0.
    """
    rotation = vector("quaternion", quaternion, 4)
    length = np.linalg.norm(rotation)
    if not length > 0.0:
        raise ValueError("quaternion is 0; allowed: four finite numbers that are not all 0")
    position = vector("position_m", position_m)
    velocity = vector("velocity_m_s", velocity_m_s)
    turning = vector("angular_velocity_rad_s", angular_velocity_rad_s)
    return Body(kind, position, rotation / length, velocity, turning, scale)


def write_body(bodies: Any, i: int, body: Body, parts: int, tile: np.ndarray) -> None:
    """Write a body into the arrays of the bodies.

    Parameters
    ----------
    bodies : state.Bodies
        The arrays.
    i : int
        Its number.
    body : Body
        What is written.
    parts : int
        The most ellipsoids of a shape.
    tile : numpy.ndarray
        Scratch, a tile of bodies.
    """
    kind, scale = body.kind, body.scale
    row = bodies.rows[i]
    row[st.POSITION : st.POSITION + 3] = body.position
    row[st.VELOCITY : st.VELOCITY + 3] = body.velocity
    row[st.ANGULAR_VELOCITY : st.ANGULAR_VELOCITY + 3] = body.angular_velocity
    row[st.INVERSE_MASS] = 1.0 / (kind.mass_kg * scale**3)
    inertia = kind.inertia_kg_m2 * scale**5
    turn = rotation_matrix(body.quaternion)
    spin = turn @ (inertia * (turn.T @ row[st.ANGULAR_VELOCITY : st.ANGULAR_VELOCITY + 3]))
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
