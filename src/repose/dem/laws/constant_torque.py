"""Rolling resistance law: a constant torque against the relative rotation of bodies.

This is model A of Ai et al.

Let w be the angular velocity of A relative to B, with the parts w_n along the normal
and w_r perpendicular to it. As in `epsd`, R = r_a r_b / (r_a + r_b) is the lever and a
the radius of the contact circle. The torques on A are

    M_r = -mu_r F_c R w_r / |w_r|
    M_n = -mu_t F_c a w_n / |w_n|,     mu_t = 3 pi / 16 mu_s unless it is set

Neither may exceed the torque that stops two spheres of these masses and levers within a
time step, 0.4 |w| / (dt (1/(m_a r_a^2) + 1/(m_b r_b^2))), so that a sphere with one
contact does not tremble about its position of rest. If a body has several contacts, as
in a groove, each of them alone may stop it, and together they can reverse its rotation.
The law resists only an existing rotation, so a body creeps as long as a torque acts on
it, and a pile goes on settling. The torque on B is opposite to that on A. Unlike
`budget`, the law therefore conserves angular momentum.

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
    """Compute the rolling and twisting torques on both bodies of each lane's contact.

    The torques oppose the angular velocity of A relative to B. The part of this
    velocity that is perpendicular to the normal is (wx, wy, wz), and the part along the
    normal is `spin`. Each torque has a limit: the friction coefficient times the force
    that limits friction (row PUSH) times a length. The torques are added to those in
    the rows TO_A and TO_B of `scratch`.

    Parameters
    ----------
    law : namedtuple
        Options of the law. This law does not use them.
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.rolling_resistance`.
    first : int
        Index in `history` at which the rows of the law begin. This law has none.
    dt : float
        Time step [s].
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, state.NORMAL, lane)
        inverse_lever, mobility = compute_levers(scratch, lane)
        spin, wx, wy, wz = compute_relative_rotation(scratch, lane, nx, ny, nz)

        # Rolling. The viscosity is a damping constant, the torque divided by the
        # angular velocity. A value above `stopping_limit` would reverse the rotation in
        # this step. It follows from the moment of inertia of two spheres about their
        # centres, whose factor is SPHERE_ABOUT_CENTRE. TINY avoids a division by 0,
        # here and below.
        stopping_limit = SPHERE_ABOUT_CENTRE / (dt * mobility + TINY)
        rolling_limit = (
            scratch[ROLLING_FRICTION + lane] * scratch[tile.PUSH + lane] / inverse_lever
        )
        rolling_speed = math.sqrt(wx * wx + wy * wy + wz * wz)
        viscosity = min(stopping_limit, rolling_limit / (rolling_speed + TINY))

        # Twisting. The limit of the torque about the normal grows with the radius of
        # the contact circle (row CIRCLE).
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
