"""Run one of the bench tests of this folder once with goji berries: its responses, a sketch with dimensions, a film.

    python examples/bench_tests/run.py lifted_cylinder

The sketch and the film are written to results/examples/.
"""

import argparse
from pathlib import Path

import numpy as np
import sketches

from repose.bench import bench
from repose.bench.drum import Drum
from repose.config.pipeline import PipelineConfig
from repose.report.renderer import film

HERE = Path(__file__).parent
NAMES = sorted(path.stem for path in HERE.glob("*.yaml"))
# Views of the films: elevation and azimuth of the camera in degrees, and simulated time between two frames.
VIEWS = {
    "lifted_cylinder": (12, -70, 0.1),
    "inclined_plane": (4, -90, 0.25),
    "drop_test": (4, -90, 0.004),
    "drawdown": (4, -90, 0.05),
    "cylinder": (12, -70, 0.1),
    "discharge": (8, -90, 0.05),
    "turning": (4, -90, 0.1),
}


def main(name, out="results/examples", pictures=48, width=420):
    """Run the bench test at the centre of the ranges and write the pictures; returns the measured run."""
    study = PipelineConfig.load("config/config.yaml", HERE / f"{name}.yaml")
    test, config = bench(name), study.config
    scene = study.scene(study.parameters.centre, 1)
    elevation, azimuth, interval_s = VIEWS[name]
    run = test.run(scene, interval_s)
    measured = test.result(run.record, run.arrays, scene)
    print(test.summary.format(**measured) if measured["status"] == "ok" else measured)
    out = Path(out)
    sketches.draw(name, out / f"{name}.png", config)
    frames = run.frames | {"shape": np.zeros(len(run.frames["scale"]), int)}
    simulation = test.build(scene)
    if name == "turning":  # its caps are endless planes; the picture has discs
        simulation.walls.planes[:, 6] = Drum.of(test.section(scene.settings)).radius_m
    view = {
        "elevation_deg": elevation,
        "azimuth_deg": azimuth,
        "width": width,
        "colour": config["colour"],
    }
    film.animate(simulation, frames, out / f"{name}.gif", pictures, **view)
    return measured


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("name", choices=NAMES)
    main(parser.parse_args().name)
