"""Mass flow from the rectangular hopper of Anand et al. (2008, Chem. Eng. Sci. 63, 5821), base case of 90 degrees.

    python benchmarks/hopper_rate.py [--seeds N] [--deep]

6,790 spheres of 2.24 mm, 2500 kg/m3, 1 MPa, e 0.94 (wall 0.90), mu 0.2, rolling torque 0.1 mm times the normal
force, over a slot of 25.1 mm in the floor of a box 125.4 mm wide. Published: 81.8 g/s for a depth of 5.6 mm that
repeats itself. Lethe, a code by others, gives 84.9 g/s as a sixth of the flow between walls six times as far apart (its
example `3d-rectangular-hopper`, of which the measures are): `--deep` does that, with 40,740 spheres. By default smooth
walls 5.6 mm apart replace the repetition. The flow is that from 0.25 to 0.75 s after the slot was opened, as there.
"""

import argparse

import numpy as np

from repose.calibrate.runs import mean_and_error
from repose.dem import Contact, Material, Mesh, Motion, Plane, Shape, Simulation

RADIUS_M = 1.12e-3
DENSITY_KG_M3 = 2500.0
HALF_WIDTH_M = 0.06272
HALF_SLOT_M = 0.012544
DEPTH_M = 0.0056
SPHERES = 6790
TIMES_DEEP = 6
TORQUE_M = 1e-4
SETTLED_S = 1.5
FIRST_S = 0.25
LAST_S = 0.75
EVERY_S = 0.05
# The law takes R*, between equal spheres half the radius.
GLASS = Contact(0.94, 0.2, 2 * TORQUE_M / RADIUS_M, twisting_friction=0.0)
WALL = Contact(0.90, 0.2, TORQUE_M / RADIUS_M, twisting_friction=0.0)
SMOOTH = Contact(0.90, 0.0, 0.0)


def scene(seed, deep):
    """The spheres on a lattice above the closed slot."""
    rng = np.random.default_rng(seed)
    depth = DEPTH_M * (TIMES_DEEP if deep else 1)
    count = SPHERES * (TIMES_DEEP if deep else 1)
    below = -0.35
    y = np.array([0.0, 0.0, depth, depth]) + np.array([-1, -1, 1, 1]) * 3 * RADIUS_M

    def panel(x0, x1):
        x = np.array([x0, x1, x1, x0])
        return Mesh(
            np.column_stack([x, y, 0 * x]),
            [[0, 1, 2], [0, 2, 3]],
            "wall",
            edge_radius_m=1e-4,
        )

    material = Material(1e6 / 2.6, 0.3)
    simulation = Simulation(
        {"sphere": Shape.sphere(RADIUS_M, DENSITY_KG_M3, "glass")},
        {"glass": material, "wall": material, "side": material},
        {
            ("glass", "glass"): GLASS,
            ("glass", "wall"): WALL,
            ("glass", "side"): WALL if deep else SMOOTH,
        },
        3e-5,
        capacity=count,
        lower=(-HALF_WIDTH_M, 0.0, below),
        upper=(HALF_WIDTH_M, depth, 0.5),
        walls={
            "front": Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "side"),
            "back": Plane((0.0, depth, 0.0), (0.0, -1.0, 0.0), "side"),
            "left": Plane((-HALF_WIDTH_M, 0.0, 0.0), (1.0, 0.0, 0.0), "wall"),
            "right": Plane((HALF_WIDTH_M, 0.0, 0.0), (-1.0, 0.0, 0.0), "wall"),
            "collector": Plane((0.0, 0.0, below), (0.0, 0.0, 1.0), "wall"),
            "floor_left": panel(-HALF_WIDTH_M - 0.01, -HALF_SLOT_M),
            "floor_right": panel(HALF_SLOT_M, HALF_WIDTH_M + 0.01),
            "gate": panel(-HALF_SLOT_M, HALF_SLOT_M),
        },
        tension="release",
        contact_law="hertz_mindlin_rescaled",
        rolling_law="constant_torque",
    )
    gap = 1.1 * RADIUS_M
    places = np.stack(
        np.meshgrid(
            np.arange(gap - HALF_WIDTH_M, HALF_WIDTH_M - gap, 2 * gap),
            np.arange(gap, depth - gap, 2 * gap),
            np.arange(2 * gap, 0.49, 2 * gap),
            indexing="ij",
        ),
        -1,
    ).reshape(-1, 3)
    places = places[np.argsort(places[:, 2], kind="stable")][:count]
    for place in places + rng.uniform(-0.09, 0.09, places.shape) * RADIUS_M:
        simulation.add("sphere", place)
    return simulation


def flow_g_s(seed, deep):
    """Flow of one run, a sixth of it where the box is six times as deep."""
    simulation = scene(seed, deep)
    simulation.run(SETTLED_S, False)
    simulation.set_motion("gate", Motion((0.0, 2.0, 0.0)))
    simulation.run(FIRST_S, False)
    times = []
    left = []
    while simulation.time_s < SETTLED_S + LAST_S + 1e-9:
        times.append(simulation.time_s)
        left.append(float((simulation.positions[:, 2] < -RADIUS_M).sum()))
        simulation.run(EVERY_S, False)
    mass_g = 1e3 * DENSITY_KG_M3 * 4.0 / 3.0 * np.pi * RADIUS_M**3
    print(
        f"seed {seed}: {simulation.n_bodies} spheres, {left[0]:.0f} to {left[-1]:.0f} have left",
        flush=True,
    )
    return np.polyfit(times, left, 1)[0] * mass_g / (TIMES_DEEP if deep else 1)


def main():
    """Print the flow of each run and the mean."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seeds", type=int, default=4)
    options.add_argument("--deep", action="store_true")
    arguments = options.parse_args()
    mean, error = mean_and_error(
        [flow_g_s(seed, arguments.deep) for seed in range(1, arguments.seeds + 1)]
    )
    print(
        f"{mean:.1f} ± {error or np.nan:.1f} g/s; Anand et al. 81.8, Lethe with --deep 84.9"
    )


if __name__ == "__main__":
    main()
