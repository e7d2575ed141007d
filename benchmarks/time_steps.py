"""Effect of the time step on hits and on the responses of a pile: tables of docs/verification.md.

    python benchmarks/time_steps.py [--config config/config.yaml] [--seeds 2] [--pairs 0]

The restitution is that of two spheres of a berry's volume that meet at 1.4 m/s, the mean over twelve places of the
first contact within a step. Of a sphere that hits a rigid plane at 5 to 70 degrees from the normal (the angles of
test 4 of Chung and Ooi 2011), in as many steps a contact: the largest error of the tangential velocity, over the normal
one, against the equation of the spring where it sticks and Coulomb's mu (1 + e) V_n where it slides. `--pairs`: hits of
two berries, the largest energy after a hit over that before, with friction, and the mean without friction and damping.
The piles have the published representative parameters.
"""

import argparse
import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from verification.hertz import ALUMINIUM_OXIDE, Solid, hertz_on_plane
from verification.simulations import grain_simulation, impact
from verification.sliding import slides, sliding_loss, velocity_after_hit
from verification.throws import throw_pairs

from repose.bench import Scene, bench
from repose.bench.settings import SimulationSettings
from repose.calibrate.runs import mean_and_error
from repose.calibrate.targets import Targets
from repose.config.pipeline import PipelineConfig
from repose.dem import Contact
from repose.stages import published
from repose.stages.job import run_once

TIME_STEPS_S = (2.9e-5, 5e-5, 1e-4, 2e-4, 2.7e-4, 3.4e-4, 4.5e-4, 4.9e-4, 1e-3)
ANGLES_DEG = (5, 20, 30, 50, 70)  # from the normal
PHASES = 12  # number of places within a step at which the impact begins
RESTITUTION = 0.2
SPHERE_M = 0.00667  # radius of a sphere of the berry's volume
# Young's modulus: 2 (1 + nu) times the shear modulus of 4.3e4 Pa
SOFT = Solid("berry", 1.1352e5, 0.32, 840.47)


def restitutions(step_s, **laws):
    """Restitution of each impact at a time step; ValueError if the simulator refuses the step."""
    impacts = []
    for phase in np.arange(PHASES) / PHASES:
        contact = Contact(RESTITUTION, 0.0, 0.0)
        axes = (SPHERE_M,) * 3
        simulation = grain_simulation(contact, step_s, axes, capacity=2, **laws)
        simulation.add(
            "body",
            (-0.0068 - 0.7 * phase * step_s, 0.0, 0.0),
            velocity_m_s=(0.7, 0.0, 0.0),
        )
        simulation.add("body", (0.0068, 0.0, 0.0), velocity_m_s=(-0.7, 0.0, 0.0))
        simulation.run_steps(round(0.1 / step_s))
        impacts.append(
            (simulation.velocities[1, 0] - simulation.velocities[0, 0]) / 1.4
        )
    return impacts


def oblique_errors(step_s, laws):
    """Largest error of the tangential velocity of hits that stick and of hits that slide, over the normal velocity."""
    contact_time_s = hertz_on_plane(SOFT, SPHERE_M, 2.0).duration_s
    contact = Contact(0.98, 0.092, 0.0)
    radius_m = 2.5e-3
    speed_m_s = 3.9
    errors = {"sticks": 0.0, "slides": 0.0}
    for degrees in ANGLES_DEG:
        normal = speed_m_s * math.cos(math.radians(degrees))
        along = speed_m_s * math.sin(math.radians(degrees))
        velocity, _ = impact(
            ALUMINIUM_OXIDE,
            radius_m,
            contact,
            (along, 0.0, -normal),
            steps_per_contact=contact_time_s / step_s,
            **laws,
        )
        if slides(contact, normal, along):
            kind = "slides"
            expected = along - sliding_loss(contact, normal)
        else:
            kind = "sticks"
            hertz = hertz_on_plane(ALUMINIUM_OXIDE, radius_m, normal)
            expected = velocity_after_hit(ALUMINIUM_OXIDE, hertz, contact, along, laws)
        errors[kind] = max(errors[kind], abs(velocity[0] - expected) / normal)
    return errors


def energies(step_s, pairs, **laws):
    """Largest energy after a hit of two berries over that before, with friction; mean without friction and damping."""
    rng = np.random.default_rng(5)
    lossy = []
    elastic = []
    while sum(map(len, lossy)) < pairs:
        contact = Contact(rng.uniform(0.1, 0.6), rng.uniform(0.2, 0.8), 0.0)
        lossy.append(throw_pairs(rng, contact, step=step_s, **laws).last)
        elastic_contact = Contact(1.0, 0.0, 0.0)
        elastic.append(throw_pairs(rng, elastic_contact, step=step_s, **laws).last)
    return np.concatenate(lossy), np.concatenate(elastic)


def runs_of(step_s, study, seeds):
    """Records of the usable runs of the published representative solution, in each target's bench test."""
    changed = {
        **study.config,
        "simulation": {**study.config["simulation"], "time_step_s": step_s},
    }
    parameters = published.read_representative(study.config["validation"]["published"])
    records = [
        run_once(
            bench(name),
            Scene.of(changed, parameters, study.grain, study.particle, seed),
        )[0]
        for name in Targets.of(study.config["targets"]).apparatus
        for seed in range(1, seeds + 1)
    ]
    return [record for record in records if record["status"] == "ok"]


def rows(study, seeds, pairs):
    """Yield (time step, quantity, mean, standard error, number of values), or (time step, the refusal)."""
    laws = SimulationSettings.model_validate(study.config["simulation"]).laws
    for step_s in TIME_STEPS_S:
        try:
            bounces = restitutions(step_s, **laws)
            errors = oblique_errors(step_s, laws)
            lossy, elastic = energies(step_s, pairs, **laws) if pairs else ([], [])
            runs = runs_of(step_s, study, seeds) if seeds else []
        except ValueError as error:
            yield step_s, str(error)
            continue
        yield step_s, "restitution", *mean_and_error(bounces), len(bounces)
        yield (
            step_s,
            "error of hits that stick, slide",
            *(f"{errors[kind]:.4f}" for kind in errors),
        )
        if pairs:
            yield (
                step_s,
                "largest energy left, with friction",
                np.max(lossy),
                len(lossy),
            )
            yield (
                step_s,
                "energy left, elastic: mean, largest",
                np.mean(elastic),
                np.max(elastic),
                len(elastic),
            )
        for response in Targets.of(study.config["targets"]).responses:
            values = [
                run[response.name] for run in runs if run.get(response.name) is not None
            ]
            yield step_s, response.name, *mean_and_error(values), len(values)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--config", nargs="+", default=["config/config.yaml"])
    parser.add_argument(
        "--seeds", type=int, default=2, help="pours of each time step; 0: impacts alone"
    )
    parser.add_argument(
        "--pairs", type=int, default=0, help="hits of two berries of each time step"
    )
    arguments = parser.parse_args()
    for row in rows(
        PipelineConfig.load(*arguments.config), arguments.seeds, arguments.pairs
    ):
        print(*row, sep="\t", flush=True)


if __name__ == "__main__":
    main()
