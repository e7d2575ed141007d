"""The files of a finished study, read for its report."""

import json
import os
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from typing import Any

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS
from repose.calibrate.chance import PERCENT, chance_of_meeting
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.sequential.kriging import Kriging, SpaceKriging
from repose.calibrate.strategies.sequential.strategy import observed_of
from repose.calibrate.surrogates import load
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.targets import Targets
from repose.common import attached, provenance
from repose.common.errors import require
from repose.common.files import read_json, read_table
from repose.report.page.html import own
from repose.report.shown import Config, Shown
from repose.stages.batches import data_of
from repose.stages.dataset import read_job
from repose.stages.tables import read_dataset, read_runs

Files = Mapping[str, str]  # paths by name

# Names of the inputs: required files, and files that the report shows if they exist.
NEEDED = ("dataset", "feasible", "summary", "table4")
# Also needed if the summary does not hold the steps to the answer.
TRAINED = ("network", "metrics", "dataset_summary")
OPTIONAL = (
    "runs",
    "posterior",
    "particle",
    "trajectory",
    "photograph",
    "overlay",
    "card",
)
CAPTIONS: dict[str, dict[str, str]] = json.loads(
    own("captions.json")
)  # of pictures of a study, by name
PICTURES = CAPTIONS["study"]


@dataclass
class Results:
    """The results of a study, for its report."""

    shown: Shown
    row: pd.Series  # the representative parameter set in table4.csv
    chance: dict[str, float | None]  # from `chance_of_meeting`
    within: dict[
        float, float | None
    ]  # probability that all responses lie within so many percent of their targets
    posterior: pd.DataFrame | None  # posterior.csv by parameter
    surrogate: Predictor | None  # None without a model of the whole ranges
    feasible: pd.DataFrame
    table4: pd.DataFrame
    dataset: pd.DataFrame
    summary: Mapping[str, Any]  # with ``steps`` if the strategy reports its own course
    date: str  # of the results
    record: Mapping[
        str, Any
    ]  # their version, commit and processor, as `repose.common.provenance.machine`
    files: Mapping[str, Any] = field(
        default_factory=dict
    )  # by names in `NEEDED`, `TRAINED`, `OPTIONAL`, `captions`
    captions: Mapping[str, str] = field(
        default_factory=lambda: PICTURES
    )  # of its figures, by name

    @property
    def targets(self) -> Targets:
        """The targets of the study."""
        return self.shown.targets

    @property
    def space(self) -> ParameterSpace:
        """The parameters of the study."""
        return self.shown.space

    @property
    def answer(self) -> np.ndarray:
        """The representative parameter set (6,)."""
        return self.row[list(self.space.names)].to_numpy(float)

    def number(self, column: str) -> float | None:
        """Give a number of the answer's row; None if missing."""
        value = self.row.get(column)
        return None if value is None or pd.isna(value) else float(value)


def read(config: Config, jobs: Sequence[str], files: Files) -> Results:
    """Read the results of a study."""
    known = (*NEEDED, *TRAINED, *OPTIONAL, *PICTURES)
    for name in files:
        require(name in known, "report", "--input", name, f"one of {', '.join(known)}")
    _require(files, NEEDED)
    summary = read_json(files["summary"], {"feasible": bool, "message": str})
    if "steps" not in summary:
        _require(files, TRAINED)
    shown = Shown(config)
    targets, runs = shown.targets, _runs(jobs, shown.targets)
    table4 = read_table(files["table4"], ("role", *PARAMETERS, *targets.predicted))
    rows = table4[table4["role"] == "representative"]
    require(
        not rows.empty,
        files["table4"],
        "role",
        None,
        "a row with the role representative",
    )
    posterior = None
    if "posterior" in files:
        columns = ("parameter", "credible_low", "credible_high", "width_ratio", "r_hat")
        posterior = read_table(files["posterior"], columns).set_index("parameter")
    return Results(
        shown=shown,
        files=files,
        row=rows.iloc[0],
        chance=chance_of_meeting(runs, targets),
        within={
            percent: chance_of_meeting(runs, targets, percent)["all"]
            for percent in PERCENT
        },
        posterior=posterior,
        surrogate=_surrogate(files, targets, shown.space),
        feasible=read_table(files["feasible"], ("solution", *PARAMETERS)),
        table4=table4,
        dataset=read_table(files["dataset"], ("sample", *PARAMETERS, *targets.names)),
        summary=summary,
        # the day of the answer's file: the page stays the same until the results are made anew
        date=date.fromtimestamp(os.path.getmtime(files["table4"])).isoformat(),
        record=attached.read(files["table4"]) or provenance.machine(),
    )


def _require(files: Files, names: tuple[str, ...]) -> None:
    """Raise InputError if any of these files is missing."""
    for name in names:
        require(
            name in files,
            "report",
            "--input",
            None,
            f"{name}=PATH; a report needs {', '.join(names)}",
        )


def _surrogate(
    files: Files, targets: Targets, space: ParameterSpace
) -> Predictor | None:
    """Give the surrogate of a file, or the kriging model of all runs of a strategy, or None."""
    if "network" in files:
        return load(files["network"], targets.names)
    if "runs" not in files:
        return None
    dataset = read_dataset(files["dataset"], targets)
    runs = read_runs(files["runs"], targets, dataset, files["dataset"])
    return SpaceKriging(
        Kriging(observed_of(data_of(dataset, runs, targets), space, targets)), space
    )


def _runs(jobs: Sequence[str], targets: Targets) -> dict[str, list[Any]]:
    """Read the runs of each bench test."""
    runs: dict[str, list[Any]] = defaultdict(list)
    for path in jobs:
        job, apparatus = read_job(path, targets)
        runs[apparatus] += job["runs"]
    return runs
