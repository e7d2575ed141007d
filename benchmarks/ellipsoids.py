"""Twenty ellipsoids fall and settle in peclet-dem and here; before that one turns freely, and one is pressed down.

    python benchmarks/ellipsoids.py --python VENV/bin/python

`VENV` is an environment with `peclet-dem` (pip install peclet-dem), another engine with a Hertz-Mindlin law for bodies
that are no spheres. Prints tables; benchmarks/ellipsoids.md has them. Five minutes of a core, and a minute to compile.
"""

import argparse
import itertools
import json
import os
import subprocess
import time
from pathlib import Path

import numpy as np

from repose.dem import Contact, Material, Plane, Shape, Simulation
from repose.dem.rotations import rotation_matrices

PEER = Path(__file__).with_name("peer_peclet.py")
AXES_M = np.array([0.010, 0.006, 0.005])
DENSITY_KG_M3 = 840.0
MASS_KG = 4.0 / 3.0 * np.pi * AXES_M.prod() * DENSITY_KG_M3
MOMENTS = MASS_KG / 5.0 * (np.sum(AXES_M**2) - AXES_M**2)
YOUNG_PA = 1e7
POISSON = 0.25
RESTITUTION = 0.3
FRICTION = 0.5
GRAVITY = 9.81
HALF_M = 0.022
TOP_M = 0.15
BODIES = 20
STEP_S = 1e-5
OVERLAPS_M = (5e-6, 2e-5, 1e-4)
POINTS = (600, 2400)
SETTLED_S = 0.6
SETTLING_STEP_S = 4e-5
SEEDS = range(1, 4)
UPRIGHT = [[1.0, 0.0, 0.0, 0.0]]
STILL = [[0.0, 0.0, 0.0]]


