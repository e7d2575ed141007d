"""Effect of the time step on restitution and on the responses of a pile: a table of docs/verification.md.

    python benchmarks/time_steps.py [--config config/config.yaml] [--seeds 2]

The restitution is that of two spheres of a berry's volume that meet at 1.4 m/s, the mean over twelve places of the
first contact within a step. The piles have the published representative parameters.
"""

import argparse

import numpy as np

from repose.apparatus import bench
from repose.apparatus.job import run_once
from repose.apparatus.settings import SimulationSettings
from repose.config.study import Study
from repose.core import published
from repose.core.runs import mean_and_error
from repose.core.targets import Targets
from repose.dem import Contact
from repose.verification.machine import berry_simulation

TIME_STEPS_S = (2.9e-5, 5e-5, 1e-4, 2e-4, 2.5e-4, 3e-4, 4e-4, 1e-3)
PHASES = 12  # number of places within a step at which the impact begins
RESTITUTION = 0.2
SPHERE_M = 0.00667  # radius of a sphere of the berry's volume


def restitutions(step_s, **laws):
    """Restitution of each impact at a time step; ValueError if the simulator refuses the step."""
    impacts = []
    for phase in np.arange(PHASES) / PHASES:
        contact, axes = Contact(RESTITUTION, 0.0, 0.0), (SPHERE_M,) * 3
        simulation = berry_simulation(contact, step_s, axes, capacity=2, **laws)
        simulation.add("body", (-0.0068 - 0.7 * phase * step_s, 0.0, 0.0), velocity_m_s=(0.7, 0.0, 0.0))
        simulation.add("body", (0.0068, 0.0, 0.0), velocity_m_s=(-0.7, 0.0, 0.0))
        simulation.run_steps(round(0.1 / step_s))
        impacts.append((simulation.velocities[1, 0] - simulation.velocities[0, 0]) / 1.4)
    return impacts


def runs_of(step_s, study, seeds):
    """Records of the usable runs of the published representative solution, in each target's bench test."""
    changed = {**study.config, "simulation": {**study.config["simulation"], "time_step_s": step_s}}
    parameters = published.representative(study.config["validation"]["published"])
    records = [
        run_once(bench(name), changed, parameters, seed, study.particle, study.grain)[0]
        for name in Targets.of(study.config["targets"]).apparatus
        for seed in range(1, seeds + 1)
    ]
    return [record for record in records if record["status"] == "ok"]


def rows(study, seeds):
    """Yield (time step, quantity, mean, standard error, number of values), or (time step, the refusal)."""
    for step_s in TIME_STEPS_S:
        try:
            bounces = restitutions(step_s, **SimulationSettings.of(study.config).laws)
            runs = runs_of(step_s, study, seeds) if seeds else []
        except ValueError as error:
            yield step_s, str(error)
            continue
        yield step_s, "restitution", *mean_and_error(bounces), len(bounces)
        for response in Targets.of(study.config["targets"]).responses:
            values = [run[response.name] for run in runs if run.get(response.name) is not None]
            yield step_s, response.name, *mean_and_error(values), len(values)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--config", nargs="+", default=["config/config.yaml"])
    parser.add_argument("--seeds", type=int, default=2, help="pours of each time step; 0: impacts alone")
    arguments = parser.parse_args()
    for row in rows(Study.load(*arguments.config), arguments.seeds):
        print(*row, sep="\t", flush=True)


if __name__ == "__main__":
    main()
