"""Read the results of a finished study for its report."""

import os
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS
from repose.calibrate.chance import REPORTED_PERCENTS, compute_target_probabilities
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.sequential.kriging import Kriging, SpaceKriging
from repose.calibrate.strategies.sequential.strategy import arrange_runs
from repose.calibrate.surrogates import load
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.targets import Targets
from repose.common import attached, provenance
from repose.common.errors import InputError
from repose.common.files import read_json, read_table
from repose.report.page import captions
from repose.report.study_view import Config, StudyView
from repose.stages.batches import arrange_for_strategy
from repose.stages.dataset import read_job
from repose.stages.published import REPRESENTATIVE
from repose.stages.tables import find_answer, read_dataset, read_runs

if TYPE_CHECKING:
    from repose.config.models import StudySettings
    from repose.measure.settings import MeasureSettings

Files = Mapping[str, str]  # paths by name

# Files that every report needs.
REQUIRED_FILES = ("dataset", "feasible", "summary", "table4")
# Files that a report also needs if the summary does not list the steps to the answer.
FILES_OF_STEPS = ("network", "metrics", "dataset_summary")
# Files that a report shows if they are available.
OPTIONAL_FILES = (
    "runs",
    "posterior",
    "posterior_summary",
    "particle",
    "trajectory",
    "photograph",
    "overlay",
    "card",
    "published",
    "drum_summary",
)
POSTERIOR_COLUMNS = (
    "parameter",
    "credible_low",
    "credible_high",
    "width_ratio",
    "information_bits",
    "r_hat",
)


@dataclass
class Results:
    """The results of a study, as its report shows them.

    Attributes
    ----------
    label, note, is_small_run
        Name of the study, what its configuration says about the data, and whether the
        study is only a trial.
    targets, parameters
        The measured responses, and the parameters that were searched.
    answer_row
        The representative parameter set, with its predicted and simulated responses.
    probability
        Probability that the mean response meets a target, by the name of the target,
        and that all targets are met, by the key ``all``. It is None if it is unknown.
    probability_within
        Probability that all responses lie within a percentage of their targets, by this
        percentage.
    posterior
        The table of the posterior by parameter, if there is one.
    assumed_errors
        The error of the simulator that the posterior assumes for each target, in the
        unit of the target; empty if it is unknown.
    surrogate
        A model of the responses over all ranges, if there is one.
    solutions, checked_sets, samples
        Tables of the sets that the search found, of those that were simulated again,
        and of all samples.
    summary
        The outcome of the search. It contains ``steps`` if the strategy reports them.
    date, origin
        Day of the results, and their version, commit and processor, as
        `repose.common.provenance.describe_machine`.
    settings
        The sections of the configuration, such as `settings.measure`; None for a study
        with a simulator of the user's own.
    simulator
        Name of the user's own program, if the workflow called one.
    files
        Paths of the files by name. A figure in memory replaces its path.
    published_sets
        Parameter sets of a publication, with its predicted and simulated responses.
    captions
        Captions of the figures by name.
    runs_of_answer
        The runs that check the answer, each with its status and its responses.
    """

    label: str
    is_small_run: bool
    targets: Targets
    parameters: ParameterSpace
    answer_row: pd.Series
    probability: Mapping[str, float | None]
    probability_within: Mapping[float, float | None]
    posterior: pd.DataFrame | None
    surrogate: Predictor | None
    solutions: pd.DataFrame
    checked_sets: pd.DataFrame
    samples: pd.DataFrame
    summary: Mapping[str, Any]
    date: str
    origin: Mapping[str, Any]
    settings: "StudySettings | None" = None
    simulator: str | None = None
    files: Mapping[str, Any] = field(default_factory=dict)
    published_sets: pd.DataFrame = field(default_factory=pd.DataFrame)
    captions: Mapping[str, str] = field(default_factory=lambda: captions.STUDY_FIGURES)
    runs_of_answer: Sequence[Mapping[str, Any]] = ()
    note: str | None = None
    assumed_errors: Sequence[float] = ()

    @property
    def answer(self) -> np.ndarray:
        """The representative parameter set, in the order of the parameters' names."""
        return self.answer_row[list(self.parameters.names)].to_numpy(float)

    @property
    def measure(self) -> "MeasureSettings | None":
        """The section `measure` of the configuration; None if there is none."""
        return None if self.settings is None else self.settings.measure

    @property
    def published_answer(self) -> pd.Series | None:
        """The set that a publication recommends, if it has all parameters."""
        sets = self.published_sets
        if "solution" not in sets or not set(self.parameters.names) <= set(sets):
            return None
        answers = sets[sets["solution"] == REPRESENTATIVE]
        return None if answers.empty else answers.iloc[0]

    def get_number(self, column: str) -> float | None:
        """Return a number of the answer's row; None if it is missing."""
        value = self.answer_row.get(column)
        if value is None or pd.isna(value):
            return None
        return float(value)


