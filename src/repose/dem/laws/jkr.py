"""Cohesion of Johnson, Kendall and Roberts (JKR): bodies attract each other up to a gap, once they have touched.

With the surface energy gamma of each of two equal surfaces, the work of adhesion is w = 2 gamma. The radius a of the
contact circle gives the overlap delta, negative for a gap, and the elastic normal force:

    delta = a^2 / R* - sqrt(2 pi w a / E*)
    F_n   = 4 E* a^3 / (3 R*) - sqrt(8 pi w E* a^3)

With a = A s^2 and A^3 = 2 pi w R*^2 / E* they are

    delta = (A^2 / R*) (s^4 - s),     F_n = pi w R* (8/3 s^6 - 4 s^3),

and s is the largest root of the first. A contact begins where bodies touch, with delta = 0, s = 1 and
F_n = -4/3 pi w R*. It ends at s^3 = 1/4, the gap 0.4725 A^2 / R*, beyond which there is no root. The strongest pull,
the pull-off force, is 3/2 pi w R* = 3 pi gamma R*. Loading and unloading take 7.09 (w^5 R*^4 / E*^2)^(1/3) from the
bodies, so two that meet with less energy stick. At rest without load a^3 = 9 pi w R*^2 / (2 E*) and
delta = a^2 / (3 R*).

Damping and the tangential spring are those of `hertz_mindlin_rescaled` with this a. Friction is limited by
F_c = F_n + 3 pi w R*, the load and twice the pull-off force (Thornton 1991). A contact that releases (`tension`) pulls
with no more than the pull-off force, damping included. The damping constant is that with which the same contact
without cohesion has the restitution set; with cohesion a hit returns less. A pair with gamma = 0 is dry.

EDEM's surface energy is w itself; LAMMPS and Lethe have this gamma.

References
----------
Johnson, Kendall and Roberts, Proc. R. Soc. Lond. A 324 (1971) 301. Thornton, J. Phys. D 24 (1991) 1942: the limit of
friction. Thornton and Ning, Powder Technol. 99 (1998) 154: the work of a cycle.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..constants import SURFACE_ENERGY
from ..kernels import tile as tl
from ..kernels.jit import inlined
from ..kernels.rows import L, Rows
from ..kernels.simd import rsqrt
from ..materials import Contact, Material, effective_moduli
from . import hertz_mindlin
from .hertz_mindlin import contact_time, damping_ratio
from .hertz_mindlin_rescaled import LAW as RESCALED
from .hertz_mindlin_rescaled import keep_force
from .law import Law
from .tangential import add_forces, normal_forces, slip

Jkr = namedtuple("Jkr", "tension friction_limit")

_rows = Rows(tl.LAW)
# Constants of two materials: those of `hertz_mindlin`, sqrt(2 pi w / E*), pi w.
NORMAL_STIFFNESS, TANGENTIAL_STIFFNESS, NORMAL_DAMPING, TANGENTIAL_DAMPING, FRICTION = (
    _rows.take_each(5)
)
BOND, ADHESION = _rows.take_each(2)
VISCOUS = _rows.take()  # as in `hertz_mindlin`
ELASTIC, PULL_OFF = _rows.take_each(2)  # elastic normal force and pull-off force [N]

_state = Rows()
SPRING = _state.take(3)
LAST_CIRCLE = _state.take()
ROOT = _state.take()  # sqrt(A); 0 without cohesion
REACH = _state.take()  # gap at which the contact ends [m]

# Of s^4 - s: the place of its minimum, and its depth.
AT_LEAST = 0.25 ** (1.0 / 3.0)
LEAST = 0.75 * AT_LEAST
START = 1.5 * AT_LEAST * AT_LEAST
NO_ROOT = 1e-14  # keeps the derivative from 0 where the bodies part


def work_of_adhesion(contact: Contact) -> float:
    """Compute the work of adhesion w = 2 gamma [J/m2]."""
    return 2.0 * contact.constants[SURFACE_ENERGY.name]


def pull_off_force(contact: Contact, radius: float) -> float:
    """3/2 pi w R* [N]."""
    return 1.5 * math.pi * work_of_adhesion(contact) * radius


def constants(
    a: Material, b: Material, contact: Contact, tension: str = "keep"
) -> np.ndarray:
    """Those of `hertz_mindlin`, sqrt(2 pi w / E*) and pi w (7,); SI."""
    young, _ = effective_moduli(a, b)
    work = work_of_adhesion(contact)
    bond = math.sqrt(2.0 * math.pi * work / young)
    return np.append(
        hertz_mindlin.constants(a, b, contact, tension), [bond, math.pi * work]
    )


def circle_radius(
    a: Material, b: Material, contact: Contact, radius: float, overlap: float
) -> float:
    """Radius of the contact circle [m] at an overlap, negative for a gap; ValueError beyond the contact's reach."""
    work, (young, _) = work_of_adhesion(contact), effective_moduli(a, b)
    if work == 0.0:
        return math.sqrt(radius * max(overlap, 0.0))
    unit = (2.0 * math.pi * work * radius**2 / young) ** (1.0 / 3.0)
    excess = overlap * radius / unit**2 + LEAST
    if excess < 0.0:
        raise ValueError(
            f"overlap is {overlap!r}; expected at least {-LEAST * unit**2 / radius:.4g}"
        )
    return unit * _root(max(excess, NO_ROOT)) ** 2


