"""Grains and jobs that the tests of the decks share."""

import numpy as np

from repose.bench.space import contact_space
from repose.common.places import find_file
from repose.export.job import make_job
from repose.grain.particle import Particle

CONFIG = str(find_file("config/quick.yaml"))
MM = 1e-3
BERRY = {"shear_modulus_pa": 43004.8, "poisson_ratio": 0.32, "density_kg_m3": 840.47}


def clump(spheres_mm):
    spheres = MM * np.asarray(spheres_mm, float)
    reach = float(np.max(np.linalg.norm(spheres[:, :3], axis=1) + spheres[:, 3]))
    inertia = np.array([1.55e-8, 4.08e-8, 4.30e-8])
    body = (
        "multisphere",
        np.zeros((0, 3)),
        840.47,
        1.488e-6,
        1.25e-3,
        inertia,
        reach,
        0.0,
        0.0,
    )
    return Particle(*body, spheres_m=spheres)


THREE = clump([[0.0, 0.0, 0.0, 5.5], [-5.5, 0.0, 0.0, 5.2], [5.5, 0.0, 0.0, 5.2]])
LARGE = [
    [0.8, 0.8, 0.1, 5.1],
    [-5.5, 0.0, 0.0, 4.9],
    [5.5, 0.0, 0.0, 4.9],
    [2.4, -0.8, 0.0, 5.1],
]
SKEW = clump(
    [
        *LARGE,
        [-3.2, 0.8, 0.0, 5.0],
        [-2.4, -0.8, -0.1, 5.1],
        [1.0, 0.2, 0.6, 5.0],
        [0.5, -0.3, -0.6, 5.0],
    ]
)
BALL = clump([[0.0, 0.0, 0.0, 5.0]])


def job_of(
    config,
    particle,
    contact_law="hertz_mindlin_rescaled",
    rolling_law="budget",
    berry=BERRY,
    **values,
):
    simulation = config["simulation"] | {
        "contact_law": contact_law,
        "rolling_law": rolling_law,
    }
    centre = contact_space(config["parameters"]).centre
    return make_job(
        config | {"simulation": simulation}, centre | values, particle, berry
    )
