"""Hertz-Mindlin contact without slip, with viscous damping and Coulomb's limit.

With overlap delta, effective radius R*, effective moduli E* and G*, mass m, damping ratio beta and relative velocities
v_n, v_t:

    F_n = 4/3 E* sqrt(R*) delta^1.5 + 2 sqrt(5/6) beta sqrt(S_n m) v_n,    S_n = 2 E* sqrt(R* delta)
    F_t = -S_t delta_t - 2 sqrt(5/6) beta sqrt(S_t m) v_t,  |F_t| <= mu_s F_c,    S_t = 8 G* sqrt(R* delta)

delta_t is the tangential spring, F_c the normal force that Coulomb's limit takes (`tangential`). m is the mass that
both bodies have at the contact along the normal n, over the number N of contacts of these two, which share the damping
(of clumps several spheres may touch). With it a hit returns its restitution (`damped_mass`). With r from a body's
centre to the contact and J its inverse inertia:

    1 / m = N (1/m_a + 1/m_b + (r_a x n) . J_a (r_a x n) + (r_b x n) . J_b (r_b x n))

For two spheres that is the usual m* = m_a m_b / (m_a + m_b). A wall has no such terms. No restitution is defined along
the tangent, and the tangential damping takes the same m.

References
----------
Hertz, J. reine angew. Math. 92 (1882) 156. Mindlin, J. Appl. Mech. 16 (1949) 259. Tsuji, Tanaka and Ishida, Powder
Technol. 71 (1992) 239: the damping. Schwager and Poeschel, Granular Matter 9 (2007) 465: a contact that does not pull.
"""

import math
from collections import namedtuple
from typing import Any

import numpy as np

from ..kernels import tile as tl
from ..kernels.jit import inlined
from ..kernels.rows import L, Rows
from ..kernels.simd import rsqrt
from ..materials import Contact, Material, effective_moduli
from .law import Law
from .tangential import add_forces, normal_forces, slip

HertzMindlin = namedtuple("HertzMindlin", "tension friction_limit")

_rows = Rows(tl.LAW)
# Constants of two materials: 4/3 E*, 8 G*, the dampings 2 sqrt(5/6) beta sqrt(2 E*) and 2 sqrt(5/6) beta sqrt(8 G*).
NORMAL_STIFFNESS, TANGENTIAL_STIFFNESS, NORMAL_DAMPING, TANGENTIAL_DAMPING, FRICTION = (
    _rows.take_each(5)
)
VISCOUS = _rows.take()  # sqrt(that radius times m)

_state = Rows()
SPRING = _state.take(3)


def damping_ratio(restitution: float, tension: str = "keep") -> float:
    """Damping ratio with which an impact ends with a coefficient of restitution.

    Parameters
    ----------
    restitution : float
        e, above 0, at most 1.
    tension : {"keep", "release", "cut"}
        How the contact ends, see `Simulation`.

    Returns
    -------
    float
        beta >= 0.

    Notes
    -----
    Where the contact lasts until the bodies part, pulling in the end, beta = -ln e / sqrt(ln^2 e + pi^2) (Tsuji et al.
    1992). "cut" keeps this damping, so its bodies leave faster. For "release" the contact ends when the force vanishes.
    With y = delta^(5/4) the damped Hertz contact is a linear oscillator, whose force vanishes where Schwager and
    Poeschel (2007) find ln e = -2 beta arccos(beta) / sqrt(1 - beta^2), and with arccosh(beta) / sqrt(beta^2 - 1) for
    beta above 1.
    """
    log = math.log(restitution)
    if tension == "release" and restitution < 1.0:
        low, high = 0.0, 1.0 / restitution
        while low < (middle := 0.5 * (low + high)) < high:
            low, high = (middle, high) if _log_released(middle) > log else (low, middle)
        return low
    return -log / math.sqrt(log * log + math.pi * math.pi)


def _log_released(b: float) -> float:
    """Logarithm of e of a contact of damping ratio b that ends when its force vanishes."""
    if abs(b - 1.0) < 1e-6:
        return -2.0 * b
    if b < 1.0:
        return -2.0 * b * math.acos(b) / math.sqrt(1.0 - b * b)
    return -2.0 * b * math.acosh(b) / math.sqrt(b * b - 1.0)


