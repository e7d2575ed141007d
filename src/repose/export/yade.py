"""Make the input script of YADE, with spheres or clumps among facets."""

import math

import numpy as np
from numpy.typing import ArrayLike

from repose.export.decks import fill_template, format_head, join_numbers
from repose.export.job import Job, Pair
from repose.export.laws import compute_rolling_stiffness
from repose.export.surface import N_FACETS, compute_profile


def make_deck(job: Job) -> dict[str, str]:
    """Make the contents of pour.py for YADE, by name of the file."""
    mass_fractions, inertia = distribute_mass(job)
    widest_m = max(job.plate_radius_m, 0.5 * job.surfaces.inlet_diameter_m)
    text = fill_template(
        "yade.py.jinja",
        job,
        head=format_head(job, _list_differences(job)),
        spheres=_format_list(job.particle.spheres_m),
        masses=_format_list(mass_fractions * job.particle.mass_kg),
        inertia=_format_list(inertia),
        damping_gg=_compute_damping_fraction(job.grains),
        damping_gp=_compute_damping_fraction(job.on_wall),
        eta=job.grains.rolling_friction * job.lever_m / job.mean_radius_m,
        krot=compute_rolling_stiffness(job.grains),
        moment_gp=job.on_wall.rolling_friction * job.lever_m,
        krot_gp=compute_rolling_stiffness(job.on_wall),
        profile=_format_list(compute_profile(job.surfaces)),
        around=N_FACETS,
        plate_side=4.0 * widest_m,
    )
    return {"pour.py": text}


def _compute_damping_fraction(pair: Pair) -> float:
    """Compute the damping of a pair as a fraction of its critical damping.

    The factor sqrt(5/6) results from the nonlinear spring of Hertz's law.
    """
    return math.sqrt(5.0 / 6.0) * pair.damping_ratio


def _list_differences(job: Job) -> list[str]:
    """List the differences between YADE and the study."""
    behaviour = "stays as it is while the normal force grows, and falls with it"
    if job.simulation.contact_law == "hertz_mindlin":
        behaviour = "grows and falls with the normal force"
    differences = [
        "the tangential force stays as it is when the normal force changes; in the study "
        f"it {behaviour}",
        # The stiffness of Hertz's law is proportional to the square root of the
        # effective radius, and sqrt(2/3) is 0.82.
        "at a facet, YADE uses two thirds of a sphere's radius as the effective radius: "
        "contacts with walls are softer by 18 %",
        "in its first time step, a contact with a wall has the rolling friction between "
        "grains",
    ]
    if job.simulation.tension == "keep":
        differences.append(
            "the normal force never pulls; in the study it may pull, and the damping is "
            "computed for this case"
        )
    return differences


def distribute_mass(job: Job) -> tuple[np.ndarray, np.ndarray]:
    """Distribute the mass and the inertia of a grain over its spheres.

    YADE adds up the masses and inertias of the spheres of a clump. The result must have
    the mass, the centre of mass and the moments of inertia of the grain.

    Parameters
    ----------
    job : Job
        The grain and its pour.

    Returns
    -------
    fractions : ndarray
        Fraction (M,) of the mass of the grain that each sphere gets. The fractions are
        as equal as possible while their sum is 1, their centre of mass is the origin
        and their products of inertia are zero.
    inertia : ndarray
        Moments of inertia (3,) that each sphere gets [kg m2], the same for all of them.
        Their sum is the difference between the moments of the grain and those of point
        masses at the centres. It may be negative.
    """
    particle = job.particle
    x, y, z = particle.spheres_m[:, :3].T
    n_spheres = len(x)

    # Write the conditions on sum (1), centre (3) and products of inertia (3) as seven
    # linear equations. Divide lengths by a scale, so that all coefficients are of order
    # one.
    scale_m = particle.bounding_radius_m
    conditions = np.stack(
        [np.ones_like(x), x / scale_m, y / scale_m, z / scale_m, x * y, x * z, y * z]
    )
    # The last three rows are products of two lengths, which are scaled here.
    conditions[4:] /= scale_m**2
    # The sum must be 1, and everything else must be 0.
    required = np.zeros(len(conditions))
    required[0] = 1.0

    # Find the smallest change to equal fractions with which the conditions are met.
    # With few or symmetric spheres, some conditions depend on each other. `rcond`
    # ignores their singular values, which are 0 except for rounding.
    equal_fractions = np.full(n_spheres, 1.0 / n_spheres)
    residual = required - conditions @ equal_fractions
    change = np.linalg.lstsq(conditions, residual, rcond=1e-9)[0]
    fractions = equal_fractions + change

    # Subtract the moments of point masses at the centres from those of the grain.
    squared_distances = np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    missing_inertia = (
        particle.inertia_kg_m2 - particle.mass_kg * squared_distances @ fractions
    )
    return fractions, missing_inertia / n_spheres


def _format_list(values: ArrayLike) -> str:
    """Write numbers (N,), or rows of numbers (N, M), as a list of Python."""
    values = np.asarray(values)
    if values.ndim == 1:
        return f"[{join_numbers(values, ', ')}]"
    rows = "".join(f"    {_format_list(row)},\n" for row in values)
    return f"[\n{rows}]"
