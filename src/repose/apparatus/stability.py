"""How long a time step may be: the limits that are known before a simulation is built.

The engine has the last word: `repose.dem.Simulation` refuses a step longer than its own `longest_time_step`, which is
`contact_limit` of the particle's exact mass and smallest radius. A multisphere has a limit of its own, see
`repose.particle.sphere_packing.longest_time_step`.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

# AoR and Height hold to 13 % of the berry's Rayleigh time and break at 32 %.
LARGEST_RAYLEIGH_SHARE = 0.2
# As the engine has them: steps in a contact, and speed of the impact [m/s]; a test holds them together.
STEPS_PER_CONTACT, IMPACT_M_S = 15, 2.0


class Limit(NamedTuple):
    """The longest time step and what sets it.

    Attributes
    ----------
    time_step_s : float
        In seconds.
    reason : str
        In words.
    """

    time_step_s: float
    reason: str


def rayleigh_time_s(
    axes_mm: Sequence[float], density_kg_m3: float, poisson: float, shear_modulus_pa: float
) -> float:
    """Time that a Rayleigh wave takes over the sphere of equal volume, the usual measure of a DEM time step.

    Parameters
    ----------
    axes_mm : sequence of float, (3,)
        The three full axes.
    density_kg_m3 : float
        Of the body.
    poisson, shear_modulus_pa : float
        Of its material.

    Returns
    -------
    float
        In seconds.

    Notes
    -----
    pi R sqrt(density / G) / (0.1631 nu + 0.8766).
    """
    radius = 0.5e-3 * math.prod(axes_mm) ** (1 / 3)
    return math.pi * radius * math.sqrt(density_kg_m3 / shear_modulus_pa) / (0.1631 * poisson + 0.8766)


def contact_limit(mass_kg: float, radius_m: float, poisson: float, shear_modulus_pa: float) -> float:
    """A share of the contact time of two equal bodies that meet head-on.

    Parameters
    ----------
    mass_kg, radius_m : float
        Of a body; the radius is half its smallest extent.
    poisson, shear_modulus_pa : float
        Of its material.

    Returns
    -------
    float
        In seconds.

    Notes
    -----
    t_c = 2.868 (m*^2 / (R* E*^2 v))^0.2, with m* and R* half of a body's and E* = G / (1 - nu).

    References
    ----------
    Johnson 1985, Contact Mechanics, Eq. 11.24.
    """
    young = shear_modulus_pa / (1.0 - poisson)
    contact_s = 2.868 * ((mass_kg / 2) ** 2 / (radius_m / 2 * young**2 * IMPACT_M_S)) ** 0.2
    return contact_s / STEPS_PER_CONTACT


def longest_time_step(berry: Mapping[str, Any], mass_kg: float | None, smallest_scale: float = 1.0) -> Limit:
    """The longest time step for the mean berry.

    Parameters
    ----------
    berry : mapping
        What the verb ``berry`` writes: mean axes [mm], density, Poisson's ratio and shear modulus.
    mass_kg : float or None
        Of the mean berry; None for the ellipsoid of its axes.
    smallest_scale : float
        Of a berry, relative to the mean one: smaller bodies have shorter contacts.

    Returns
    -------
    Limit
        The smaller one of the Rayleigh wave's and the contact's.
    """
    axes_mm = [berry[key] for key in ("long_mm", "major_mm", "minor_mm")]
    moduli = berry["poisson_ratio"], berry["shear_modulus_pa"]
    if mass_kg is None:
        mass_kg = berry["density_kg_m3"] * math.pi / 6 * math.prod(axes_mm) * 1e-9
    wave = LARGEST_RAYLEIGH_SHARE * rayleigh_time_s(axes_mm, berry["density_kg_m3"], *moduli)
    contact = smallest_scale * contact_limit(mass_kg, 0.5e-3 * min(axes_mm), *moduli)
    return min(
        Limit(wave, f"{LARGEST_RAYLEIGH_SHARE:.0%} of the Rayleigh time of the mean berry"),
        Limit(
            contact,
            f"1/{STEPS_PER_CONTACT} of the contact time of two berries that meet at {IMPACT_M_S:g} m/s",
        ),
    )
