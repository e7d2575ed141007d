"""Edinburgh elasto-plastic adhesion (EEPA): a contact that was pressed unloads more stiffly, and then pulls.

Of the normal force one part depends on the way. With the overlap d, the plastic overlap d_p, and k1 = 4/3 E* sqrt(R*):

    loading     k1 d^1.5                                  d_p^1.5 = L d^1.5
    unloading   k2 (d^1.5 - d_p^1.5),                     k2 = k1 / (1 - L), and loading again as far as k1 d^1.5
    adhesion    -k_a d^1.5,                               below the point where unloading reaches the strongest pull

L = 1 - k1 / k2 is the plasticity ratio. The strongest pull is 3/2 pi w a with a^2 = 2 R* d_p, the circle in which two
spheres cut each other at the plastic overlap, and the work of adhesion w = 2 gamma; at most k2 d_p^1.5 / 2, half of
what the contact was pressed with for L = 0.5. k_a follows. A contact that is loaded again from this branch goes up as
it unloads, so its d_p is smaller. It ends where the bodies part. Here both exponents are 1.5, and the pull-off force of
a contact that was never pressed is 0.

The dashpot is that of `hertz_mindlin` at the present overlap. The restitution set is that of the dashpot alone, as in
LIGGGHTS; a hit returns less. Without dashpot and surface energy it returns e_p (`restitution`):

    e_p^2 = (1 - 5/2 L + 3/2 L^(5/3)) / (1 - L)

The tangential force is that of `hertz_mindlin_rescaled`; Coulomb's limit takes the normal force and k_a d^1.5.

References
----------
Morrissey, PhD thesis, University of Edinburgh (2013). Thakur, Morrissey, Sun, Chen and Ooi, Granular Matter 16 (2014)
383. LIGGGHTS(R)-PUBLIC, normal model edinburgh: the strongest pull and its bound.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..constants import PLASTICITY_RATIO, SURFACE_ENERGY
from ..kernels import state as st
from ..kernels import tile as tl
from ..kernels.jit import inlined
from ..kernels.rows import L, Rows
from ..materials import Contact, Material
from . import hertz_mindlin
from .hertz_mindlin import (
    FRICTION,
    NORMAL_DAMPING,
    NORMAL_STIFFNESS,
    TANGENTIAL_DAMPING,
    TANGENTIAL_STIFFNESS,
    VISCOUS,
    contact_sizes,
)
from .hertz_mindlin_rescaled import LAST_CIRCLE, SPRING, keep_force
from .hertz_mindlin_rescaled import LAW as RESCALED
from .law import ELASTIC, KEEP, Law
from .tangential import add_forces, slip

TINY = 1e-300  # keeps unused lanes finite

Eepa = namedtuple("Eepa", "tension friction_limit")

_rows = Rows(tl.LAW)
_rows.take(hertz_mindlin.LAW.n_rows)
# L^(2/3), k2 / k1, and the strongest pull over the square root of R* d_p.
SHARE, STIFFER, ADHESION = _rows.take_each(3)
FORCE, FLOOR = _rows.take_each(2)  # the normal force without dashpot, and k_a d^1.5

PLASTIC = RESCALED.n_state * L  # d_p, after the spring and the radius of the circle


def constants(
    a: Material, b: Material, contact: Contact, tension: str = "keep"
) -> np.ndarray:
    """Constants of `hertz_mindlin`, its other rows, and the three of this law (n,); SI."""
    plasticity, gamma = (
        contact.constants[of.name] for of in (PLASTICITY_RATIO, SURFACE_ENERGY)
    )
    values = np.zeros(hertz_mindlin.LAW.n_rows + 3)
    values[: hertz_mindlin.LAW.n_constants] = hertz_mindlin.constants(
        a, b, contact, tension
    )
    values[-3:] = (
        plasticity ** (2.0 / 3.0),
        1.0 / (1.0 - plasticity),
        3.0 * math.pi * gamma * math.sqrt(2.0),
    )
    return values


def restitution(plasticity: float) -> float:
    """e_p: restitution of a head-on hit without dashpot and surface energy.

    Parameters
    ----------
    plasticity : float
        L, from 0, below 1.

    Returns
    -------
    float
        The root of the work of unloading over that of loading.
    """
    released = 1.0 - 2.5 * plasticity + 1.5 * plasticity ** (5.0 / 3.0)
    return math.sqrt(max(released, 0.0) / (1.0 - plasticity))


def contact_time(
    a: Material, b: Material, contact: Contact, mass: float, radius: float, speed: float
) -> float:
    """Return the time of `hertz_mindlin` times sqrt(1 - L), for unloading is faster; arguments as there."""
    faster = math.sqrt(1.0 - contact.constants[PLASTICITY_RATIO.name])
    return faster * hertz_mindlin.contact_time(a, b, contact, mass, radius, speed)


def oscillator(
    a: Material,
    b: Material,
    contact: Contact,
    tension: str,
    radius: float,
    overlap: float,
) -> tuple[float, float]:
    """Stiffness of unloading and its damping ratio; arguments as of `hertz_mindlin.oscillator`."""
    stiffness, ratio = hertz_mindlin.oscillator(a, b, contact, tension, radius, overlap)
    faster = math.sqrt(1.0 - contact.constants[PLASTICITY_RATIO.name])
    return stiffness / faster**2, ratio * faster


@inlined
def branches(
    stiffness: float, stiffer: float, adhesion: float, radius: float, plastic: float
) -> tuple[float, float, float]:
    """k1 d_p^1.5, k1 d^1.5 where unloading meets adhesion, and k_a / k1."""
    circle = math.sqrt(radius * plastic)
    pressed = stiffness * circle * plastic
    pull = min(adhesion * circle, 0.5 * stiffer * pressed)
    lowest = pressed - pull / stiffer
    return pressed, lowest, pull / max(lowest, TINY)


@inlined
def hysteresis(t: np.ndarray, c: np.ndarray, last: int, plastic: int) -> None:
    """Rows `FORCE` and `FLOOR` of each lane, and the plastic overlap; row `last` is still that of the step before."""
    for k in range(L):
        gap = t[tl.GAP + k]
        overlap = -gap if gap < 0.0 else 0.0
        radius, circle, before = t[tl.RADIUS + k], t[tl.CIRCLE + k], c[last + k]
        stiffness, stiffer, adhesion = (
            t[NORMAL_STIFFNESS + k],
            t[STIFFER + k],
            t[ADHESION + k],
        )
        kept = c[plastic + k]
        pressed, lowest, share = branches(stiffness, stiffer, adhesion, radius, kept)
        shallow = before * before / max(radius, TINY)  # the overlap of the step before
        if circle > before and stiffness * before * shallow < lowest:
            kept = shallow * (1.0 + share / stiffer) ** (2.0 / 3.0)
        kept = max(kept, t[SHARE + k] * overlap)
        pressed, lowest, share = branches(stiffness, stiffer, adhesion, radius, kept)
        loading = stiffness * circle * overlap
        t[FLOOR + k] = share * loading
        t[FORCE + k] = max(stiffer * (loading - pressed), -share * loading)
        c[plastic + k] = st.alive(kept) if overlap > 0.0 else 0.0


@inlined
def push(
    t: np.ndarray, c: np.ndarray, spring: int, tension: int, friction_limit: int
) -> None:
    """Compute normal force, and the tangential force that Coulomb's limit leaves, of each lane."""
    for k in range(L):
        circle, viscous, force, floor = (
            t[tl.CIRCLE + k],
            t[VISCOUS + k],
            t[FORCE + k],
            t[FLOOR + k],
        )
        damped = force + t[NORMAL_DAMPING + k] * viscous * t[tl.VN + k]
        least = -math.inf if tension == KEEP else min(force, 0.0)
        fn = max(damped, least)
        limit = abs((force if friction_limit == ELASTIC else fn) + floor)
        stiffness = t[TANGENTIAL_STIFFNESS + k] * circle
        damping = t[TANGENTIAL_DAMPING + k] * viscous
        add_forces(t, c, spring, k, fn, limit, t[FRICTION + k], stiffness, damping)


def kernel(law: Any, t: np.ndarray, c: np.ndarray, at: int, dt: float) -> None:
    """Compute the forces of each lane, as `law.contact_forces` asks for them."""
    contact_sizes(t)
    hysteresis(t, c, at + LAST_CIRCLE, at + PLASTIC)
    keep_force(t, c, at + SPRING, at + LAST_CIRCLE)
    slip(t, c, at + SPRING, dt)
    push(t, c, at + SPRING, law.tension, law.friction_limit)


LAW = Law(
    name="eepa",
    options=Eepa,
    constants=constants,
    n_constants=hertz_mindlin.LAW.n_rows + 3,
    n_rows=_rows.count,
    n_state=RESCALED.n_state + 1,
    kernel=kernel,
    words={
        "normal": "Edinburgh elasto-plastic adhesion, exponents 1.5: plasticity ratio 1 - k1 / k2, strongest pull "
        "3/2 pi w a of the plastic overlap, w = 2 gamma; the restitution is that of the dashpot alone",
        "tangential": RESCALED.words["tangential"],
    },
    limits={
        "elastic": "the sum of the normal force without dashpot and the adhesion at its overlap",
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
