"""Contact law of Hertz and Mindlin, with viscous damping and Coulomb's limit.

With the overlap delta, the effective radius R*, the radius of the contact circle a =
sqrt(R* delta), the effective moduli E* and G*, the mass m, the damping ratio beta, and
the relative velocities v_n and v_t, the forces are

    F_n = 4/3 E* a delta + 2 sqrt(5/6) beta sqrt(S_n m) v_n,      S_n = 2 E* a
    F_t = -S_t delta_t - 2 sqrt(5/6) beta sqrt(S_t m) v_t,        S_t = 8 G* a
    |F_t| <= mu_s F_c

delta_t is the elongation of the tangential spring, and F_c the normal force in
Coulomb's limit (`tangential`). m is the effective mass of both bodies at the contact
along the normal n, divided by the number N of contacts between these bodies, which
share the damping. Two clumps may touch at several spheres. With this mass, a hit has
the configured restitution (`damped_mass`). If r is the vector from a body's centre to
the contact and J the inverse inertia of the body, then

    1 / m = N (1/m_a + 1/m_b + (r_a x n) . J_a (r_a x n) + (r_b x n) . J_b (r_b x n))

For two spheres this is the usual m* = m_a m_b / (m_a + m_b). A wall contributes no
terms. No restitution is defined in the tangential direction, so the tangential damping
uses the same m.

Rows of the tile `scratch`, by their symbols:

    GAP            -delta        NORMAL_STIFFNESS       4/3 E*
    RADIUS         R*            TANGENTIAL_STIFFNESS   8 G* = S_t / a
    INVERSE_MASS   1 / m         NORMAL_DAMPING         2 sqrt(5/6) beta sqrt(2 E*)
    CIRCLE         a             TANGENTIAL_DAMPING     2 sqrt(5/6) beta sqrt(8 G*)
    VISCOUS        sqrt(a m)     FRICTION               mu_s
    VN, V          v_n, v_t      PUSH                   F_c

Rows that a contact keeps in `history`: SPRING, the three components of delta_t.

References
----------
Hertz, J. reine angew. Math. 92 (1882) 156. Mindlin, J. Appl. Mech. 16 (1949) 259.
Tsuji, Tanaka and Ishida, Powder Technol. 71 (1992) 239: the damping. Schwager and
Poeschel, Granular Matter 9 (2007) 465: a contact that does not pull at its end.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import tile
from ..kernels.jit import inlined
from ..kernels.rows import LANES, Rows
from ..kernels.simd import rsqrt
from ..materials import Contact, Material, effective_moduli
from .law import Law
from .tangential import compute_normal_forces, update_springs, write_forces

HertzMindlin = namedtuple("HertzMindlin", "tension friction_limit")

_scratch_rows = Rows(tile.LAW)
NORMAL_STIFFNESS, TANGENTIAL_STIFFNESS = _scratch_rows.take_each(2)
NORMAL_DAMPING, TANGENTIAL_DAMPING = _scratch_rows.take_each(2)
FRICTION = _scratch_rows.take()
VISCOUS = _scratch_rows.take()

_history_rows = Rows()
SPRING = _history_rows.take(3)


def damping_ratio(restitution: float, tension: str = "keep") -> float:
    """Compute the damping ratio that gives a coefficient of restitution in an impact.

    Parameters
    ----------
    restitution : float
        Coefficient of restitution e, above 0 and at most 1.
    tension : {"keep", "release", "cut"}
        How the contact ends, see `Simulation`.

    Returns
    -------
    float
        Damping ratio beta, 0 or more.

    Notes
    -----
    With "keep", the contact lasts until the bodies part, so the dashpot pulls at the
    end, and beta = -ln e / sqrt(ln^2 e + pi^2) (Tsuji et al. 1992). With "cut", beta is
    the same, but the contact ends before the dashpot pulls, so bodies leave faster.
    With "release", the contact ends when the force vanishes, too, and beta is found by
    bisection from `_compute_log_restitution`, so that the restitution is e.
    """
    log_e = math.log(restitution)
    if tension != "release" or restitution == 1.0:
        return -log_e / math.sqrt(log_e * log_e + math.pi * math.pi)
    # Bisection: ln e decreases when beta increases. The solution is searched between 0
    # and 1 / e.
    low, high = 0.0, 1.0 / restitution
    middle = 0.5 * (low + high)
    # Stop when no floating-point number lies between low and high.
    while low < middle < high:
        if _compute_log_restitution(middle) > log_e:
            low = middle
        else:
            high = middle
        middle = 0.5 * (low + high)
    return low


def _compute_log_restitution(beta: float) -> float:
    """Compute ln e of a contact that ends when its force vanishes.

    In terms of y = delta^(5/4), the damped Hertz contact is a linear oscillator. From
    the time at which its force vanishes, Schwager and Poeschel (2007) derive ln e = -2
    beta arccos(beta) / sqrt(1 - beta^2). For beta above 1, arccosh(beta) and
    sqrt(beta^2 - 1) take the place of arccos(beta) and sqrt(1 - beta^2).

    Parameters
    ----------
    beta : float
        Damping ratio, 0 or more.

    Returns
    -------
    float
        The logarithm of the coefficient of restitution, 0 or less.
    """
    if abs(beta - 1.0) < 1e-6:
        return (
            -2.0 * beta
        )  # the limit of both formulas at beta = 1, where they are 0 / 0
    if beta < 1.0:
        return -2.0 * beta * math.acos(beta) / math.sqrt(1.0 - beta * beta)
    return -2.0 * beta * math.acosh(beta) / math.sqrt(beta * beta - 1.0)


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
    ndarray (5,)
        The values of the first five rows of the law, in SI units.
    """
    young, shear = effective_moduli(a, b)
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio(contact.restitution, tension)
    # The dashpot constants are these values times sqrt(a m), which is the row VISCOUS.
    normal_damping = damping * math.sqrt(2.0 * young)
    tangential_damping = damping * math.sqrt(8.0 * shear)
    return np.array(
        [
            4.0 / 3.0 * young,
            8.0 * shear,
            normal_damping,
            tangential_damping,
            contact.static_friction,
        ]
    )


