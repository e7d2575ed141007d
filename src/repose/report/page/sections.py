"""What each section of the report says, as plain values for its template."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.bench.parameters import LABELS
from repose.calibrate.answer import NEAR_BOUNDS, describe_optimism, nearness
from repose.calibrate.bounds import in_words
from repose.calibrate.card import widen_to_value, with_remark
from repose.calibrate.designs.latin_hypercube import METHODS
from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.runs import error_of
from repose.calibrate.targets import Target
from repose.calibrate.uncertainty.posterior import LARGEST_R_HAT
from repose.common.files import read_json
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import line_for, line_of
from repose.report.page import captions
from repose.report.page.pictures import EmbeddedPicture, embed_known
from repose.report.page.prediction import has_network
from repose.report.page.study import Results
from repose.report.page.tables import FoldedTable, Table, folded_table
from repose.report.page.templates import cell_text
from repose.report.page.verdict import VerdictText, checks_of, percent_text, verdict_of
from repose.report.study_view import parameter_ranges
from repose.stages.card import read as read_card


@dataclass(frozen=True)
class AnswerSection:
    """The parameters with their intervals, and whether they meet the targets."""

    label: str
    verdict: VerdictText
    impossible_targets: list[str]
    origin: str
    nearness: str  # empty if the answer was not simulated again
    near_bounds: str  # empty where no parameter is near a bound
    table: Table
    has_intervals: bool
    intervals_are_unsettled: bool


@dataclass(frozen=True)
class CheckSection:
    """Measured, predicted and simulated responses, and the pile."""

    responses: Table
    failures: str  # of the new simulations, in words
    angle_definitions: Table | None
    has_view: bool  # of the pile in 3-D
    pile_pictures: list[EmbeddedPicture]
    checked_sets: Table | None


class OtherParametersSection(NamedTuple):
    """What the sliders' predictions come from."""

    surrogate: str
    has_network: bool


@dataclass(frozen=True)
class MethodSection:
    """The steps to the answer, a sentence each, with their figures."""

    steps: list[str]
    figures: list[EmbeddedPicture]


# --- The answer -----------------------------------------------------------------------


def answer(study: Results) -> AnswerSection:
    """Describe the parameters, their intervals, and whether they meet the targets."""
    posterior = study.posterior
    is_unsettled = posterior is not None and posterior["r_hat"].max() > LARGEST_R_HAT
    return AnswerSection(
        label=study.label,
        verdict=verdict_of(study),
        impossible_targets=impossible_targets(study.files),
        origin=_origin(study),
        nearness=_nearness(study),
        near_bounds=_near_bounds(study),
        table=_parameter_table(study),
        has_intervals=posterior is not None,
        intervals_are_unsettled=bool(is_unsettled),
    )


def impossible_targets(files: Mapping[str, str]) -> list[str]:
    """Say which angles of the card piles of these grains cannot have at their Height."""
    if "card" not in files:
        return []
    sentences = []
    for test in read_card(files["card"])["tests"]:
        if "reach" in test and not test["reach"]["possible"]:
            sentences.append(test["reach"]["sentence"])
    return sentences


def _origin(study: Results) -> str:
    """Say when and by what the results were made."""
    version = study.origin.get("repose")
    processor = study.origin.get("processor")
    commit = ""
    if study.origin.get("commit"):
        commit = f", commit {study.origin['commit']}"
    return f"Results of {study.date}, by repose {version}{commit}, on {processor}."


def _nearness(study: Results) -> str:
    """Say how far the simulated means are from the measured ones; empty without them."""
    if not study.number("n_seeds"):
        return ""
    checks = checks_of(study)
    return nearness(replace(check, response=check.label) for check in checks)


def _near_bounds(study: Results) -> str:
    """Say which parameters are at a bound as far as the fit can tell; empty if none is."""
    clauses = [in_words(near) for near in study.summary.get("near_bounds", ())]
    return f"{NEAR_BOUNDS}: {'; '.join(clauses)}." if clauses else ""


def _parameter_table(study: Results) -> Table:
    """Tabulate the parameters of the answer."""
    columns = ["parameter", "meaning", "value"]
    if study.posterior is not None:
        columns += ["95 % interval", "left open"]
    columns += ["searched", "sets found"]
    rows = [
        _parameter_row(study, name, value)
        for name, value in zip(
            study.parameters.names, study.answer.tolist(), strict=True
        )
    ]
    return Table(columns, rows, style="answer")


