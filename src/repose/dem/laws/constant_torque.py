"""Rolling resistance law: a constant torque against the relative rotation of bodies.

This is model A of Ai et al.

With the angular velocity w of A relative to B, its part w_n along the normal and w_r
across it, the lever R = r_a r_b / (r_a + r_b) and the radius a of the contact circle,
as in `epsd`:

    M_r = -mu_r F_c R w_r / |w_r|
    M_n = -mu_t F_c a w_n / |w_n|,     mu_t = 3 pi / 16 mu_s unless it is set

Neither is larger than what stops two spheres of these masses and levers within a time
step, 0.4 |w| / (dt (1/(m_a r_a^2) + 1/(m_b r_b^2))), so that a sphere with one contact
does not shiver about rest. Of a body with several contacts, as in a groove, each
contact alone may stop it, and together they can turn it back. The law needs a rotation
to resist: where a torque acts a body creeps, and a pile goes on settling. The torque on
B is the opposite of that on A, so angular momentum is kept, which `budget` does not do.

Rows of the tile `scratch`: ROLLING_FRICTION is mu_r, TWISTING_FRICTION mu_t, PUSH
F_c, CIRCLE a.

References
----------
Zhou, Wright, Yang, Xu, Yu, Physica A 269 (1999) 536. Ai, Chen, Rotter and Ooi, Powder
Technol. 206 (2011) 269, model A.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import state, tile
from ..kernels.rows import LANES, Rows, lane_vector
from ..materials import Contact, Material
from . import epsd
from .epsd import (
    SPHERE_ABOUT_CENTRE,
    TINY,
    apply_torques,
    compute_levers,
    compute_relative_rotation,
)
from .law import Law

ConstantTorque = namedtuple("ConstantTorque", "tension friction_limit")

_scratch_rows = Rows(tile.ROLLING)
ROLLING_FRICTION, TWISTING_FRICTION = _scratch_rows.take_each(2)


def constants(
    a: Material, b: Material, contact: Contact, _tension: str = "keep"
) -> np.ndarray:
    """Return the constants of two materials: mu_r and mu_t (2,).

    The arguments are those of `epsd.constants`.
    """
    return epsd.constants(a, b, contact)[:2]


def kernel(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the torques on both bodies of each lane's contact.

    The torques oppose the angular velocity of A relative to B. Its part across the
    normal is (wx, wy, wz), and its part along the normal is `spin`. The torques in the
    rows TO_A and TO_B of `scratch` are changed.

    Parameters
    ----------
    law : namedtuple
        Options of the law. This law does not use them.
    scratch, history : numpy.ndarray
        The tiles of 32 contacts, one in each lane, see `law.rolling_resistance`.
    first : int
        Index in `history` at which the rows of the law begin. This law has none.
    dt : float
        Time step [s].
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, state.NORMAL, lane)
        inverse_lever, mobility = compute_levers(scratch, lane)
        spin, wx, wy, wz = compute_relative_rotation(scratch, lane, nx, ny, nz)

        # Rolling: viscosity is the torque divided by the angular velocity. A larger value
        # than stopping_limit would reverse the rotation in this step. TINY avoids a
        # division by 0.
        stopping_limit = SPHERE_ABOUT_CENTRE / (dt * mobility + TINY)
        rolling_limit = (
            scratch[ROLLING_FRICTION + lane] * scratch[tile.PUSH + lane] / inverse_lever
        )
        rolling_speed = math.sqrt(wx * wx + wy * wy + wz * wz)
        viscosity = min(stopping_limit, rolling_limit / (rolling_speed + TINY))

        # Twisting: the torque about the normal.
        twisting_limit = (
            scratch[TWISTING_FRICTION + lane]
            * scratch[tile.PUSH + lane]
            * scratch[tile.CIRCLE + lane]
        )
        twist = max(-twisting_limit, min(twisting_limit, stopping_limit * spin))

        # Add the rolling torque, across the normal, and the twisting torque along it.
        x = viscosity * wx + twist * nx
        y = viscosity * wy + twist * ny
        z = viscosity * wz + twist * nz
        apply_torques(scratch, lane, x, y, z)


LAW = Law(
    name="constant_torque",
    options=ConstantTorque,
    constants=constants,
    n_constants=2,
    n_rows=_scratch_rows.count,
    n_state=0,
    kernel=kernel,
    words={
        "rolling": (
            "constant torque against the rotation of one body relative to the other "
            "(model A of Ai et al. 2011), mu_r times {limit} times the reduced "
            "lever; spin about the normal is resisted by mu_t (3 pi / 16 mu_s unless "
            "it is set) times {limit} times the radius of the contact circle"
        ),
    },
)
