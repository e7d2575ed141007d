"""What a sphere loses that hits a plane obliquely.

Coulomb's law determines it where the sphere slides, the spring where it sticks.

A sphere that slides through the whole impact loses the tangential velocity mu (1 + e)
V_n and gains the spin 5/2 mu (1 + e) V_n / R. This holds when the surface moves faster
than 7/2 mu (1 + e) V_n by a margin. Coulomb's limit gives exactly that when it takes
the elastic normal force and the contact may pull, or all of the normal force and the
contact is released. Where the sphere sticks, the tangential spring determines the
result; the reference is the equation of that spring (`velocity_after_hit`).
"""

import math

import numpy as np
from scipy.integrate import trapezoid
from verification.hertz import rigid

from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

LIMIT_OF_SLIDING = 3.5  # tangential velocity over mu (1 + e) V_n
CLEAR_SLIDING = 1.25  # gross sliding: above this multiple of the limit


def sliding_loss(contact, normal_m_s):
    """Compute the tangential velocity that rigid bodies lose in gross sliding [m/s].

    It is mu (1 + e) V_n.
    """
    return contact.static_friction * (1.0 + contact.restitution) * normal_m_s


def slides(contact, normal_m_s, tangential_m_s):
    """Tell whether a sphere without spin clearly slides through its whole impact."""
    limit = LIMIT_OF_SLIDING * sliding_loss(contact, normal_m_s)
    return tangential_m_s > CLEAR_SLIDING * limit


def sliding_spin(contact, hertz, tension):
    """Compute the change of spin [rad/s] in gross sliding by the engine's law.

    It is mu times the integral of F (R - delta / 2) / I: the contact lies in the middle
    of the overlap. F is the elastic part of the damped impact's force where the contact
    may pull, all of it where it may not.
    """
    time, overlap, force = hertz.history(contact.restitution, 4000, tension)
    if tension == "keep":
        force = hertz.force_n * (np.maximum(overlap, 0.0) / hertz.overlap_m) ** 1.5
    friction = contact.static_friction * force
    torque_impulse = trapezoid(friction * (hertz.radius - 0.5 * overlap), time)
    return 2.5 * torque_impulse / (hertz.mass * hertz.radius**2)


def velocity_after_hit(solid, hertz, contact, tangential_m_s, laws):
    """Solve a hit on the rigid plane for the tangential velocity [m/s] after it.

    The tangential spring of "hertz_mindlin" is the present stiffness times the path;
    that of "hertz_mindlin_rescaled" adds what the path adds, and shrinks with the
    stiffness.
    """
    spring = laws["contact_law"]
    tension = laws["tension"]
    young, shear = effective_moduli(solid.material, rigid(solid.material))
    beta = damping_ratio(contact.restitution, tension)
    damping = 2.0 * math.sqrt(5.0 / 6.0) * beta
    mass = hertz.mass
    radius = hertz.radius
    step = hertz.duration_s / 20_000

    approach = hertz.speed
    along = tangential_m_s  # velocity of the centre
    rim = 0.0  # velocity of the rim by the spin
    overlap = path = spring_force = previous_circle = 0.0
    while True:
        circle = math.sqrt(radius * overlap)  # radius of the contact's circle
        elastic = 4.0 / 3.0 * young * circle * overlap
        normal_damping = damping * math.sqrt(2.0 * young * circle * mass)
        normal_force = elastic + normal_damping * approach
        if tension == "release" and normal_force < 0.0:
            return along
        carrying = elastic if tension == "keep" else normal_force
        limit = contact.static_friction * carrying

        stiffness = 8.0 * shear * circle
        surface = along + rim
        path += surface * step
        if spring == "hertz_mindlin":
            spring_force = stiffness * path
        else:
            shrinks = min(1.0, circle / previous_circle) if previous_circle else 1.0
            spring_force = shrinks * spring_force + stiffness * surface * step
        spring_force = max(-limit, min(limit, spring_force))
        if stiffness:
            path = spring_force / stiffness
        dashpot = damping * math.sqrt(stiffness * mass) * surface
        friction = max(-limit, min(limit, spring_force + dashpot))

        approach -= normal_force / mass * step
        along -= friction / mass * step
        rim -= 2.5 * friction / mass * step * (1.0 - 0.5 * overlap / radius) ** 2
        previous_circle = circle
        overlap += approach * step
        if overlap <= 0.0:
            return along
