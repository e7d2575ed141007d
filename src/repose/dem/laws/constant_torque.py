"""Rolling resistance of constant size against the rotation of one body relative to the other, model A of Ai et al.

With the relative angular velocity w, its part w_n along the normal and w_r across it, the lever
R = r_a r_b / (r_a + r_b) and the contact circle a, as in `epsd`:

    M_r = -mu_r F_c R w_r / |w_r|,     M_n = -mu_t F_c a w_n / |w_n|,     mu_t = 3 pi / 16 mu_s unless it is given

Neither is larger than what stops two spheres of these masses and levers within a time step,
0.4 |w| / (dt (1/(m_a r_a^2) + 1/(m_b r_b^2))), so that a sphere with one contact does not shiver about rest. Of a body
with several contacts, as in a groove, each contact alone may stop it, and together they can turn it back. The law needs
a rotation to resist: where a torque acts a body creeps, and a pile goes on settling. The torque on B is the opposite of
that on A, so angular momentum is kept, which `budget` does not do.

References
----------
Zhou, Wright, Yang, Xu, Yu, Physica A 269 (1999) 536. Ai, Chen, Rotter and Ooi, Powder Technol. 206 (2011) 269, model A.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import state as st
from ..kernels import tile as tl
from ..kernels.rows import L, Rows
from ..materials import Contact, Material
from . import epsd
from .epsd import SPUN, TINY, levers, oppose, turning
from .law import Law

ConstantTorque = namedtuple("ConstantTorque", "tension friction_limit")

_rows = Rows(tl.ROLLING)
ROLLING_FRICTION, TWISTING_FRICTION = _rows.take_each(2)


def constants(
    a: Material, b: Material, contact: Contact, _tension: str = "keep"
) -> np.ndarray:
    """mu_r and mu_t of two materials (2,)."""
    return epsd.constants(a, b, contact)[:2]


def kernel(law: Any, t: np.ndarray, c: np.ndarray, at: int, dt: float) -> None:
    """Compute the torques of each lane on both bodies, as `law.rolling_resistance` asks for them."""
    for k in range(L):
        nx, ny, nz = c[st.NORMAL + k], c[st.NORMAL + L + k], c[st.NORMAL + 2 * L + k]
        inverse_arm, mobility = levers(t, k)
        spin, wx, wy, wz = turning(t, k, nx, ny, nz)
        most = t[ROLLING_FRICTION + k] * t[tl.PUSH + k] / inverse_arm
        stopping = SPUN / (dt * mobility + TINY)
        held = min(stopping, most / (math.sqrt(wx * wx + wy * wy + wz * wz) + TINY))
        limit = t[TWISTING_FRICTION + k] * t[tl.PUSH + k] * t[tl.CIRCLE + k]
        twist = max(-limit, min(limit, stopping * spin))
        x, y, z = held * wx + twist * nx, held * wy + twist * ny, held * wz + twist * nz
        oppose(t, k, x, y, z)


LAW = Law(
    name="constant_torque",
    options=ConstantTorque,
    constants=constants,
    n_constants=2,
    n_rows=_rows.count,
    n_state=0,
    kernel=kernel,
    words={
        "rolling": "constant torque against the rotation of one body relative to the other (model A of Ai et al. "
        "2011), mu_r times {limit} times the reduced lever; spin about the normal is resisted by mu_t (3 pi / 16 "
        "mu_s unless it is set) times {limit} times the radius of the contact circle"
    },
)
