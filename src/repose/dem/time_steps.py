"""The longest time step: it resolves an impact, and a body between two others is stable."""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from .laws.law import Law
from .materials import Contact, Material
from .shapes import Clump, Shape

STEPS_PER_CONTACT = 8  # the contact time of a head-on impact over the longest time step
FASTEST_IMPACT_M_S = 2.0
# Overlap of a soft body under a pile, as between two plates, over half its smallest extent.
PRESSED = 0.1
# Speed times duration of an impact over its overlap: 2.94 by Hertz's law, pi by a linear spring.
DURATION_OVER_OVERLAP = 3.0


class Limit(NamedTuple):
    """The longest time step, and the reason for it in words."""

    time_step_s: float
    reason: str

    @property
    def allowed(self) -> str:
        """The limit in words, rounded down so that the printed number is allowed."""
        unit = 10.0 ** (math.floor(math.log10(self.time_step_s)) - 2)
        return (
            f"at most {math.floor(self.time_step_s / unit) * unit:.3g}, {self.reason}"
        )


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
    """Compute the longest time step among walls: the least of `impact` and `pressed`, times the smallest scale."""
    kinds = list(scene.shapes.values())
    impacts = [impact(scene, a, b, speed_m_s) for a in kinds for b in kinds]
    limit = min(
        impacts + [limit for kind in kinds for limit in _pressed_by_all(scene, kind)]
    )
    if smallest_scale == 1.0:
        return limit
    reason = f"{limit.reason}, at the smallest scale, {smallest_scale:.3g}"
    return Limit(smallest_scale * limit.time_step_s, reason)


def smallest_scales(scene: Scene, time_step_s: float) -> dict[str, float]:
    """Compute the smallest scale of each shape for a time step, rounded down so that the limit itself is accepted."""
    limits = {
        name: longest(scene._replace(shapes={name: shape}))
        for name, shape in scene.shapes.items()
    }
    return {
        name: (1.0 - 1e-12) * (time_step_s / limit.time_step_s)
        for name, limit in limits.items()
    }


def impact(scene: Scene, a: Shape | Clump, b: Shape | Clump, speed_m_s: float) -> Limit:
    """Compute the time step that resolves a head-on impact of two bodies in `STEPS_PER_CONTACT` steps."""
    duration = _duration(scene, a, b, speed_m_s)
    reason = f"1/{STEPS_PER_CONTACT} of the contact time of two bodies that meet at {speed_m_s:g} m/s"
    return Limit(duration / STEPS_PER_CONTACT, reason)


def pressed(
    scene: Scene,
    shape: Shape | Clump,
    other: str,
    of_body: bool = False,
    overlap_m: float | None = None,
) -> Limit:
    """Compute the longest time step with which a body between two plates that press it is stable.

    `other` is the material of the plates; with `of_body` these are equal bodies that move against the body, as in a row
    of bodies whose neighbours move against each other, the stiffest case. The default overlap with each plate is that
    of a soft body under a pile or of the fastest impact, whichever is smaller.

    The stiffness S of one contact, the number N of them that act at one place, and the mass m of the body give the
    oscillator w^2 = 2 N S / m. Its damping ratio z is sqrt(2) times that of one contact, for any N, since the N
    contacts share the damping. The semi-implicit Euler method, in which the force depends on the velocity before the
    step, is stable for dt < 2 / w (sqrt(1 + z^2) - z). In a row of equal bodies m is the m* of two of them.
    """
    shared = 2.0 if of_body else 1.0
    radius, mass = shape.flattest_radius_m / shared, shape.mass_kg / shared
    thickness = float(shape.half_extents_m.min())
    if overlap_m is None:
        meeting = (
            _duration(scene, shape, shape, FASTEST_IMPACT_M_S) * FASTEST_IMPACT_M_S
        )
        overlap_m = min(PRESSED * thickness, meeting / DURATION_OVER_OVERLAP)
    a, b = scene.materials[shape.material], scene.materials[other]
    contact = scene.contacts[shape.material, other]
    assert scene.law.oscillator is not None
    stiffness, ratio = scene.law.oscillator(
        a, b, contact, scene.tension, radius, overlap_m
    )
    number = shape.acting_together(overlap_m)
    frequency = math.sqrt(2.0 * number * stiffness / mass)
    z = math.sqrt(2.0) * ratio
    spheres = f", {number:.1f} spheres at one place" if number > 1.0 else ""
    reason = f"the stable step of a body between two of {other} (restitution {contact.restitution:g}{spheres})"
    return Limit(2.0 / frequency / (math.sqrt(1.0 + z * z) + z), reason)


def _pressed_by_all(scene: Scene, shape: Shape | Clump) -> Iterator[Limit]:
    """Yield `pressed` by each wall and by bodies of each shape's material."""
    yield from (pressed(scene, shape, wall) for wall in sorted(scene.walls))
    for material in sorted({kind.material for kind in scene.shapes.values()}):
        yield pressed(scene, shape, material, of_body=True)


def _duration(
    scene: Scene, a: Shape | Clump, b: Shape | Clump, speed_m_s: float
) -> float:
    """Compute the duration of a head-on impact of two shapes [s]."""
    mass = 1.0 / (1.0 / a.mass_kg + 1.0 / b.mass_kg)
    radius = 1.0 / (1.0 / a.smallest_radius_m + 1.0 / b.smallest_radius_m)
    materials = scene.materials[a.material], scene.materials[b.material]
    assert scene.law.contact_time is not None
    return scene.law.contact_time(
        *materials, scene.contacts[a.material, b.material], mass, radius, speed_m_s
    )
