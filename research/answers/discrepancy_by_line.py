"""How the posterior of `goji_berry` depends on the lines whose models give the discrepancy.

    python -m research.answers.discrepancy_by_line

The shape study measured each of its models by six lines. The posterior takes the scatter over all models and lines as
the discrepancy. This script takes the models of one line at a time. A row for each line, and one for all: the
discrepancy, and the information and the intervals that the posterior then has.
"""

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from repose.calibrate import training
from repose.calibrate.uncertainty import discrepancy, implausibility, noise, posterior
from repose.calibrate.uncertainty.likelihood import make_observation
from repose.config.pipeline import PipelineConfig

ROOT = Path(__file__).parents[2]
RUN = ROOT / "results" / "published" / "goji_berry"
SHAPE_STUDY = ROOT / "resources" / "shape_study.csv"
OUT = Path(__file__).with_suffix(".csv")
ALL_LINES = "all six"


def discrepancy_of(combinations, targets):
    """The discrepancy by the models of some rows of the shape study."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "combinations.csv"
        combinations.to_csv(path, index=False)
        return discrepancy.estimate_from_shape_study(path, targets)


def main():
    study = PipelineConfig.load(ROOT / "config" / "config.yaml")
    targets = study.targets
    runs = noise.read_runs(RUN / "runs.csv", targets)
    model = training.restore_surrogate(
        RUN / "network/network.json",
        RUN / "network/predictions.csv",
        RUN / "dataset.csv",
    )
    points = implausibility.PriorPoints(model, study.parameters)
    measured = posterior.make_measurement(targets, runs, study.settings.posterior)

    def observe(percent, correlation):
        stated = discrepancy.compute_stated_covariance(
            targets, runs, percent, correlation
        )
        return make_observation(targets, measured.correlation, stated)

    combinations = pd.read_csv(SHAPE_STUDY)
    tables = {ALL_LINES: combinations}
    tables |= dict(tuple(combinations.groupby("definition")))
    rows = []
    for line, of_line in tables.items():
        found = discrepancy_of(of_line, targets)
        observed = make_observation(targets, measured.correlation, found.covariance)
        # The last row of the curve belongs to the given observation.
        last = implausibility.compute_information_curve(
            points, targets, observe, observed
        ).iloc[-1]
        angle_deg, height_mm = np.sqrt(np.diag(found.covariance))
        rows.append(
            {
                "line": line,
                "models": found.models,
                "aor_mean_deg": found.mean[0],
                "height_mean_mm": found.mean[1],
                "aor_sd_deg": angle_deg,
                "height_sd_mm": height_mm,
                **last.drop(["discrepancy_percent", "evidence"]),
            }
        )
    pd.DataFrame(rows).to_csv(OUT, index=False, float_format="%.6g")


if __name__ == "__main__":
    main()
