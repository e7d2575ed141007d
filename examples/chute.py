"""Berries flow down a chute, an inclined plane between two walls, and run out on a level floor."""

import math
from pathlib import Path

import numpy as np
from PIL import Image

from repose.dem import Contact, Material, Plane, Recorder, Shape, Simulation, VtkSeries
from repose.report.renderer.film import animate
from repose.report.renderer.render import render_simulation

OUT = Path("results/examples/chute")
BERRY = (0.0106, 0.0057, 0.0049)  # half axes of a goji berry [m]
SLOPE = math.radians(32.0)
HALF_WIDTH = 0.04
DOWN = np.array([math.cos(SLOPE), 0.0, -math.sin(SLOPE)])
NORMAL = np.array([math.sin(SLOPE), 0.0, math.cos(SLOPE)])


def main(bodies=240, seconds=1.5):
    """Let the bodies flow, and draw where they come to."""
    walls = {
        "slope": Plane((0.0, 0.0, 0.0), NORMAL, "steel"),
        "floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "steel"),
        "left": Plane((0.0, HALF_WIDTH, 0.0), (0.0, -1.0, 0.0), "steel"),
        "right": Plane((0.0, -HALF_WIDTH, 0.0), (0.0, 1.0, 0.0), "steel"),
    }
    simulation = Simulation(
        shapes={"berry": Shape.ellipsoid(BERRY, 840.0, "berry")},
        materials={"berry": Material(4.3e4, 0.32), "steel": Material(1e7, 0.3)},
        contacts={
            ("berry", "berry"): Contact(
                restitution=0.2, static_friction=0.6, rolling_friction=0.03
            ),
            ("berry", "steel"): Contact(
                restitution=0.3, static_friction=0.4, rolling_friction=0.03
            ),
        },
        time_step_s=1e-4,
        capacity=bodies,
        lower=(-0.36, -HALF_WIDTH, 0.0),
        upper=(0.30, HALF_WIDTH, 0.24),
        walls=walls,
    )
    rng = np.random.default_rng(1)
    for k in range(
        bodies
    ):  # loosely stacked at the top of the slope: 3 across, 8 along, 10 high
        across, along, up = k % 3 - 1, k // 3 % 8, k // 24
        place = (
            (-0.38 + 0.022 * along) * DOWN
            + (0.012 + 0.021 * up) * NORMAL
            + np.array([0.0, 0.024 * across, 0.0])
        )
        simulation.add("berry", place, rng.normal(size=4))

    frames = Recorder()
    simulation.run(
        seconds, record=[frames, VtkSeries(OUT / "chute.pvd")], record_every_s=0.05
    )

    view = {"elevation_deg": 16.0, "azimuth_deg": -62.0}
    Image.fromarray(render_simulation(simulation, **view)).save(OUT / "chute.png")
    animate(
        simulation,
        frames.frames(),
        OUT / "chute.gif",
        pictures=24,
        width=400,
        height=240,
        **view,
    )
    print(
        f"{len(frames)} frames in {OUT}; the front is at {1e3 * simulation.positions[:, 0].max():.0f} mm"
    )


if __name__ == "__main__":
    main()
