"""The deck of YADE: spheres or clumps among facets."""

import math

import numpy as np
from numpy.typing import ArrayLike

from repose.export.job import Job
from repose.export.laws import damped_alone, limited_friction, rolled, rolling_stiffness, undamped_tangent
from repose.export.surface import AROUND, profile
from repose.export.template import filled


def deck(job: Job) -> dict[str, str]:
    """The file of a YADE run by name: pour.py."""
    weights, inertia = member_masses(job)
    # sqrt(5/6) beta is the damping over the critical damping
    damping = {
        name: math.sqrt(5.0 / 6.0) * pair.damping_ratio for name, pair in (("gg", job.grains), ("gp", job.on_wall))
    }
    text = filled(
        "yade.py.txt",
        job,
        "# ",
        _differences(job),
        seed=job.seed,
        spheres=_listed(job.spheres_m),
        masses=_listed(weights * job.mass_kg),
        inertia=_listed(inertia),
        damping_gg=damping["gg"],
        damping_gp=damping["gp"],
        eta=job.grains.rolling_friction * job.lever_m / job.mean_radius_m,
        krot=rolling_stiffness(job.grains),
        moment_gp=job.on_wall.rolling_friction * job.lever_m,
        krot_gp=rolling_stiffness(job.on_wall),
        profile=_listed(profile(job.funnel)),
        around=AROUND,
        plate_side=4.0 * max(job.plate_radius_m, 0.5 * job.funnel.inlet_diameter_m),
    )
    return {"pour.py": text}


def member_masses(job: Job) -> tuple[np.ndarray, np.ndarray]:
    """Shares (M,) of the mass, with sum 1, and the inertia (3,) of each sphere [kg m2] that give the clump the body's.

    The shares have their centre at the origin and no products of inertia, and are as equal as that allows; the inertia
    is the remainder of the body's.
    """
    x, y, z = job.spheres_m[:, :3].T
    size = job.bounding_radius_m
    rows = np.stack([np.ones_like(x), x / size, y / size, z / size, x * y, x * z, y * z])
    rows[4:] /= size**2
    moments = np.zeros(7)
    moments[0] = 1.0
    alike = np.full(len(x), 1.0 / len(x))
    weights = alike + np.linalg.lstsq(rows, moments - rows @ alike, rcond=1e-9)[0]
    squares = np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    return weights, (job.inertia_kg_m2 - job.mass_kg * squares @ weights) / len(x)


def _listed(values: ArrayLike) -> str:
    """Write nested lists of numbers as text of Python."""
    values = np.asarray(values)
    if values.ndim == 1:
        return "[" + ", ".join(f"{value:.9g}" for value in values) + "]"
    return "[\n" + "".join(f"    {_listed(row)},\n" for row in values) + "]"


def _differences(job: Job) -> list[str]:
    """List the differences between YADE and this engine."""
    lines = [
        rolled(job),
        *damped_alone(job),
        undamped_tangent(),
        *limited_friction(job, "kept"),
        "on a facet YADE takes two thirds of a sphere's radius as the effective one: contacts with walls are softer by "
        "18 %",
        "a contact with a wall rolls in its first step with the coefficient of the grains",
    ]
    if job.tension == "keep":
        lines.append("the normal force never pulls, damped as if it could")
    return lines
