"""The sand pile of Ai et al. (2011), by rolling law: heights of a pile of 3,000 discs over time.

    python benchmarks/ai_pile.py LAW [--seed N] [--until SECONDS] [--grains N]

Discs are spheres between two smooth planes: 6.9 and 8.9 mm wide (70 and 30 %), 1056 kg/m3, 4 MPa, 0.49, e 0.7,
mu 0.8, mu_r 0.3. They fill a hopper of 50.5 degrees, which opens at 4.5 s. Published heights: elastic-plastic spring
and dashpot (`epsd`) 0.272 m and steady; constant torque 0.242 m at 9.6 s and 0.219 m at 48 s. The outlet here is a
choice, 0.1 m wide and 0.3 m above the floor. 5e9 steps of bodies to 48 s, some six minutes of a core. A line a second.
"""

import argparse

import numpy as np
import viscous  # noqa: F401  registers the law `viscous`

from repose.dem import Contact, Material, Mesh, Motion, Plane, Shape, Simulation
from repose.dem.laws import ROLLING_LAWS

OPENS_S = 4.5
WIDTHS_M = (0.0069, 0.0089)
LARGE_SHARE = 0.3
DEPTH = 0.5 * WIDTHS_M[1]  # half the distance of the planes
HALF_OUTLET = 0.05
OUTLET_HEIGHT = 0.3
HALF_WIDTH = 0.45
SLOPE = np.radians(50.5)
GRAIN = Contact(0.7, 0.8, 0.3)
SMOOTH = Contact(0.7, 0.0, 0.0)


def panel(x0, z0, x1, z1, material="wall"):
    """A flat wall across the gap of the planes, from one point to another; its outside is on the left of the way."""
    y = 3.0 * DEPTH
    corners = [[x0, -y, z0], [x1, -y, z1], [x1, y, z1], [x0, y, z0]]
    return Mesh(np.array(corners), [[0, 1, 2], [0, 2, 3]], material, edge_radius_m=5e-4)


def scene(law, seed, grains):
    """The grains above the closed hopper."""
    rng = np.random.default_rng(seed)
    top = OUTLET_HEIGHT + (HALF_WIDTH - HALF_OUTLET) * np.tan(SLOPE)
    stone = Material(4e6 / 2.98, 0.49)
    simulation = Simulation(
        {
            name: Shape.sphere(0.5 * width, 1056.0, "grain")
            for name, width in zip("sl", WIDTHS_M, strict=True)
        },
        {"grain": stone, "wall": stone, "side": stone},
        {
            ("grain", "grain"): GRAIN,
            ("grain", "wall"): GRAIN,
            ("grain", "side"): SMOOTH,
        },
        3e-5,
        capacity=grains,
        lower=(-0.8, -DEPTH, 0.0),
        upper=(0.8, DEPTH, 1.5),
        walls={
            "floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall"),
            "front": Plane((0.0, -DEPTH, 0.0), (0.0, 1.0, 0.0), "side"),
            "back": Plane((0.0, DEPTH, 0.0), (0.0, -1.0, 0.0), "side"),
            "right": panel(HALF_OUTLET, OUTLET_HEIGHT, HALF_WIDTH, top),
            "left": panel(-HALF_WIDTH, top, -HALF_OUTLET, OUTLET_HEIGHT),
            "upper_right": panel(HALF_WIDTH, top, HALF_WIDTH, 2.0, "side"),
            "upper_left": panel(-HALF_WIDTH, 2.0, -HALF_WIDTH, top, "side"),
            "gate": panel(
                -HALF_OUTLET, OUTLET_HEIGHT, HALF_OUTLET, OUTLET_HEIGHT, "side"
            ),
        },
        tension="release",
        contact_law="hertz_mindlin_rescaled",
        rolling_law=law,
    )
    z = OUTLET_HEIGHT + 0.01
    placed = 0
    while placed < grains:
        reach = (
            min(HALF_WIDTH, HALF_OUTLET + (z - OUTLET_HEIGHT) / np.tan(SLOPE)) - 0.012
        )
        for x in np.arange(-reach, reach, 0.0092)[: grains - placed]:
            shape = "l" if rng.uniform() < LARGE_SHARE else "s"
            simulation.add(shape, (x + rng.uniform(-1e-4, 1e-4), 0.0, z))
            placed += 1
        z += 0.0092
    return simulation


def height(simulation):
    """Highest point of a grain below the outlet."""
    below = simulation.positions[:, 2] < OUTLET_HEIGHT - 0.01
    radii = 0.5 * np.array(WIDTHS_M)[simulation.shape_ids]
    return float((simulation.positions[:, 2] + radii)[below].max(initial=0.0))


def main():
    """Print time, height and kinetic energy."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("law", choices=list(ROLLING_LAWS))
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--until", type=float, default=48.0)
    options.add_argument("--grains", type=int, default=3000)
    arguments = options.parse_args()
    simulation = scene(arguments.law, arguments.seed, arguments.grains)
    simulation.run(min(OPENS_S, arguments.until), False)
    simulation.set_motion("gate", Motion((0.0, 1.0, 0.0)))
    while simulation.time_s < arguments.until - 1e-9:
        simulation.run(min(1.0, arguments.until - simulation.time_s), False)
        energy = simulation.kinetic_energies().sum()
        print(
            f"{simulation.time_s:6.2f} s  {height(simulation):.4f} m  {energy:.2e} J",
            flush=True,
        )


if __name__ == "__main__":
    main()
