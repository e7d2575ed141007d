"""Write the state of one body into the arrays of the engine."""

from typing import Any, NamedTuple

import numpy as np

from .kernels import state
from .kernels.rigid import write_body_shape
from .rotations import rotation_matrix
from .shapes import Clump, Shape


class Body(NamedTuple):
    """A body as a user describes it."""

    shape: Shape | Clump
    position: np.ndarray  # of the centre of mass [m]
    quaternion: np.ndarray  # (w, x, y, z), body to world, of length 1
    velocity: np.ndarray  # in the world frame [m/s]
    angular_velocity: np.ndarray  # in the world frame [rad/s]
    scale: float  # length of the body over that of its shape


def write_body(
    bodies: Any, index: int, body: Body, parts: int, scratch: np.ndarray
) -> None:
    """Write a body into the arrays of the bodies.

    Position, velocity and mass are in the body's row of `bodies.rows`. The numbers of
    its rotation are in a tile of `bodies.motion`. `write_body_shape` computes the rest
    from both, so it comes last.

    Parameters
    ----------
    bodies : repose.dem.kernels.state.Bodies
        The arrays, which are changed.
    index : int
        Index of the body.
    body : Body
        Its shape, position, orientation, velocities and scale.
    parts : int
        Largest number of ellipsoids of any body (`shapes.count_ellipsoids`).
    scratch : ndarray
        Working memory for a tile of bodies (`kernels.body_tile`). It is overwritten.
    """
    # The mass is proportional to the third power of the lengths, and the moments of
    # inertia to the fifth power.
    mass = body.shape.mass_kg * body.scale**3
    inertia = body.shape.inertia_kg_m2 * body.scale**5

    # A row of `bodies.rows` has the numbers of one body side by side.
    row = bodies.rows[index]
    row[state.POSITION : state.POSITION + 3] = body.position
    row[state.VELOCITY : state.VELOCITY + 3] = body.velocity
    row[state.ANGULAR_VELOCITY : state.ANGULAR_VELOCITY + 3] = body.angular_velocity
    row[state.INVERSE_MASS] = 1.0 / mass

    # The moments of inertia are about the axes of the body. Therefore rotate the
    # angular velocity into these axes, multiply it by the moments, and rotate the
    # angular momentum back into the axes of the world.
    rotation = rotation_matrix(body.quaternion)
    velocity_in_body = rotation.T @ body.angular_velocity
    angular_momentum = rotation @ (inertia * velocity_in_body)
    bounding_radius = body.shape.bounding_radius_m * body.scale

    # In a tile of LANES bodies, the numbers of one body are LANES places apart
    # (`kernels.rows`). The slice is a view of them.
    tile = bodies.motion[index // state.LANES]
    body_numbers = tile[index % state.LANES :: state.LANES]
    _write_numbers(body_numbers, state.QUATERNION, body.quaternion)
    _write_numbers(body_numbers, state.ANGULAR_MOMENTUM, angular_momentum)
    _write_numbers(body_numbers, state.INVERSE_MOMENTS, 1.0 / inertia)
    _write_numbers(body_numbers, state.SQUARES, _compute_squared_axes(body))
    _write_numbers(body_numbers, state.RADIUS, np.array([bounding_radius]))
    # The kernel computes the numbers that depend on the orientation from those above.
    write_body_shape(bodies, index, parts, scratch)


def _write_numbers(body_numbers: np.ndarray, offset: int, values: np.ndarray) -> None:
    """Write values to one body's numbers in a tile.

    Parameters
    ----------
    body_numbers : ndarray
        A view of the numbers, which is changed.
    offset : int
        Offset of the first one in the tile (`kernels.state`), a multiple of LANES.
    values : ndarray
        The values, which are written to consecutive numbers.
    """
    first = offset // state.LANES
    body_numbers[first : first + len(values)] = values


def _compute_squared_axes(body: Body) -> np.ndarray:
    """Compute the squares of the half axes of a body's ellipsoids [m2].

    The result has three numbers for each of `MOST_PARTS` ellipsoids. They are zero for
    ellipsoids that the body does not have, and for a clump.
    """
    squares = np.zeros(3 * state.MOST_PARTS)
    if isinstance(body.shape, Shape):
        semi_axes = body.shape.semi_axes_m
        squares[: semi_axes.size] = ((semi_axes * body.scale) ** 2).ravel()
    return squares