def read_results(config: Config, jobs: Sequence[str], files: Files) -> Results:
    """Read the results of a study, and compute how probably it meets its targets.

    Parameters
    ----------
    config : mapping
        The configuration of the study.
    jobs : sequence of paths
        Files of the runs of the answer with their measured responses, one for each
        bench test.
    files : mapping
        Paths by name, for the names in `REQUIRED_FILES`, `FILES_OF_STEPS` and
        `OPTIONAL_FILES`, and for the figures that have a caption.

    Returns
    -------
    Results
        The results.

    Raises
    ------
    InputError
        If a file is missing, has an unknown name, or cannot be read.
    """
    _check_file_names(files)
    _require_files(files, REQUIRED_FILES)
    summary = read_json(files["summary"], {"feasible": bool, "message": str})
    # If the strategy does not report its steps, the report describes them from files.
    if "steps" not in summary:
        _require_files(files, FILES_OF_STEPS)
    study = StudyView(config)
    targets = study.targets
    runs_by_bench_test = _read_runs_of_answer(jobs, targets)
    # Files from our own simulator contain all contact parameters. Those from another
    # program contain the parameters of the study.
    parameter_columns: Sequence[str] = PARAMETERS
    names = None  # the functions that read tables take this for our own parameters
    if study.simulator is not None:
        names = study.parameters.names
        parameter_columns = names
    # "Table 4" is the table of the article with the sets that were simulated again.
    answer_path = files["table4"]
    checked_sets = read_table(
        answer_path, ("role", *parameter_columns, *targets.predicted)
    )
    # Date the page by the file of the answer, so that the date changes only with the
    # results.
    modified = date.fromtimestamp(os.path.getmtime(answer_path))
    return Results(
        label=study.settings.label,
        note=study.settings.note,
        is_small_run=study.settings.small_run,
        targets=targets,
        parameters=study.parameters,
        answer_row=find_answer(checked_sets, source=answer_path),
        probability=compute_target_probabilities(runs_by_bench_test, targets),
        probability_within=_compute_probabilities_within(runs_by_bench_test, targets),
        posterior=_read_posterior(files),
        surrogate=_load_or_fit_surrogate(files, targets, study.parameters, names),
        solutions=read_table(files["feasible"], ("solution", *parameter_columns)),
        checked_sets=checked_sets,
        samples=read_table(
            files["dataset"], ("sample", *parameter_columns, *targets.names)
        ),
        summary=summary,
        simulator=study.simulator,
        date=modified.isoformat(),
        origin=attached.read_record(answer_path) or provenance.describe_machine(),
        settings=study.settings,
        files=files,
        published_sets=_read_published_sets(files),
        runs_of_answer=list(chain.from_iterable(runs_by_bench_test.values())),
        assumed_errors=_read_assumed_errors(files),
    )


