"""Contact law: a linear spring and dashpot, with Coulomb's limit.

With the overlap delta, the effective radius R*, the effective moduli E* and G*, the
mass m, the damping ratio beta and the relative velocities v_n and v_t, the forces are

    F_n = k_n delta + 2 beta sqrt(k_n m) v_n,        k_n = 4/3 E* sqrt(SECANT) R*
    F_t = -k_t delta_t - 2 beta sqrt(k_t m) v_t,     k_t = 4 G* / E* k_n
    |F_t| <= mu_s F_c

m is the same mass at the contact as in `hertz_mindlin`. k_n is the secant stiffness of
a Hertz contact at the overlap SECANT R*, and k_t / k_n is the ratio of Mindlin's
stiffnesses. F_c is the normal force in Coulomb's limit (`tangential`). An impact lasts
pi / sqrt(k_n / m (1 - beta^2)) and has the same restitution at any speed.

Rows of the tile `scratch`, by their symbols:

    GAP               -delta              STIFFNESS          k_n / R*
    RADIUS            R*                  TANGENTIAL_RATIO   k_t / k_n
    INVERSE_MASS      1 / m               DAMPING            2 beta
    VN, V             v_n, v_t            FRICTION           mu_s

Rows that a contact keeps in `history`: SPRING, the three components of delta_t.

References
----------
Cundall and Strack, Geotechnique 29 (1979) 47. Schwager and Poeschel, Granular Matter 9
(2007) 465: the damping.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import tile
from ..kernels.rows import LANES, Rows
from ..kernels.simd import rsqrt
from ..materials import Contact, Material, effective_moduli
from .hertz_mindlin import damping_ratio
from .law import Law
from .tangential import compute_normal_forces, update_springs, write_forces

# Overlap over effective radius at which the spring has the same force as a Hertz
# contact.
SECANT = 0.01

LinearSpring = namedtuple("LinearSpring", "tension friction_limit")
_scratch_rows = Rows(tile.LAW)
STIFFNESS, TANGENTIAL_RATIO, DAMPING, FRICTION = _scratch_rows.take_each(4)
_history_rows = Rows()
SPRING = _history_rows.take(3)


def constants(
    a: Material, b: Material, contact: Contact, tension: str = "keep"
) -> np.ndarray:
    """Compute the constants of the law for two materials.

    Parameters
    ----------
    a, b : Material
        The two materials.
    contact : Contact
        Their contact.
    tension : {"keep", "release", "cut"}
        How a contact ends, see `Simulation`.

    Returns
    -------
    ndarray (4,)
        The values of the rows of the law: k_n / R* [Pa], k_t / k_n, 2 beta and mu_s.
    """
    young, shear = effective_moduli(a, b)
    # The damping follows from the restitution.
    beta = damping_ratio(contact.restitution, tension)
    return np.array(
        [
            4.0 / 3.0 * young * math.sqrt(SECANT),
            4.0 * shear / young,
            2.0 * beta,
            contact.static_friction,
        ]
    )


def contact_time(
    a: Material,
    b: Material,
    _contact: Contact,
    mass: float,
    radius: float,
    _speed: float,
) -> float:
    """Compute the duration of an elastic head-on impact; it is the same at any speed.

    Parameters
    ----------
    a, b : Material
        Materials of the two bodies.
    _contact : Contact
        Their contact, which this law does not need.
    mass : float
        Effective mass m* [kg].
    radius : float
        Effective radius R* [m].
    _speed : float
        Relative speed [m/s]; not used.

    Returns
    -------
    float
        The duration [s], pi sqrt(m* / k_n).
    """
    young, _ = effective_moduli(a, b)
    stiffness = 4.0 / 3.0 * young * math.sqrt(SECANT) * radius
    return math.pi * math.sqrt(mass / stiffness)


def oscillator(
    a: Material,
    b: Material,
    contact: Contact,
    tension: str,
    radius: float,
    _overlap: float,
) -> tuple[float, float]:
    """Compute stiffness and damping ratio of a contact, which hold at any overlap.

    Parameters
    ----------
    a, b : Material
        Materials of the two bodies.
    contact : Contact
        Their contact.
    tension : {"keep", "release", "cut"}
        How a contact ends, see `Simulation`.
    radius : float
        R* [m].
    _overlap : float
        Overlap [m]; not used.

    Returns
    -------
    stiffness : float
        k_n [N/m].
    ratio : float
        beta, which is the damping constant divided by 2 sqrt(k_n m).
    """
    young, _ = effective_moduli(a, b)
    stiffness = 4.0 / 3.0 * young * math.sqrt(SECANT) * radius
    return stiffness, damping_ratio(contact.restitution, tension)


def kernel(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the forces of LANES contacts, one in each lane, of this time step.

    The rows TO_A (the force on body A), PUSH (the force that limits friction) and
    CIRCLE (radius of the contact circle) of `scratch` and the springs in `history` are
    overwritten. `write_forces` writes the first two.

    Parameters
    ----------
    law : namedtuple
        The options of the law as integers: `tension` and `friction_limit`.
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.contact_forces`.
    first : int
        Index in `history` at which the rows of the law begin.
    dt : float
        Time step [s].
    """
    spring = first + SPRING
    update_springs(scratch, history, spring, dt)
    for lane in range(LANES):
        # Beyond the edge of a disc the gap is infinite. The overlap is therefore
        # selected by a condition, because infinity times 0 would be NaN.
        gap = scratch[tile.GAP + lane]
        touching = 1.0 if gap < 0.0 else 0.0
        overlap = -gap if gap < 0.0 else 0.0
        scratch[tile.CIRCLE + lane] = math.sqrt(scratch[tile.RADIUS + lane] * overlap)

        # The normal force is the sum of the forces of the spring and the dashpot. The
        # constant STIFFNESS is the stiffness divided by the effective radius. `viscous`
        # is sqrt(k m), with the stiffness k and the effective mass m.
        stiffness = touching * scratch[STIFFNESS + lane] * scratch[tile.RADIUS + lane]
        viscous = math.sqrt(stiffness) * rsqrt(scratch[tile.INVERSE_MASS + lane])
        elastic = stiffness * overlap
        damped = elastic + scratch[DAMPING + lane] * viscous * scratch[tile.VN + lane]
        normal_force, limit = compute_normal_forces(
            elastic, damped, law.tension, law.friction_limit
        )

        # The tangential spring and dashpot
        stiffness_ratio = scratch[TANGENTIAL_RATIO + lane]
        damping = scratch[DAMPING + lane] * math.sqrt(stiffness_ratio) * viscous
        write_forces(
            scratch,
            history,
            spring,
            lane,
            normal_force,
            limit,
            scratch[FRICTION + lane],
            stiffness_ratio * stiffness,
            damping,
        )


LAW = Law(
    name="linear_spring",
    options=LinearSpring,
    constants=constants,
    n_constants=4,
    n_rows=_scratch_rows.count,
    n_state=_history_rows.count,
    kernel=kernel,
    words={
        "normal": "linear spring and dashpot (Cundall and Strack 1979)",
        "tangential": "linear spring and dashpot; Coulomb's limit mu_s times {limit}",
    },
    contact_time=contact_time,
    oscillator=oscillator,
)
