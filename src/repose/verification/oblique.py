"""Oblique impacts: tests 4 and 5 of Chung & Ooi (2011), Granular Matter 13, 643-656.

A sphere that slides through the whole impact loses the tangential velocity mu (1 + e) V_n and gains the spin 5/2 mu (1
+ e) V_n / R. This holds when the surface moves faster than 7/2 mu (1 + e) V_n by a margin. Coulomb's limit gives
exactly that when it takes the elastic normal force and the contact may pull, or all of the normal force and the contact
is released. Where the sphere sticks, the tangential spring determines the result; the reference is the equation of that
spring (`equation_of_hit`).
"""

import math
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from repose.dem import Contact
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

from .case import DIGITISED, Effort, Rows, close
from .hertz import Hertz, Solid, hertz_on_plane, rigid
from .impacts import ALUMINIUM_OXIDE
from .machine import impact

STEEL = Solid("steel", 208e9, 0.30, 7850.0)
POLYETHYLENE = Solid("polyethylene", 1e9, 0.40, 1400.0)

# Test 4: angle from the normal [deg]: tangential restitution, spin after the impact [rad/s].
TEST_4 = {
    5: (0.948, -19.3),
    20: (0.616, -511.0),
    30: (0.684, -617.0),
    50: (0.845, -457.0),
    70: (0.932, -246.0),
}
SPRING_NOTE = "it sticks, and the tangential spring determines the answer: the published one is near S_t delta_t"
EQUATION = "equation of the spring, solved in 20,000 steps"
ARM_NOTE = "the lever arm is R - delta / 2, not R: the contact lies in the middle of the overlap"
LAW = "mu times the limiting force times R - delta / 2, integrated by scipy over the impact"
SLIDES = 1.25  # gross sliding: above this multiple of the limit of sliding
Motion = tuple[float, float]  # tangential velocity [m/s] and spin [rad/s]


def sliding_impulse(contact: Contact, normal_m_s: Any) -> Any:
    """Compute the change of the tangential velocity [m/s] of rigid bodies in gross sliding: mu (1 + e) V_n."""
    return contact.static_friction * (1.0 + contact.restitution) * normal_m_s


def sliding_spin(contact: Contact, hertz: Hertz, tension: str) -> float:
    """Compute the size of the change of spin [rad/s] in gross sliding on a plane by the engine's law.

    It is mu times the integral of F (R - delta / 2) / I: the contact lies in the middle of the overlap. F is the
    elastic part of the damped impact's force where the contact may pull, all of it where it may not.
    """
    time, overlap, force = hertz.history(contact.restitution, 4000, tension)
    if tension == "keep":
        force = hertz.force_n * (np.maximum(overlap, 0.0) / hertz.overlap_m) ** 1.5
    push = contact.static_friction * force
    return (
        2.5
        * trapezoid(push * (hertz.radius - 0.5 * overlap), time)
        / (hertz.mass * hertz.radius**2)
    )


def sliding_rows(
    at: str, contact: Contact, hertz: Hertz, after: Motion, before: Motion, tension: str
) -> Rows:
    """Compare gross sliding: the change of velocity with rigid bodies, that of spin with the law and rigid bodies."""
    rigid = sliding_impulse(contact, hertz.speed)
    velocity, spin = after
    sign = math.copysign(1.0, velocity - before[0])
    moved, spun = sign * (velocity - before[0]), -sign * (spin - before[1])
    yield close(f"{at}: change of tangential velocity", "m/s", moved, rigid)
    yield close(
        f"{at}: change of spin",
        "rad/s",
        spun,
        sliding_spin(contact, hertz, tension),
        LAW,
    )
    yield close(
        f"{at}: change of spin",
        "rad/s",
        spun,
        2.5 * rigid / hertz.radius,
        known=ARM_NOTE,
    )


