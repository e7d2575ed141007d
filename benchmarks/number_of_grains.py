"""Effect of the number of grains on the angle and the Height of a poured pile: the table of scene_size.py.

    python benchmarks/number_of_grains.py [--config config/config.yaml] [--out number_of_grains.csv]

The scene is scaled as `repose.bench.scene_size.scale_funnel` does it; the parameters are the centre of the ranges. The
tables of several crops together are what that module reads.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench import Scene, bench, scene_size
from repose.bench.funnel import FunnelSettings
from repose.calibrate.runs import mean_and_error
from repose.config.computed import compute_diameter_mm as diameter_mm_of
from repose.config.pipeline import PipelineConfig
from repose.stages.job import run_once

# number of grains: number of pours
GRAINS = {
    62: 32,
    125: 32,
    250: 32,
    500: 32,
    1000: 16,
    2000: 8,
    4000: 6,
    8000: 4,
}
# longest time from the last grain to rest; a pour ends when its pile rests
AFTER_S = 4.0
ANGLES = ("whole", "flank", "secant", "steepest")


def row(study, grains, pours):
    """Means and standard errors of the pours of one number of grains."""
    diameter_mm = diameter_mm_of(study.grain)
    funnel = scene_size.scale_funnel(
        FunnelSettings(**study.config["funnel"]), grains, diameter_mm
    )
    funnel["duration_s"] = grains / funnel["rate_per_s"] + AFTER_S
    config = {**study.config, "funnel": funnel}
    scale = (grains / study.config["funnel"]["berries"]) ** (1 / 3)
    began = time.process_time()
    records = [
        run_once(
            bench("funnel"),
            Scene.of(
                config, study.parameters.centre, study.grain, study.particle, seed
            ),
        )[0]
        for seed in range(1, pours + 1)
    ]
    cost = (time.process_time() - began) / pours
    good = [record for record in records if record["status"] == "ok"]
    values = {
        "label": study.config["label"],
        "grains": grains,
        "scale": scale,
        "pours": len(good),
        "of": pours,
    }
    for name in ANGLES:
        found = [
            record[f"aor_{name}_deg"]
            for record in good
            if record.get(f"aor_{name}_deg") is not None
        ]
        values[f"aor_{name}_deg"], values[f"aor_{name}_se_deg"] = mean_and_error(found)
    heights = np.array([record["height_mm"] for record in good])
    values["height_scaled_mm"], values["height_scaled_se_mm"] = mean_and_error(
        heights / scale
    )
    values["height_grains"] = heights.mean() / diameter_mm
    return values | {"cpu_s": cost}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--config", nargs="+", default=["config/config.yaml"])
    parser.add_argument("--grains", type=int, nargs="+", default=list(GRAINS))
    parser.add_argument("--out", type=Path, default=Path("number_of_grains.csv"))
    arguments = parser.parse_args()
    study = PipelineConfig.load(*arguments.config)
    rows = []
    for grains in arguments.grains:
        rows.append(row(study, grains, GRAINS[grains]))
        pd.DataFrame(rows).to_csv(arguments.out, index=False, float_format="%.4g")
        print(rows[-1], flush=True)


if __name__ == "__main__":
    main()
