"""Angle of repose on a plate whose sides open, beside the formula of Zhou et al. (2002, Powder Technol. 125, 45).

    python benchmarks/plate_discharge.py [--until SECONDS] [--cores N]

Spheres lie between two gates on a plate 0.9 m wide, 0.4 m above the floor of a box of 1 x 0.2 x 1 m; the gates open and
half of the spheres fall past the plate. 2400 kg/m3, 1 MPa, e 0.9, mu 0.2, constant torque with mu_r 0.1. With the
diameter and mu_r times the diameter in mm the formula is

    phi = 68.61 mu_pp^0.27 mu_pw^0.22 mu_r,pp^0.06 mu_r,pw^0.12 d^-0.2,

19.67 degrees for 10 mm. Three diameters have the rolling friction of 1 mm, so that the diameter alone changes; three
frictions, of grains and walls alike, are at 14 mm. Set-up: Lethe's example `3d-plate-discharge`. The angle is that of
lines through the highest spheres at |x| from 0.15 to 0.35 m, mean of both sides.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise

import numpy as np

from repose.calibrate.runs import mean_and_error
from repose.dem import Contact, Material, Mesh, Motion, Plane, Shape, Simulation

HALF_PLATE_M = 0.45
HALF_BOX_M = 0.5
DEPTH_M = 0.2
PLATE_M = 0.4
TOP_M = 1.2
SPHERES_OF_10_MM = 52_000
OPENS_S = 0.75
BINS = 10
TORQUE_MM = 1.0
CASES = {  # diameter [mm], friction, seeds
    "10 mm": (10.0, 0.2, 1),
    "14 mm": (14.0, 0.2, 2),
    "20 mm": (20.0, 0.2, 3),
    "14 mm, mu 0.1": (14.0, 0.1, 2),
    "14 mm, mu 0.4": (14.0, 0.4, 2),
}


def formula(diameter_mm, friction, torque_mm=TORQUE_MM):
    """Zhou's angle with equal coefficients for grains and walls [degrees]."""
    return 68.61 * friction**0.49 * torque_mm**0.18 * diameter_mm**-0.2


def panel(corners, material):
    """A flat wall of four corners."""
    return Mesh(np.array(corners), [[0, 1, 2], [0, 2, 3]], material, edge_radius_m=5e-4)


def scene(diameter_mm, friction, seed):
    """The spheres on a lattice between the gates."""
    rng = np.random.default_rng(seed)
    d = 1e-3 * diameter_mm
    contact = Contact(0.9, friction, TORQUE_MM / diameter_mm, twisting_friction=0.0)
    stone = Material(1e6 / 2.6, 0.3)
    y = (-0.05, DEPTH_M + 0.05)
    plate = [
        (x, side, PLATE_M)
        for x, side in zip((-1, 1, 1, -1), (y[0], y[0], y[1], y[1]), strict=True)
    ]
    walls = {
        "floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall"),
        "front": Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "wall"),
        "back": Plane((0.0, DEPTH_M, 0.0), (0.0, -1.0, 0.0), "wall"),
        "left": Plane((-HALF_BOX_M, 0.0, 0.0), (1.0, 0.0, 0.0), "wall"),
        "right": Plane((HALF_BOX_M, 0.0, 0.0), (-1.0, 0.0, 0.0), "wall"),
        "plate": panel([(HALF_PLATE_M * x, side, z) for x, side, z in plate], "wall"),
    }
    for name, x in (("gate_left", -HALF_PLATE_M), ("gate_right", HALF_PLATE_M)):
        corners = [
            (x, y[0], PLATE_M),
            (x, y[1], PLATE_M),
            (x, y[1], TOP_M),
            (x, y[0], TOP_M),
        ]
        walls[name] = panel(corners, "wall")
    count = round(SPHERES_OF_10_MM * (10.0 / diameter_mm) ** 3)
    simulation = Simulation(
        {"sphere": Shape.sphere(0.5 * d, 2400.0, "grain")},
        {"grain": stone, "wall": stone},
        {("grain", "grain"): contact, ("grain", "wall"): contact},
        1.4e-5 * diameter_mm,
        capacity=count,
        lower=(-HALF_BOX_M, 0.0, 0.0),
        upper=(HALF_BOX_M, DEPTH_M, TOP_M),
        walls=walls,
        tension="release",
        contact_law="hertz_mindlin_rescaled",
        rolling_law="constant_torque",
    )
    gap = 1.04 * d
    columns = (
        np.arange(-HALF_PLATE_M + 0.55 * d, HALF_PLATE_M - 0.55 * d, gap),
        np.arange(0.52 * d, DEPTH_M - 0.52 * d, gap),
        np.arange(PLATE_M + 0.55 * d, TOP_M - 0.6 * d, gap),
    )
    places = np.stack(np.meshgrid(*columns, indexing="ij"), -1).reshape(-1, 3)
    places = places[np.argsort(places[:, 2], kind="stable")][:count]
    for place in places + rng.uniform(-0.015, 0.015, places.shape) * d:
        simulation.add("sphere", place)
    return simulation


