"""Rolling resistance law "budget": a torque against the rotation of each body.

Every contact gives each of its bodies a budget mu_r F_c r, where r is the distance of
the contact from the body's centre of mass and F_c the normal force that limits friction
(`tangential`). The sum B of a body's budgets opposes its rotation. A body at rest
begins to rotate when the torque on it exceeds B. The resistance may stop a rotation but
never reverses it (`kernels.body_rotation`), so a pile comes to rest. For a single
contact, this is the directional constant torque, the standard rolling friction of EDEM.

The rotation is that of the body in space (or in the rolling frame), not the rotation of
two bodies relative to each other. Therefore the resistance takes angular momentum from
a pair of touching bodies that rotate freely in the air. Without rolling friction,
angular momentum is conserved.

References
----------
Sakaguchi, Ozaki, Igarashi, Int. J. Mod. Phys. B 7 (1993) 1949: the torque of each body.
Zhou, Wright, Yang, Xu, Yu, Physica A 269 (1999) 536. Ai, Chen, Rotter, Ooi, Powder
Technol. 206 (2011) 269, model A.
"""

from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import state, tile
from ..kernels.rows import LANES, Rows, lane_vector
from ..kernels.simd import rsqrt
from ..materials import Contact, Material
from .law import Law

RollingBudget = namedtuple("RollingBudget", "tension friction_limit")

_scratch_rows = Rows(tile.ROLLING)
ROLLING_FRICTION = _scratch_rows.take()  # mu_r

# Rows of the budgets of both bodies
BUDGET_A = tile.TO_A + state.ROLL * LANES
BUDGET_B = tile.TO_B + state.ROLL * LANES


def constants(
    _a: Material, _b: Material, contact: Contact, _tension: str = "keep"
) -> np.ndarray:
    """Return the constant of two materials: mu_r (1,).

    The materials and the tension have no influence.
    """
    return np.array([contact.rolling_friction])


def kernel(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the rolling resistance that each contact allows on both of its bodies.

    This limit of a torque is called a budget: mu_r times the force that limits friction
    times the arm, the distance of the contact from the centre of the body. The budgets
    of LANES contacts, one in each lane, are written to the rows ROLL of TO_A and TO_B.
    `tangential` has written the force to the row PUSH. The engine adds up the budgets
    of each body and applies the resistance.

    Parameters
    ----------
    law : namedtuple
        Options of the law. This law does not use them.
    scratch : numpy.ndarray
        Scratch tile of the contacts, see `law.rolling_resistance`.
    history, first, dt
        The tile that contacts keep, its first row, and the time step, which are not
        used.
    """
    for lane in range(LANES):
        torque_per_arm = scratch[ROLLING_FRICTION + lane] * scratch[tile.PUSH + lane]
        # Body A. The length of the arm is squared_arm * rsqrt(squared_arm), where
        # rsqrt(x) is 1 / sqrt(x). For an arm of 0 it is 0, since rsqrt(0) is finite.
        x, y, z = lane_vector(scratch, tile.RA, lane)
        squared_arm = x * x + y * y + z * z
        scratch[BUDGET_A + lane] = torque_per_arm * squared_arm * rsqrt(squared_arm)
        # Body B; the arm of a wall is 0, and so is its budget.
        x, y, z = lane_vector(scratch, tile.RB, lane)
        squared_arm = x * x + y * y + z * z
        scratch[BUDGET_B + lane] = torque_per_arm * squared_arm * rsqrt(squared_arm)


LAW = Law(
    name="budget",
    options=RollingBudget,
    constants=constants,
    n_constants=1,
    n_rows=_scratch_rows.count,
    n_state=0,
    kernel=kernel,
    words={
        "rolling": (
            "directional constant torque (model A of Ai et al. 2011), a budget for "
            "each body: mu_r times {limit} times the distance of the contact from "
            "the body's centre"
        ),
    },
)
