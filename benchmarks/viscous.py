"""Viscous rolling resistance, model B of Ai et al. (2011), registered from outside of the package.

    M_r = -mu_r F_c R (r_a w_a - r_b w_b),     mu_r in s/m

across the normal, with the lever R = r_a r_b / (r_a + r_b). It vanishes with the rotation, so it holds no pile up; the
package leaves it out for that reason, and `ai_pile.py` shows it.
"""

from collections import namedtuple

from repose.dem.kernels import state as st
from repose.dem.kernels import tile as tl
from repose.dem.kernels.rows import Rows
from repose.dem.laws import ROLLING_LAWS
from repose.dem.laws.epsd import SPHERE_ABOUT_CENTRE, TINY, lever, levers, oppose
from repose.dem.laws.law import Law

L = st.LANES
Viscous = namedtuple("Viscous", "tension friction_limit")
_rows = Rows(tl.ROLLING)
FRICTION = _rows.take()


def constants(_a, _b, contact, _tension="keep"):
    """mu_r of two materials (1,)."""
    return [contact.rolling_friction]


def kernel(law, t, c, at, dt):
    """The torques of each lane on both bodies: against the velocity of rolling, without its part along the normal."""
    a = tl.A + st.ANGULAR_VELOCITY * L
    b = tl.B + st.ANGULAR_VELOCITY * L
    for k in range(L):
        nx = c[st.NORMAL + k]
        ny = c[st.NORMAL + L + k]
        nz = c[st.NORMAL + 2 * L + k]
        r_a = lever(t[tl.RA + k], t[tl.RA + L + k], t[tl.RA + 2 * L + k])
        r_b = lever(t[tl.RB + k], t[tl.RB + L + k], t[tl.RB + 2 * L + k])
        inverse_arm, mobility = levers(t, k)
        x = r_a * t[a + k] - r_b * t[b + k]
        y = r_a * t[a + L + k] - r_b * t[b + L + k]
        z = r_a * t[a + 2 * L + k] - r_b * t[b + 2 * L + k]
        along = x * nx + y * ny + z * nz
        held = t[FRICTION + k] * t[tl.PUSH + k] / inverse_arm
        # the torque may at most stop two spheres
        held = min(held, SPHERE_ABOUT_CENTRE / (dt * mobility * min(r_a, r_b) + TINY))
        oppose(
            t,
            k,
            held * (x - along * nx),
            held * (y - along * ny),
            held * (z - along * nz),
        )


ROLLING_LAWS["viscous"] = Law(
    name="viscous",
    options=Viscous,
    constants=constants,
    n_constants=1,
    n_rows=_rows.count,
    n_state=0,
    kernel=kernel,
    words={"rolling": "viscous torque (model B of Ai et al. 2011), mu_r in s/m"},
)