def _compute_probabilities_within(
    runs_by_bench_test: Mapping[str, list[Any]], targets: Targets
) -> dict[float, float | None]:
    """Compute how probably all responses lie within some percent of their targets.

    Parameters
    ----------
    runs_by_bench_test : mapping
        Runs of the answer, by the name of their bench test.
    targets : Targets
        The targets.

    Returns
    -------
    dict
        The probability for each of `REPORTED_PERCENTS`; None if it is unknown.
    """
    probabilities = {}
    for percent in REPORTED_PERCENTS:
        of_targets = compute_target_probabilities(runs_by_bench_test, targets, percent)
        probabilities[percent] = of_targets["all"]
    return probabilities


def _check_file_names(files: Files) -> None:
    """Raise InputError for a file whose name no report uses."""
    known_names = (
        *REQUIRED_FILES,
        *FILES_OF_STEPS,
        *OPTIONAL_FILES,
        *captions.STUDY_FIGURES,
        *captions.DRUM_FIGURES,
    )
    for name in files:
        if name not in known_names:
            raise InputError(
                "report",
                key="--input",
                value=name,
                allowed=f"one of {', '.join(known_names)}",
            )


def _require_files(files: Files, names: Sequence[str]) -> None:
    """Raise InputError if any of these files is missing."""
    for name in names:
        if name not in files:
            raise InputError(
                "report",
                key="--input",
                value=None,
                allowed=f"{name}=PATH; a report needs {', '.join(names)}",
            )


def _read_posterior(files: Files) -> pd.DataFrame | None:
    """Read the table of the posterior by parameter, if there is one."""
    if "posterior" not in files:
        return None
    return read_table(files["posterior"], POSTERIOR_COLUMNS).set_index("parameter")


def _read_assumed_errors(files: Files) -> list[float]:
    """Read the error of the simulator that the posterior assumes for each target."""
    if "posterior_summary" not in files:
        return []
    return list(read_json(files["posterior_summary"])["discrepancy_sd"])


def _read_published_sets(files: Files) -> pd.DataFrame:
    """Read the published parameter sets; the table is empty if there are none."""
    if "published" not in files:
        return pd.DataFrame()
    return read_table(files["published"], ("solution", *PARAMETERS))


def _load_or_fit_surrogate(
    files: Files,
    targets: Targets,
    parameters: ParameterSpace,
    names: Sequence[str] | None,
) -> Predictor | None:
    """Load the surrogate from its file, or fit one to all runs of the study.

    Only some strategies write a file of a surrogate.

    Parameters
    ----------
    files : mapping
        Paths by name: `network` for the file of a surrogate, `runs` for the table of
        runs, and `dataset` for the table of samples.
    targets : Targets
        The targets, whose responses the surrogate predicts.
    parameters : ParameterSpace
        The parameters of the study.
    names : sequence of str or None
        Names of the parameters of another simulator; None for those of our own.

    Returns
    -------
    Predictor or None
        The surrogate from the file, or a kriging model fitted to the runs. It is None
        if there is neither a file of a surrogate nor a table of runs.
    """
    if "network" in files:
        return load(files["network"], targets.names)
    if "runs" not in files:
        return None
    samples = read_dataset(files["dataset"], targets, names)
    runs = read_runs(
        files["runs"], targets, dataset=samples, dataset_csv=files["dataset"]
    )
    # First make a table in which each row has all responses, although a run of one
    # bench test gives only some of them. Then convert the table to the arrays of
    # kriging.
    rows_of_runs = arrange_for_strategy(samples, runs, targets)
    observed = arrange_runs(rows_of_runs, parameters, targets)
    return SpaceKriging(Kriging(observed), parameters)


def _read_runs_of_answer(jobs: Sequence[str], targets: Targets) -> dict[str, list[Any]]:
    """Read the runs of the answer from files, by the name of their bench test."""
    runs: dict[str, list[Any]] = defaultdict(list)
    for path in jobs:
        job, bench_test = read_job(path, targets)
        runs[bench_test] += job["runs"]
    return runs