def _parameter_row(study: Results, name: str, value: float) -> list[str]:
    """Give the row of one parameter in the table of the answer."""
    parameters = study.parameters
    label = LABELS.get(name, name)
    if name in parameters.fixed:
        interval_cells = [] if study.posterior is None else ["", ""]
        return [name, label, f"{value:.4g}", *interval_cells, "fixed", ""]

    if study.posterior is None:
        interval_cells = []
        interval = widen_to_value(parameters, name, value=value, low=value, high=value)
    else:
        row = study.posterior.loc[name]
        interval = widen_to_value(
            parameters,
            name,
            value=value,
            low=float(row["credible_low"]),
            high=float(row["credible_high"]),
        )
        interval_cells = [
            f"{interval['low']:.3g} to {interval['high']:.3g}",
            f"{100 * row['width_ratio']:.0f} %",
        ]
    low, high = parameter_ranges(parameters)[name]
    searched = f"{low:.3g} to {high:.3g}"
    values_of_sets = study.solutions[name]
    sets_found = f"{values_of_sets.min():.3g} to {values_of_sets.max():.3g}"
    meaning = with_remark(label, interval)
    return [name, meaning, f"{value:.4g}", *interval_cells, searched, sets_found]


# --- The check ------------------------------------------------------------------------


def check(study: Results) -> CheckSection:
    """Describe measured, predicted and simulated responses, and the pile."""
    return CheckSection(
        responses=_response_table(study),
        failures=cell_text(study.answer_row.get("reason")),
        angle_definitions=_table_of_angle_definitions(study),
        has_view="trajectory" in study.files,
        pile_pictures=embed_known(study.files, captions.PILE_PICTURES),
        checked_sets=_table_of_checked_sets(study),
    )


def _response_table(study: Results) -> Table:
    """Tabulate the responses of the answer; without new simulations up to the predicted."""
    columns = ["response", "measured", "target range", "predicted"]
    if study.number("n_seeds") is not None:
        columns += ["simulated", "difference", "inside"]
    rows = [_response_row(study, target)[: len(columns)] for target in study.targets]
    return Table(columns, rows, style="check")


def _response_row(study: Results, target: Target) -> list[str]:
    """Give the row of one target in the table of the responses."""
    response = target.response
    unit = response.unit
    measured = f"{target.value:.4g} ± {target.sd:.2g} {unit} (n = {target.repetitions})"
    target_range = f"{target.low:g} to {target.high:g} {unit}"

    predicted = study.number(response.predicted)
    predicted_text = "" if predicted is None else f"{predicted:.4g} {unit}"
    optimism = study.number(response.optimism)
    if optimism is not None:
        expected = describe_optimism(optimism, study.number(response.optimism_error))
        predicted_text += f" ({expected.replace('+-', '±')})"

    simulated = study.number(response.simulated)
    error = study.number(response.error)
    simulated_text = _mean_with_error(simulated, error, f" {unit}")
    difference = ""
    if simulated is not None:
        percent = 100 * (simulated - target.value) / target.whole_value
        difference = f"{percent:+.1f} %"

    inside = percent_text(study.probability[target.name])
    return [
        response.label,
        measured,
        target_range,
        predicted_text,
        simulated_text,
        difference,
        inside,
    ]


def _table_of_angle_definitions(study: Results) -> Table | None:
    """Tabulate the angle of the answer's piles by every definition; None without piles."""
    if not set(MEAN_KEYS.values()) <= set(study.answer_row.index):
        return None
    measure = study.measure
    if measure is None:
        return None
    calibrated_lines = {line_for(measure, name) for name in study.targets.names}
    rows = []
    for definition, column in MEAN_KEYS.items():
        line = line_of(measure, definition)
        mean = study.number(column)
        error = study.number(error_of(column))
        remark = "calibrated" if line in calibrated_lines else ""
        rows.append([line, _mean_with_error(mean, error, " deg"), remark])
    return Table(["line", "simulated", ""], rows, style="lines")