def oscillator(
    a: Material,
    b: Material,
    contact: Contact,
    tension: str,
    radius: float,
    overlap: float,
) -> tuple[float, float]:
    """2 E* a, which dF_n / d delta does not exceed, and the damping ratio at it; see `hertz_mindlin.oscillator`."""
    young, _ = effective_moduli(a, b)
    ratio = math.sqrt(5.0 / 6.0) * damping_ratio(contact.restitution, tension)
    return 2.0 * young * circle_radius(a, b, contact, radius, overlap), ratio


@inlined
def _root(excess: float) -> float:
    """Compute the largest s with s^4 - s + LEAST = excess > 0, to 2e-12: three Newton steps on u = s - AT_LEAST."""
    u = math.sqrt(START + math.sqrt(excess)) - math.sqrt(START)
    for _ in range(3):
        rest = u * u * (u * (u + 4.0 * AT_LEAST) + 6.0 * AT_LEAST * AT_LEAST) - excess
        u -= rest / (4.0 * u * (u * (u + 3.0 * AT_LEAST) + 3.0 * AT_LEAST * AT_LEAST))
    return AT_LEAST + u


@inlined
def begin(t: np.ndarray, c: np.ndarray, root: int) -> None:
    """Compute the cube root that a contact needs when it begins; `sizes` updates it when R* changes."""
    for k in range(L):
        if (
            c[root + k] == 0.0
            and t[tl.GAP + k] < 0.0
            and t[BOND + k] * t[tl.RADIUS + k] > 0.0
        ):
            c[root + k] = (t[tl.RADIUS + k] * t[BOND + k]) ** (1.0 / 3.0)


@inlined
def sizes(t: np.ndarray, c: np.ndarray, root: int, reach: int) -> None:
    """Radius of the contact circle, elastic force, pull-off force and reach of each lane."""
    for k in range(L):
        gap, radius, root_a = t[tl.GAP + k], t[tl.RADIUS + k], c[root + k]
        coheres = root_a > 0.0
        square = root_a * root_a if coheres else 1.0
        root_a -= (root_a - radius * t[BOND + k] / square) / 3.0
        square = root_a * root_a
        length = square * square / radius if coheres else 1.0
        end = LEAST * length if coheres else 0.0
        there = 1.0 if gap <= end else 0.0
        excess = LEAST - gap / length
        s = _root(excess if excess > NO_ROOT else NO_ROOT)
        cube = s * s * s
        pull_off = there * t[ADHESION + k] * radius if coheres else 0.0
        overlap = -gap if gap < 0.0 else 0.0
        dry = math.sqrt(radius * overlap)
        circle = there * square * s * s if coheres else dry
        t[tl.CIRCLE + k] = circle
        t[VISCOUS + k] = math.sqrt(circle) * rsqrt(t[tl.INVERSE_MASS + k])
        adhesive = pull_off * cube * (8.0 / 3.0 * cube - 4.0)
        t[ELASTIC + k] = (
            adhesive if coheres else t[NORMAL_STIFFNESS + k] * dry * overlap
        )
        t[PULL_OFF + k] = 1.5 * pull_off
        c[root + k] = root_a if coheres else 0.0
        c[reach + k] = end


@inlined
def push(
    t: np.ndarray, c: np.ndarray, spring: int, tension: int, friction_limit: int
) -> None:
    """`hertz_mindlin.push` with forces that end at the strongest pull instead of at 0."""
    for k in range(L):
        viscous, pull_off = t[VISCOUS + k], t[PULL_OFF + k]
        elastic = t[ELASTIC + k] + pull_off
        damped = elastic + t[NORMAL_DAMPING + k] * viscous * t[tl.VN + k]
        fn, limit = normal_forces(elastic, damped, tension, friction_limit)
        fn -= pull_off
        limit += pull_off
        stiffness = t[TANGENTIAL_STIFFNESS + k] * t[tl.CIRCLE + k]
        damping = t[TANGENTIAL_DAMPING + k] * viscous
        add_forces(t, c, spring, k, fn, limit, t[FRICTION + k], stiffness, damping)


def kernel(law: Any, t: np.ndarray, c: np.ndarray, at: int, dt: float) -> None:
    """Compute the forces of each lane, as `law.contact_forces` asks for them."""
    begin(t, c, at + ROOT)
    sizes(t, c, at + ROOT, at + REACH)
    keep_force(t, c, at + SPRING, at + LAST_CIRCLE)
    slip(t, c, at + SPRING, dt, at + REACH)
    push(t, c, at + SPRING, law.tension, law.friction_limit)


def reach(law: Any, c: np.ndarray, at: int, k: int) -> float:
    """Gap at which the contact of a lane ends, as `law.reach` asks for it."""
    return c[at + REACH + k]


LAW = Law(
    name="jkr",
    options=Jkr,
    constants=constants,
    n_constants=7,
    n_rows=_rows.count,
    n_state=_state.count,
    kernel=kernel,
    words={
        "normal": "Johnson, Kendall and Roberts with w = 2 gamma, pull-off force 3 pi gamma R*, damped as Hertz's "
        "contact (Tsuji, Tanaka and Ishida 1992)",
        "tangential": RESCALED.words["tangential"],
    },
    limits={
        "elastic": "the sum of the elastic normal force and twice the pull-off force",
        "total": "the sum of the damped normal force and twice the pull-off force",
    },
    ends={
        "keep": "the damped force may pull by more than the pull-off force",
        "release": "the force never pulls by more than the pull-off force; without cohesion the damping gives the "
        "restitution set",
    },
    contact_time=contact_time,
    oscillator=oscillator,
    asks=(SURFACE_ENERGY,),
    reach=reach,
)
