"""How long a time step may be, from the duration of an impact."""

from collections.abc import Collection, Mapping

from .laws import Law
from .materials import Material
from .shapes import Clump, Shape

STEPS_PER_CONTACT = 15  # the longest time step is this share of a head-on impact's contact time
FASTEST_IMPACT_M_S = 2.0


def longest(
    law: Law, materials: Mapping[str, Material], shapes: Collection[Shape | Clump], speed_m_s: float
) -> float:
    """Longest time step for impacts of any two of some shapes.

    Parameters
    ----------
    law : Law
        The contact law; it tells the duration of an impact.
    materials : mapping
        From name to Material.
    shapes : collection of Shape or Clump
        At least one.
    speed_m_s : float
        Of approach.

    Returns
    -------
    float
        In seconds, `STEPS_PER_CONTACT` of them in the shortest impact.
    """
    return min(_duration(law, materials, a, b, speed_m_s) for a in shapes for b in shapes) / STEPS_PER_CONTACT


def smallest_scale(
    law: Law, materials: Mapping[str, Material], shape: Shape | Clump, time_step_s: float
) -> float:
    """Smallest scale of a body for a time step: the duration of an impact grows with the scale.

    Parameters
    ----------
    law : Law
        The contact law; it tells the duration of an impact.
    materials : mapping
        From name to Material.
    shape : Shape or Clump
        The body at scale 1.
    time_step_s : float
        Of the simulation.

    Returns
    -------
    float
        Just below the exact one, so that rounding refuses no body.
    """
    limit = _duration(law, materials, shape, shape, FASTEST_IMPACT_M_S) / STEPS_PER_CONTACT
    return (1.0 - 1e-12) * (time_step_s / limit)


def _duration(law, materials, a, b, speed_m_s):
    """Duration of an impact of two shapes that meet head-on [s]."""
    mass = 1.0 / (1.0 / a.mass_kg + 1.0 / b.mass_kg)
    radius = 1.0 / (1.0 / a.smallest_radius_m + 1.0 / b.smallest_radius_m)
    return law.contact_time(materials[a.material], materials[b.material], mass, radius, speed_m_s)
