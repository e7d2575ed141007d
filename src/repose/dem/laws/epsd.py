"""Rolling resistance law: a spring and a dashpot between two bodies.

This is model C of Ai et al., with another spring and dashpot against twisting.

Let w be the angular velocity of A relative to B, with the parts w_n along the normal
and w_r perpendicular to it. R is the lever, and a = sqrt(R* delta) the radius of the
contact circle. The torques on A are

    M_r = -k_r theta_r - c_r w_r,     |M_r| <= mu_r F_c R
    k_r = 2.25 k_n mu_r^2 R^2,        k_n = 2 E* a

    M_n = -k_t theta_n - c_t w_n,     |M_n| <= mu_t F_c a
    k_t = 4 G* a^3,                   mu_t = 3 pi / 16 mu_s unless it is set

theta is the integral of w over the time for which the two touch. The torque of a spring
does not change when only the load changes. The damping constants are c_r = 2 eta sqrt(I
k_r) and c_t = 2 eta sqrt(J k_t), with the damping ratio eta = 0.3. As in Coulomb's law,
the limit is applied first to the spring, then to the sum of spring and dashpot.

I is the moment of inertia of both bodies about the contact, with 1/I = 1/(1.4 m_a
r_a^2) + 1/(1.4 m_b r_b^2). J is that about the normal, with 0.4 in place of 1.4. These
factors are those of spheres. R = r_a r_b / (r_a + r_b), where r is the distance of the
contact from the centre of a body; R = r_a if B is a wall. F_c is the normal force that
limits friction.

The torque on B is opposite to that on A, so angular momentum is conserved, and a
rotating wall carries the bodies along. For two equal spheres, R is half of the lever
that the law `budget` has for each of them.

Rows of the tile `scratch`, by their symbols:

    ROLLING_FRICTION    mu_r        NORMAL_STIFFNESS      2 E* = k_n / a
    TWISTING_FRICTION   mu_t        TWISTING_STIFFNESS    4 G* = k_t / a^3
    CIRCLE              a           PUSH                  F_c

Rows that a contact keeps in `history`: ROLLED, the three components of the torque k_r
theta_r, and TWISTED, the torque k_t theta_n.

References
----------
Ai, Chen, Rotter and Ooi, Powder Technol. 206 (2011) 269, model C. Marshall, J. Comput.
Phys. 228 (2009) 1541: the twisting spring, half the tangential stiffness times a^2.
Johnson, Contact Mechanics (1985), section 7.2: its limit.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import state, tile
from ..kernels.jit import inlined
from ..kernels.rows import LANES, Rows, add_vector, lane_vector, write_vector
from ..materials import Contact, Material, effective_moduli
from .law import Law

ETA = 0.3  # damping ratio of rolling (Ai et al. 2011)
# Moments of inertia of a sphere over m r^2, about a point of its surface and about its
# centre.
SPHERE_ABOUT_CONTACT = 1.4
SPHERE_ABOUT_CENTRE = 0.4
HERTZ_TWIST = 3.0 * math.pi / 16.0  # mu_t / mu_s of a Hertz contact that slides
TINY = 1e-60  # added to divisors, which may be 0
INFINITE_ARM = 1e30  # m

Epsd = namedtuple("Epsd", "tension friction_limit")

_scratch_rows = Rows(tile.ROLLING)
ROLLING_FRICTION, TWISTING_FRICTION, NORMAL_STIFFNESS, TWISTING_STIFFNESS = (
    _scratch_rows.take_each(4)
)

_history_rows = Rows()
ROLLED = _history_rows.take(3)
TWISTED = _history_rows.take()

# First rows of the torques, budgets, angular velocities and inverse masses of both
# bodies
TORQUE_A = tile.TO_A + 3 * LANES
TORQUE_B = tile.TO_B + 3 * LANES
BUDGET_A = tile.TO_A + state.ROLL * LANES
BUDGET_B = tile.TO_B + state.ROLL * LANES
SPIN_A = tile.A + state.ANGULAR_VELOCITY * LANES
SPIN_B = tile.B + state.ANGULAR_VELOCITY * LANES
INVERSE_MASS_A = tile.A + state.INVERSE_MASS * LANES
INVERSE_MASS_B = tile.B + state.INVERSE_MASS * LANES


def constants(
    a: Material, b: Material, contact: Contact, _tension: str = "keep"
) -> np.ndarray:
    """Compute the constants of two materials: mu_r, mu_t, 2 E* and 4 G*.

    Parameters
    ----------
    a, b : Material
        The two materials.
    contact : Contact
        Their contact. If it has no twisting friction, mu_t follows from the static
        friction.
    _tension : str
        How a contact ends; not used.

    Returns
    -------
    ndarray (4,)
        The constants in SI units, in the order of the law's rows.
    """
    young, shear = effective_moduli(a, b)
    twisting_friction = contact.twisting_friction
    if twisting_friction is None:
        twisting_friction = HERTZ_TWIST * contact.static_friction
    return np.array(
        [contact.rolling_friction, twisting_friction, 2.0 * young, 4.0 * shear]
    )


@inlined
def compute_arm_length(x: float, y: float, z: float) -> float:
    """Compute the length of an arm (x, y, z) [m].

    The arm of a wall is stored as 0 but counts as infinite, so the result is then
    `INFINITE_ARM`.
    """
    squared_length = x * x + y * y + z * z
    return math.sqrt(squared_length) if squared_length > 0.0 else INFINITE_ARM


@inlined
def compute_levers(scratch: np.ndarray, lane: int) -> tuple[float, float]:
    """Compute the inverse effective lever arm and the mobility of a lane's contact.

    With the distances r of the centres from the contact, the effective lever arm is R =
    1 / (1/r_a + 1/r_b), as for an effective radius. The mobility 1/(m_a r_a^2) + 1/(m_b
    r_b^2) is that of two spheres with the masses m of the bodies and these distances. A
    wall has an inverse mass of 0 and an infinite r (`compute_arm_length`).

    Parameters
    ----------
    scratch : numpy.ndarray
        Scratch tile of 32 contacts (rows of `kernels.tile`).
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.

    Returns
    -------
    inverse_lever : float
        1/R = 1/r_a + 1/r_b [1/m].
    mobility : float
        1/(m_a r_a^2) + 1/(m_b r_b^2) [1/(kg m2)].
    """
    ax, ay, az = lane_vector(scratch, tile.RA, lane)
    bx, by, bz = lane_vector(scratch, tile.RB, lane)
    r_a = compute_arm_length(ax, ay, az)
    r_b = compute_arm_length(bx, by, bz)
    # A wall has an inverse mass of 0, so it adds nothing.
    mobility = scratch[INVERSE_MASS_A + lane] / (r_a * r_a)
    mobility += scratch[INVERSE_MASS_B + lane] / (r_b * r_b)
    return 1.0 / r_a + 1.0 / r_b, mobility


@inlined
def compute_relative_rotation(
    scratch: np.ndarray, lane: int, nx: float, ny: float, nz: float
) -> tuple[float, float, float, float]:
    """Split the angular velocity of A relative to B into twisting and rolling.

    Parameters
    ----------
    scratch : numpy.ndarray
        Scratch tile of 32 contacts (rows of `kernels.tile`).
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    nx, ny, nz : float
        Unit normal from A to B.

    Returns
    -------
    spin : float
        The component along the normal [rad/s].
    wx, wy, wz : float
        The vector perpendicular to the normal [rad/s].
    """
    ax, ay, az = lane_vector(scratch, SPIN_A, lane)
    bx, by, bz = lane_vector(scratch, SPIN_B, lane)
    wx, wy, wz = ax - bx, ay - by, az - bz
    # The part along the normal is twisting, and the rest is rolling.
    spin = wx * nx + wy * ny + wz * nz
    return spin, wx - spin * nx, wy - spin * ny, wz - spin * nz


@inlined
def apply_torques(scratch: np.ndarray, lane: int, x: float, y: float, z: float) -> None:
    """Add opposite torques to both bodies of a lane, and set their budgets to zero.

    Parameters
    ----------
    scratch : numpy.ndarray
        Scratch tile of 32 contacts. Its rows TO_A and TO_B are changed.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    x, y, z : float
        The torque on B [N m]. That on A is (-x, -y, -z).
    """
    add_vector(scratch, TORQUE_A, lane, -x, -y, -z)
    add_vector(scratch, TORQUE_B, lane, x, y, z)
    scratch[BUDGET_A + lane] = 0.0
    scratch[BUDGET_B + lane] = 0.0


@inlined
def compute_torques(
    scratch: np.ndarray,
    history: np.ndarray,
    first: int,
    dt: float,
    tangential: int,
    eta: float,
) -> None:
    """Compute the torques on both bodies of each lane's contact.

    The springs in `history` and the torques of TO_A and TO_B in `scratch` are changed.

    Parameters
    ----------
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.rolling_resistance`.
    first : int
        Index in `history` at which the rows of the law begin.
    dt : float
        Time step [s].
    tangential : int
        1 if k_r follows from the tangential stiffness, for the law `epsd2`; else 0.
    eta : float
        Damping ratio of rolling.
    """
    rolled = first + ROLLED
    twisted = first + TWISTED
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, state.NORMAL, lane)
        circle = scratch[tile.CIRCLE + lane]
        touching = 1.0 if circle > 0.0 else 0.0
        normal_force = scratch[tile.PUSH + lane]
        friction = scratch[ROLLING_FRICTION + lane]
        inverse_lever, mobility = compute_levers(scratch, lane)
        lever = 1.0 / inverse_lever
        spin, wx, wy, wz = compute_relative_rotation(scratch, lane, nx, ny, nz)

        # The stiffness k_r of the rolling spring
        if tangential:
            stiffness = (
                2.0 * scratch[TWISTING_STIFFNESS + lane] * circle * lever * lever
            )
        else:
            stiffness = 2.25 * scratch[NORMAL_STIFFNESS + lane] * circle
            stiffness = stiffness * friction * friction * lever * lever

        # The torque (x, y, z) of the rolling spring: drop the part along the present
        # normal, add the rotation of this step, and cut it to the limit.
        x, y, z = lane_vector(history, rolled, lane)
        normal_part = x * nx + y * ny + z * nz
        x = x - normal_part * nx + stiffness * dt * wx
        y = y - normal_part * ny + stiffness * dt * wy
        z = z - normal_part * nz + stiffness * dt * wz
        limit = friction * normal_force * lever
        factor = touching * min(1.0, limit / math.sqrt(x * x + y * y + z * z + TINY))
        x, y, z = factor * x, factor * y, factor * z
        write_vector(
            history,
            rolled,
            lane,
            state.flush_tiny(x),
            state.flush_tiny(y),
            state.flush_tiny(z),
        )

        # Add the torque of the rolling dashpot, and cut the sum to the limit.
        inertia_stiffness = SPHERE_ABOUT_CONTACT * stiffness / (mobility + TINY)
        damping = 2.0 * eta * math.sqrt(inertia_stiffness)
        x, y, z = x + damping * wx, y + damping * wy, z + damping * wz
        factor = min(1.0, limit / math.sqrt(x * x + y * y + z * z + TINY))

        # Do the same about the normal, with the twisting spring, its dashpot and limit.
        stiffness = scratch[TWISTING_STIFFNESS + lane] * circle * circle * circle
        limit = touching * scratch[TWISTING_FRICTION + lane] * normal_force * circle
        twist = max(-limit, min(limit, history[twisted + lane] + stiffness * dt * spin))
        history[twisted + lane] = state.flush_tiny(twist)
        inertia_stiffness = SPHERE_ABOUT_CENTRE * stiffness / (mobility + TINY)
        twist += 2.0 * ETA * math.sqrt(inertia_stiffness) * spin
        twist = max(-limit, min(limit, twist))

        x, y, z = (
            factor * x + twist * nx,
            factor * y + twist * ny,
            factor * z + twist * nz,
        )
        apply_torques(scratch, lane, x, y, z)


def kernel(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the torques on both bodies of 32 contacts, one in each lane.

    Parameters
    ----------
    law : namedtuple
        Options of the law. This law does not use them.
    scratch, history : numpy.ndarray
        The tiles of the contacts, see `law.rolling_resistance`.
    first : int
        Index in `history` at which the rows of the law begin.
    dt : float
        Time step [s].
    """
    compute_torques(scratch, history, first, dt, 0, ETA)


LAW = Law(
    name="epsd",
    options=Epsd,
    constants=constants,
    n_constants=4,
    n_rows=_scratch_rows.count,
    n_state=_history_rows.count,
    kernel=kernel,
    words={
        "rolling": (
            "elastic-plastic spring and dashpot against the rotation of one body "
            "relative to the other (model C of Ai et al. 2011), at most mu_r times "
            "{limit} times the reduced lever; spin about the normal is resisted by "
            "at most mu_t (3 pi / 16 mu_s unless it is set) times {limit} times the "
            "radius of the contact circle"
        ),
    },
)
