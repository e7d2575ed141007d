"""Rigid motion of a wall."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .checks import vector

ORIGIN = (0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)
Vector = Sequence[float] | np.ndarray


@dataclass(frozen=True)
class Motion:
    """Rigid motion of a wall.

    Parameters
    ----------
    velocity_m_s : array_like (3,)
        Velocity of the pivot [m/s].
    angular_velocity_rad_s : array_like (3,)
        Angular velocity about the pivot [rad/s].
    pivot_m : array_like (3,)
        The pivot at the beginning [m]; it moves along.

    Raises
    ------
    ValueError
        Naming the value that is not three finite numbers.
    """

    velocity_m_s: Vector = ORIGIN
    angular_velocity_rad_s: Vector = ORIGIN
    pivot_m: Vector = ORIGIN

    def __post_init__(self):
        self.row()

    def row(self) -> np.ndarray:
        """Velocity, angular velocity and pivot as the kernels take them (9,)."""
        return np.concatenate(
            [
                vector("velocity_m_s", self.velocity_m_s),
                vector("angular_velocity_rad_s", self.angular_velocity_rad_s),
                vector("pivot_m", self.pivot_m),
            ]
        )


STILL = Motion()
