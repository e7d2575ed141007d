"""The laws of LIGGGHTS, LAMMPS and YADE for this engine, where they are not among its own.

`one_pile.py` gives them to the engine in order to measure what they change. Importing this module adds them to the
engine's lists of laws.
"""

import math
from collections import namedtuple

import numpy as np

from repose.dem.kernels import state, tile
from repose.dem.kernels.rows import Rows
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS, hertz_mindlin
from repose.dem.laws.law import Law
from repose.dem.laws.tangential import update_springs
from repose.dem.materials import effective_moduli

L = state.LANES

BodyDamping = namedtuple("BodyDamping", "tension friction_limit")
RollingSpring = namedtuple("RollingSpring", "tension friction_limit")

_scratch_rows = Rows(tile.ROLLING)
STIFFNESS, FRICTION = _scratch_rows.take_each(2)


def undamped_tangent(a, b, contact, tension="keep"):
    """The constants of Hertz and Mindlin's law without a dashpot along the tangent."""
    return hertz_mindlin.constants(a, b, contact, tension) * (1.0, 1.0, 1.0, 0.0, 1.0)


def body_damping(law, t, c, at, dt):
    """Hertz and Mindlin's law; the masses of the two bodies damp each contact, along its normal only."""
    for k in range(L):
        t[tile.INVERSE_MASS + k] = (
            t[tile.A + state.INVERSE_MASS * L + k]
            + t[tile.B + state.INVERSE_MASS * L + k]
        )
    hertz_mindlin.compute_contact_circles(t)
    update_springs(t, c, at + hertz_mindlin.SPRING, dt)
    hertz_mindlin.compute_forces(
        t, c, at + hertz_mindlin.SPRING, law.tension, law.friction_limit
    )


def spring_constants(a, b, contact, _tension="keep"):
    """8 G* and the rolling friction, of the lever R*."""
    return np.array([8.0 * effective_moduli(a, b)[1], contact.rolling_friction])


def rolling_spring(law, t, c, at, dt):
    """A spring of stiffness S_t R*^2 against the relative rotation about the tangents, at most mu_r R* F."""
    for k in range(L):
        nx = c[state.NORMAL + k]
        ny = c[state.NORMAL + L + k]
        nz = c[state.NORMAL + 2 * L + k]
        first = tile.A + state.ANGULAR_VELOCITY * L + k
        second = tile.B + state.ANGULAR_VELOCITY * L + k
        gap = t[tile.GAP + k]
        radius = t[tile.RADIUS + k]
        overlap = -gap if gap < 0.0 else 0.0
        touching = 1.0 if gap < 0.0 else 0.0
        turn = dt * t[STIFFNESS + k] * math.sqrt(radius * overlap) * radius * radius
        x = c[at + k] + turn * (t[first] - t[second])
        y = c[at + L + k] + turn * (t[first + L] - t[second + L])
        z = c[at + 2 * L + k] + turn * (t[first + 2 * L] - t[second + 2 * L])
        along = x * nx + y * ny + z * nz
        x = x - along * nx
        y = y - along * ny
        z = z - along * nz
        most = t[FRICTION + k] * t[tile.PUSH + k] * radius
        cut = touching * min(1.0, most / math.sqrt(x * x + y * y + z * z + 1e-60))
        x = cut * x
        y = cut * y
        z = cut * z
        c[at + k] = state.flush_tiny(x)
        c[at + L + k] = state.flush_tiny(y)
        c[at + 2 * L + k] = state.flush_tiny(z)
        t[tile.TO_A + 3 * L + k] -= x
        t[tile.TO_A + 4 * L + k] -= y
        t[tile.TO_A + 5 * L + k] -= z
        t[tile.TO_B + 3 * L + k] += x
        t[tile.TO_B + 4 * L + k] += y
        t[tile.TO_B + 5 * L + k] += z
        t[tile.TO_A + state.ROLL * L + k] = 0.0
        t[tile.TO_B + state.ROLL * L + k] = 0.0


CONTACT_LAWS["body_damping"] = Law(
    name="body_damping",
    options=BodyDamping,
    constants=undamped_tangent,
    n_constants=5,
    n_rows=hertz_mindlin.LAW.n_rows,
    n_state=hertz_mindlin.LAW.n_state,
    kernel=body_damping,
    words={},
    contact_time=hertz_mindlin.contact_time,
    oscillator=hertz_mindlin.oscillator,
)
ROLLING_LAWS["spring"] = Law(
    name="spring",
    options=RollingSpring,
    constants=spring_constants,
    n_constants=2,
    n_rows=_scratch_rows.count,
    n_state=3,
    kernel=rolling_spring,
    words={},
)
