"""Write the deck of YADE: spheres or clumps among facets."""

import math

import numpy as np
from numpy.typing import ArrayLike

from repose.export.decks import fill_template, head, numbers
from repose.export.job import Job, Pair
from repose.export.laws import rolling_stiffness
from repose.export.surface import AROUND, profile


def deck(job: Job) -> dict[str, str]:
    """Write the file of a YADE run by name: pour.py."""
    weights, inertia = member_masses(job)
    widest_m = max(job.plate_radius_m, 0.5 * job.surfaces.inlet_diameter_m)
    text = fill_template(
        "yade.py.jinja",
        job,
        head=head(job, _notes(job)),
        spheres=_list_text(job.particle.spheres_m),
        masses=_list_text(weights * job.particle.mass_kg),
        inertia=_list_text(inertia),
        damping_gg=_damping_share(job.grains),
        damping_gp=_damping_share(job.on_wall),
        eta=job.grains.rolling_friction * job.lever_m / job.mean_radius_m,
        krot=rolling_stiffness(job.grains),
        moment_gp=job.on_wall.rolling_friction * job.lever_m,
        krot_gp=rolling_stiffness(job.on_wall),
        profile=_list_text(profile(job.surfaces)),
        around=AROUND,
        plate_side=4.0 * widest_m,
    )
    return {"pour.py": text}


def _damping_share(pair: Pair) -> float:
    """Compute the damping of a pair over the critical damping."""
    return math.sqrt(5.0 / 6.0) * pair.damping_ratio


def _notes(job: Job) -> list[str]:
    """List how YADE differs from the study."""
    behaviour = "stays on loading and falls on unloading"
    if job.simulation.contact_law == "hertz_mindlin":
        behaviour = "grows and falls with the normal load"
    notes = [
        "a tangential force stays as it is when the normal load changes; in the study it "
        f"{behaviour}",
        "on a facet YADE takes two thirds of a sphere's radius as the effective one: "
        "contacts with walls are softer by 18 %",
        "a contact with a wall rolls in its first step with the coefficient of the grains",
    ]
    if job.simulation.tension == "keep":
        notes.append("the normal force never pulls, damped as if it could")
    return notes


def member_masses(job: Job) -> tuple[np.ndarray, np.ndarray]:
    """Distribute mass and inertia over the spheres of a clump.

    Together the spheres must have the mass, the centre of mass and the moments of
    inertia of the body.

    Returns
    -------
    shares : array
        Share (M,) of each sphere in the mass. The shares are as equal as possible. Their
        sum is 1, their centre is the origin and their products of inertia are zero.
    inertia : array
        Moments of inertia (3,) of each sphere [kg m2]. Together they supply what the
        masses at the centres of the spheres lack.
    """
    particle = job.particle
    x, y, z = particle.spheres_m[:, :3].T
    n_spheres = len(x)

    # Write the conditions on sum, centre and products of inertia as linear equations. A
    # length scale makes all coefficients of order one.
    scale_m = particle.bounding_radius_m
    conditions = np.stack(
        [np.ones_like(x), x / scale_m, y / scale_m, z / scale_m, x * y, x * z, y * z]
    )
    conditions[4:] /= scale_m**2
    required = np.zeros(7)
    required[0] = 1.0

    # Find the smallest change of equal shares that fulfils the conditions.
    equal_shares = np.full(n_spheres, 1.0 / n_spheres)
    residual = required - conditions @ equal_shares
    change = np.linalg.lstsq(conditions, residual, rcond=1e-9)[0]
    shares = equal_shares + change

    # Find the moments that the masses at the centres of the spheres lack.
    squared_distances = np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    missing_inertia = (
        particle.inertia_kg_m2 - particle.mass_kg * squared_distances @ shares
    )
    return shares, missing_inertia / n_spheres


def _list_text(values: ArrayLike) -> str:
    """Write a list of numbers, or a list of such lists, as text of Python."""
    values = np.asarray(values)
    if values.ndim == 1:
        return f"[{numbers(values, ', ')}]"
    rows = "".join(f"    {_list_text(row)},\n" for row in values)
    return f"[\n{rows}]"
