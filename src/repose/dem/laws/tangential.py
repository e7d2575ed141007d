"""The tangential spring of a contact and Coulomb's limit, which contact laws share.

Let v be the velocity of A relative to B at the contact point, with the normal part v_n
and the tangential part v_t:

    v = v_a - v_b + w_a x r_a - w_b x r_b,      v_n = v . n,      v_t = v - v_n n
    F_t = -(k_t e + d v_t),                     |F_t| <= mu_s F_c

The spring e is the path of the contact point of A relative to that of B in the tangent
plane since the two began to touch (Cundall and Strack 1979). When the plane tilts, the
part of the spring along the present normal is dropped. When both bodies rotate together
about the normal, the spring does not rotate with them. The limit is applied first to
the spring, then to the sum of spring and dashpot.

F_c is the normal force for which a sliding impact changes the tangential velocity by
mu_s (1 + e) V_n, as with rigid bodies (`law.COULOMB`); here e is the restitution. If
the damped force may pull, the dashpot contributes nothing over a whole impact, so F_c
is the elastic force, as in EDEM's Hertz-Mindlin contact. If it may not pull, F_c is the
magnitude of the total force, as in LIGGGHTS and LAMMPS. The limit then also holds at
every moment.

The dashpots of all contacts of a body add up in its rotation about the long axis. With
a time step dt, they may reverse this rotation, and a body that touches eight others
could tremble forever. Therefore all dashpots together may at most stop the rotation of
a body in one step. Let J be the inverse moments of inertia, d the damping constants and
r their arms. If S = dt max(J) sum(d r^2) is above 1, a body allows only the fraction
1 / S of each dashpot to act, and a contact has the smaller fraction of its two bodies.
The fraction comes from the previous step. For shorter time steps it is 1, so it is not
part of the law itself.

Rows of the tile `scratch` (see `kernels.tile`): velocities and arms of both bodies and
SHARE are read; V (v_t), VN (v_n), TO_A (the force on A), PUSH (F_c) and DASHPOT (d) are
written. Rows of `history`: the normal n, and three rows of e from the index `spring`
on.
"""

import math

import numpy as np

from ..kernels import state, tile
from ..kernels.jit import inlined
from ..kernels.rows import LANES, lane_vector, write_vector
from ..kernels.simd import rsqrt
from .law import ELASTIC, KEEP

# First rows of the velocities and angular velocities of both bodies
VELOCITY_A = tile.A + state.VELOCITY * LANES
VELOCITY_B = tile.B + state.VELOCITY * LANES
SPIN_A = tile.A + state.ANGULAR_VELOCITY * LANES
SPIN_B = tile.B + state.ANGULAR_VELOCITY * LANES


@inlined
def update_springs(
    scratch: np.ndarray, history: np.ndarray, spring: int, dt: float, reach: int = 0
) -> None:
    """Update each lane's tangential spring by the relative velocity of its bodies.

    The spring is the tangential displacement of the contact point of A relative to that
    of B since the contact began. It is 0 in lanes without a contact. The springs in
    `history` and the rows V and VN of `scratch` are overwritten.

    Parameters
    ----------
    scratch : numpy.ndarray
        Working memory of this step for 32 contacts, one in each lane. The tangential
        and the normal velocity of A relative to B [m/s] are written to the rows V and
        VN.
    history : numpy.ndarray
        Tile of the numbers that the contacts keep from one step to the next, laid out
        like `scratch`.
    spring : int
        Index in `history` at which the three rows of the spring begin.
    dt : float
        Time step [s].
    reach : int
        Index in `history` of the row with the gaps at which the contacts end [m]. The
        number 0 stands for a law whose contacts end when the surfaces part.
    """
    for lane in range(LANES):
        # Normal n, arms a and b, velocities v and angular velocities w of both bodies.
        nx, ny, nz = lane_vector(history, state.NORMAL, lane)
        ax, ay, az = lane_vector(scratch, tile.RA, lane)
        bx, by, bz = lane_vector(scratch, tile.RB, lane)
        vax, vay, vaz = lane_vector(scratch, VELOCITY_A, lane)
        vbx, vby, vbz = lane_vector(scratch, VELOCITY_B, lane)
        wax, way, waz = lane_vector(scratch, SPIN_A, lane)
        wbx, wby, wbz = lane_vector(scratch, SPIN_B, lane)

        # (vx, vy, vz) is the relative velocity at the contact point, v_a - v_b + w_a x
        # a - w_b x b.
        vx = vax - vbx + way * az - waz * ay - (wby * bz - wbz * by)
        vy = vay - vby + waz * ax - wax * az - (wbz * bx - wbx * bz)
        vz = vaz - vbz + wax * ay - way * ax - (wbx * by - wby * bx)

        # Split it. From here on, (vx, vy, vz) is the tangential part, and vn the normal
        # part.
        vn = vx * nx + vy * ny + vz * nz
        vx -= vn * nx
        vy -= vn * ny
        vz -= vn * nz
        write_vector(scratch, tile.V, lane, vx, vy, vz)
        scratch[tile.VN + lane] = vn

        # `touching` is 1.0 while the contact lasts. Otherwise it is 0.0, which resets
        # the spring to zero length. The default 0 of `reach` stands for a law without
        # reach, for which this must compile to a single comparison.
        if reach > 0:
            touching = 1.0 if scratch[tile.GAP + lane] <= history[reach + lane] else 0.0
        else:
            touching = 1.0 if scratch[tile.GAP + lane] < 0.0 else 0.0

        # (ex, ey, ez) is the spring. It loses its part along the normal, and grows by
        # the tangential path of this step.
        ex, ey, ez = lane_vector(history, spring, lane)
        normal_part = ex * nx + ey * ny + ez * nz
        history[spring + lane] = state.flush_tiny(
            touching * (ex - normal_part * nx + vx * dt)
        )
        history[spring + LANES + lane] = state.flush_tiny(
            touching * (ey - normal_part * ny + vy * dt)
        )
        history[spring + 2 * LANES + lane] = state.flush_tiny(
            touching * (ez - normal_part * nz + vz * dt)
        )