def angle_deg(positions):
    """Slope of the lines through the highest spheres, mean of both sides."""
    slopes = []
    edges = np.linspace(0.15, 0.35, BINS + 1)
    for side in (-1.0, 1.0):
        x = side * positions[:, 0]
        z = positions[:, 2]
        on = z > PLATE_M
        tops = [z[on & (x >= a) & (x < b)].max() for a, b in pairwise(edges)]
        slopes.append(-np.polyfit(0.5 * (edges[1:] + edges[:-1]), tops, 1)[0])
    return float(np.degrees(np.arctan(slopes)).mean())


def run(job):
    """Mean angle in the last second of a case and a seed."""
    (diameter_mm, friction, _), seed, until_s = job
    simulation = scene(diameter_mm, friction, seed)
    simulation.run(OPENS_S, False)
    for gate in ("gate_left", "gate_right"):
        simulation.set_motion(gate, Motion((0.0, 2.0, 0.0)))
    simulation.run(until_s - 1.0 - OPENS_S, False)
    angles = []
    for _ in range(5):
        simulation.run(0.2, False)
        angles.append(angle_deg(simulation.positions))
    return float(np.mean(angles))


def main():
    """Print the table and the exponents of diameter and friction."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--until", type=float, default=6.75)
    options.add_argument("--cores", type=int, default=2)
    arguments = options.parse_args()
    jobs = [
        (case, seed, arguments.until)
        for case in CASES.values()
        for seed in range(1, case[2] + 1)
    ]
    with ProcessPoolExecutor(arguments.cores) as pool:
        found = list(pool.map(run, jobs))
    print(
        "| case | spheres | runs | angle, deg | formula, deg |\n|---|---|---|---|---|"
    )
    means = {}
    for name, case in CASES.items():
        angles = [
            value for (of, *_), value in zip(jobs, found, strict=True) if of == case
        ]
        mean, error = mean_and_error(angles)
        means[name] = mean
        count = round(SPHERES_OF_10_MM * (10.0 / case[0]) ** 3)
        shown = f"{mean:.2f} ± {error:.2f}" if error else f"{mean:.2f}"
        print(
            f"| {name} | {count:,} | {len(angles)} | {shown} | {formula(*case[:2]):.2f} |",
            flush=True,
        )
    for what, k, names, expected in (
        ("diameter", 0, ("10 mm", "14 mm", "20 mm"), -0.2),
        ("friction", 1, ("14 mm, mu 0.1", "14 mm", "14 mm, mu 0.4"), 0.49),
    ):
        points = []
        for name in names:
            for (case, *_), value in zip(jobs, found, strict=True):
                if case == CASES[name]:
                    points.append((np.log(case[k]), value))
        x, y = np.array(points).T
        (slope, _), covariance = np.polyfit(x, np.log(y), 1, cov=True)
        print(
            f"exponent of the {what}: {slope:.3f} ± {np.sqrt(covariance[0, 0]):.3f}; formula {expected:g}"
        )


if __name__ == "__main__":
    main()