def contact_time(
    a: Material,
    b: Material,
    _contact: Contact,
    mass: float,
    radius: float,
    speed: float,
) -> float:
    """Compute the duration of an elastic head-on impact.

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
    speed : float
        Relative speed v [m/s].

    Returns
    -------
    float
        The duration [s], 2.868 (m*^2 / (R* E*^2 v))^0.2 (Johnson 1985, Eq. 11.24).
    """
    young, _ = effective_moduli(a, b)
    return 2.868 * (mass**2 / (radius * young**2 * speed)) ** 0.2


def oscillator(
    a: Material,
    b: Material,
    contact: Contact,
    tension: str,
    radius: float,
    overlap: float,
) -> tuple[float, float]:
    """Compute stiffness and damping ratio for small motions about an overlap.

    Parameters
    ----------
    a, b : Material
        Materials of the two bodies.
    contact : Contact
        Their contact.
    tension : {"keep", "release", "cut"}
        How a contact ends, see `Simulation`.
    radius, overlap : float
        R* and delta [m].

    Returns
    -------
    stiffness : float
        S_n = 2 E* sqrt(R* delta) [N/m].
    ratio : float
        sqrt(5/6) beta, which is the damping constant divided by 2 sqrt(S_n m).
    """
    young, _ = effective_moduli(a, b)
    ratio = math.sqrt(5.0 / 6.0) * damping_ratio(contact.restitution, tension)
    return 2.0 * young * math.sqrt(radius * overlap), ratio


