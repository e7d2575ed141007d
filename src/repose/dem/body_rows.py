"""Write the state of one body into the arrays of the engine."""

from typing import Any, NamedTuple

import numpy as np

from .kernels import state
from .kernels.rigid import write_body_shape
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
    bodies: Any, index: int, body: Body, parts: int, scratch: np.ndarray
) -> None:
    """Write a body into the arrays of the bodies.

    Parameters
    ----------
    bodies : repose.dem.kernels.state.Bodies
        The arrays, which are changed.
    index : int
        Index of the body.
    body : Body
        Its kind, place, velocities and scale.
    parts : int
        Largest number of ellipsoids of a body in the simulation (`shapes.parts_of`).
    scratch : ndarray
        Scratch tile of bodies, which is overwritten.
    """
    # Mass goes with the third power of the lengths, moments of inertia with the fifth.
    mass = body.kind.mass_kg * body.scale**3
    inertia = body.kind.inertia_kg_m2 * body.scale**5

    # Position, velocities and mass are in a row of their own.
    row = bodies.rows[index]
    row[state.POSITION : state.POSITION + 3] = body.position
    row[state.VELOCITY : state.VELOCITY + 3] = body.velocity
    row[state.ANGULAR_VELOCITY : state.ANGULAR_VELOCITY + 3] = body.angular_velocity
    row[state.INVERSE_MASS] = 1.0 / mass

    # The moments of inertia are about the axes of the body. So the angular momentum is
    # computed in the frame of the body, and turned back into that of the world.
    rotation = rotation_matrix(body.quaternion)
    body_velocity = rotation.T @ body.angular_velocity
    angular_momentum = rotation @ (inertia * body_velocity)
    radius = body.kind.bounding_radius_m * body.scale

    # Numbers of the rotation are in a tile of LANES bodies. In it those of one body are
    # LANES apart (`kernels.rows`).
    tile = bodies.motion[index // state.LANES]
    body_numbers = tile[index % state.LANES :: state.LANES]
    _write_numbers(body_numbers, state.QUATERNION, body.quaternion)
    _write_numbers(body_numbers, state.ANGULAR_MOMENTUM, angular_momentum)
    _write_numbers(body_numbers, state.INVERSE_MOMENTS, 1.0 / inertia)
    _write_numbers(body_numbers, state.SQUARES, _square_axes(body))
    _write_numbers(body_numbers, state.RADIUS, np.array([radius]))
    # The kernel computes from them what depends on the orientation.
    write_body_shape(bodies, index, parts, scratch)


def _write_numbers(body_numbers: np.ndarray, offset: int, values: np.ndarray) -> None:
    """Write values to the numbers of one body in a tile.

    Parameters
    ----------
    body_numbers : ndarray
        A view of the numbers, which is changed.
    offset : int
        Place of the first one in the tile (`kernels.state`), a multiple of LANES.
    values : ndarray
        The values.
    """
    first = offset // state.LANES
    body_numbers[first : first + len(values)] = values


def _square_axes(body: Body) -> np.ndarray:
    """Square the half axes of a body's ellipsoids [m2].

    The result has zeros for ellipsoids that the body has not, and for a clump.
    """
    squares = np.zeros(3 * state.MOST_PARTS)
    if isinstance(body.kind, Shape):
        semi_axes = body.kind.semi_axes_m
        squares[: semi_axes.size] = ((semi_axes * body.scale) ** 2).ravel()
    return squares
