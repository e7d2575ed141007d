"""Viscous rolling resistance, model B of Ai et al. (2011), registered from outside of the package.

    M_r = -mu_r F_c R (r_a w_a - r_b w_b),     mu_r in s/m

across the normal, with the lever R = r_a r_b / (r_a + r_b). It vanishes with the rotation, so it holds no pile up; the
package leaves it out for that reason, and `ai_pile.py` shows it.
"""

from collections import namedtuple

from repose.dem.kernels import state, tile
from repose.dem.kernels.rows import Rows
from repose.dem.laws import ROLLING_LAWS
from repose.dem.laws.epsd import (
    SPHERE_ABOUT_CENTRE,
    TINY,
    apply_torques,
    compute_arm_length,
    compute_levers,
)
from repose.dem.laws.law import Law

L = state.LANES
Viscous = namedtuple("Viscous", "tension friction_limit")
_scratch_rows = Rows(tile.ROLLING)
FRICTION = _scratch_rows.take()


def constants(_a, _b, contact, _tension="keep"):
    """mu_r of two materials (1,)."""
    return [contact.rolling_friction]


def kernel(law, t, c, at, dt):
    """The torques of each lane on both bodies: against the velocity of rolling, without its part along the normal."""
    a = tile.A + state.ANGULAR_VELOCITY * L
    b = tile.B + state.ANGULAR_VELOCITY * L
    for k in range(L):
        nx = c[state.NORMAL + k]
        ny = c[state.NORMAL + L + k]
        nz = c[state.NORMAL + 2 * L + k]
        r_a = compute_arm_length(
            t[tile.RA + k], t[tile.RA + L + k], t[tile.RA + 2 * L + k]
        )
        r_b = compute_arm_length(
            t[tile.RB + k], t[tile.RB + L + k], t[tile.RB + 2 * L + k]
        )
        inverse_arm, mobility = compute_levers(t, k)
        x = r_a * t[a + k] - r_b * t[b + k]
        y = r_a * t[a + L + k] - r_b * t[b + L + k]
        z = r_a * t[a + 2 * L + k] - r_b * t[b + 2 * L + k]
        along = x * nx + y * ny + z * nz
        held = t[FRICTION + k] * t[tile.PUSH + k] / inverse_arm
        # the torque may at most stop two spheres
        held = min(held, SPHERE_ABOUT_CENTRE / (dt * mobility * min(r_a, r_b) + TINY))
        apply_torques(
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
    n_rows=_scratch_rows.count,
    n_state=0,
    kernel=kernel,
    words={"rolling": "viscous torque (model B of Ai et al. 2011), mu_r in s/m"},
)
