"""The tangential spring of a contact and Coulomb's limit, which contact laws share.

With the velocity v of A against B at the contact point, its normal part v_n and its
tangential part v_t:

    v = v_a - v_b + w_a x r_a - w_b x r_b,      v_n = v . n,      v_t = v - v_n n
    F_t = -(k_t e + d v_t),                     |F_t| <= mu_s F_c

The spring e is the path of the contact point of A over that of B in the tangent plane,
as long as the two touch (Cundall and Strack 1979). It follows the plane as this tilts:
its part along the present normal is dropped. When both bodies turn together about the
normal, the spring does not turn with them. The limit cuts the spring first, then the
sum of spring and dashpot.

F_c is the normal force that makes a sliding impact change the tangential velocity by
mu_s (1 + e) V_n, as of rigid bodies (`law.COULOMB`). Where the damped force may pull,
its dashpot adds nothing over a whole impact. So F_c is the elastic force, as in EDEM's
Hertz-Mindlin contact. Where it may not pull, F_c is the size of all of the force, as in
LIGGGHTS and LAMMPS; then the limit holds at every moment too.

A body that touches many others has the dashpots of all of them, which add up about its
long axis. With a time step dt they may reverse its rotation, and a body among eight
others trembles for ever. So all of them together stop at most its whole rotation in a
step. Where S = dt max(J) sum(d r^2) is above 1, with the inverse moments of inertia J,
the dashpots d and their arms r, a body takes the share 1 / S of each dashpot, and a
contact that of the body with the smaller share. The share is that of the step before.
With shorter steps it is 1: this is no part of the law.

Rows of the scratch tile `t` (see `kernels.tile`): velocities and arms of both bodies
are read, V (v_t), VN (v_n), TO_A (the force on A), PUSH (F_c) and DASHPOT (d) are
written, SHARE is read. Rows of the contacts' tile `c`: the normal n, and three rows of
e, from a place `spring` on.
"""

import math

import numpy as np

from ..kernels import state as st
from ..kernels import tile as tl
from ..kernels.jit import inlined
from ..kernels.rows import L, lane_vector, write_vector
from ..kernels.simd import rsqrt
from .law import ELASTIC, KEEP

# First rows of the velocities and angular velocities of both bodies.
VELOCITY_A = tl.A + st.VELOCITY * L
VELOCITY_B = tl.B + st.VELOCITY * L
SPIN_A = tl.A + st.ANGULAR_VELOCITY * L
SPIN_B = tl.B + st.ANGULAR_VELOCITY * L


@inlined
def slip(t: np.ndarray, c: np.ndarray, spring: int, dt: float, reach: int = 0) -> None:
    """Compute the velocity of A against B in each lane, and move the tangential spring.

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
        Place in `c` of the row with the gaps at which the contacts end; 0 for a law
        whose contacts end when the surfaces part.
    """
    for k in range(L):
        nx, ny, nz = lane_vector(c, st.NORMAL, k)
        ax, ay, az = lane_vector(t, tl.RA, k)  # arm of A
        bx, by, bz = lane_vector(t, tl.RB, k)  # arm of B
        vax, vay, vaz = lane_vector(t, VELOCITY_A, k)
        vbx, vby, vbz = lane_vector(t, VELOCITY_B, k)
        wax, way, waz = lane_vector(t, SPIN_A, k)
        wbx, wby, wbz = lane_vector(t, SPIN_B, k)
        vx = vax - vbx + way * az - waz * ay - (wby * bz - wbz * by)
        vy = vay - vby + waz * ax - wax * az - (wbz * bx - wbx * bz)
        vz = vaz - vbz + wax * ay - way * ax - (wbx * by - wby * bx)

        vn = vx * nx + vy * ny + vz * nz
        vx -= vn * nx
        vy -= vn * ny
        vz -= vn * nz
        write_vector(t, tl.V, k, vx, vy, vz)
        t[tl.VN + k] = vn

        if reach > 0:  # a law without reach must compile to one comparison
            touching = 1.0 if t[tl.GAP + k] <= c[reach + k] else 0.0
        else:
            touching = 1.0 if t[tl.GAP + k] < 0.0 else 0.0
        ex, ey, ez = lane_vector(c, spring, k)
        en = ex * nx + ey * ny + ez * nz
        c[spring + k] = st.alive(touching * (ex - en * nx + vx * dt))
        c[spring + L + k] = st.alive(touching * (ey - en * ny + vy * dt))
        c[spring + 2 * L + k] = st.alive(touching * (ez - en * nz + vz * dt))


@inlined
def normal_forces(
    elastic: float, damped: float, tension: int, friction_limit: int
) -> tuple[float, float]:
    """Compute the normal force, and the one that limits friction and rolling.

    Both are 0 if the contact has ended because the damped force vanished.

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
    smallest = -math.inf if tension == KEEP else 0.0
    force = damped if damped > smallest else smallest
    limit = elastic if friction_limit == ELASTIC else abs(force)
    return force, limit if damped > smallest else 0.0


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
    """Compute the forces of one lane, within Coulomb's limit.

    Parameters
    ----------
    t : numpy.ndarray
        Tile of 32 contacts, with the velocity in row V; its rows TO_A, PUSH and DASHPOT
        are written.
    c : numpy.ndarray
        Tile of the quantities that the contacts keep from step to step; the spring in
        it is cut.
    spring : int
        Place of the spring's first row in `c`.
    k : int
        The lane.
    fn, limit : float
        The normal force, and the one that limits friction and rolling [N].
    friction : float
        Coefficient of static friction.
    stiffness, damping : float
        Of the tangential spring [N/m], and of the dashpot [N s/m], of which the share
        in row SHARE acts.
    """
    t[tl.DASHPOT + k] = damping
    damping *= t[tl.SHARE + k]
    cap = friction * limit

    # cut the spring
    ex, ey, ez = lane_vector(c, spring, k)
    sx, sy, sz = stiffness * ex, stiffness * ey, stiffness * ez
    cut = cap * rsqrt(sx * sx + sy * sy + sz * sz)
    cut = cut if cut < 1.0 else 1.0
    write_vector(c, spring, k, cut * ex, cut * ey, cut * ez)

    # Add the dashpot and cut the sum. The velocities are read here, one by one: if they
    # were read before, the compiler would fuse other products, and the last bits would
    # change.
    fx = cut * sx + damping * t[tl.V + k]
    fy = cut * sy + damping * t[tl.V + L + k]
    fz = cut * sz + damping * t[tl.V + 2 * L + k]
    cut = cap * rsqrt(fx * fx + fy * fy + fz * fz)
    cut = cut if cut < 1.0 else 1.0

    nx, ny, nz = lane_vector(c, st.NORMAL, k)
    write_vector(
        t, tl.TO_A, k, -fn * nx - cut * fx, -fn * ny - cut * fy, -fn * nz - cut * fz
    )
    t[tl.PUSH + k] = limit
