"""Contact law with the cohesion of Johnson, Kendall and Roberts (JKR).

Once two bodies have touched, they attract each other up to a certain gap.

If each of two equal surfaces has the surface energy gamma, the work of adhesion is w =
2 gamma. The overlap delta, which is negative for a gap, and the elastic normal force
are functions of the radius a of the contact circle:

    delta = a^2 / R* - sqrt(2 pi w a / E*)
    F_n   = 4 E* a^3 / (3 R*) - sqrt(8 pi w E* a^3)

With A^3 = 2 pi w R*^2 / E* and the dimensionless s in a = A s^2, they become

    delta = (A^2 / R*) (s^4 - s),     F_n = pi w R* (8/3 s^6 - 4 s^3),

where s is the largest root of the first equation. A contact begins when the bodies
touch, with delta = 0, s = 1 and F_n = -4/3 pi w R*. It ends at s^3 = 1/4, at the gap
0.4725 A^2 / R*, beyond which there is no root. The strongest pull, called the pull-off
force, is 3/2 pi w R* = 3 pi gamma R*. A cycle of loading and unloading dissipates 7.09
(w^5 R*^4 / E*^2)^(1/3), so two bodies that meet with less energy stick together. At
rest without load, a^3 = 9 pi w R*^2 / (2 E*) and delta = a^2 / (3 R*).

Damping and the tangential spring are those of `hertz_mindlin_rescaled` with this a.
Friction is limited by F_c = F_n + 3 pi w R*, the load plus twice the pull-off force
(Thornton 1991). With the tension "release" or "cut", a contact pulls with at most the
pull-off force, including damping. The damping constant is that with which the same
contact without cohesion has the configured restitution. With cohesion, the restitution
of a hit is lower. A pair with gamma = 0 is dry.

In EDEM, the surface energy is w itself. LAMMPS and Lethe use the same gamma as here.

Rows of the tile `scratch`, by their symbols, in addition to those of the same names in
`hertz_mindlin`:

    BOND       sqrt(2 pi w / E*)      ELASTIC     F_n without dashpot
    ADHESION   pi w                   PULL_OFF    3/2 pi w R*

Rows that a contact keeps in `history`: SPRING and LAST_CIRCLE as in
`hertz_mindlin_rescaled`; ROOT, the square root of A, or 0 without cohesion; and REACH,
the gap at which the contact ends [m].

References
----------
Johnson, Kendall and Roberts, Proc. R. Soc. Lond. A 324 (1971) 301. Thornton, J. Phys. D
24 (1991) 1942: the limit of friction. Thornton and Ning, Powder Technol. 99 (1998) 154:
the work of a cycle.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..constants import SURFACE_ENERGY
from ..kernels import tile
from ..kernels.jit import inlined
from ..kernels.rows import LANES, Rows
from ..kernels.simd import rsqrt
from ..materials import Contact, Material, effective_moduli
from . import hertz_mindlin
from .hertz_mindlin import contact_time, damping_ratio
from .hertz_mindlin_rescaled import LAW as RESCALED
from .hertz_mindlin_rescaled import rescale_springs
from .law import Law
from .tangential import compute_normal_forces, update_springs, write_forces

Jkr = namedtuple("Jkr", "tension friction_limit")

_scratch_rows = Rows(tile.LAW)
NORMAL_STIFFNESS, TANGENTIAL_STIFFNESS = _scratch_rows.take_each(2)
NORMAL_DAMPING, TANGENTIAL_DAMPING = _scratch_rows.take_each(2)
FRICTION = _scratch_rows.take()
BOND, ADHESION = _scratch_rows.take_each(2)
VISCOUS = _scratch_rows.take()
ELASTIC, PULL_OFF = _scratch_rows.take_each(2)

_history_rows = Rows()
SPRING = _history_rows.take(3)
LAST_CIRCLE = _history_rows.take()
ROOT = _history_rows.take()
REACH = _history_rows.take()

# s^4 - s has its minimum -DEPTH at s = S_END, where the contact ends.
S_END = 0.25 ** (1.0 / 3.0)
DEPTH = 0.75 * S_END
START = 1.5 * S_END * S_END  # q of `_solve_root`, for the first approximation
SMALLEST_EXCESS = 1e-14  # keeps the derivative of s^4 - s from 0


def work_of_adhesion(contact: Contact) -> float:
    """Compute the work of adhesion w = 2 gamma [J/m2]."""
    return 2.0 * contact.constants[SURFACE_ENERGY.name]


def pull_off_force(contact: Contact, radius: float) -> float:
    """Compute the pull-off force 3/2 pi w R* [N]."""
    return 1.5 * math.pi * work_of_adhesion(contact) * radius


def constants(
    a: Material, b: Material, contact: Contact, tension: str = "keep"
) -> np.ndarray:
    """Compute the constants of the law for two materials, in SI units.

    Parameters
    ----------
    a, b : Material
        The two materials.
    contact : Contact
        Their contact, with its surface energy.
    tension : {"keep", "release", "cut"}
        How a contact ends, see `Simulation`.

    Returns
    -------
    ndarray (7,)
        The constants of `hertz_mindlin`, then BOND and ADHESION.
    """
    young, _ = effective_moduli(a, b)
    work = work_of_adhesion(contact)
    bond = math.sqrt(2.0 * math.pi * work / young)
    hertz_constants = hertz_mindlin.constants(a, b, contact, tension)
    return np.append(hertz_constants, [bond, math.pi * work])


def circle_radius(
    a: Material, b: Material, contact: Contact, radius: float, overlap: float
) -> float:
    """Compute the radius a of the contact circle at an overlap.

    The radius is a = A s^2, where A is a length, and s the largest root of s^4 - s =
    overlap R* / A^2. The left side is at least -DEPTH, so a contact ends at a gap of
    DEPTH A^2 / R*.

    Parameters
    ----------
    a, b : Material
        Materials of the two bodies.
    contact : Contact
        Their contact.
    radius : float
        Effective radius R* [m].
    overlap : float
        Overlap, negative for a gap [m].

    Returns
    -------
    float
        The radius a of the contact circle [m].

    Raises
    ------
    ValueError
        If the gap is larger than that at which a contact ends.
    """
    work = work_of_adhesion(contact)
    young, _ = effective_moduli(a, b)
    # Without cohesion, it is Hertz's radius.
    if work == 0.0:
        return math.sqrt(radius * max(overlap, 0.0))
    # `unit` is the length A. `excess` is s^4 - s + DEPTH, which is negative beyond the
    # gap at which the contact ends.
    unit = (2.0 * math.pi * work * radius**2 / young) ** (1.0 / 3.0)  # A
    excess = overlap * radius / unit**2 + DEPTH
    if excess < 0.0:
        smallest = -DEPTH * unit**2 / radius
        raise ValueError(f"overlap is {overlap!r}; expected at least {smallest:.4g}")
    return unit * _solve_root(max(excess, SMALLEST_EXCESS)) ** 2


def oscillator(
    a: Material,
    b: Material,
    contact: Contact,
    tension: str,
    radius: float,
    overlap: float,
) -> tuple[float, float]:
    """Compute stiffness and damping ratio for small motions about an overlap.

    The stiffness is 2 E* a, an upper bound of the slope of the force over the overlap.

    Parameters
    ----------
    a, b : Material
        Materials of the two bodies.
    contact : Contact
        Their contact.
    tension : {"keep", "release", "cut"}
        How a contact ends, see `Simulation`.
    radius, overlap : float
        R*, and the overlap, negative for a gap [m].

    Returns
    -------
    stiffness, ratio : float
        See `hertz_mindlin.oscillator` [N/m].
    """
    young, _ = effective_moduli(a, b)
    ratio = math.sqrt(5.0 / 6.0) * damping_ratio(contact.restitution, tension)
    return 2.0 * young * circle_radius(a, b, contact, radius, overlap), ratio


@inlined
def _solve_root(excess: float) -> float:
    """Find the largest root s of s^4 - s + DEPTH = excess, with an error below 2e-12.

    With u = s - S_END, the equation becomes u^4 + 4 S_END u^3 + 6 S_END^2 u^2 = excess.
    The root of (u^2 + 2 sqrt(q) u)^2 = excess with q = 3/2 S_END^2 is a first
    approximation, which three steps of Newton's method refine.

    Parameters
    ----------
    excess : float
        The right side, above 0.

    Returns
    -------
    float
        The root s of the dimensionless radius of the contact circle.
    """
    u = math.sqrt(START + math.sqrt(excess)) - math.sqrt(START)
    for _ in range(3):
        residual = u * u * (u * (u + 4.0 * S_END) + 6.0 * S_END * S_END) - excess
        u -= residual / (4.0 * u * (u * (u + 3.0 * S_END) + 3.0 * S_END * S_END))
    return S_END + u


@inlined
def begin_cohesion(scratch: np.ndarray, history: np.ndarray, root: int) -> None:
    """Compute the row ROOT of contacts that begin: (R* sqrt(2 pi w / E*))^(1/3).

    A contact begins if its entry in this row is still 0 and the bodies overlap. From
    then on, `compute_cohesive_contacts` updates the entry when R* changes.

    Parameters
    ----------
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.contact_forces`.
    root : int
        Index in `history` at which the row ROOT begins.
    """
    for lane in range(LANES):
        if (
            history[root + lane] == 0.0
            and scratch[tile.GAP + lane] < 0.0
            and scratch[BOND + lane] * scratch[tile.RADIUS + lane] > 0.0
        ):
            history[root + lane] = (
                scratch[tile.RADIUS + lane] * scratch[BOND + lane]
            ) ** (1.0 / 3.0)


@inlined
def compute_cohesive_contacts(
    scratch: np.ndarray, history: np.ndarray, root: int, reach: int
) -> None:
    """Compute the contact circle, elastic force, pull-off force and reach of each lane.

    The radius of the contact circle is a = A s^2. The length A = (R*^2 BOND^2)^(1/3) is
    the unit of radii, and s is the largest root of s^4 - s = overlap R* / A^2. The
    reach is the gap up to which the bodies attract each other. The rows CIRCLE,
    VISCOUS, ELASTIC and PULL_OFF of `scratch` and the rows ROOT (the square root of A,
    or 0 without cohesion) and REACH of `history` are overwritten.

    The loop has no branches, so that it becomes vector code: it computes each lane with
    and without cohesion, and selects one. `touching` is 1.0 or 0.0.

    Parameters
    ----------
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.contact_forces`.
    root, reach : int
        Indices at which the rows ROOT and REACH of `history` begin: the square root of
        the unit A, 0 without cohesion, and the gap at which the contact ends [m].
    """
    for lane in range(LANES):
        gap, radius, root_a = (
            scratch[tile.GAP + lane],
            scratch[tile.RADIUS + lane],
            history[root + lane],
        )
        is_cohesive = root_a > 0.0

        # The square root of A is the cube root of R* BOND. One step of Newton's method,
        # from the value of the last time step in `history`, suffices, because R*
        # changes little in a step.
        circle_unit = root_a * root_a if is_cohesive else 1.0
        root_a -= (root_a - radius * scratch[BOND + lane] / circle_unit) / 3.0
        # The units A of the circle and A^2 / R* of the overlap, and the gap at which
        # the contact ends
        circle_unit = root_a * root_a
        overlap_unit = circle_unit * circle_unit / radius if is_cohesive else 1.0
        end_gap = DEPTH * overlap_unit if is_cohesive else 0.0
        touching = 1.0 if gap <= end_gap else 0.0

        # The force with cohesion, pi w R* (8/3 s^6 - 4 s^3). The lower bound of
        # `excess` keeps the solver away from the end of the contact, where its
        # derivative is 0.
        excess = DEPTH - gap / overlap_unit
        s = _solve_root(excess if excess > SMALLEST_EXCESS else SMALLEST_EXCESS)
        s_cubed = s * s * s
        work_radius = (
            touching * scratch[ADHESION + lane] * radius if is_cohesive else 0.0
        )
        cohesive_force = work_radius * s_cubed * (8.0 / 3.0 * s_cubed - 4.0)

        # Hertz's force, without cohesion
        overlap = -gap if gap < 0.0 else 0.0
        dry_circle = math.sqrt(radius * overlap)
        dry_force = scratch[NORMAL_STIFFNESS + lane] * dry_circle * overlap

        circle = touching * circle_unit * s * s if is_cohesive else dry_circle
        scratch[tile.CIRCLE + lane] = circle
        # VISCOUS is sqrt(a m), and rsqrt(x) is 1 / sqrt(x).
        scratch[VISCOUS + lane] = math.sqrt(circle) * rsqrt(
            scratch[tile.INVERSE_MASS + lane]
        )
        scratch[ELASTIC + lane] = cohesive_force if is_cohesive else dry_force
        # The pull-off force, the strongest attraction, is 3/2 pi w R*.
        scratch[PULL_OFF + lane] = 1.5 * work_radius
        history[root + lane] = root_a if is_cohesive else 0.0
        history[reach + lane] = end_gap


@inlined
def compute_forces(
    scratch: np.ndarray,
    history: np.ndarray,
    spring: int,
    tension: int,
    friction_limit: int,
) -> None:
    """Compute the forces of each lane from velocities, springs and the elastic force.

    Call `compute_cohesive_contacts` and `tangential.update_springs` first. The rows
    TO_A (the force on body A) and PUSH of `scratch` and the springs in `history` are
    overwritten.

    The pull-off force is the strongest attraction of a contact. It is added before
    `tangential.compute_normal_forces` is called, and subtracted from its result.
    Therefore a contact with the tension "release" ends when its pull reaches the
    pull-off force, instead of when the force vanishes.

    Parameters
    ----------
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.contact_forces`.
    spring : int
        Index in `history` at which the three rows of the tangential spring begin.
    tension, friction_limit : int
        The options of the law as integers: a value of `law.TENSIONS` (how a contact
        ends) and of `law.FRICTION_LIMITS` (which force limits friction).
    """
    for lane in range(LANES):
        viscous, pull_off = scratch[VISCOUS + lane], scratch[PULL_OFF + lane]
        elastic = scratch[ELASTIC + lane] + pull_off
        damped = (
            elastic + scratch[NORMAL_DAMPING + lane] * viscous * scratch[tile.VN + lane]
        )
        normal_force, limit = compute_normal_forces(
            elastic, damped, tension, friction_limit
        )
        # The limit of friction is the normal force plus twice the pull-off force. It
        # contains this force once already, from the addition above.
        normal_force -= pull_off
        limit += pull_off
        # Stiffness and damping of the tangential spring depend on the radius of the
        # contact circle.
        stiffness = scratch[TANGENTIAL_STIFFNESS + lane] * scratch[tile.CIRCLE + lane]
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
    begin_cohesion(scratch, history, first + ROOT)
    compute_cohesive_contacts(scratch, history, first + ROOT, first + REACH)
    rescale_springs(scratch, history, first + SPRING, first + LAST_CIRCLE)
    update_springs(scratch, history, first + SPRING, dt, first + REACH)
    compute_forces(scratch, history, first + SPRING, law.tension, law.friction_limit)


def reach(law: Any, history: np.ndarray, first: int, lane: int) -> float:
    """Return the gap at which the contact of a lane ends [m].

    Parameters
    ----------
    law : namedtuple
        Options of the law. This law does not use them.
    history : numpy.ndarray
        Tile of the numbers that the contacts keep from one step to the next, laid out
        like `scratch`.
    first : int
        Index in `history` at which the rows of the law begin.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    """
    return history[first + REACH + lane]


LAW = Law(
    name="jkr",
    options=Jkr,
    constants=constants,
    n_constants=7,
    n_rows=_scratch_rows.count,
    n_state=_history_rows.count,
    kernel=kernel,
    words={
        "normal": (
            "Johnson, Kendall and Roberts with w = 2 gamma, pull-off force 3 pi gamma "
            "R*, damped as Hertz's contact (Tsuji, Tanaka and Ishida 1992)"
        ),
        "tangential": RESCALED.words["tangential"],
    },
    limits={
        "elastic": "the sum of the elastic normal force and twice the pull-off force",
        "total": "the sum of the damped normal force and twice the pull-off force",
    },
    ends={
        "keep": "the damped force may pull by more than the pull-off force",
        "release": (
            "the force never pulls by more than the pull-off force; without cohesion "
            "the damping gives the restitution set"
        ),
    },
    contact_time=contact_time,
    oscillator=oscillator,
    asks=(SURFACE_ENERGY,),
    reach=reach,
)
