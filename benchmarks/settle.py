"""Whether tens of thousands of the default berry settle without trouble: they fall from a loose lattice into a box.

    python benchmarks/settle.py --berries 50000 --threads 2

The body, the time step and the end of a contact are those of config/config.yaml. The bounds of a pour hold. One row a
quarter of a second: motion, the deepest overlaps as shares of a berry's smallest extent, and what the walls carry of
the weight; up to the first row in which the berries rest.
"""

import argparse
import resource
import time

import numpy as np
from beds import LAYERS, SPACING_M, bed

from repose.bench.bounds import Bounded
from repose.config.pipeline import PipelineConfig
from repose.grain import berry as berries
from repose.grain import build

TABLE1 = "resources/published/table1.csv"
# mean energy of motion of a berry at rest: it would lift one by a tenth of a micrometre
REST_J = 1e-9
LONGEST_S = 5.0
ROW_S = 0.25


def default_shape(config):
    """The body of the default berry."""
    section = config["berry"]
    mean = berries.compute_mean_grain(
        section["sizes"], section["compression"], TABLE1, section["density_kg_m3"]
    )[1]
    return build.make_configured_particle(mean, section).dem_shape("berry")


def deepest(overlaps, thickness_m):
    """The largest overlap as a share of the smallest extent."""
    return overlaps.max(initial=0.0) / thickness_m


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--berries", type=int, default=50_000)
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    config = PipelineConfig.load("config/config.yaml").config
    settings = config["simulation"]
    began = time.process_time()
    simulation = bed(
        default_shape(config),
        arguments.berries,
        settings["time_step_s"],
        0,
        arguments.threads,
        tension=settings["tension"],
    )
    bounded = Bounded(simulation, LAYERS * SPACING_M)
    weight = 9.81 * simulation.masses_kg.sum()
    print(
        "time_s  mean_J    fastest_m_s  berries  walls   carried/weight  contacts/berry  CPU_s"
    )
    energy = np.inf
    while energy > REST_J and simulation.time_s < LONGEST_S:
        bounded.run_to(simulation.steps + round(ROW_S / settings["time_step_s"]))
        bounded.check()
        energy = simulation.kinetic_energies().mean()
        between = deepest(simulation.overlaps()[1], bounded.thickness_m)
        at_walls = deepest(simulation.wall_overlaps()[2], bounded.thickness_m)
        carried = (
            -sum(load.force_n[2] for load in simulation.wall_loads().values()) / weight
        )
        contacts = 2 * len(simulation.contacts()) / arguments.berries
        fastest = np.linalg.norm(simulation.velocities, axis=1).max()
        print(
            f"{simulation.time_s:6.2f}  {energy:.2e}  {fastest:11.4f}  {between:7.4f}  {at_walls:6.4f}"
            f"  {carried:14.5f}  {contacts:14.2f}  {time.process_time() - began:5.0f}",
            flush=True,
        )
    lost = arguments.berries - int(np.sum(simulation.present))
    outside = int(
        np.sum(
            np.any(
                (simulation.positions < 0) | (simulation.positions > simulation.upper),
                axis=1,
            )
        )
    )
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"at rest: {energy <= REST_J}; gone: {lost}; outside of the box: {outside}; {memory:.0f} MB"
    )


if __name__ == "__main__":
    main()
