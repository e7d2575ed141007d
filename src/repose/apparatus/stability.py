"""How long a time step may be."""

import math

# AoR and Height hold to 13 % of the berry's Rayleigh time and break at 32 %.
LARGEST_RAYLEIGH_SHARE = 0.2


def rayleigh_time_s(axes_mm, density_kg_m3, poisson, shear_modulus_pa):
    """Time that a Rayleigh wave takes over the sphere of equal volume, s; axes_mm are the three full axes.

    pi R sqrt(density / G) / (0.1631 nu + 0.8766), the usual measure of a DEM time step.
    """
    radius = 0.5e-3 * math.prod(axes_mm) ** (1 / 3)
    return math.pi * radius * math.sqrt(density_kg_m3 / shear_modulus_pa) / (0.1631 * poisson + 0.8766)
