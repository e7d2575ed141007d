"""Elastic constants and the parameters of a contact between two materials."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from .checks import not_negative, number, positive


@dataclass(frozen=True)
class Material:
    """An isotropic elastic material.

    shear_modulus_pa: G > 0 [Pa]; poisson_ratio: -1 < nu <= 0.5.
    Raises ValueError naming the value that is out of range.
    """

    shear_modulus_pa: float
    poisson_ratio: float

    def __post_init__(self):
        positive("shear_modulus_pa", self.shear_modulus_pa)
        number("poisson_ratio", self.poisson_ratio, "above -1, at most 0.5", lambda nu: -1.0 < nu <= 0.5)

    @property
    def elastic_modulus_pa(self):
        """E = 2 G (1 + nu) [Pa], the paper's Eq. 4."""
        return 2.0 * self.shear_modulus_pa * (1.0 + self.poisson_ratio)


@dataclass(frozen=True)
class Contact:
    """What the contact law needs to know of a pair of surfaces.

    restitution: 0 < e <= 1; static_friction, rolling_friction: >= 0 (dimensionless).
    Raises ValueError naming the value that is out of range.
    """

    restitution: float
    static_friction: float
    rolling_friction: float

    def __post_init__(self):
        number("restitution", self.restitution, "above 0, at most 1", lambda e: 0.0 < e <= 1.0)
        not_negative("static_friction", self.static_friction)
        not_negative("rolling_friction", self.rolling_friction)


def effective_moduli(a, b):
    """E* and G* of two materials: 1/E* = sum (1 - nu^2)/E, 1/G* = sum (2 - nu)/G [Pa]."""
    young = 1.0 / sum((1.0 - m.poisson_ratio**2) / m.elastic_modulus_pa for m in (a, b))
    shear = 1.0 / sum((2.0 - m.poisson_ratio) / m.shear_modulus_pa for m in (a, b))
    return young, shear


def damping_ratio(restitution, tension="keep"):
    """Damping ratio b >= 0 with which an impact ends with a restitution e.

    Where the contact lasts until the bodies part, pulling in the end, b = -ln e / sqrt(ln^2 e + pi^2) (Tsuji et al.
    1992); so too for "cut", whose bodies leave faster. For "release" the contact ends when the force vanishes: with y =
    delta^(5/4) the damped Hertz contact is a linear oscillator, whose force vanishes where Schwager & Poeschel (2007)
    find ln e = -2 b arccos(b) / sqrt(1 - b^2), and with arccosh(b) / sqrt(b^2 - 1) for b above 1.
    """
    if tension == "release" and restitution < 1.0:
        return brentq(lambda b: _log_released(b) - math.log(restitution), 0.0, 1.0 / restitution)
    log = math.log(restitution)
    return -log / math.sqrt(log * log + math.pi * math.pi)


def _log_released(b):
    """ln e of a contact of damping ratio b that ends when its force vanishes."""
    if abs(b - 1.0) < 1e-6:
        return -2.0 * b
    if b < 1.0:
        return -2.0 * b * math.acos(b) / math.sqrt(1.0 - b * b)
    return -2.0 * b * math.acosh(b) / math.sqrt(b * b - 1.0)


def contact_law(a, b, contact, tension="keep"):
    """Constants of the force law as the kernels take them (6,).

    4/3 E*, 8 G*, the dampings 2 sqrt(5/6) beta sqrt(2 E*) and 2 sqrt(5/6) beta sqrt(8 G*), static friction, rolling
    friction.
    """
    young, shear = effective_moduli(a, b)
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio(contact.restitution, tension)
    return np.array(
        [
            4.0 / 3.0 * young,
            8.0 * shear,
            damping * math.sqrt(2.0 * young),
            damping * math.sqrt(8.0 * shear),
            contact.static_friction,
            contact.rolling_friction,
        ]
    )
