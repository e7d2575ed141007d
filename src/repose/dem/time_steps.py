"""Compute the longest time step with which a simulation is stable.

The time step must resolve an impact, and a body between two other bodies must stay
stable.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from .laws.law import Law
from .materials import Contact, Material
from .shapes import Clump, Shape

STEPS_PER_CONTACT = 8  # smallest number of time steps in a head-on impact
FASTEST_IMPACT_M_S = 2.0
# Largest overlap of a soft body under a pile, over half its smallest extent
OVERLAP_UNDER_PILE = 0.1
# Speed times duration of an impact, over its largest overlap. The exact value is 2.94
# with Hertz's law and pi with a linear spring.
DURATION_OVER_OVERLAP = 3.0


class Limit(NamedTuple):
    """An upper limit of the time step, with a phrase that explains it."""

    time_step_s: float
    reason: str

    @property
    def allowed(self) -> str:
        """Phrase that states the limit.

        The limit is rounded down to three digits, so that the printed number is
        allowed.
        """
        third_digit = 10.0 ** (math.floor(math.log10(self.time_step_s)) - 2)
        rounded_down = math.floor(self.time_step_s / third_digit) * third_digit
        return f"at most {rounded_down:.3g}, {self.reason}"


class Scene(NamedTuple):
    """Everything on which the longest time step depends."""

    law: Law
    tension: str
    materials: Mapping[str, Material]
    contacts: Mapping[tuple[str, str], Contact]  # of pairs in both orders
    shapes: Mapping[str, Shape | Clump]
    walls: frozenset[str]  # materials of the walls


def compute_longest(
    scene: Scene, speed_m_s: float = FASTEST_IMPACT_M_S, smallest_scale: float = 1.0
) -> Limit:
    """Compute the longest time step with which a scene is stable.

    Each impact (`compute_impact_limit`) and each body that is pressed between others
    (`compute_pressed_limit`) allows a largest time step. The smallest of these limits
    is the result. All of them are proportional to the lengths of the bodies, so they
    are multiplied by the smallest scale.

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
    limits = [
        compute_impact_limit(scene, a, b, speed_m_s) for a in shapes for b in shapes
    ]
    for shape in shapes:
        limits += _list_pressed_limits(scene, shape)
    # Tuples are compared by their first field, the time step.
    shortest = min(limits)
    if smallest_scale == 1.0:
        return shortest
    reason = f"{shortest.reason}, at the smallest scale, {smallest_scale:.3g}"
    return Limit(smallest_scale * shortest.time_step_s, reason)


def smallest_scales(scene: Scene, time_step_s: float) -> dict[str, float]:
    """Compute the smallest scale of each shape at which a time step is stable.

    Parameters
    ----------
    scene : Scene
        Bodies, walls and laws.
    time_step_s : float
        The time step [s].

    Returns
    -------
    dict of str to float
        The scales by the names of the shapes.
    """
    slightly_less = 1.0 - 1e-12  # so that rounding does not reject the limit itself
    scales = {}
    for name, shape in scene.shapes.items():
        limit = compute_longest(scene._replace(shapes={name: shape}))
        scales[name] = slightly_less * (time_step_s / limit.time_step_s)
    return scales


def compute_impact_limit(
    scene: Scene, a: Shape | Clump, b: Shape | Clump, speed_m_s: float
) -> Limit:
    """Compute the longest time step that resolves a head-on impact of two bodies.

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


def compute_pressed_limit(
    scene: Scene,
    shape: Shape | Clump,
    plate_material: str,
    between_bodies: bool = False,
    overlap_m: float | None = None,
) -> Limit:
    """Compute the longest time step with which a body between two plates is stable.

    Parameters
    ----------
    scene : Scene
        Materials and laws.
    shape : Shape or Clump
        The body.
    plate_material : str
        Material of the plates.
    between_bodies : bool
        Whether bodies of the same kind take the place of the plates. They form a row in
        which each body moves against its neighbours, which is the stiffest case.
    overlap_m : float, optional
        Overlap with each plate [m]. By default, it is that of a soft body under a pile
        or that of the fastest impact, whichever is smaller.

    Returns
    -------
    Limit
        The longest time step [s], with its reason.

    Notes
    -----
    Let S be the stiffness of one contact, N the number of contacts that act together at
    one place, and m the mass of the body. The body between the plates is an oscillator
    with the angular frequency w, where w^2 = 2 N S / m. Its damping ratio z is sqrt(2)
    times that of one contact for any N, since the N contacts share the damping. The
    semi-implicit Euler method, in which the force depends on the velocity before the
    step, is stable for dt < 2 / w (sqrt(1 + z^2) - z). In a row of equal bodies, m is
    the effective mass m* of two of them.
    """
    # The effective radius and mass of two equal bodies are half of those of a body and
    # a plate, so both are divided by 2 in a row of bodies.
    n_bodies = 2.0 if between_bodies else 1.0
    radius = shape.flattest_radius_m / n_bodies
    mass = shape.mass_kg / n_bodies
    if overlap_m is None:
        overlap_m = _estimate_overlap(scene, shape)

    contact = scene.contacts[shape.material, plate_material]
    # Every contact law has an oscillator: the stiffness and the damping ratio of a
    # contact for small motions. Rolling laws have none.
    assert scene.law.oscillator is not None
    stiffness, contact_damping_ratio = scene.law.oscillator(
        scene.materials[shape.material],
        scene.materials[plate_material],
        contact,
        scene.tension,
        radius,
        overlap_m,
    )
    # The mean number of contacts that act together, which need not be a whole number
    n_contacts = shape.acting_together(overlap_m)
    angular_frequency = math.sqrt(2.0 * n_contacts * stiffness / mass)
    z = math.sqrt(2.0) * contact_damping_ratio  # damping ratio, see the notes
    # 1 / (sqrt(1 + z^2) + z) equals sqrt(1 + z^2) - z, with less rounding error.
    time_step = 2.0 / angular_frequency / (math.sqrt(1.0 + z * z) + z)

    spheres = f", {n_contacts:.1f} spheres at one place" if n_contacts > 1.0 else ""
    reason = (
        f"the stable step of a body between two of {plate_material} "
        f"(restitution {contact.restitution:g}{spheres})"
    )
    return Limit(time_step, reason)


def _estimate_overlap(scene: Scene, shape: Shape | Clump) -> float:
    """Estimate the largest overlap of a body under a pile [m].

    The result is at most the overlap in the fastest impact.
    """
    half_thickness = float(shape.half_extents_m.min())
    duration = _compute_impact_duration(scene, shape, shape, FASTEST_IMPACT_M_S)
    overlap_in_impact = duration * FASTEST_IMPACT_M_S / DURATION_OVER_OVERLAP
    return min(OVERLAP_UNDER_PILE * half_thickness, overlap_in_impact)


def _list_pressed_limits(scene: Scene, shape: Shape | Clump) -> list[Limit]:
    """List the limits of a body between two walls, and between two bodies.

    There is one limit for each material of walls, and one for each material of bodies.
    """
    limits = [compute_pressed_limit(scene, shape, wall) for wall in sorted(scene.walls)]
    for material in sorted({other.material for other in scene.shapes.values()}):
        limits.append(
            compute_pressed_limit(scene, shape, material, between_bodies=True)
        )
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
