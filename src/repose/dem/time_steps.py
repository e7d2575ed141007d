"""Compute the longest time step with which a simulation is stable.

It is short enough to resolve an impact, and to keep a body stable that is pressed
between two others.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from .laws.law import Law
from .materials import Contact, Material
from .shapes import Clump, Shape

STEPS_PER_CONTACT = 8  # contact time of a head-on impact over the longest time step
FASTEST_IMPACT_M_S = 2.0
# Overlap of a soft body under a pile, over half its smallest extent
OVERLAP_UNDER_PILE = 0.1
# Speed times duration of an impact over its overlap: 2.94 by Hertz's law, pi by a
# linear spring.
DURATION_OVER_OVERLAP = 3.0


class Limit(NamedTuple):
    """An upper limit of the time step, and the reason for it in words."""

    time_step_s: float
    reason: str

    @property
    def allowed(self) -> str:
        """The limit in words, rounded down so that the printed number is allowed."""
        unit = 10.0 ** (math.floor(math.log10(self.time_step_s)) - 2)
        rounded = math.floor(self.time_step_s / unit) * unit
        return f"at most {rounded:.3g}, {self.reason}"


class Scene(NamedTuple):
    """All that the longest time step depends on."""

    law: Law
    tension: str
    materials: Mapping[str, Material]
    contacts: Mapping[tuple[str, str], Contact]  # of pairs in both orders
    shapes: Mapping[str, Shape | Clump]
    walls: frozenset[str]  # their materials


def longest(
    scene: Scene, speed_m_s: float = FASTEST_IMPACT_M_S, smallest_scale: float = 1.0
) -> Limit:
    """Compute the longest time step of a scene.

    It is the smallest limit of all impacts (`impact`) and all pressed bodies
    (`pressed`), and proportional to the scale of the bodies.

    Parameters
    ----------
    scene : Scene
        Bodies, walls and laws.
    speed_m_s : float
        Speed of the fastest impact [m/s].
    smallest_scale : float
        Scale of the smallest body.

    Returns
    -------
    Limit
        The smallest limit, with its reason.
    """
    shapes = list(scene.shapes.values())
    limits = [impact(scene, a, b, speed_m_s) for a in shapes for b in shapes]
    for shape in shapes:
        limits += _list_pressed_limits(scene, shape)
    shortest = min(limits)  # by the time step, the first field
    if smallest_scale == 1.0:
        return shortest
    reason = f"{shortest.reason}, at the smallest scale, {smallest_scale:.3g}"
    return Limit(smallest_scale * shortest.time_step_s, reason)


def smallest_scales(scene: Scene, time_step_s: float) -> dict[str, float]:
    """Compute the smallest scale that each shape may have with a time step."""
    slightly_less = 1.0 - 1e-12  # so that the limit itself is accepted
    scales = {}
    for name, shape in scene.shapes.items():
        limit = longest(scene._replace(shapes={name: shape}))
        scales[name] = slightly_less * (time_step_s / limit.time_step_s)
    return scales


def impact(scene: Scene, a: Shape | Clump, b: Shape | Clump, speed_m_s: float) -> Limit:
    """Compute the time step that resolves a head-on impact of two bodies.

    The impact takes `STEPS_PER_CONTACT` steps.

    Parameters
    ----------
    scene : Scene
        Materials and laws.
    a, b : Shape or Clump
        The two bodies.
    speed_m_s : float
        Their relative speed [m/s].
    """
    duration = _compute_impact_duration(scene, a, b, speed_m_s)
    reason = (
        f"1/{STEPS_PER_CONTACT} of the contact time of two bodies "
        f"that meet at {speed_m_s:g} m/s"
    )
    return Limit(duration / STEPS_PER_CONTACT, reason)


def pressed(
    scene: Scene,
    shape: Shape | Clump,
    other: str,
    of_body: bool = False,
    overlap_m: float | None = None,
) -> Limit:
    """Compute the longest time step with which a body that two plates press is stable.

    Parameters
    ----------
    scene : Scene
        Materials and laws.
    shape : Shape or Clump
        The body.
    other : str
        Material of the plates.
    of_body : bool
        Whether the plates are equal bodies that move against the body, as in a row of
        bodies whose neighbours move against each other. This is the stiffest case.
    overlap_m : float, optional
        Overlap with each plate [m]. None stands for that of a soft body under a pile or
        that of the fastest impact, whichever is smaller.

    Returns
    -------
    Limit
        The longest time step [s], with its reason.

    Notes
    -----
    The stiffness S of one contact, the number N of them that act at one place, and the
    mass m of the body give the oscillator w^2 = 2 N S / m. Its damping ratio z is
    sqrt(2) times that of one contact, for any N, since the N contacts share the
    damping. The semi-implicit Euler method, in which the force depends on the velocity
    before the step, is stable for dt < 2 / w (sqrt(1 + z^2) - z). In a row of equal
    bodies m is the m* of two of them.
    """
    # R* and m* of two equal bodies are half those of a body against a plate.
    n_bodies = 2.0 if of_body else 1.0
    radius = shape.flattest_radius_m / n_bodies
    mass = shape.mass_kg / n_bodies
    if overlap_m is None:
        overlap_m = _estimate_overlap(scene, shape)

    contact = scene.contacts[shape.material, other]
    assert scene.law.oscillator is not None
    stiffness, contact_damping_ratio = scene.law.oscillator(
        scene.materials[shape.material],
        scene.materials[other],
        contact,
        scene.tension,
        radius,
        overlap_m,
    )
    n_contacts = shape.acting_together(overlap_m)
    angular_frequency = math.sqrt(2.0 * n_contacts * stiffness / mass)
    z = math.sqrt(2.0) * contact_damping_ratio
    # 1 / (sqrt(1 + z^2) + z) is sqrt(1 + z^2) - z
    time_step = 2.0 / angular_frequency / (math.sqrt(1.0 + z * z) + z)

    spheres = f", {n_contacts:.1f} spheres at one place" if n_contacts > 1.0 else ""
    reason = (
        f"the stable step of a body between two of {other} "
        f"(restitution {contact.restitution:g}{spheres})"
    )
    return Limit(time_step, reason)


def _estimate_overlap(scene: Scene, shape: Shape | Clump) -> float:
    """Estimate the largest overlap of a body under a pile [m].

    It is not more than in the fastest impact.
    """
    half_thickness = float(shape.half_extents_m.min())
    duration = _compute_impact_duration(scene, shape, shape, FASTEST_IMPACT_M_S)
    overlap_in_impact = duration * FASTEST_IMPACT_M_S / DURATION_OVER_OVERLAP
    return min(OVERLAP_UNDER_PILE * half_thickness, overlap_in_impact)


def _list_pressed_limits(scene: Scene, shape: Shape | Clump) -> list[Limit]:
    """Compute the limits of a body between two walls, and between two bodies.

    There is one for each material of walls, and one for each material of bodies.
    """
    limits = [pressed(scene, shape, wall) for wall in sorted(scene.walls)]
    for material in sorted({other.material for other in scene.shapes.values()}):
        limits.append(pressed(scene, shape, material, of_body=True))
    return limits


def _compute_impact_duration(
    scene: Scene, a: Shape | Clump, b: Shape | Clump, speed_m_s: float
) -> float:
    """Compute the duration of a head-on impact of two shapes [s]."""
    assert scene.law.contact_time is not None
    return scene.law.contact_time(
        scene.materials[a.material],
        scene.materials[b.material],
        scene.contacts[a.material, b.material],
        1.0 / (1.0 / a.mass_kg + 1.0 / b.mass_kg),
        1.0 / (1.0 / a.smallest_radius_m + 1.0 / b.smallest_radius_m),
        speed_m_s,
    )