def angles(effort: Effort) -> Rows:
    """Test 4: aluminium oxide, radius 2.5 mm, 3.9 m/s at angles of 5 to 85 degrees from the normal."""
    contact, radius, speed = Contact(0.98, 0.092, 0.0), 0.0025, 3.9
    spring = effort.laws.get("contact_law", "hertz_mindlin")
    for angle in (5, 10, 15, 20, 25, 30, 35, 40, 50, 60, 70, 80, 85):
        tangential = speed * math.sin(math.radians(angle))
        normal = speed * math.cos(math.radians(angle))
        v, w = impact(
            ALUMINIUM_OXIDE, radius, contact, (tangential, 0.0, -normal), **effort.laws
        )
        # the published sense of rotation is opposite
        kept, spin = v[0] / tangential, -w[1]
        of_kept, of_spin = (
            (f"{angle} deg: tangential restitution", ""),
            (f"{angle} deg: spin", "rad/s"),
        )
        lost = sliding_impulse(contact, normal)
        if tangential > SLIDES * 3.5 * lost:
            yield close(*of_kept, kept, 1.0 - lost / tangential)
            yield close(*of_spin, spin, -2.5 * lost / radius)
        elif spring in SPRINGS:
            hertz = hertz_on_plane(ALUMINIUM_OXIDE, radius, normal)
            left = equation_of_hit(
                ALUMINIUM_OXIDE, hertz, contact, tangential, spring, effort.tension
            )
            yield close(*of_kept, kept, left / tangential, EQUATION)
        if angle in TEST_4:
            known, published = SPRING_NOTE if angle == 5 else "", TEST_4[angle]
            yield close(*of_kept, kept, published[0], DIGITISED, known=known)
            yield close(*of_spin, spin, published[1], DIGITISED, known=known)


SPRINGS = ("hertz_mindlin", "hertz_mindlin_rescaled")


def equation_of_hit(
    solid: Solid,
    hertz: Hertz,
    contact: Contact,
    along: float,
    spring: str,
    tension: str,
) -> float:
    """Solve the equation of a hit on the rigid plane in small steps: the tangential velocity [m/s] after it."""
    young, shear = effective_moduli(solid.material, rigid(solid.material))
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio(contact.restitution, tension)
    mass, step = hertz.mass, hertz.duration_s / 20_000
    approach = hertz.speed
    overlap = spun = path = pull = before = 0.0
    while True:
        circle = math.sqrt(hertz.radius * overlap)
        stiffness, surface = 8.0 * shear * circle, along + spun
        elastic = 4.0 / 3.0 * young * circle * overlap
        push = elastic + damping * math.sqrt(2.0 * young * circle * mass) * approach
        if tension != "keep" and push < 0.0:
            return along
        most = contact.static_friction * (elastic if tension == "keep" else push)
        path += surface * step
        grown = (
            min(1.0, circle / before if before else 1.0) * pull
            + stiffness * surface * step
        )
        pull = stiffness * path if spring == "hertz_mindlin" else grown
        pull = max(-most, min(most, pull))
        path = pull / stiffness if stiffness else path
        drag = max(
            -most, min(most, pull + damping * math.sqrt(stiffness * mass) * surface)
        )
        approach, along = approach - push / mass * step, along - drag / mass * step
        spun -= 2.5 * drag / mass * step * (1.0 - 0.5 * overlap / hertz.radius) ** 2
        overlap, before = overlap + approach * step, circle
        if overlap <= 0.0:
            return along


def tangential_speeds(effort: Effort) -> Rows:
    """Test 5: radius 10 um, normal 5 m/s, tangential 13.5 and 25 m/s, e 1, mu 0.3; steel and polyethylene."""
    contact, radius, normal = Contact(1.0, 0.3, 0.0), 1e-5, 5.0
    for solid in (STEEL, POLYETHYLENE):
        hertz = hertz_on_plane(solid, radius, normal)
        for u in (13.5, 25.0):
            v, w = impact(solid, radius, contact, (u, 0.0, -normal), **effort.laws)
            at, result = f"{solid.name}, {u:g} m/s", (v[0], w[1])
            yield from sliding_rows(
                at, contact, hertz, result, (u, 0.0), effort.tension
            )