@inlined
def compute_normal_forces(
    elastic: float, damped: float, tension: int, friction_limit: int
) -> tuple[float, float]:
    """Compute the normal force, and the force that limits friction and rolling.

    Both are 0 if the contact has ended because its damped force vanished.

    Parameters
    ----------
    elastic, damped : float
        The elastic part of the normal force, and the total force with damping [N].
    tension, friction_limit : int
        The options of the law as integers: a value of `law.TENSIONS` (how a contact
        ends) and of `law.FRICTION_LIMITS` (which force limits friction).

    Returns
    -------
    force, limit : float
        The normal force, and the force that limits friction and rolling [N].
    """
    # The force may pull only with the tension "keep".
    lowest = -math.inf if tension == KEEP else 0.0
    force = damped if damped > lowest else lowest
    limit = elastic if friction_limit == ELASTIC else abs(force)
    return force, limit if damped > lowest else 0.0


@inlined
def write_forces(
    scratch: np.ndarray,
    history: np.ndarray,
    spring: int,
    lane: int,
    normal_force: float,
    limit: float,
    friction: float,
    stiffness: float,
    damping: float,
) -> None:
    """Write the force on body A of one lane, whose friction obeys Coulomb's limit.

    The normal force, the stiffness and the damping constant are those of the contact
    law. The spring in `history` and the rows TO_A (the force on body A), PUSH (`limit`)
    and DASHPOT (`damping`) of `scratch` are overwritten. The row SHARE holds the
    fraction of the dashpot that acts: all dashpots of a body together must not reverse
    its rotation.

    Parameters
    ----------
    scratch : numpy.ndarray
        Working memory of this step for 32 contacts. The row V has the tangential
        velocity.
    history : numpy.ndarray
        Tile of the numbers that the contacts keep from one step to the next, laid out
        like `scratch`.
    spring : int
        Index in `history` at which the three rows of the spring begin.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    normal_force, limit : float
        The normal force, and the force that limits friction and rolling [N].
    friction : float
        Coefficient of static friction.
    stiffness, damping : float
        Stiffness of the tangential spring [N/m], and constant of its dashpot [N s/m].
        The row SHARE holds the share of the dashpot that acts.
    """
    scratch[tile.DASHPOT + lane] = damping
    # DASHPOT keeps the whole constant. From here on, only the fraction acts.
    damping *= scratch[tile.SHARE + lane]
    largest_force = friction * limit

    # Shorten the spring if the magnitude of its force, -(sx, sy, sz), exceeds the
    # limit. rsqrt(x) is 1 / sqrt(x); rsqrt(0) is large but finite, so that a spring of
    # length 0 stays 0.
    ex, ey, ez = lane_vector(history, spring, lane)
    sx, sy, sz = stiffness * ex, stiffness * ey, stiffness * ez
    factor = largest_force * rsqrt(sx * sx + sy * sy + sz * sz)
    factor = factor if factor < 1.0 else 1.0
    write_vector(history, spring, lane, factor * ex, factor * ey, factor * ez)

    # Add the force of the dashpot, and shorten the sum to the limit. The velocities are
    # read here, one by one. If they were read earlier, the compiler would fuse other
    # products, which would change the last bits of the result.
    fx = factor * sx + damping * scratch[tile.V + lane]
    fy = factor * sy + damping * scratch[tile.V + LANES + lane]
    fz = factor * sz + damping * scratch[tile.V + 2 * LANES + lane]
    factor = largest_force * rsqrt(fx * fx + fy * fy + fz * fz)
    factor = factor if factor < 1.0 else 1.0

    # The force on A opposes the normal and the tangential velocity.
    nx, ny, nz = lane_vector(history, state.NORMAL, lane)
    write_vector(
        scratch,
        tile.TO_A,
        lane,
        -normal_force * nx - factor * fx,
        -normal_force * ny - factor * fy,
        -normal_force * nz - factor * fz,
    )
    scratch[tile.PUSH + lane] = limit
