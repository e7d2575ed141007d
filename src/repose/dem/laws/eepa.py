"""Contact law: Edinburgh elasto-plastic adhesion (EEPA).

A contact that has been pressed unloads more stiffly than it was loaded, and then pulls.

One part of the normal force depends on the history of the overlap. With the overlap d,
the plastic overlap d_p, and k1 = 4/3 E* sqrt(R*), it is

    loading     k1 d^1.5,                    d_p^1.5 = L d^1.5
    unloading   k2 (d^1.5 - d_p^1.5),        k2 = k1 / (1 - L)
    adhesion    -k_a d^1.5

A contact that is loaded again follows the unloading branch up to k1 d^1.5. The adhesive
branch begins where unloading reaches the strongest pull.

L = 1 - k1 / k2 is the plasticity ratio. The strongest pull is 3/2 pi w a, where w = 2
gamma is the work of adhesion and a^2 = 2 R* d_p gives the circle in which two spheres
intersect at the plastic overlap. It is limited to k2 d_p^1.5 / 2, which for L = 0.5 is
half of the force with which the contact was pressed. k_a follows from the strongest
pull. If the contact is loaded again from the adhesive branch, its force rises with the
stiffness of unloading, so d_p becomes smaller. The contact ends when the bodies part.
Here both exponents are 1.5, and the pull-off force of a contact that was never pressed
is 0.

The dashpot is that of `hertz_mindlin` at the present overlap. The configured
restitution is that of the dashpot alone, as in LIGGGHTS, so the actual restitution of a
hit is lower. Without dashpot and surface energy it is e_p (`restitution`):

    e_p^2 = (1 - 5/2 L + 3/2 L^(5/3)) / (1 - L)

The tangential force is that of `hertz_mindlin_rescaled`. Coulomb's limit applies to the
sum of the normal force and k_a d^1.5.

Rows of the tile `scratch`, after those of `hertz_mindlin` (NORMAL_STIFFNESS is 4/3
E*, CIRCLE sqrt(R* d)):

    PLASTIC_SHARE    L^(2/3), d_p / d when loading
    STIFFENING       k2 / k1
    ADHESION         3/2 pi w sqrt(2), the strongest pull over sqrt(R* d_p)
    FORCE            normal force without dashpot
    FLOOR            k_a d^1.5

Rows that a contact keeps in `history`, after those of `hertz_mindlin_rescaled`:
PLASTIC, the plastic overlap d_p.

References
----------
Morrissey, PhD thesis, University of Edinburgh (2013). Thakur, Morrissey, Sun, Chen and
Ooi, Granular Matter 16 (2014) 383. LIGGGHTS(R)-PUBLIC, normal model edinburgh: the
strongest pull and its bound.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..constants import PLASTICITY_RATIO, SURFACE_ENERGY
from ..kernels import state, tile
from ..kernels.jit import inlined
from ..kernels.rows import LANES, Rows
from ..materials import Contact, Material
from . import hertz_mindlin
from .hertz_mindlin import (
    FRICTION,
    NORMAL_DAMPING,
    NORMAL_STIFFNESS,
    TANGENTIAL_DAMPING,
    TANGENTIAL_STIFFNESS,
    VISCOUS,
    compute_contact_circles,
)
from .hertz_mindlin_rescaled import LAST_CIRCLE, SPRING, rescale_springs
from .hertz_mindlin_rescaled import LAW as RESCALED
from .law import ELASTIC, KEEP, Law
from .tangential import update_springs, write_forces

TINY = 1e-300  # added to divisors, so that unused lanes do not divide by 0

Eepa = namedtuple("Eepa", "tension friction_limit")

_scratch_rows = Rows(tile.LAW)
_scratch_rows.take(hertz_mindlin.LAW.n_rows)
PLASTIC_SHARE, STIFFENING, ADHESION = _scratch_rows.take_each(3)
FORCE, FLOOR = _scratch_rows.take_each(2)

PLASTIC = RESCALED.n_state * LANES


def constants(
    a: Material, b: Material, contact: Contact, tension: str = "keep"
) -> np.ndarray:
    """Compute the constants of the law for two materials, in SI units.

    L is the plasticity ratio, k1 and k2 are the stiffnesses of loading and unloading,
    and d_p is the plastic overlap. L is below 1.

    Parameters
    ----------
    a, b : Material
        The two materials.
    contact : Contact
        Their contact, with plasticity ratio and surface energy.
    tension : {"keep", "release", "cut"}
        How a contact ends, see `Simulation`.

    Returns
    -------
    ndarray (n,)
        The constants of `hertz_mindlin`, zeros for the other rows of that law, and the
        values of the rows PLASTIC_SHARE, STIFFENING and ADHESION.
    """
    plasticity = contact.constants[PLASTICITY_RATIO.name]
    gamma = contact.constants[SURFACE_ENERGY.name]
    hertz_constants = hertz_mindlin.constants(a, b, contact, tension)
    values = np.zeros(hertz_mindlin.LAW.n_rows + 3)
    values[: hertz_mindlin.LAW.n_constants] = hertz_constants
    # The rows PLASTIC_SHARE, STIFFENING and ADHESION: L^(2/3), which is d_p over the
    # overlap while loading; k2 / k1; and the strongest pull divided by sqrt(R* d_p)
    values[-3] = plasticity ** (2.0 / 3.0)
    values[-2] = 1.0 / (1.0 - plasticity)
    values[-1] = 3.0 * math.pi * gamma * math.sqrt(2.0)
    return values


def restitution(plasticity: float) -> float:
    """Compute e_p, the restitution of a head-on hit without dashpot and surface energy.

    Parameters
    ----------
    plasticity : float
        Plasticity ratio L, 0 or more and below 1.

    Returns
    -------
    float
        The square root of the work of unloading over that of loading.
    """
    released_work = 1.0 - 2.5 * plasticity + 1.5 * plasticity ** (5.0 / 3.0)
    return math.sqrt(max(released_work, 0.0) / (1.0 - plasticity))


def contact_time(
    a: Material, b: Material, contact: Contact, mass: float, radius: float, speed: float
) -> float:
    """Compute the contact time of a head-on impact [s].

    A contact unloads faster than it is loaded. Therefore the contact time is taken as
    that of `hertz_mindlin` times sqrt(1 - L), where L is the plasticity ratio.

    Parameters
    ----------
    a, b : Material
        Materials of the two bodies.
    contact : Contact
        Their contact.
    mass, radius : float
        Effective mass m* [kg] and effective radius R* [m].
    speed : float
        Relative speed [m/s].
    """
    time_ratio = math.sqrt(1.0 - contact.constants[PLASTICITY_RATIO.name])
    return time_ratio * hertz_mindlin.contact_time(a, b, contact, mass, radius, speed)


def oscillator(
    a: Material,
    b: Material,
    contact: Contact,
    tension: str,
    radius: float,
    overlap: float,
) -> tuple[float, float]:
    """Compute the stiffness of unloading at an overlap, and its damping ratio.

    Parameters
    ----------
    a, b : Material
        Materials of the two bodies.
    contact : Contact
        Their contact.
    tension : {"keep", "release", "cut"}
        How a contact ends, see `Simulation`.
    radius, overlap : float
        R* and the overlap [m].

    Returns
    -------
    stiffness, ratio : float
        See `hertz_mindlin.oscillator` [N/m].
    """
    stiffness, ratio = hertz_mindlin.oscillator(a, b, contact, tension, radius, overlap)
    time_ratio = math.sqrt(1.0 - contact.constants[PLASTICITY_RATIO.name])
    return stiffness / time_ratio**2, ratio * time_ratio


@inlined
def compute_branches(
    stiffness: float,
    stiffening: float,
    adhesion: float,
    radius: float,
    plastic_overlap: float,
) -> tuple[float, float, float]:
    """Compute the forces that separate the branches of the law, for a plastic overlap.

    Parameters
    ----------
    stiffness, stiffening, adhesion : float
        4/3 E* [Pa], the ratio k2 / k1 of the stiffnesses of unloading and loading, and
        the strongest pull over sqrt(R* d_p) [N/m].
    radius, plastic_overlap : float
        Effective radius R* and plastic overlap d_p [m].

    Returns
    -------
    pressed : float
        k1 d_p^1.5 [N]. Unloading reaches force 0 where k1 d^1.5 has this value.
    lowest : float
        Value of k1 d^1.5 at which unloading meets adhesion [N].
    adhesive_share : float
        k_a / k1.
    """
    circle = math.sqrt(radius * plastic_overlap)
    pressed = stiffness * circle * plastic_overlap
    strongest_pull = min(adhesion * circle, 0.5 * stiffening * pressed)
    lowest = pressed - strongest_pull / stiffening
    return pressed, lowest, strongest_pull / max(lowest, TINY)


@inlined
def compute_plastic_forces(
    scratch: np.ndarray, history: np.ndarray, last_circle: int, plastic: int
) -> None:
    """Compute the normal force without dashpot from the history of the overlap.

    With the overlap d and the plastic overlap d_p, a contact that is pressed follows
    the loading branch. When it is released, it follows the unloading branch, which is
    steeper by the factor `stiffening` and zero at d = d_p. This branch ends at the
    adhesive branch, on which the bodies attract each other. The row FORCE of `scratch`
    is overwritten with the force, FLOOR with the magnitude of the adhesive branch at
    this overlap, and the row `plastic` of `history` with the plastic overlap. The order
    of the two updates of the plastic overlap matters.

    Parameters
    ----------
    scratch, history : numpy.ndarray
        Tiles of 32 contacts: the working memory of this step, and what the contacts
        keep from one step to the next. A row holds one quantity of all contacts, and a
        lane is one contact: `scratch[row + lane]`. See `law.contact_forces`.
    last_circle, plastic : int
        Indices at which two rows of `history` begin: the radius of the contact circle
        in the previous step [m], and the plastic overlap [m].
    """
    for lane in range(LANES):
        gap = scratch[tile.GAP + lane]
        overlap = -gap if gap < 0.0 else 0.0
        radius, circle = scratch[tile.RADIUS + lane], scratch[tile.CIRCLE + lane]
        stiffness = scratch[NORMAL_STIFFNESS + lane]
        stiffening, adhesion = scratch[STIFFENING + lane], scratch[ADHESION + lane]

        # A contact on the adhesive branch may be loaded again. Then it follows a new
        # unloading branch through its last point. Its plastic overlap is where this
        # branch is zero, and is smaller than before.
        plastic_overlap = history[plastic + lane]
        _, lowest, adhesive_share = compute_branches(
            stiffness, stiffening, adhesion, radius, plastic_overlap
        )
        old_circle = history[last_circle + lane]
        # The overlap of the last step, from the radius of its contact circle, sqrt(R*
        # d)
        old_overlap = old_circle * old_circle / max(radius, TINY)
        if circle > old_circle and stiffness * old_circle * old_overlap < lowest:
            load_ratio = 1.0 + adhesive_share / stiffening
            plastic_overlap = old_overlap * load_ratio ** (2.0 / 3.0)
        # If a contact is pressed deeper than before, its plastic overlap becomes
        # larger.
        plastic_overlap = max(plastic_overlap, scratch[PLASTIC_SHARE + lane] * overlap)

        # The force follows the unloading branch, but not below the adhesive branch.
        pressed, _, adhesive_share = compute_branches(
            stiffness, stiffening, adhesion, radius, plastic_overlap
        )
        loading = stiffness * circle * overlap
        unloading = stiffening * (loading - pressed)
        scratch[FLOOR + lane] = adhesive_share * loading
        scratch[FORCE + lane] = max(unloading, -adhesive_share * loading)
        # A contact that has parted has no plastic overlap.
        history[plastic + lane] = (
            state.flush_tiny(plastic_overlap) if overlap > 0.0 else 0.0
        )


@inlined
def compute_forces(
    scratch: np.ndarray,
    history: np.ndarray,
    spring: int,
    tension: int,
    friction_limit: int,
) -> None:
    """Compute the forces of each lane from velocities, springs and the plastic force.

    Call `compute_contact_circles`, `update_springs` and `compute_plastic_forces` first.
    They write the rows that are read here: CIRCLE (radius of the contact circle),
    VISCOUS (sqrt(a m), with this radius a and the effective mass m), VN (normal
    velocity), FORCE (the force without dashpot) and FLOOR (magnitude of the adhesive
    branch at this overlap). The rows TO_A (the force on body A) and PUSH of `scratch`
    and the springs in `history` are overwritten.

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
        circle = scratch[tile.CIRCLE + lane]
        viscous = scratch[VISCOUS + lane]
        force = scratch[FORCE + lane]
        damped = (
            force + scratch[NORMAL_DAMPING + lane] * viscous * scratch[tile.VN + lane]
        )
        # With the tensions RELEASE and CUT, the dashpot must not increase the pull.
        smallest = -math.inf if tension == KEEP else min(force, 0.0)
        normal_force = max(damped, smallest)
        # Friction is limited by the sum of the normal force and the adhesion at this
        # overlap.
        chosen_force = force if friction_limit == ELASTIC else normal_force
        limit = abs(chosen_force + scratch[FLOOR + lane])
        # Stiffness and damping of the tangential spring depend on the radius of the
        # contact circle.
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
    compute_plastic_forces(scratch, history, first + LAST_CIRCLE, first + PLASTIC)
    rescale_springs(scratch, history, first + SPRING, first + LAST_CIRCLE)
    update_springs(scratch, history, first + SPRING, dt)
    compute_forces(scratch, history, first + SPRING, law.tension, law.friction_limit)


LAW = Law(
    name="eepa",
    options=Eepa,
    constants=constants,
    n_constants=hertz_mindlin.LAW.n_rows + 3,
    n_rows=_scratch_rows.count,
    n_state=RESCALED.n_state + 1,
    kernel=kernel,
    words={
        "normal": (
            "Edinburgh elasto-plastic adhesion, exponents 1.5: plasticity ratio 1 - k1 "
            "/ k2, strongest pull 3/2 pi w a of the plastic overlap, w = 2 gamma; the "
            "restitution is that of the dashpot alone"
        ),
        "tangential": RESCALED.words["tangential"],
    },
    limits={
        "elastic": (
            "the sum of the normal force without dashpot and the adhesion at its "
            "overlap"
        ),
        "total": "the sum of the damped normal force and the adhesion at its overlap",
    },
    ends={
        "keep": "the damped force may pull at the end of an impact",
        "release": "the dashpot never makes the contact pull more than its adhesion",
    },
    contact_time=contact_time,
    oscillator=oscillator,
    asks=(PLASTICITY_RATIO, SURFACE_ENERGY),
)
