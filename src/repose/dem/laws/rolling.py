"""Rolling resistance as a budget of torque.

Every contact lends each of its bodies a budget of mu_r F_c r, with r the distance of the contact from the body's
centre of mass and F_c the normal force that limits friction (`tangential`). The sum B of a body's budgets opposes its
rotation: a body at rest begins to turn when the torque on it exceeds B, and the resistance stops a rotation and never
reverses it (`kernels.body_rotation`), so a pile comes to rest. For one contact this is the directional constant torque,
the standard rolling friction of EDEM.

The rotation is that of the body in space (or in the rolling frame), not that of two bodies against each other. So the
resistance takes angular momentum from a pair of bodies that turn in the air; without rolling friction it is kept.

References
----------
Sakaguchi, Ozaki, Igarashi, Int. J. Mod. Phys. B 7 (1993) 1949: the torque of each body. Zhou, Wright, Yang, Xu, Yu,
Physica A 269 (1999) 536. Ai, Chen, Rotter, Ooi, Powder Technol. 206 (2011) 269, model A.
"""

from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import state as st
from ..kernels import tile as tl
from ..kernels.rows import L, Rows
from ..kernels.simd import rsqrt
from ..materials import Contact, Material
from .law import Law

RollingBudget = namedtuple("RollingBudget", "tension friction_limit")

_rows = Rows(tl.ROLLING)
ROLLING_FRICTION = _rows.take()


def constants(
    _a: Material, _b: Material, contact: Contact, _tension: str = "keep"
) -> np.ndarray:
    """Constants of the law for two materials as the kernel takes them.

    Parameters
    ----------
    contact : Contact
        Of the two.

    Returns
    -------
    numpy.ndarray, (1,)
        The rolling friction.
    """
    return np.array([contact.rolling_friction])


def kernel(law: Any, t: np.ndarray, c: np.ndarray, at: int, dt: float) -> None:
    """Compute the budgets of each lane's bodies, as `law.rolling_resistance` asks for them.

    Parameters
    ----------
    law : RollingBudget
        The options; not used.
    t : numpy.ndarray
        Tile of 32 contacts.
    c : numpy.ndarray
        Tile of the quantities that the contacts keep from step to step; not used.
    at : int
        Place of the law's first row in `c`; not used.
    dt : float
        Time step [s]; not used.
    """
    for k in range(L):
        rolling = t[ROLLING_FRICTION + k] * t[tl.PUSH + k]
        x, y, z = t[tl.RA + k], t[tl.RA + L + k], t[tl.RA + 2 * L + k]
        square = x * x + y * y + z * z
        t[tl.TO_A + st.ROLL * L + k] = rolling * square * rsqrt(square)
        x, y, z = t[tl.RB + k], t[tl.RB + L + k], t[tl.RB + 2 * L + k]
        square = x * x + y * y + z * z
        t[tl.TO_B + st.ROLL * L + k] = rolling * square * rsqrt(square)


LAW = Law(
    name="budget",
    options=RollingBudget,
    constants=constants,
    n_constants=1,
    n_rows=_rows.count,
    n_state=0,
    kernel=kernel,
    words={
        "rolling": "directional constant torque (model A of Ai et al. 2011), a budget for each body: mu_r times "
        "{limit} times the distance of the contact from the body's centre"
    },
)
