"""Berries of many sizes, a truncated normal distribution as sorted fruit has it, fill a cylinder."""

from pathlib import Path

import numpy as np
from PIL import Image
from scipy.stats import truncnorm

from repose.dem import (
    Contact,
    Cylinder,
    Material,
    Plane,
    Recorder,
    Shape,
    Simulation,
    VtkSeries,
)
from repose.report.renderer.film import animate
from repose.report.renderer.render import render_simulation

OUT = Path("results/examples/size_distribution")
SMALLEST, LARGEST, SPREAD = 0.7, 1.4, 0.2  # of the scale about 1
RADIUS = 0.05  # of the cylinder [m]


def main(layers=60, seconds=0.5):
    """Fill the cylinder, and let the bodies settle for some seconds."""
    simulation = Simulation(
        shapes={"berry": Shape.ellipsoid((0.0106, 0.0057, 0.0049), 840.0, "berry")},
        materials={"berry": Material(4.3e4, 0.32), "acrylic": Material(1e7, 0.35)},
        contacts={
            ("berry", "berry"): Contact(
                restitution=0.2, static_friction=0.6, rolling_friction=0.03
            ),
            ("berry", "acrylic"): Contact(
                restitution=0.3, static_friction=0.4, rolling_friction=0.03
            ),
        },
        time_step_s=1e-4,
        capacity=5 * layers,
        lower=(-RADIUS, -RADIUS, 0.0),
        upper=(RADIUS, RADIUS, 0.14),
        walls={
            "floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "acrylic"),
            "shell": Cylinder(
                (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.13, RADIUS, "acrylic"
            ),
        },
        largest_scale=LARGEST,
    )
    rng = np.random.default_rng(3)
    bounds = (SMALLEST - 1.0) / SPREAD, (LARGEST - 1.0) / SPREAD
    scales = truncnorm.rvs(
        *bounds, loc=1.0, scale=SPREAD, size=5 * layers, random_state=rng
    )
    frames = Recorder()
    series = VtkSeries(OUT / "size_distribution.pvd", surfaces=True)
    for layer in np.split(
        scales, layers
    ):  # five berries at a time, on a ring above the cylinder's floor
        turn = rng.uniform(0.0, 2.0 * np.pi)
        for k, scale in enumerate(layer):
            angle = turn + 2.0 * np.pi * k / 5
            place = (0.031 * np.cos(angle), 0.031 * np.sin(angle), 0.115)
            simulation.add(
                "berry", place, rng.normal(size=4), (0.0, 0.0, -0.5), scale=scale
            )
        simulation.run(0.04, progress=False, record=frames, record_every_s=0.1)
    simulation.run(seconds, record=[frames, series], record_every_s=0.1)

    view = {"elevation_deg": 20.0, "azimuth_deg": 20.0}
    Image.fromarray(render_simulation(simulation, height=800, **view)).save(
        OUT / "size_distribution.png"
    )
    animate(
        simulation,
        frames.frames(),
        OUT / "size_distribution.gif",
        pictures=16,
        width=300,
        height=320,
        **view,
    )
    print(
        f"scales {scales.min():.2f} to {scales.max():.2f}, mean {scales.mean():.2f}; pictures in {OUT}"
    )


if __name__ == "__main__":
    main()