def constants(
    a: Material, b: Material, contact: Contact, tension: str = "keep"
) -> np.ndarray:
    """Constants of the law for two materials as the kernel takes them.

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
        4/3 E*, 8 G*, the dampings 2 sqrt(5/6) beta sqrt(2 E*) and 2 sqrt(5/6) beta sqrt(8 G*), static friction; SI.
    """
    young, shear = effective_moduli(a, b)
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio(contact.restitution, tension)
    normal, tangential = (
        damping * math.sqrt(2.0 * young),
        damping * math.sqrt(8.0 * shear),
    )
    return np.array(
        [4.0 / 3.0 * young, 8.0 * shear, normal, tangential, contact.static_friction]
    )


def contact_time(
    a: Material,
    b: Material,
    _contact: Contact,
    mass: float,
    radius: float,
    speed: float,
) -> float:
    """Duration of an elastic head-on impact.

    Parameters
    ----------
    a, b : Material
        Materials of the two bodies.
    _contact : Contact
        Their contact; a law with constants of its own may need it.
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
    """Stiffness and damping ratio of a contact for small motions about an overlap.

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
        sqrt(5/6) beta: the damping over 2 sqrt(S_n m).
    """
    young, _ = effective_moduli(a, b)
    ratio = math.sqrt(5.0 / 6.0) * damping_ratio(contact.restitution, tension)
    return 2.0 * young * math.sqrt(radius * overlap), ratio


@inlined
def contact_sizes(t: np.ndarray) -> None:
    """Roots that the forces need, in a loop of their own, of which the processor runs several lanes at once.

    Parameters
    ----------
    t : numpy.ndarray
        Tile of 32 contacts; its rows `tl.CIRCLE` and `VISCOUS` are written.
    """
    for k in range(L):
        gap = t[tl.GAP + k]
        overlap = -gap if gap < 0.0 else 0.0
        square = t[tl.RADIUS + k] * overlap
        circle = square * rsqrt(square)
        t[tl.CIRCLE + k] = circle
        t[VISCOUS + k] = circle * rsqrt(circle * t[tl.INVERSE_MASS + k])


@inlined
def push(
    t: np.ndarray, c: np.ndarray, spring: int, tension: int, friction_limit: int
) -> None:
    """Compute normal force, and the tangential force that Coulomb's limit leaves, of each lane.

    Parameters
    ----------
    t : numpy.ndarray
        Tile of 32 contacts; its rows TO_A and PUSH are written.
    c : numpy.ndarray
        Tile of the quantities that the contacts keep from step to step.
    spring : int
        Place of the spring's first row in `c`.
    tension, friction_limit : int
        Numbers of `law.TENSIONS` and `law.FRICTION_LIMITS`.
    """
    for k in range(L):
        gap = t[tl.GAP + k]
        overlap = -gap if gap < 0.0 else 0.0
        circle = t[tl.CIRCLE + k]
        viscous = t[VISCOUS + k]
        elastic = t[NORMAL_STIFFNESS + k] * circle * overlap
        damped = elastic + t[NORMAL_DAMPING + k] * viscous * t[tl.VN + k]
        fn, limit = normal_forces(elastic, damped, tension, friction_limit)
        stiffness = t[TANGENTIAL_STIFFNESS + k] * circle
        damping = t[TANGENTIAL_DAMPING + k] * viscous
        add_forces(t, c, spring, k, fn, limit, t[FRICTION + k], stiffness, damping)


def kernel(law: Any, t: np.ndarray, c: np.ndarray, at: int, dt: float) -> None:
    """Compute the forces of each lane, as `law.contact_forces` asks for them.

    Several short loops, because a processor runs as many lanes at once as its window holds.

    Parameters
    ----------
    law : HertzMindlin
        The options.
    t : numpy.ndarray
        Tile of 32 contacts.
    c : numpy.ndarray
        Tile of the quantities that the contacts keep from step to step.
    at : int
        Place of the law's first row in `c`.
    dt : float
        Time step [s].
    """
    contact_sizes(t)
    slip(t, c, at + SPRING, dt)
    push(t, c, at + SPRING, law.tension, law.friction_limit)


LAW = Law(
    name="hertz_mindlin",
    options=HertzMindlin,
    constants=constants,
    n_constants=5,
    n_rows=_rows.count,
    n_state=_state.count,
    kernel=kernel,
    words={
        "normal": "Hertz with viscous damping (Tsuji, Tanaka and Ishida 1992)",
        "tangential": "Mindlin without slip, damped; Coulomb's limit mu_s times {limit}",
    },
    contact_time=contact_time,
    oscillator=oscillator,
)
