"""The tangential spring of a contact and Coulomb's limit, which contact laws share.

The spring is the path of the contact point of A over that of B in the tangent plane, as long as the two touch
(Cundall and Strack 1979). It follows the plane as this tilts: its part along the present normal is dropped. When both
bodies turn together about the normal, the spring does not turn with them.

Coulomb's limit takes the normal force that makes a sliding impact change the tangential velocity by mu_s (1 + e) V_n,
as of rigid bodies (`law.COULOMB`). Where the damped force may pull, its dashpot adds nothing over a whole impact, so
that is the elastic force, as in EDEM's Hertz-Mindlin contact. Where it may not pull it is the size of all of the force,
as in LIGGGHTS and LAMMPS; then the limit holds at every moment too.

A body that touches many others has the dashpots of all of them, which add up about its long axis. With a time step dt
they may reverse its rotation, and a body among eight others trembles for ever. So all of them together stop at most its
whole rotation in a step: where L = dt max(J) sum(c r^2) is above 1, J the inverse moments of inertia, c the dashpots
and r their arms, a body takes the share 1 / L of each dashpot, and a contact that of the body with the smaller share.
The share is that of the step before. With shorter steps it is 1: this is no part of the law.
"""

import math

import numpy as np

from ..kernels import state as st
from ..kernels import tile as tl
from ..kernels.jit import inlined
from ..kernels.rows import L, lane_vector, write_vector
from ..kernels.simd import rsqrt
from .law import ELASTIC, KEEP

N = st.NORMAL


@inlined
def slip(t: np.ndarray, c: np.ndarray, spring: int, dt: float, reach: int = 0) -> None:
    """Velocity of A against B at each lane's contact, and the tangential spring in the present tangent plane.

    Writes rows V (tangential) and VN (normal) of the tile and the three rows from `spring` on.

    Parameters
    ----------
    t : numpy.ndarray
        Tile of 32 contacts; its rows V (tangential) and VN (normal) are written.
    c : numpy.ndarray
        Tile of the quantities that the contacts keep from step to step.
    spring : int
        Place of the spring's first row in `c`; its three rows are written.
    dt : float
        Time step [s].
    reach : int
        Place in `c` of the row with the gaps at which the contacts end; 0 for a law whose contacts end where they part.
    """
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        rx, ry, rz = t[tl.RA + k], t[tl.RA + L + k], t[tl.RA + 2 * L + k]
        sx, sy, sz = t[tl.RB + k], t[tl.RB + L + k], t[tl.RB + 2 * L + k]
        ox, oy, oz = lane_vector(t, tl.A + st.ANGULAR_VELOCITY * L, k)
        px, py, pz = lane_vector(t, tl.B + st.ANGULAR_VELOCITY * L, k)
        vx = (
            t[tl.A + 3 * L + k]
            - t[tl.B + 3 * L + k]
            + oy * rz
            - oz * ry
            - (py * sz - pz * sy)
        )
        vy = (
            t[tl.A + 4 * L + k]
            - t[tl.B + 4 * L + k]
            + oz * rx
            - ox * rz
            - (pz * sx - px * sz)
        )
        vz = (
            t[tl.A + 5 * L + k]
            - t[tl.B + 5 * L + k]
            + ox * ry
            - oy * rx
            - (px * sy - py * sx)
        )
        vn = vx * nx + vy * ny + vz * nz
        vx -= vn * nx
        vy -= vn * ny
        vz -= vn * nz
        write_vector(t, tl.V, k, vx, vy, vz)
        t[tl.VN + k] = vn
        ex, ey, ez = c[spring + k], c[spring + L + k], c[spring + 2 * L + k]
        en = ex * nx + ey * ny + ez * nz
        if reach > 0:  # a law without reach must compile to one comparison
            touching = 1.0 if t[tl.GAP + k] <= c[reach + k] else 0.0
        else:
            touching = 1.0 if t[tl.GAP + k] < 0.0 else 0.0
        c[spring + k] = st.alive(touching * (ex - en * nx + vx * dt))
        c[spring + L + k] = st.alive(touching * (ey - en * ny + vy * dt))
        c[spring + 2 * L + k] = st.alive(touching * (ez - en * nz + vz * dt))


@inlined
def normal_forces(
    elastic: float, damped: float, tension: int, friction_limit: int
) -> tuple[float, float]:
    """Compute normal force, and the one that limits friction and rolling.

    A contact that has ended because the damped force vanished has neither.

    Parameters
    ----------
    elastic, damped : float
        The elastic part of the normal force, and all of it [N].
    tension, friction_limit : int
        Numbers of `law.TENSIONS` and `law.FRICTION_LIMITS`.

    Returns
    -------
    force, limit : float
        In N.
    """
    least = -math.inf if tension == KEEP else 0.0
    force = damped if damped > least else least
    limit = elastic if friction_limit == ELASTIC else abs(force)
    return force, limit if damped > least else 0.0


@inlined
def add_forces(
    t: np.ndarray,
    c: np.ndarray,
    spring: int,
    k: int,
    fn: float,
    limit: float,
    friction: float,
    stiffness: float,
    damping: float,
) -> None:
    """Compute the forces of one lane: the normal one, and the tangential one that Coulomb's limit leaves.

    The limit cuts the spring first, then the sum of spring and dashpot.

    Parameters
    ----------
    t : numpy.ndarray
        Tile of 32 contacts, with the velocity in row V; its rows TO_A, PUSH and DASHPOT are written.
    c : numpy.ndarray
        Tile of the quantities that the contacts keep from step to step; the spring in it is cut.
    spring : int
        Place of the spring's first row in `c`.
    k : int
        The lane.
    fn, limit : float
        The normal force, and the one that limits friction and rolling [N].
    friction : float
        Coefficient of static friction.
    stiffness, damping : float
        Of the tangential spring [N/m], and of the dashpot [N s/m], of which the share in row SHARE acts.
    """
    t[tl.DASHPOT + k] = damping
    damping *= t[tl.SHARE + k]
    cap = friction * limit
    ex, ey, ez = c[spring + k], c[spring + L + k], c[spring + 2 * L + k]
    gx, gy, gz = stiffness * ex, stiffness * ey, stiffness * ez
    cut = cap * rsqrt(gx * gx + gy * gy + gz * gz)
    cut = cut if cut < 1.0 else 1.0
    write_vector(c, spring, k, cut * ex, cut * ey, cut * ez)
    fx = cut * gx + damping * t[tl.V + k]
    fy = cut * gy + damping * t[tl.V + L + k]
    fz = cut * gz + damping * t[tl.V + 2 * L + k]
    cut = cap * rsqrt(fx * fx + fy * fy + fz * fz)
    cut = cut if cut < 1.0 else 1.0
    t[tl.TO_A + k] = -fn * c[st.NORMAL + k] - cut * fx
    t[tl.TO_A + L + k] = -fn * c[st.NORMAL + L + k] - cut * fy
    t[tl.TO_A + 2 * L + k] = -fn * c[st.NORMAL + 2 * L + k] - cut * fz
    t[tl.PUSH + k] = limit
