"""Run a bench test of this folder once with goji berries: responses, sketch and film.

    python examples/bench_tests/run.py lifted_cylinder

The sketch, with dimensions, and the film are written to results/examples/.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
import sketches

from repose.bench import bench
from repose.bench.drum import Drum
from repose.config.pipeline import PipelineConfig
from repose.report.renderer import film

FOLDER = Path(__file__).parent
NAMES = sorted(path.stem for path in FOLDER.glob("*.yaml"))


class View(NamedTuple):
    """The view of a film."""

    elevation_deg: float
    azimuth_deg: float
    interval_s: float  # simulated time between two frames


VIEWS = {
    "lifted_cylinder": View(12, -70, 0.1),
    "inclined_plane": View(4, -90, 0.25),
    "drop_test": View(4, -90, 0.004),
    "drawdown": View(4, -90, 0.05),
    "cylinder": View(12, -70, 0.1),
    "discharge": View(8, -90, 0.05),
    "turning": View(4, -90, 0.1),
}


def main(name, out="results/examples", pictures=48, width=420):
    """Run the bench test at the centre of the ranges and write the pictures.

    Returns the measured run.
    """
    study = PipelineConfig.load("config/config.yaml", FOLDER / f"{name}.yaml")
    test = bench(name)
    scene = study.scene(study.parameters.centre, 1)
    view = VIEWS[name]
    run = test.run(scene, view.interval_s)
    measured = test.result(run.record, run.arrays, scene)
    if measured["status"] == "ok":
        print(test.summary.format(**measured))
    else:
        print(measured)

    out = Path(out)
    sketches.draw(name, out / f"{name}.png", study.config)
    simulation = test.build(scene)
    if name == "turning":
        # The caps of the drum are endless planes; the picture shows discs.
        radius_m = Drum.of(test.section(scene.settings)).radius_m
        simulation.walls.planes[:, 6] = radius_m
    all_of_one_shape = np.zeros(len(run.frames["scale"]), int)
    film.animate(
        simulation,
        run.frames | {"shape": all_of_one_shape},
        out / f"{name}.gif",
        pictures,
        elevation_deg=view.elevation_deg,
        azimuth_deg=view.azimuth_deg,
        width=width,
        colour=study.config["colour"],
    )
    return measured


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("name", choices=NAMES)
    main(parser.parse_args().name)
