"""The deck of YADE: spheres or clumps among facets."""

import math

import numpy as np
from numpy.typing import ArrayLike

from repose.export.job import Job
from repose.export.laws import rolling_stiffness
from repose.export.surface import AROUND, profile
from repose.export.template import filled, head, numbers


def deck(job: Job) -> dict[str, str]:
    """Write the file of a YADE run by name: pour.py."""
    weights, inertia = member_masses(job)
    words = {"head": head(job, "# ", "yade"), "around": AROUND}
    lists = {
        "spheres": job.particle.spheres_m,
        "masses": weights * job.particle.mass_kg,
        "inertia": inertia,
    }
    words |= {
        name: _listed(values)
        for name, values in (lists | {"profile": profile(job.surfaces)}).items()
    }
    values = {  # sqrt(5/6) beta is the damping over the critical damping
        **{
            f"damping_{name}": math.sqrt(5.0 / 6.0) * pair.damping_ratio
            for name, pair in job.pairs.items()
        },
        "eta": job.grains.rolling_friction * job.lever_m / job.mean_radius_m,
        "krot": rolling_stiffness(job.grains),
        "moment_gp": job.on_wall.rolling_friction * job.lever_m,
        "krot_gp": rolling_stiffness(job.on_wall),
        "plate_side": 4.0
        * max(job.plate_radius_m, 0.5 * job.surfaces.inlet_diameter_m),
    }
    return {"pour.py": filled("yade.py.txt", job, **words, **values)}


def member_masses(job: Job) -> tuple[np.ndarray, np.ndarray]:
    """Find the shares (M,) of the mass and the inertia (3,) of each sphere [kg m2] that give the clump the body's.

    The shares, whose sum is 1, have their centre at the origin and no products of inertia, and are as equal as that
    allows; the inertia is the remainder of the body's.
    """
    x, y, z = job.particle.spheres_m[:, :3].T
    size = job.particle.bounding_radius_m
    rows = np.stack(
        [np.ones_like(x), x / size, y / size, z / size, x * y, x * z, y * z]
    )
    rows[4:] /= size**2
    moments = np.zeros(7)
    moments[0] = 1.0
    alike = np.full(len(x), 1.0 / len(x))
    weights = alike + np.linalg.lstsq(rows, moments - rows @ alike, rcond=1e-9)[0]
    squares = np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    return weights, (
        job.particle.inertia_kg_m2 - job.particle.mass_kg * squares @ weights
    ) / len(x)


def _listed(values: ArrayLike) -> str:
    """Write nested lists of numbers as text of Python."""
    values = np.asarray(values)
    if values.ndim == 1:
        return f"[{numbers(values, ', ')}]"
    return "[\n" + "".join(f"    {_listed(row)},\n" for row in values) + "]"
