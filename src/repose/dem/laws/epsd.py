"""Rolling resistance as a spring and dashpot between two bodies, model C of Ai et al., and one against twisting.

With the relative angular velocity w, its part w_n along the normal and w_r across it, the lever R and the contact
circle a = sqrt(R* delta):

    M_r = -k_r theta_r - c_r w_r,     |M_r| <= mu_r F_c R,               k_r = 2.25 k_n mu_r^2 R^2,  k_n = 2 E* a
    M_n = -k_t theta_n - c_t w_n,     |M_n| <= mu_t F_c a,               k_t = 4 G* a^3,  mu_t = 3 pi / 16 mu_s

theta is the path of w as long as the two touch; a torque stays as it is when the load changes. The dashpots c_r = 2
eta sqrt(I k_r) and c_t = 2 eta sqrt(J k_t) have eta 0.3. The limit cuts the spring first, then the sum, as Coulomb's
does. I is the moment of both bodies about the contact, 1/I = 1/(1.4 m_a r_a^2) + 1/(1.4 m_b r_b^2), and J that about
the normal, with 0.4 for 1.4, as of spheres. R = r_a r_b / (r_a + r_b), r the distance of the contact from a centre;
r_a where B is a wall. F_c is the normal force that limits friction. The torque on B is the opposite of that on A, so
angular momentum is kept; and a wall that turns takes the bodies along. For two equal spheres R is half of what the
law `budget` takes as the lever of either.

References
----------
Ai, Chen, Rotter and Ooi, Powder Technol. 206 (2011) 269, model C. Marshall, J. Comput. Phys. 228 (2009) 1541: the
twisting spring, half the tangential stiffness times a^2. Johnson, Contact Mechanics (1985), section 7.2: its limit.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import state as st
from ..kernels import tile as tl
from ..kernels.jit import inlined
from ..kernels.rows import L, Rows, add_vector
from ..materials import Contact, Material, effective_moduli
from .law import Law

ETA = 0.3  # damping ratio of rolling (Ai et al. 2011)
SPHERE, SPUN = (
    1.4,
    0.4,
)  # moments of a sphere about a point of its surface and about its centre over m r^2
HERTZ_TWIST = 3.0 * math.pi / 16.0
TINY = 1e-60  # keeps a root from 0

Epsd = namedtuple("Epsd", "tension friction_limit")

_rows = Rows(tl.ROLLING)
ROLLING_FRICTION, TWISTING_FRICTION, NORMAL_STIFFNESS, TWISTING_STIFFNESS = (
    _rows.take_each(4)
)

_state = Rows()
ROLLED = _state.take(3)  # k_r theta_r [N m]
TWISTED = _state.take()  # M_n [N m]


def constants(
    a: Material, b: Material, contact: Contact, _tension: str = "keep"
) -> np.ndarray:
    """mu_r, mu_t, 2 E* and 4 G* of two materials (4,)."""
    young, shear = effective_moduli(a, b)
    twist = contact.twisting_friction
    if twist is None:
        twist = HERTZ_TWIST * contact.static_friction
    return np.array([contact.rolling_friction, twist, 2.0 * young, 4.0 * shear])


@inlined
def lever(x: float, y: float, z: float) -> float:
    """Length of an arm; the arm of a wall is 0 and counts as infinite."""
    square = x * x + y * y + z * z
    return math.sqrt(square) if square > 0.0 else 1e30


@inlined
def levers(t: np.ndarray, k: int) -> tuple[float, float]:
    """1/R and 1/(m_a r_a^2) + 1/(m_b r_b^2) of a lane."""
    r_a = lever(t[tl.RA + k], t[tl.RA + L + k], t[tl.RA + 2 * L + k])
    r_b = lever(t[tl.RB + k], t[tl.RB + L + k], t[tl.RB + 2 * L + k])
    mobility = t[tl.A + st.INVERSE_MASS * L + k] / (r_a * r_a)
    mobility += t[tl.B + st.INVERSE_MASS * L + k] / (r_b * r_b)
    return 1.0 / r_a + 1.0 / r_b, mobility


@inlined
def turning(
    t: np.ndarray, k: int, nx: float, ny: float, nz: float
) -> tuple[float, float, float, float]:
    """Relative angular velocity of a lane: its part along the normal, and the three components across it."""
    first, second = (
        tl.A + st.ANGULAR_VELOCITY * L + k,
        tl.B + st.ANGULAR_VELOCITY * L + k,
    )
    wx = t[first] - t[second]
    wy = t[first + L] - t[second + L]
    wz = t[first + 2 * L] - t[second + 2 * L]
    spin = wx * nx + wy * ny + wz * nz
    return spin, wx - spin * nx, wy - spin * ny, wz - spin * nz


@inlined
def oppose(t: np.ndarray, k: int, x: float, y: float, z: float) -> None:
    """Apply a torque of a lane against A and along B, with no budget of rolling."""
    add_vector(t, tl.TO_A + 3 * L, k, -x, -y, -z)
    add_vector(t, tl.TO_B + 3 * L, k, x, y, z)
    t[tl.TO_A + st.ROLL * L + k] = 0.0
    t[tl.TO_B + st.ROLL * L + k] = 0.0


@inlined
def resist(
    t: np.ndarray, c: np.ndarray, at: int, dt: float, of_tangent: int, eta: float
) -> None:
    """Compute the torques of each lane on both bodies; of_tangent: k_r from the tangential stiffness, see `epsd2`."""
    for k in range(L):
        nx, ny, nz = c[st.NORMAL + k], c[st.NORMAL + L + k], c[st.NORMAL + 2 * L + k]
        circle = t[tl.CIRCLE + k]
        touching = 1.0 if circle > 0.0 else 0.0
        push, friction = t[tl.PUSH + k], t[ROLLING_FRICTION + k]
        inverse_arm, mobility = levers(t, k)
        arm = 1.0 / inverse_arm
        spin, wx, wy, wz = turning(t, k, nx, ny, nz)
        if of_tangent:
            stiffness = 2.0 * t[TWISTING_STIFFNESS + k] * circle * arm * arm
        else:
            stiffness = (
                2.25
                * t[NORMAL_STIFFNESS + k]
                * circle
                * friction
                * friction
                * arm
                * arm
            )
        x, y, z = c[at + k], c[at + L + k], c[at + 2 * L + k]
        along = x * nx + y * ny + z * nz
        x = x - along * nx + stiffness * dt * wx
        y = y - along * ny + stiffness * dt * wy
        z = z - along * nz + stiffness * dt * wz
        most = friction * push * arm
        held = touching * min(1.0, most / math.sqrt(x * x + y * y + z * z + TINY))
        x, y, z = held * x, held * y, held * z
        c[at + k], c[at + L + k], c[at + 2 * L + k] = (
            st.alive(x),
            st.alive(y),
            st.alive(z),
        )
        dashpot = 2.0 * eta * math.sqrt(SPHERE * stiffness / (mobility + TINY))
        x, y, z = x + dashpot * wx, y + dashpot * wy, z + dashpot * wz
        cut = min(1.0, most / math.sqrt(x * x + y * y + z * z + TINY))
        stiffness = t[TWISTING_STIFFNESS + k] * circle * circle * circle
        limit = touching * t[TWISTING_FRICTION + k] * push * circle
        twist = max(-limit, min(limit, c[at + 3 * L + k] + stiffness * dt * spin))
        c[at + 3 * L + k] = st.alive(twist)
        twist += 2.0 * ETA * math.sqrt(SPUN * stiffness / (mobility + TINY)) * spin
        twist = max(-limit, min(limit, twist))
        x, y, z = cut * x + twist * nx, cut * y + twist * ny, cut * z + twist * nz
        oppose(t, k, x, y, z)


def kernel(law: Any, t: np.ndarray, c: np.ndarray, at: int, dt: float) -> None:
    """Compute the torques of each lane on both bodies, as `law.rolling_resistance` asks for them."""
    resist(t, c, at, dt, 0, ETA)


LAW = Law(
    name="epsd",
    options=Epsd,
    constants=constants,
    n_constants=4,
    n_rows=_rows.count,
    n_state=_state.count,
    kernel=kernel,
    words={
        "rolling": "elastic-plastic spring and dashpot against the rotation of one body relative to the other (model C "
        "of Ai et al. 2011), at most mu_r times {limit} times the reduced lever; spin about the normal is resisted by "
        "at most mu_t (3 pi / 16 mu_s unless it is set) times {limit} times the radius of the contact circle"
    },
)