def _table_of_checked_sets(study: Results) -> Table | None:
    """Tabulate the sets that were simulated again; None for the answer alone."""
    if len(study.checked_sets) < 2:
        return None
    columns = ["set", "role", "runs"]
    for response in study.targets.responses:
        unit = response.unit or "–"
        columns.append(f"{response.symbol} predicted ({unit})")
        if response.optimism in study.checked_sets:
            columns.append(f"expected optimism ({unit})")
        columns.append(f"{response.symbol} simulated ({unit})")
    rows = []
    for _, row in study.checked_sets.iterrows():
        cells = [row.get("solution"), row.get("role"), row.get("n_seeds")]
        for response in study.targets.responses:
            cells.append(row[response.predicted])
            if response.optimism in study.checked_sets:
                optimism = row[response.optimism]
                error = row[response.optimism_error]
                cells.append(_mean_with_error(optimism, error))
            simulated = row.get(response.simulated)
            error = row.get(response.error)
            cells.append(_mean_with_error(simulated, error))
        rows.append(cells)
    return Table(columns, rows, style="sets")


def _mean_with_error(mean: float | None, error: float | None, unit: str = "") -> str:
    """Write a mean with its standard error."""
    if mean is None or pd.isna(mean):
        return "no result"
    return f"{mean:.4g} ± {error or 0:.2g}{unit}"


# --- Other parameters, the method, the tables -----------------------------------------


def other_parameters(study: Results) -> OtherParametersSection | None:
    """Describe the surrogate behind the sliders; None without a surrogate."""
    if study.surrogate is None:
        return None
    return OtherParametersSection(study.surrogate.name, has_network(study.surrogate))


def method(study: Results) -> MethodSection:
    """Describe the steps to the answer with their figures."""
    return MethodSection(_steps(study), embed_known(study.files, study.captions))


def _steps(study: Results) -> list[str]:
    """Say the steps to the answer, a sentence each."""
    if "steps" in study.summary:
        return list(study.summary["steps"])
    bench_tests = " and ".join(study.targets.apparatus).replace("_", " ")
    simulated = read_json(study.files["dataset_summary"], {"text": str})
    steps = []
    if study.settings is not None:
        steps.append(_design_step(study, study.settings.design))
    steps.append(f"Simulation of the bench test ({bench_tests}): {simulated['text']}")
    if study.surrogate is not None:
        surrogate = study.surrogate.name.replace("_", " ")
        steps.append(f"Surrogate ({surrogate}): {_accuracy(study)}")
    steps.append(f"Search: {study.summary['message']}")
    n_sets = len(study.checked_sets)
    n_runs = study.answer_row.get("n_seeds", 0)
    steps.append(
        f"Check: {n_sets} of the sets found were simulated again with new seeds; "
        f"the answer {n_runs:.0f} times."
    )
    return steps


def _design_step(study: Results, design: DesignSettings) -> str:
    """Say which parameter sets were simulated."""
    n_free = study.parameters.dimensions
    n_parameters = len(study.parameters.names)
    searched = f"{n_free} parameters"
    if n_free < n_parameters:
        searched = f"{n_free} of {n_parameters} parameters, the others fixed"
    method = METHODS[design.method]
    return f"Design: {design.samples} parameter sets over {searched} ({method})."


def _accuracy(study: Results) -> str:
    """Say how well the surrogate predicts samples that its training did not use."""
    metrics_on_test_samples = read_json(study.files["metrics"]).get("test") or {}
    accuracies = []
    for response in study.targets.responses:
        metrics = metrics_on_test_samples.get(response.name, {})
        rmse = metrics.get("rmse") or np.nan
        if np.isfinite(rmse):
            accuracies.append(
                f"{response.label} to {rmse:.2g} {response.unit} "
                f"(R² {metrics['r2']:.2f})"
            )
    if not accuracies:
        return "its accuracy was not tested."
    predictions = " and the ".join(accuracies)
    return f"on samples that it had not learned from, it predicts the {predictions}."


def folded_tables(tables: Mapping[str, pd.DataFrame]) -> list[FoldedTable]:
    """Put each table of the study behind its title."""
    return [folded_table(title, frame) for title, frame in tables.items()]


def template_values(
    study: Results, tables: Mapping[str, pd.DataFrame]
) -> dict[str, Any]:
    """Give the sections by the names that the templates have for them."""
    return {
        "answer": answer(study),
        "check": check(study),
        "other_parameters": other_parameters(study),
        "method": method(study),
        "tables": folded_tables(tables),
    }
