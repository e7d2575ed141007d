"""The report of a study with a simulator of the user's own."""

import os

import pandas as pd

from repose.chain.answer import WITHIN
from repose.pictures.report import page
from repose.pictures.report.study import Study
from repose.studies.calibration import Calibration


def write(found: Calibration, out_path: str | os.PathLike) -> None:
    """Write the report."""
    study, targets = found.study, found.study.targets
    row = {"role": "representative", "reason": ""}
    row |= dict(zip(targets.predicted, found.mean.tolist(), strict=True))
    chance: dict[str, float | None] = dict.fromkeys(targets.names)
    shown = Study(
        config={"label": study.config["label"], "small_run": False},
        targets=targets,
        space=study.parameters,
        files={},
        answer=found.values,
        row=pd.Series(row),
        chance=chance | {"all": found.probability["inside"]},
        within={percent: found.probability[column] for percent, column in WITHIN.items()},
        posterior=found.posterior.parameters.set_index("parameter"),
        surrogate=found.model,
        feasible=found.solutions,
        table4=found.solutions[:1],
        dataset=found.samples,
        summary=found.summary,
        metrics={},
        dataset_summary={},
    )
    tables = {"Simulated samples": found.samples, "Parameter sets found": found.solutions}
    page.write_study(shown, tables, out_path)
