"""Berries and clay balls fall into a box and make a mixed bed: two shapes, two materials, three kinds of contacts."""

from pathlib import Path

import numpy as np
from PIL import Image

from repose.dem import Contact, Material, Plane, Shape, Simulation, VtkSeries
from repose.report.renderer.render import render_simulation

OUT = Path("results/examples/mixed_bed")
HALF = 0.05  # of the box [m]


def main(bodies=400, seconds=1.6):
    """Fill the box, and count the contacts."""
    walls = {"floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "glass")}
    for name, x, y in (
        ("east", 1, 0),
        ("west", -1, 0),
        ("north", 0, 1),
        ("south", 0, -1),
    ):
        walls[name] = Plane((x * HALF, y * HALF, 0.0), (-x, -y, 0.0), "glass")
    simulation = Simulation(
        shapes={
            "berry": Shape.ellipsoid((0.0106, 0.0057, 0.0049), 840.0, "berry"),
            "ball": Shape.sphere(0.007, 1800.0, "clay"),
        },
        materials={
            "berry": Material(4.3e4, 0.32),
            "clay": Material(2e6, 0.25),
            "glass": Material(
                2e6, 0.25
            ),  # softer than glass is, for a longer time step
        },
        contacts={
            ("berry", "berry"): Contact(
                restitution=0.2, static_friction=0.6, rolling_friction=0.03
            ),
            ("berry", "clay"): Contact(
                restitution=0.3, static_friction=0.5, rolling_friction=0.02
            ),
            ("clay", "clay"): Contact(
                restitution=0.6, static_friction=0.4, rolling_friction=0.01
            ),
            ("berry", "glass"): Contact(
                restitution=0.3, static_friction=0.4, rolling_friction=0.02
            ),
            ("clay", "glass"): Contact(
                restitution=0.6, static_friction=0.3, rolling_friction=0.01
            ),
        },
        time_step_s=5e-5,
        capacity=bodies,
        lower=(-HALF, -HALF, 0.0),
        upper=(HALF, HALF, 0.09),
        walls=walls,
    )
    rng = np.random.default_rng(2)
    spots = 0.024 * (np.arange(4) - 1.5)
    for k in range(bodies):  # layers of 4 x 4, every third body a ball
        layer, place = divmod(k, 16)
        xy = spots[[place % 4, place // 4]] + rng.uniform(-0.001, 0.001, 2)
        simulation.add(
            "ball" if rng.random() < 1 / 3 else "berry",
            (*xy, 0.015 + 0.023 * layer),
            rng.normal(size=4),
        )

    simulation.run(seconds, record=VtkSeries(OUT / "mixed_bed.pvd"), record_every_s=0.1)

    picture = render_simulation(
        simulation, elevation_deg=38.0, azimuth_deg=25.0, width=800, height=640
    )
    Image.fromarray(picture).save(OUT / "mixed_bed.png")
    pairs = simulation.shape_ids[simulation.contacts()]
    unlike = np.mean(pairs[:, 0] != pairs[:, 1])
    print(
        f"{len(pairs)} contacts, {100 * unlike:.0f} % of them between a berry and a ball; pictures in {OUT}"
    )


if __name__ == "__main__":
    main()
