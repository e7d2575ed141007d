"""The time of a step with `jkr` over that of the dry law: 500 berries settled in a cylinder, in alternating runs.

    python benchmarks/cohesive_step.py

CPU time of the process, so a busy machine matters little. Both simulations have the places of the dry pile.
"""

import time

import numpy as np

from repose.common.provenance import machine
from repose.dem import (
    Contact,
    Cylinder,
    Material,
    Plane,
    Shape,
    Simulation,
    random_quaternion,
)

RUNS = 9
STEPS = 2000
LAWS = {
    "hertz_mindlin_rescaled": {},
    "jkr": {"surface_energy_j_m2": 0.02},
    "sjkr": {"cohesion_energy_density_j_m3": 2000.0},
}


def simulation(law):
    """500 berries of the mean axes above the floor of a cylinder."""
    rng = np.random.default_rng(1)
    contact = Contact(0.25, 0.55, 0.045, constants=LAWS[law])
    berry = Shape.ellipsoid(np.array([0.02114, 0.01137, 0.00988]) / 2.0, 840.0, "berry")
    s = Simulation(
        {"berry": berry},
        {"berry": Material(4.3e4, 0.32), "wall": Material(1.12e9, 0.4)},
        {("berry", "berry"): contact, ("berry", "wall"): contact},
        2e-4,
        capacity=500,
        lower=(-0.06, -0.06, 0.0),
        upper=(0.06, 0.06, 0.6),
        walls={
            "floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall"),
            "cylinder": Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2.0, 0.05, "wall"),
        },
        tension="release",
        contact_law=law,
    )
    for number in range(500):
        angle = 0.4 * np.pi * number
        place = (
            0.03 * np.cos(angle),
            0.03 * np.sin(angle),
            0.012 + 0.0225 * (number // 5),
        )
        s.add("berry", place, random_quaternion(rng))
    s.run(3.0, False)
    return s


def main():
    """Print the microseconds of a step and the ratio."""
    scenes = {law: simulation(law) for law in LAWS}
    took = {law: [] for law in LAWS}
    for _ in range(RUNS):
        for law, s in scenes.items():
            began = time.process_time()
            s.run_steps(STEPS)
            took[law].append(1e6 * (time.process_time() - began) / STEPS)
    dry = np.array(took["hertz_mindlin_rescaled"])
    print(machine()["processor"])
    for law, times in took.items():
        ratio = np.array(times) / dry
        contacts = len(scenes[law].contacts())
        print(
            f"{law}: {contacts} contacts, {np.median(times):.1f} us a step, {np.median(ratio):.2f} times the dry one"
        )


if __name__ == "__main__":
    main()