@inlined
def compute_contact_circles(scratch: np.ndarray) -> None:
    """Compute the radius a of the contact circle, and sqrt(a m), of each contact.

    m is the effective mass. The results are written to the rows CIRCLE and VISCOUS,
    whose names stand for these two quantities. They are 0 if the bodies do not touch.
    The square roots are slow, so they have a short loop of their own, in which the
    processor handles several lanes at once. Do not merge it with another loop.

    Parameters
    ----------
    scratch : numpy.ndarray
        Scratch tile of 32 contacts, with the rows GAP, RADIUS and INVERSE_MASS.
    """
    for lane in range(LANES):
        gap = scratch[tile.GAP + lane]
        overlap = -gap if gap < 0.0 else 0.0
        # rsqrt(x) is 1 / sqrt(x), so squared_radius * rsqrt(squared_radius) is the
        # radius. It is 0 if the bodies do not touch, since rsqrt(0) is finite.
        squared_radius = scratch[tile.RADIUS + lane] * overlap
        circle = squared_radius * rsqrt(squared_radius)
        scratch[tile.CIRCLE + lane] = circle
        # sqrt(a m) is a / sqrt(a / m).
        scratch[VISCOUS + lane] = circle * rsqrt(
            circle * scratch[tile.INVERSE_MASS + lane]
        )


@inlined
def compute_forces(
    scratch: np.ndarray,
    history: np.ndarray,
    spring: int,
    tension: int,
    friction_limit: int,
) -> None:
    """Compute the forces of each lane from velocities and springs of this step.

    Call `compute_contact_circles` first, which writes the rows CIRCLE (radius a of the
    contact circle) and VISCOUS (sqrt(a m), with the effective mass m), and
    `tangential.update_springs`, which writes the velocities. The rows TO_A (the force
    on body A) and PUSH (the force that limits friction) of `scratch` and the springs in
    `history` are overwritten by `write_forces`.

    Parameters
    ----------
    scratch : numpy.ndarray
        Working memory of this step for 32 contacts, one in each lane.
    history : numpy.ndarray
        Tile of the numbers that the contacts keep from one step to the next, laid out
        like `scratch`.
    spring : int
        Index in `history` at which the three rows of the spring begin.
    tension, friction_limit : int
        The options of the law as integers: a value of `law.TENSIONS` (how a contact
        ends) and of `law.FRICTION_LIMITS` (which force limits friction).
    """
    for lane in range(LANES):
        gap = scratch[tile.GAP + lane]
        overlap = -gap if gap < 0.0 else 0.0
        circle = scratch[tile.CIRCLE + lane]
        viscous = scratch[VISCOUS + lane]
        # The normal force is the sum of Hertz's elastic force and the dashpot's.
        elastic = scratch[NORMAL_STIFFNESS + lane] * circle * overlap
        damped = (
            elastic + scratch[NORMAL_DAMPING + lane] * viscous * scratch[tile.VN + lane]
        )
        normal_force, limit = compute_normal_forces(
            elastic, damped, tension, friction_limit
        )
        # The tangential stiffness and damping depend on the contact circle, too.
        stiffness = scratch[TANGENTIAL_STIFFNESS + lane] * circle
        damping = scratch[TANGENTIAL_DAMPING + lane] * viscous
        write_forces(
            scratch,
            history,
            spring,
            lane,
            normal_force,
            limit,
            scratch[FRICTION + lane],
            stiffness,
            damping,
        )


def kernel(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the forces of LANES contacts, one in each lane, of this time step.

    The work is split into several short loops, because a processor can overlap more
    iterations of a short loop.

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
    compute_contact_circles(scratch)
    update_springs(scratch, history, first + SPRING, dt)
    compute_forces(scratch, history, first + SPRING, law.tension, law.friction_limit)


LAW = Law(
    name="hertz_mindlin",
    options=HertzMindlin,
    constants=constants,
    n_constants=5,
    n_rows=_scratch_rows.count,
    n_state=_history_rows.count,
    kernel=kernel,
    words={
        "normal": "Hertz with viscous damping (Tsuji, Tanaka and Ishida 1992)",
        "tangential": (
            "Mindlin without slip, damped; Coulomb's limit mu_s times {limit}"
        ),
    },
    contact_time=contact_time,
    oscillator=oscillator,
)
