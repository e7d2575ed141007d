"""Calibrate any simulator from its runs: find the answer and its uncertainty."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate import card as cards
from repose.calibrate.answer import (
    NOT_SIMULATED_AGAIN,
    WITHIN_COLUMNS,
    Check,
    Result,
    describe_missing_optimism,
    describe_probabilities,
    is_out_of_reach,
)
from repose.calibrate.chance import compute_target_probabilities
from repose.calibrate.progress import announce
from repose.calibrate.runs import Recorded, name_error_column, summarise_runs
from repose.calibrate.samples_inside import find_samples_inside
from repose.calibrate.strategies import answer as answers
from repose.calibrate.strategies.base import Answer, Batch, strategy
from repose.calibrate.strategies.runs import OK, check_responses
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import Kriging, SpaceKriging
from repose.calibrate.strategies.sequential.noise import REPLICATES, Noise
from repose.calibrate.strategies.sequential.strategy import arrange_runs, estimate_noise
from repose.calibrate.study import Study
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.surrogates.support import Support
from repose.calibrate.training import describe_training
from repose.calibrate.uncertainty.posterior import (
    SPARE_DEGREES_OF_FREEDOM,
    Posterior,
    infer_posterior,
    make_measurement,
)
from repose.calibrate.uncertainty.settings import PosteriorSettings
from repose.common.errors import InputError
from repose.common.files import StrPath, convert_to_path, write_json, write_table
from repose.common.numbers import format_significant, format_with_error

# Files that `Calibration.save` writes. It lists their contents in the same order.
TABLE_FILES = ("samples.csv", "solutions.csv", "posterior.csv", "draws.csv")
RECORD_FILES = ("posterior.json", "summary.json", "card.json")
# Key of the note of an answer that describes the training of its model.
METRICS_NOTE = "metrics"
# Key of the note with the expected optimism of the predictions.
OPTIMISM_NOTE = "optimism"


class Calibration(NamedTuple):
    """Result of a calibration by the runs of a simulator.

    Attributes
    ----------
    study : Study
        The study.
    runs : pandas.DataFrame
        All runs.
    samples : pandas.DataFrame
        Means of the runs by sample, with standard errors.
    model : Predictor
        The model of the simulator's means over the whole ranges.
    answer : Answer
        The answer of the strategy.
    solutions : pandas.DataFrame
        The answer, then other parameter sets predicted inside all ranges.
    posterior : Posterior
        The posterior of the parameters.
    summary : dict
        The answer in plain values, as in ``summary.json``.
    check : pandas.DataFrame or None
        Runs with the parameters of the answer, which are not among `runs`. None if it
        was not simulated again.
    """

    study: Study
    runs: pd.DataFrame
    samples: pd.DataFrame
    model: Predictor
    answer: Answer
    solutions: pd.DataFrame
    posterior: Posterior
    summary: dict[str, Any]
    check: pd.DataFrame | None = None

    @property
    def parameters(self) -> dict[str, float]:
        """The answer by name."""
        return self.summary["representative"]

    @property
    def probability(self) -> dict[str, float]:
        """Probabilities that the simulator's means meet all targets.

        The keys ``within_1_percent`` and ``within_2_percent`` are for a tolerance in
        percent of the aims. The key ``inside`` is for the ranges of the targets.
        """
        return self.answer.probability

    @property
    def why(self) -> str:
        """Why no more runs are needed."""
        return self.answer.why

    @property
    def intervals(self) -> dict[str, dict[str, Any]]:
        """Value in the answer and credible interval of each parameter.

        Each entry has ``value``, ``low`` and ``high``, and perhaps ``at_bound`` or
        ``widened`` (`repose.calibrate.card.make_interval_entry`). The material card has
        the same intervals.
        """
        space = self.study.parameters
        credible_intervals = cards.find_intervals(
            space, self.solutions, self._posterior_tables
        )
        entries = {}
        for name, (low, high) in credible_intervals.items():
            # The credible interval need not contain the answer, so widen it.
            value = self.parameters[name]
            entry = cards.make_interval_entry(space, name, value, low, high)
            entries[name] = {"value": value, **entry}
        return entries

    @property
    def prediction(self) -> pd.DataFrame:
        """A row for each response: `target`, predicted `mean` and its standard `error`."""
        return pd.DataFrame(self.summary["responses"]).T

    @property
    def card(self) -> dict[str, Any]:
        """Content of the material card, which `save` writes to a file.

        A material card is a JSON file with the calibrated parameters, their intervals,
        and the comparison with the targets.
        """
        settings = self.study.settings
        # The user's own simulator has no bench tests of this package. It only has a
        # text that defines each response.
        tests = {}
        for name in self.study.targets.names:
            definition: dict[str, Any] = {
                "name": settings.definitions.get(name),
                "settings": {},
            }
            tests[name] = {"definition": definition, "bench": None}
        card = cards.assemble_card(
            about={"simulator": settings.simulator, "probability": self.probability},
            tests=tests,
            answer=self.as_answer(),
            space=self.study.parameters,
            solutions=self.solutions,
            posterior=self._posterior_tables,
            comparisons={
                "samples_inside": find_samples_inside(
                    self.samples, self.study.parameters, self.study.targets
                )
            },
        )
        # The record of provenance, from which `assemble_card` takes the seed, belongs
        # to a stage of the workflow. There is none here, so add the seed.
        card["made_by"]["seed"] = settings.design.seed
        return card

    @property
    def _posterior_tables(self) -> cards.PosteriorTables:
        """Intervals of the parameters, and draws."""
        return self.posterior.parameters, self.posterior.draws

    @property
    def optimism(self) -> dict[str, Mapping[str, Any]]:
        """Expected optimism of the predictions by response; empty if it is unknown.

        Each entry has `optimism`, the expected value of the prediction minus the true
        mean, and `optimism_se`, its standard error.
        """
        rows = self.answer.notes.get(OPTIMISM_NOTE, ())
        return {row["response"]: row for row in rows}

    @property
    def files_of_strategy(self) -> list[str]:
        """Additional files of the strategy that `save` writes."""
        notes = self.answer.notes
        files = strategy(self.study.settings.strategy).files
        return [file for file in files if Path(file).stem in notes]

    def save(self, out_dir: StrPath) -> None:
        """Write tables, summary and material card into a folder.

        docs/own_simulator.md lists the files.

        Parameters
        ----------
        out_dir : path
            The folder. It is created if it does not exist.

        Raises
        ------
        InputError
            If `out_dir` is a file.
        """
        out = convert_to_path("out_dir", out_dir)
        if out.is_file():
            raise InputError(
                source=out, key="out_dir", value="a file", allowed="a folder"
            )
        # These are in the order of `TABLE_FILES`.
        tables = (
            self.samples,
            self.solutions,
            self.posterior.parameters,
            self.posterior.draws,
        )
        for file_name, table in zip(TABLE_FILES, tables, strict=True):
            write_table(out / file_name, table)
        # These are in the order of `RECORD_FILES`.
        records = (self.posterior.summary, self.summary, self.card)
        for file_name, record in zip(RECORD_FILES, records, strict=True):
            write_json(out / file_name, record)
        # The notes of an answer are additional results of its strategy, such as the
        # accuracy of its surrogate.
        answers.write_notes(self.answer.notes, self.files_of_strategy, out)

    def as_answer(self) -> Result:
        """Make the `Result` for the card, with the runs that check the answer."""
        targets = self.study.targets
        means = self.summarise_check()
        was_simulated = self.check is not None
        probabilities = self.compute_target_probabilities()
        checks = []
        for target, mean in zip(targets, self.answer.mean.tolist(), strict=True):
            optimism = self.optimism.get(target.name, {})
            check = Check.from_target(
                target,
                simulated=means.get(target.name),
                standard_error=means.get(name_error_column(target.name)),
                runs=means["n_seeds"],
                status=means["status"],
                predicted=mean,
                optimism=optimism.get("optimism"),
                optimism_error=optimism.get("optimism_se"),
            )
            checks.append(check)
        return Result(
            label=self.study.settings.label,
            parameters=self.parameters,
            feasible=self.summary["feasible"],
            message=self.summary["message"],
            checks=tuple(checks),
            folder=Path(),
            out_of_reach=is_out_of_reach(self.summary),
            inside=probabilities["all"],
            within={
                percent: self.compute_target_probabilities(percent)["all"]
                if was_simulated
                else self.probability[column]
                for percent, column in WITHIN_COLUMNS.items()
            },
        )

    def summarise_check(self) -> dict[str, Any]:
        """Compute the means of the runs that check the answer.

        Returns
        -------
        dict
            The result of `repose.calibrate.runs.summarise_runs`. Without such runs, it
            has only `status` and `n_seeds`.
        """
        if self.check is None:
            return {"status": NOT_SIMULATED_AGAIN, "n_seeds": 0}
        responses = Recorded(self.study.targets.names)
        return summarise_runs(self.check.to_dict("records"), responses)

    def compute_target_probabilities(
        self, percent: float | None = None
    ) -> dict[str, float | None]:
        """Compute how probably the true means of the answer meet the targets.

        Parameters
        ----------
        percent : float, optional
            Accepted distance from the aims; by default the ranges of the targets count.

        Returns
        -------
        dict
            The probability of each target by its name, and of all by the key ``all``.
            They come from the runs that check the answer. Without such runs, only the
            predicted probability for the ranges of all targets is known.
        """
        targets = self.study.targets
        if self.check is None:
            unknown: dict[str, float | None] = dict.fromkeys(targets.names)
            return unknown | {"all": self.probability["inside"]}
        records = self.check.to_dict("records")
        return compute_target_probabilities(
            dict.fromkeys(targets.benches, records), targets, percent
        )

    def __str__(self) -> str:
        """Describe the answer in several lines: parameters, predictions, probabilities."""
        lines = [
            self.as_answer().headline,
            "The calibrated parameters [95 % interval]:",
        ]
        for name, row in self.intervals.items():
            interval = "fixed"
            if row["low"] is not None:
                interval = f"[{format_significant(row['low'])}, {format_significant(row['high'])}]"
            text = f"  {name} {format_significant(row['value'])} {interval}"
            lines.append(cards.add_remark(text, row))
        model_name = self.model.name.replace("_", " ")
        checks = self.as_answer().checks
        if self.check is None:
            lines.append(f"Predicted by {model_name}, not simulated again:")
        else:
            lines.append("Simulated again:")
            lines += [f"  {check}" for check in checks]
            lines.append(f"Predicted by {model_name} before:")
        lines += self._describe_predictions(checks)
        lines.append(
            "Predicted probability that the simulator's means there lie "
            f"{describe_probabilities(self.probability)}. "
            f"{describe_missing_optimism(checks)}"
        )
        if METRICS_NOTE in self.answer.notes:
            lines.append(describe_training(self.answer.notes[METRICS_NOTE]))
        return "\n".join(lines)

    def _describe_predictions(self, checks: Sequence[Check]) -> list[str]:
        """Write a line for each response that compares its prediction with the target.

        `checks` are those of `as_answer`, one for each target.
        """
        lines = []
        for target, mean, error, check in zip(
            self.study.targets,
            self.answer.mean,
            self.answer.error,
            checks,
            strict=True,
        ):
            unit = f" {target.response.unit}".rstrip()
            line = (
                f"  {target.name}: {format_with_error(mean, error)}{unit}, "
                f"{target.off_percent(mean):+.2f} % off the target "
                f"{format_significant(target.aim)}, range {format_significant(target.low)} "
                f"to {format_significant(target.high)}{unit}"
            )
            if check.optimism is not None:
                line += f"; {check.optimism_clause}"
            lines.append(line)
        return lines

    def __repr__(self) -> str:
        return f"<Calibration of {self.study.settings.label}>\n{self}"

    def _repr_html_(self) -> str:
        """Return the answer as HTML, which a notebook shows instead of the text.

        It has tables of the parameters, the predictions and the probabilities.
        """
        parameters = pd.DataFrame(self.intervals).T
        # Leave out the columns with remarks about intervals, because most of their
        # cells are empty.
        parameters = parameters.drop(columns=["at_bound", "widened"], errors="ignore")
        probability = pd.DataFrame({"probability": self.probability})
        probability = probability.rename(index=lambda name: name.replace("_", " "))
        html = ""
        for table in (parameters, self.prediction, probability):
            # Only the intervals of fixed parameters have missing numbers.
            html += table.to_html(float_format=format_significant, na_rep="fixed")
        headline = escape(self.as_answer().headline)
        return f"{html}<p>{headline}</p><p>{escape(self.why)}</p>"


def calibrate(
    study: Study,
    runs: pd.DataFrame,
    proposal: Batch | Answer | None = None,
    check: pd.DataFrame | None = None,
) -> Calibration:
    """Find the parameters that meet the targets, and how certain they are.

    The steps are the answer of the strategy, the noise of the runs, a model of the
    responses, the posterior of the parameters, and a summary.

    Parameters
    ----------
    study : Study
        The study, with its parameters, targets and settings.
    runs : pandas.DataFrame
        Result of `repose.calibrate.strategies.runs.checked_runs`. The runs need not be
        those that the strategy asked for.
    proposal : Batch or Answer, optional
        Proposal of the strategy after these runs. If it is an answer, the answer is
        used unchanged. Otherwise the strategy gives the best answer that these runs
        allow.
    check : pandas.DataFrame, optional
        Runs with the parameters of the proposed answer, which check it. They do not
        change the answer.

    Returns
    -------
    Calibration
        The answer, the model, the posterior and the summary.

    Raises
    ------
    InputError
        If the runs do not determine an answer.
    """
    space = study.parameters
    targets = study.targets
    settings = study.settings
    check_responses(runs, targets)
    if isinstance(proposal, Answer):
        answer = proposal
    else:
        announce("fit the model of the responses", runs)
        answer = strategy(settings.strategy).answer(study, runs)

    # Estimate the noise of a single run. If the strategy has no model of the responses,
    # fit kriging to the means of the samples.
    observed = arrange_runs(runs, space, targets)
    noise = estimate_noise(study, observed)
    model = answer.model or SpaceKriging(Kriging(observed, noise.covariance), space)
    samples = _average_samples(study, runs)
    support = Support.from_space(space.values(observed.unit_points), space)

    # Draw from the posterior. The correlation of the responses can only be estimated
    # from repeated runs. Without them, it has no degrees of freedom.
    has_replicates = REPLICATES in noise.sources.values()
    degrees_of_freedom = observed.degrees_of_freedom if has_replicates else 0
    inference_settings = adapt_posterior_settings(
        settings.posterior, degrees_of_freedom, len(targets)
    )
    announce("draw the posterior of the parameters", runs)
    posterior = infer_posterior(
        model,
        support,
        parameters=space,
        targets=targets,
        measurement=make_measurement(targets, runs, inference_settings),
        settings=inference_settings,
        references={},  # there are no other intervals to compare with
    )

    # Describe the answer, the runs, and the steps that led to the answer.
    feasible, message = answers.judge_answer(answer, targets)
    summary = {
        **_summarise_answer(study, answer, feasible, message),
        **_summarise_runs(study, runs, samples, noise),
        "steps": _describe_steps(
            study, runs, len(samples), model, answer, noise.warning
        ),
    }
    solutions = answers.tabulate_solutions(answer, feasible, space, targets)
    return Calibration(
        study=study,
        runs=runs,
        samples=samples,
        model=model,
        answer=answer,
        solutions=solutions,
        posterior=posterior,
        summary=summary,
        check=check,
    )


def _summarise_answer(
    study: Study, answer: Answer, feasible: bool, message: str
) -> dict[str, Any]:
    """Make the entries of summary.json that describe the answer.

    Parameters
    ----------
    study : Study
        The study.
    answer : Answer
        The answer.
    feasible : bool
        Whether the answer is predicted inside all ranges.
    message : str
        Sentence that says whether it is.
    """
    values = answer.values.tolist()
    summary: dict[str, Any] = {
        "simulator": study.settings.simulator,
        "representative": dict(zip(study.parameters.names, values, strict=True)),
        "responses": _compare_responses(study, answer),
        "feasible": feasible,
        "message": message,
    }
    if "stop" in answer.notes:
        summary["stop"] = answer.notes["stop"]
    summary["probability"] = answer.probability
    return summary


def _summarise_runs(
    study: Study, runs: pd.DataFrame, samples: pd.DataFrame, noise: Noise
) -> dict[str, Any]:
    """Make the entries of summary.json that describe the runs and their noise."""
    settings = study.settings
    section = settings.sequential
    goal = Goal.from_targets(study.targets, section.tolerance_percent, study.parameters)
    return {
        "runs": len(runs),
        "failed_runs": int((runs["status"] != OK).sum()),
        "samples": len(samples),
        "needed": goal.count_needed_runs(noise.covariance, section.probability),
        "noise": _describe_noise(study, noise),
        "warning": noise.warning,
        "definitions": settings.definitions,
    }


def adapt_posterior_settings(
    settings: PosteriorSettings, degrees_of_freedom: int, responses: int
) -> PosteriorSettings:
    """Adapt the section `posterior` to the number of repeated runs.

    The correlation of the measured responses is usually estimated from repeated runs.
    If there are too few of them, it is set to 0.

    Parameters
    ----------
    settings : PosteriorSettings
        The section of the study.
    degrees_of_freedom : int
        Degrees of freedom of the noise: good runs minus samples.
    responses : int
        Number of targets.
    """
    if degrees_of_freedom >= responses + SPARE_DEGREES_OF_FREEDOM:
        return settings
    return settings.model_copy(update={"measured_correlation": 0.0})


def _compare_responses(study: Study, answer: Answer) -> dict[str, dict[str, float]]:
    """Return target, predicted mean and its standard error by response."""
    responses = {}
    for target, mean, error in zip(
        study.targets, answer.mean, answer.error, strict=True
    ):
        responses[target.name] = {
            "target": target.aim,
            "mean": float(mean),
            "error": float(error),
        }
    return responses


def _describe_noise(study: Study, noise: Noise) -> dict[str, dict[str, Any]]:
    """Return the standard deviation of a single run and its source by response."""
    deviations = np.sqrt(np.diagonal(noise.covariance))
    return {
        name: {"sd": float(sd), "from": noise.sources[name]}
        for name, sd in zip(study.targets.names, deviations, strict=True)
    }


def _average_samples(study: Study, runs: pd.DataFrame) -> pd.DataFrame:
    """Average the good runs of each sample.

    Parameters
    ----------
    study : Study
        The study.
    runs : pandas.DataFrame
        All runs, with `sample`, `status`, parameters and responses.

    Returns
    -------
    pandas.DataFrame
        `sample`, parameters, `runs` (number of good runs), means and standard errors.
    """
    good = runs[runs["status"] == OK].groupby("sample", sort=False)
    first_runs = runs.drop_duplicates("sample").set_index("sample")
    table = first_runs[list(study.parameters.names)].copy()
    # If all runs of a sample failed, it has 0 good runs and NaN as means.
    table["runs"] = good.size().reindex(table.index, fill_value=0)
    for name, error in zip(study.targets.names, study.targets.errors, strict=True):
        table[name] = good[name].mean()
        table[error] = good[name].sem()
    return table.reset_index()


def _describe_steps(
    study: Study,
    runs: pd.DataFrame,
    n_samples: int,
    model: Predictor,
    answer: Answer,
    warning: str | None,
) -> list[str]:
    """Describe in sentences the steps that led to the answer.

    Parameters
    ----------
    study : Study
        The study.
    runs : pandas.DataFrame
        All runs.
    n_samples : int
        Number of samples.
    model : Predictor
        The model that predicts the responses.
    answer : Answer
        The answer.
    warning : str or None
        Warning about the noise of the runs.
    """
    settings = study.settings
    n_failed = int((runs["status"] != OK).sum())
    within_1 = answer.probability["within_1_percent"]
    within_2 = answer.probability["within_2_percent"]
    steps = [
        f"Simulation in {settings.simulator}: {len(runs)} runs of {n_samples} parameter "
        f"sets, {n_failed} failed.",
        _describe_model(model, warning),
        *_summarise_training(answer),
        f"Answer: {_describe_choice(study, answer)}; within 1 % with probability {within_1:.2f}, "
        f"within 2 % with {within_2:.2f}.",
    ]
    return steps + _describe_definitions(settings.definitions)


def _describe_model(model: Predictor, warning: str | None) -> str:
    """Name the model of the responses, followed by the warning if there is one."""
    name = model.name.replace("_", " ")
    if warning is not None:
        return f"Model: {name}. Warning: {warning}"
    if model.name == "kriging":
        return f"Model: {name} of the samples' means with their known errors."
    return f"Model: {name}."


def _summarise_training(answer: Answer) -> list[str]:
    """Describe the accuracy of a trained model; empty for a model without test samples."""
    if METRICS_NOTE not in answer.notes:
        return []
    lines = describe_training(answer.notes[METRICS_NOTE]).splitlines()
    return [f"Training: {'; '.join(lines)}."]


def _describe_choice(study: Study, answer: Answer) -> str:
    """Describe in a clause the rule by which the answer was chosen."""
    settings = study.settings
    if settings.strategy != "sequential":
        return f"that of the strategy {settings.strategy}"
    if "nearest" in answer.why:
        return "the set that comes nearest to the targets"
    return (
        f"the set that lies within {settings.sequential.tolerance_percent:g} % of "
        "all targets most probably"
    )


def _describe_definitions(definitions: Mapping[str, str]) -> list[str]:
    """Write a sentence for each response that defines it."""
    return [f"{name}: {text}." for name, text in definitions.items()]