def theirs(
    python: str, positions, quaternions, turning, steps, **changes
) -> list[dict]:
    """States of peclet-dem after each number of steps."""
    scene = {
        "semi_axes_m": AXES_M.tolist(),
        "mass_kg": MASS_KG,
        "points": POINTS[0],
        "half_width_m": HALF_M,
        "top_m": TOP_M,
        "restitution": RESTITUTION,
        "friction": FRICTION,
        "young_pa": YOUNG_PA,
        "poisson": POISSON,
        "gravity_m_s2": GRAVITY,
        "time_step_s": STEP_S,
        "positions_m": np.asarray(positions).tolist(),
        "quaternions": np.asarray(quaternions).tolist(),
        "angular_velocities_rad_s": np.asarray(turning).tolist(),
        "steps": steps,
    }
    call = [python, str(PEER)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        call,
        input=json.dumps(scene | changes),
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    return [
        {key: np.array(value) for key, value in state.items()}
        for state in json.loads(done.stdout)
    ]


def ours(
    positions, quaternions, turning, gravity: float = GRAVITY, step_s: float = STEP_S
) -> Simulation:
    """The same scene here."""
    sides = {
        side: Plane((HALF_M * x, HALF_M * y, 0.0), (-x, -y, 0.0), "grain")
        for side, x, y in SIDES
    }
    simulation = Simulation(
        {"body": Shape.ellipsoid(AXES_M, DENSITY_KG_M3, "grain")},
        {"grain": Material(YOUNG_PA / (2.0 + 2.0 * POISSON), POISSON)},
        {
            ("grain", "grain"): Contact(
                RESTITUTION, FRICTION, 0.0, twisting_friction=0.0
            )
        },
        step_s,
        capacity=len(positions),
        lower=(-HALF_M, -HALF_M, 0.0),
        upper=(HALF_M, HALF_M, TOP_M),
        walls={"floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "grain"), **sides},
        gravity_m_s2=(0.0, 0.0, -gravity),
        contact_law="hertz_mindlin",
        rolling_law="epsd2",
    )
    for place, quaternion, rates in zip(positions, quaternions, turning, strict=True):
        simulation.add("body", place, quaternion, angular_velocity_rad_s=rates)
    return simulation


SIDES = (("east", 1, 0), ("west", -1, 0), ("north", 0, 1), ("south", 0, -1))


def momentum(quaternions, rates) -> np.ndarray:
    """Angular momentum of each body in space; its angular velocity is in space, too."""
    turned = rotation_matrices(np.asarray(quaternions))
    return np.einsum("nij,j,nkj,nk->ni", turned, MOMENTS, turned, np.asarray(rates))


def energy(positions, velocities, quaternions, rates) -> tuple[float, float]:
    """Potential and kinetic energy of all bodies [J]."""
    spin = np.sum(momentum(quaternions, rates) * rates)
    return MASS_KG * GRAVITY * float(np.sum(positions[:, 2])), 0.5 * float(
        MASS_KG * np.sum(velocities**2) + spin
    )


def hertz_n(overlap_m: float) -> float:
    """Force of the ellipsoid that lies on a plane: Hertz's law with the mean radius of curvature."""
    effective_pa = YOUNG_PA / (1.0 - POISSON**2) / 2.0
    return (
        4.0
        / 3.0
        * effective_pa
        * np.sqrt(AXES_M[0] * AXES_M[1] / AXES_M[2])
        * overlap_m**1.5
    )


def free_rotation(python: str) -> None:
    """Angular momentum and energy of a body that nothing touches, after 0.4 s: how far they changed."""
    rates = [[5.0, 20.0, 0.5]]
    place = [[0.0, 0.0, 0.08]]
    other = theirs(python, place, UPRIGHT, rates, [40_000], gravity_m_s2=0.0)[0]
    here = ours(place, UPRIGHT, rates, gravity=0.0)
    here.run_steps(40_000)
    before = momentum(UPRIGHT, rates)
    energy_before = np.sum(momentum(UPRIGHT, rates) * rates)
    for name, quaternions, after in (
        ("peclet-dem", other["quaternions"], other["angular_velocities_rad_s"]),
        ("repose", here.quaternions, here.angular_velocities),
    ):
        now = momentum(quaternions, after)
        changed = (
            np.linalg.norm(now - before) / np.linalg.norm(before),
            np.sum(now * after) / energy_before - 1.0,
        )
        print(f"| {name} | {100 * changed[0]:.2g} % | {100 * changed[1]:+.2g} % |")


def pressed(python: str) -> None:
    """Force on a body that is pressed into the floor by an overlap, from the first step's change of velocity."""
    for overlap in OVERLAPS_M:
        place = [[0.0, 0.0, AXES_M[2] - overlap]]
        row = []
        here = ours(place, UPRIGHT, STILL)
        here.run_steps(1)
        row.append(MASS_KG * (here.velocities[0, 2] / STEP_S + GRAVITY))
        for points in POINTS:
            state = theirs(python, place, UPRIGHT, STILL, [1], points=points)[0]
            row.append(MASS_KG * (state["velocities_m_s"][0, 2] / STEP_S + GRAVITY))
        print(
            f"| {1e6 * overlap:g} | {hertz_n(overlap):.4f} | "
            + " | ".join(f"{force:.4f}" for force in row)
            + " |"
        )


def start(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Places above the floor, and orientations."""
    rng = np.random.default_rng(seed)
    grid = [
        (x, y, z) for z in range(5) for x, y in itertools.product((-1, 1), repeat=2)
    ][:BODIES]
    return np.array(grid) * (0.0108, 0.0108, 0.022) + (0.0, 0.0, 0.0125), rng.normal(
        size=(BODIES, 4)
    )


def settled(python: str) -> None:
    """Twenty bodies after 0.6 s, by engine and seed; then each state as the other engine takes it."""
    rows: dict[str, list] = {"repose": [], "peclet-dem": []}
    steps = round(SETTLED_S / SETTLING_STEP_S)
    for seed in SEEDS:
        places, quaternions = start(seed)
        quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
        still = np.zeros((BODIES, 3))
        here = ours(places, quaternions, still, step_s=SETTLING_STEP_S)
        here.run_steps(1)
        began = time.process_time()
        here.run_steps(steps - 1)
        took = time.process_time() - began
        there = theirs(
            python, places, quaternions, still, [steps], time_step_s=SETTLING_STEP_S
        )[0]
        rows["repose"].append(
            (
                *energy(
                    here.positions,
                    here.velocities,
                    here.quaternions,
                    here.angular_velocities,
                ),
                np.max(here.positions[:, 2]),
                1e6 * took / steps,
            )
        )
        state = [
            there[key]
            for key in (
                "positions_m",
                "velocities_m_s",
                "quaternions",
                "angular_velocities_rad_s",
            )
        ]
        rows["peclet-dem"].append(
            (
                *energy(*state),
                np.max(state[0][:, 2]),
                1e6 * float(there["processor_s"]) / steps,
            )
        )
        crossed(python, seed, here, there)
    for name, values in rows.items():
        table = np.array(values)
        mean = table.mean(axis=0)
        error = table.std(axis=0, ddof=1) / np.sqrt(len(table))
        print(
            f"| {name} | {1e3 * mean[0]:.3f} ± {1e3 * error[0]:.3f} | {np.median(table[:, 1]):.1e} "
            f"| {1e3 * mean[2]:.1f} ± {1e3 * error[2]:.1f} | {np.median(table[:, 3]):.0f} |"
        )
    ratios = np.array(rows["peclet-dem"])[:, 3] / np.array(rows["repose"])[:, 3]
    print(f"a step there over one here: {np.median(ratios):.1f}")


def crossed(python: str, seed: int, here: Simulation, there: dict) -> None:
    """Contact forces on the bodies of a settled state in either engine, over the weight of one: medians.

    From rest the first step has normal forces alone, so both engines have the same state and no spring of friction.
    """
    still = np.zeros((BODIES, 3))
    up = np.array([0.0, 0.0, GRAVITY])

    def median(velocities):
        return np.median(np.linalg.norm(velocities / STEP_S + up, axis=1)) / GRAVITY

    for name, places, quaternions in (
        ("repose", here.positions.copy(), here.quaternions.copy()),
        ("peclet-dem", there["positions_m"], there["quaternions"]),
    ):
        again = ours(places, quaternions, still)
        again.run_steps(1)
        other = theirs(python, places, quaternions, still, [1])[0]
        print(
            f"| {seed}, {name} | {median(again.velocities):.2f} | {median(other['velocities_m_s']):.2f} |",
            flush=True,
        )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", required=True, help="a Python that has peclet-dem")
    parser.add_argument(
        "--part",
        choices=("free", "pressed", "settled"),
        nargs="+",
        default=("free", "pressed", "settled"),
    )
    asked = parser.parse_args()
    for part in asked.part:
        print(f"\n{part}")
        {"free": free_rotation, "pressed": pressed, "settled": settled}[part](
            asked.python
        )


if __name__ == "__main__":
    main()
