"""Collect what each section of the report says, as plain values for its template."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.bench.parameters import LABELS
from repose.calibrate.answer import (
    NEAR_BOUNDS_INTRODUCTION,
    describe_differences,
    describe_optimism,
)
from repose.calibrate.bounds import describe_near_bound
from repose.calibrate.card import add_remark, widen_to_value
from repose.calibrate.designs.latin_hypercube import METHOD_LABELS
from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.responses import compute_deviation_percent
from repose.calibrate.runs import describe_overlaps, name_error_column
from repose.calibrate.targets import Target
from repose.calibrate.uncertainty.posterior import MAX_R_HAT
from repose.common.files import read_json, read_table
from repose.common.numbers import format_significant, format_with_error
from repose.common.statuses import describe_failures
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import describe_line_of_response, line_of
from repose.report.page import captions
from repose.report.page.material import (
    describe_size,
    tabulate_laws,
    tabulate_material,
)
from repose.report.page.pictures import EmbeddedPicture, embed_captioned_pictures
from repose.report.page.prediction import has_network, unwrap_scales
from repose.report.page.study import Results
from repose.report.page.tables import FoldedTable, Table, fold_table
from repose.report.page.verdict import (
    VerdictText,
    format_percent,
    make_checks,
    make_verdict,
)
from repose.report.study_view import parameter_ranges
from repose.stages.card import read_card as read_card
from repose.stages.dataset import describe_counts

# The last step of a study whose runs another program made.
OTHER_PROGRAM_STEP = (
    "The runs were made by another program, so this report has no grain, no drum, no "
    "published sets and no pictures of piles."
)
# An interval that covers this fraction of the range or more does not determine a
# parameter.
UNDETERMINED_FRACTION = 0.9
# If a standard error is a smaller fraction of its mean, all runs gave the same value,
# and the error is only due to rounding.
ROUNDING_FRACTION = 1e-9
# Angles by which the drum has turned: before the first slip, and at the time when the
# run of the article ends.
SLIP_ANGLE = "before_turned_deg"
REPORT_ANGLE = "report_turned_deg"
# Quantities of the drum by key, with their units.
DRUM_QUANTITIES = {
    SLIP_ANGLE: "deg",
    "before_time_s": "s",
    "before_surface_deg": "deg",
    "after_surface_deg": "deg",
    REPORT_ANGLE: "deg",
    "report_surface_deg": "deg",
}


@dataclass(frozen=True)
class AnswerSection:
    """The parameters with their intervals, and whether they meet the targets."""

    label: str  # name of the study
    verdict: VerdictText
    impossible_targets: list[str]
    origin: str  # when, and by which version and machine, the results were made
    determination: str  # how many parameters are determined; empty without intervals
    sets_inside: str  # how many samples meet the targets; empty if there are few
    nearness: str  # of the simulated means; empty if the answer was not simulated again
    near_bounds: str  # parameters that may be at a bound; empty without any
    table: Table
    has_intervals: bool
    intervals_are_unsettled: bool


@dataclass(frozen=True)
class CheckSection:
    """Measured, predicted and simulated responses, and the pile."""

    responses: Table
    has_simulations: bool  # whether the answer was simulated again
    failures: str  # of these simulations; empty without any
    overlaps: str  # a warning of deep overlaps in them
    angle_definitions: Table | None
    has_view: bool  # whether there is a 3-D view of the pile
    pile_pictures: list[EmbeddedPicture]
    checked_sets: Table | None
    abbreviations: str  # of responses in the columns of this table
    has_published_sets: bool  # whether this table contains published sets


class MaterialSection(NamedTuple):
    """What another program needs to simulate the answer."""

    values: Table
    laws: Table
    size: str  # a sentence on whether the grains are equal in size


class DrumSection(NamedTuple):
    """The answer in the rotating drum."""

    comparison: str  # with the article; empty if there are no published sets
    table: Table
    figures: list[EmbeddedPicture]


class OtherParametersSection(NamedTuple):
    """How the predictions for other parameters, chosen by sliders, are made."""

    surrogate: str  # name of the surrogate
    has_network: bool  # whether the page contains the surrogate itself
    constraints: str  # on the parameters; empty without any


@dataclass(frozen=True)
class MethodSection:
    """The steps to the answer, with their figures."""

    steps: list[str]  # a sentence for each step
    search_result: str  # a sentence on how many sets the search kept
    sets_found: Table | None  # ranges of the parameters of these sets
    figures: list[EmbeddedPicture]


# --- The answer -----------------------------------------------------------------------


def make_answer_section(study: Results) -> AnswerSection:
    """Describe the parameters, their intervals, and whether they meet the targets."""
    posterior = study.posterior
    is_unsettled = posterior is not None and posterior["r_hat"].max() > MAX_R_HAT
    return AnswerSection(
        label=study.label,
        verdict=make_verdict(study),
        impossible_targets=list_impossible_targets(study.files),
        origin=_describe_origin(study),
        determination=_describe_determination(study),
        sets_inside=_describe_sets_inside(study),
        nearness=_describe_nearness(study),
        near_bounds=_describe_near_bounds(study),
        table=_make_parameter_table(study),
        has_intervals=posterior is not None,
        intervals_are_unsettled=bool(is_unsettled),
    )


def list_impossible_targets(files: Mapping[str, str]) -> list[str]:
    """List the card's warnings about angles that no pile of this height can have.

    Without a card, the list is empty.
    """
    if "card" not in files:
        return []
    sentences = []
    for test in read_card(files["card"])["tests"]:
        if "reach" in test and not test["reach"]["possible"]:
            sentences.append(test["reach"]["sentence"])
    return sentences


def _describe_origin(study: Results) -> str:
    """State when the results were made, and by which version and processor."""
    version = study.origin.get("repose")
    processor = study.origin.get("processor")
    commit = ""
    if study.origin.get("commit"):
        commit = f", commit {study.origin['commit']}"
    return f"Results of {study.date}, by repose {version}{commit}, on {processor}."


def _describe_determination(study: Results) -> str:
    """Describe how many parameters the measurements determine.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    str
        One sentence. It is empty if the study has no intervals of the parameters.
    """
    if study.posterior is None:
        return ""
    shares = study.posterior["width_ratio"]
    n_parameters = len(shares)
    n_determined = int((shares < UNDETERMINED_FRACTION).sum())
    # The intervals are estimates, so this fraction may slightly exceed 1.
    narrowest = 100 * min(shares.min(), 1.0)
    condition = f"With the assumed error of the simulator{_list_assumed_errors(study)}"
    if n_determined == 0:
        return (
            f"{condition}, the measurements determine none of the {n_parameters} "
            f"parameters: each 95 % interval covers {narrowest:.0f} % or more of its width "
            "without them."
        )
    return (
        f"{condition}, the measurements narrow {n_determined} of the {n_parameters} "
        f"parameters: the narrowest 95 % interval covers {narrowest:.0f} % of its width "
        "without them."
    )


def _list_assumed_errors(study: Results) -> str:
    """List the assumed errors in brackets, such as `` (2 deg, 2.5 mm)``."""
    if not study.assumed_errors:
        return ""
    errors = [
        _format_with_unit(error, target.response.unit)
        for target, error in zip(study.targets, study.assumed_errors, strict=True)
    ]
    return f" ({', '.join(errors)})"


def _describe_sets_inside(study: Results) -> str:
    """Describe how many samples meet all targets, and how far apart they are.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    str
        One sentence. It is empty if fewer than two samples meet all targets.
    """
    samples = study.samples
    is_inside = np.ones(len(samples), bool)
    for target in study.targets:
        is_inside &= samples[target.name].between(target.low, target.high)
    samples_inside = samples[is_inside]
    if len(samples_inside) < 2:
        return ""
    # For each parameter, compute the fraction of its range that these samples span.
    spans = [
        (np.ptp(study.parameters.shares(name, samples_inside[name])), name)
        for name in study.parameters.free
    ]
    narrowest, narrowest_name = min(spans, key=itemgetter(0))
    widest, widest_name = max(spans, key=itemgetter(0))
    return (
        f"{len(samples_inside)} of the {len(samples)} simulated samples already lie "
        f"inside all target ranges; they span {100 * narrowest:.0f} ({narrowest_name}) "
        f"to {100 * widest:.0f} % ({widest_name}) of the searched ranges."
    )


def _describe_nearness(study: Results) -> str:
    """Describe how far the simulated means are from the measured ones.

    Further sentences state the scatter of single simulations and the standard errors of
    the measured means.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    str
        The sentences; empty if the answer was not simulated again.
    """
    if not study.get_number("n_seeds"):
        return ""
    checks = list(make_checks(study))
    # Name the responses by their labels, which readers understand.
    named_checks = [replace(check, response=check.label) for check in checks]
    sentences = [describe_differences(named_checks)]
    # The standard deviation of a single run follows from the standard error of the
    # mean.
    scatters = [
        _format_with_unit(check.standard_error * math.sqrt(check.runs), check.unit)
        for check in checks
        if check.standard_error is not None
    ]
    if scatters:
        sentences.append(
            f"Single simulations scatter more than their mean: by {' and '.join(scatters)} "
            "(standard deviation)."
        )
    # The errors above are those of the simulation alone.
    errors = [
        _format_with_unit(check.sd / math.sqrt(check.repetitions), check.unit)
        for check in checks
    ]
    sentences.append(
        f"The standard errors of the measured means, {' and '.join(errors)}, are not "
        "in these numbers."
    )
    return " ".join(sentences)


def _describe_near_bounds(study: Results) -> str:
    """Describe which parameters may lie at a bound; empty if there are none."""
    clauses = [
        describe_near_bound(near) for near in study.summary.get("near_bounds", ())
    ]
    return f"{NEAR_BOUNDS_INTRODUCTION}: {'; '.join(clauses)}." if clauses else ""


def _make_parameter_table(study: Results) -> Table:
    """Tabulate the parameters of the answer."""
    columns = ["parameter", "meaning", "value"]
    if study.posterior is not None:
        columns += ["95 % interval", "left open"]
    columns.append("searched")
    rows = [
        _make_parameter_row(study, name, value)
        for name, value in zip(
            study.parameters.names, study.answer.tolist(), strict=True
        )
    ]
    return Table(columns, rows, style="answer")


def _format_with_unit(value: float, unit: str) -> str:
    """Write a number with two digits and its unit, which may be empty."""
    return f"{format_significant(value, 2)} {unit}".rstrip()


def _make_parameter_row(study: Results, name: str, value: float) -> list[str]:
    """Make the cells of one parameter in the table of the answer.

    If the study has intervals, two of the columns describe that of the parameter.

    Parameters
    ----------
    study : Results
        The results of the study.
    name : str
        Name of the parameter.
    value : float
        Value of the parameter in the answer.

    Returns
    -------
    list of str
        The cells, from left to right.
    """
    parameters = study.parameters
    label = LABELS.get(name, "")  # empty for parameters of another simulator
    if name in parameters.fixed:
        empty_cells = [] if study.posterior is None else ["", ""]
        return [name, label, format_significant(value), *empty_cells, "fixed"]

    # `widen_to_value` also notes whether the value lies at an end of its range.
    if study.posterior is None:
        interval_cells: list[str] = []
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
            _format_ends(interval["low"], interval["high"]),
            _describe_fraction_left_open(row["width_ratio"]),
        ]
    searched = _format_ends(*parameter_ranges(parameters)[name])
    # If the label is empty, the remark begins with a separator. Remove it.
    meaning = add_remark(label, interval).removeprefix("; ")
    return [name, meaning, format_significant(value, 3), *interval_cells, searched]


def _format_ends(low: float, high: float) -> str:
    """Write both ends of an interval with three digits."""
    return f"{format_significant(low, 3)} to {format_significant(high, 3)}"


def _describe_fraction_left_open(share: float) -> str:
    """Write how much of a parameter's range its 95 % interval leaves open.

    The intervals are estimates, so the fraction may slightly exceed 1.
    """
    percent = f"{100 * min(share, 1.0):.0f} %"
    return f"{percent}: not determined" if share >= UNDETERMINED_FRACTION else percent


# --- The material ---------------------------------------------------------------------


def make_material_section(study: Results) -> MaterialSection | None:
    """Describe the material and the contact laws.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    MaterialSection or None
        The section. It is None if the study has no card, or if another program
        simulated the study.
    """
    if "card" not in study.files:
        return None
    card = read_card(study.files["card"])
    # The card of another simulator has no contact laws.
    if "laws" not in card:
        return None
    if "simulation" not in card and study.settings is not None:
        # Cards of earlier versions have neither gravity nor time step.
        simulation = study.settings.simulation
        card["simulation"] = {
            "gravity_m_s2": simulation.gravity_m_s2,
            "time_step_s": simulation.time_step_s,
        }
    return MaterialSection(
        values=tabulate_material(card),
        laws=tabulate_laws(card),
        size=describe_size(card["grain"]),
    )


# --- The check ------------------------------------------------------------------------


def make_check_section(study: Results) -> CheckSection:
    """Describe measured, predicted and simulated responses, and the pile."""
    return CheckSection(
        responses=_make_response_table(study),
        has_simulations=study.get_number("n_seeds") is not None,
        failures=_describe_failures(study),
        overlaps=describe_overlaps(study.runs_of_answer),
        angle_definitions=_make_table_of_angle_definitions(study),
        has_view="trajectory" in study.files,
        pile_pictures=embed_captioned_pictures(study.files, captions.PILE_PICTURES),
        checked_sets=_make_table_of_checked_sets(study),
        abbreviations=_explain_abbreviations(study),
        has_published_sets=len(study.published_sets) > 0,
    )


def _describe_failures(study: Results) -> str:
    """Describe how many of the answer's runs failed and why; empty if none did."""
    statuses = [run["status"] for run in study.runs_of_answer]
    failures = Counter(status for status in statuses if status != "ok")
    if not failures:
        return ""
    return f"Of these {len(statuses)} simulations, {describe_failures(failures, 'failed')}."


def _make_response_table(study: Results) -> Table:
    """Tabulate the responses of the answer.

    Without new simulations, the last column contains the predictions.
    """
    columns = ["response", "measured", "target range", "predicted"]
    if study.get_number("n_seeds") is not None:
        columns += ["simulated", "difference", "inside"]
    # Each row is made for all columns. Drop the cells of columns that are not shown.
    rows = [
        _make_response_row(study, target)[: len(columns)] for target in study.targets
    ]
    return Table(columns, rows, style="check")


def _make_response_row(study: Results, target: Target) -> list[str]:
    """Make the cells of one target in the table of the responses.

    There are cells for all columns, although the last columns are shown only if the
    answer was simulated again.

    Parameters
    ----------
    study : Results
        The results of the study.
    target : Target
        The target.

    Returns
    -------
    list of str
        The cells, from left to right.
    """
    response = target.response
    unit = response.unit
    mean = format_significant(target.value)
    sd = format_significant(target.sd, 2)
    measured = f"{mean} ± {sd} {unit} (n = {target.repetitions})"
    target_range = f"{target.low:g} to {target.high:g} {unit}"

    # Write the simulated mean, and its difference from the measured mean.
    simulated = study.get_number(response.simulated)
    error = study.get_number(response.standard_error)
    simulated_text = _format_mean_with_error(simulated, error, f" {unit}")
    difference = ""
    if simulated is not None:
        percent = 100 * (simulated - target.value) / target.whole_value
        difference = f"{percent:+.1f} %"

    inside = format_percent(study.probability[target.name])
    return [
        response.label,
        measured,
        target_range,
        _format_prediction(study, target),
        simulated_text,
        difference,
        inside,
    ]


def _format_prediction(study: Results, target: Target) -> str:
    """Write the predicted response of the answer, with its expected optimism.

    Parameters
    ----------
    study : Results
        The results of the study.
    target : Target
        The target of the response.

    Returns
    -------
    str
        The prediction; empty if there is none.
    """
    response = target.response
    predicted = study.get_number(response.predicted)
    if predicted is None:
        return ""
    text = f"{format_significant(predicted)} {response.unit}"
    optimism = study.get_number(response.optimism)
    if optimism is None:
        return text
    expected = describe_optimism(optimism, study.get_number(response.optimism_error))
    return f"{text} ({expected.replace('+-', '±')})"


def _make_table_of_angle_definitions(study: Results) -> Table | None:
    """Tabulate the answer's angle of repose by each definition.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    Table or None
        A row for each definition. The table is None if the study has no piles, or if
        its results do not contain all of these angles.
    """
    measure = study.measure
    has_all_angles = set(MEAN_KEYS.values()) <= set(study.answer_row.index)
    if measure is None or not has_all_angles:
        return None
    calibrated_lines = {
        describe_line_of_response(measure, name) for name in study.targets.names
    }
    rows = []
    for definition, column in MEAN_KEYS.items():
        line = line_of(measure, definition)
        mean = study.get_number(column)
        error = study.get_number(name_error_column(column))
        remark = "calibrated" if line in calibrated_lines else ""
        rows.append([line, _format_mean_with_error(mean, error, " deg"), remark])
    return Table(["line", "simulated", ""], rows, style="lines")


class _Cell(NamedTuple):
    """A cell of a table with the header of its column."""

    header: str
    value: Any


def _make_table_of_checked_sets(study: Results) -> Table | None:
    """Tabulate the sets that were simulated again; None if only the answer was.

    Published sets follow in further rows, with the numbers from their publication.
    """
    if len(study.checked_sets) < 2:
        return None
    cells_of_rows = [
        _make_cells_of_set(study, row) for _, row in study.checked_sets.iterrows()
    ]
    for _, row in study.published_sets.iterrows():
        published = _mark_as_published(row)
        cells_of_rows.append(
            _make_cells_of_set(study, published, placeholder="not published")
        )
    return Table(
        columns=[cell.header for cell in cells_of_rows[0]],
        rows=[[cell.value for cell in cells] for cells in cells_of_rows],
        style="sets",
        screen_rows=len(study.published_sets),
    )


def _mark_as_published(row: pd.Series) -> pd.Series:
    """Mark the name of a published set, because the study's sets also have numbers."""
    name = row["solution"]
    marked = row.copy()
    if name == "representative":
        marked["solution"] = "published answer"
    else:
        marked["solution"] = f"published {name}"
    marked["role"] = "published"
    return marked


def _explain_abbreviations(study: Results) -> str:
    """Explain the symbols of those responses whose label is different."""
    sentences = []
    for response in study.targets.responses:
        if response.symbol != response.label:
            sentences.append(f"{response.symbol}: {response.label}.")
    return " ".join(sentences)


def _make_cells_of_set(
    study: Results, row: pd.Series, placeholder: str = "no result"
) -> list[_Cell]:
    """Make the cells of one parameter set, from left to right.

    The headers are the same for every set.

    Parameters
    ----------
    study : Results
        The results of the study.
    row : Series
        The parameter set with its predicted and simulated responses.
    placeholder : str
        Text that takes the place of a missing simulated mean.

    Returns
    -------
    list of _Cell
        The cells.
    """
    cells = [
        _Cell("set", row.get("solution")),
        _Cell("role", row.get("role")),
        _Cell("runs", row.get("n_seeds")),
    ]
    for name in study.parameters.names:
        cells.append(_Cell(name, format_significant(row[name], 3)))
    for response in study.targets.responses:
        symbol = response.symbol
        unit = response.unit or "–"
        predicted = row.get(response.predicted)
        simulated = row.get(response.simulated)
        cells.append(_Cell(f"{symbol} predicted ({unit})", predicted))
        if response.optimism in study.checked_sets:
            optimism = _format_mean_with_error(
                row.get(response.optimism),
                row.get(response.optimism_error),
                missing="",
            )
            cells.append(_Cell(f"expected optimism ({unit})", optimism))
        mean = _format_mean_with_error(
            simulated, row.get(response.standard_error), missing=placeholder
        )
        cells.append(_Cell(f"{symbol} simulated ({unit})", mean))
        error = _format_error_percent(predicted, simulated)
        cells.append(_Cell(f"{symbol} error (%)", error))
    return cells


def _format_error_percent(predicted: float | None, simulated: float | None) -> str:
    """Write the error of a prediction in percent of the simulated value.

    The result is empty if either value is missing, or if the simulated value is 0.
    """
    if predicted is None or simulated is None:
        return ""
    percent = compute_deviation_percent(predicted, simulated) if simulated else np.nan
    return f"{percent:.2f}" if np.isfinite(percent) else ""


def _format_mean_with_error(
    mean: float | None,
    error: float | None,
    unit: str = "",
    missing: str = "no result",
) -> str:
    """Write a mean with its standard error.

    Parameters
    ----------
    mean : float or None
        The mean; None or NaN if there is none.
    error : float or None
        Standard error of the mean. It is left out if it is None, NaN or so small that
        it is only due to rounding.
    unit : str
        Text that follows the numbers.
    missing : str
        Text that is returned if there is no mean.

    Returns
    -------
    str
        The mean with its standard error and unit, or `missing`.
    """
    if mean is None or pd.isna(mean):
        return missing
    is_rounding_error = error is not None and error < ROUNDING_FRACTION * abs(mean)
    if pd.isna(error) or is_rounding_error:
        error = None
    return f"{format_with_error(mean, error).replace('+-', '±')}{unit}"


# --- The drum -------------------------------------------------------------------------


def make_drum_section(study: Results) -> DrumSection | None:
    """Describe the check of the answer in the drum.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    DrumSection or None
        The section; None if the study does not include this check.
    """
    if "drum_summary" not in study.files:
        return None
    summary = read_table(study.files["drum_summary"], ("quantity", "key", "mean"))
    summary = summary.set_index("key")
    rows = []
    for key, unit in DRUM_QUANTITIES.items():
        if key in summary.index:
            row = summary.loc[key]
            mean = _format_mean_with_error(
                row["mean"], row["standard_error"], f" {unit}"
            )
            rows.append([row["quantity"], mean, f"{row['runs']:.0f}"])
    # Only a study with published sets belongs to the article.
    comparison = ""
    if len(study.published_sets) > 0:
        comparison = _compare_slip_with_article(summary)
    return DrumSection(
        comparison=comparison,
        table=Table(["quantity", "simulated", "runs"], rows, style="drum"),
        figures=embed_captioned_pictures(study.files, captions.DRUM_FIGURES),
    )


def _compare_slip_with_article(summary: pd.DataFrame) -> str:
    """Compare when the bed slips in the simulation and in the article.

    Parameters
    ----------
    summary : DataFrame
        Means of the drum's quantities, by their keys.

    Returns
    -------
    str
        The sentences. They are empty if the angle of the slip, or that of the reported
        time, is missing.
    """
    if SLIP_ANGLE not in summary.index or REPORT_ANGLE not in summary.index:
        return ""
    slip_deg = summary.loc[SLIP_ANGLE, "mean"]
    report_deg = summary.loc[REPORT_ANGLE, "mean"]
    comparison = (
        "By its times, the article's run ends when its drum has turned by "
        f"{report_deg:.0f}°. It shows the bed after a slip and states no angle. Here "
        f"the bed first slips at {slip_deg:.0f}°."
    )
    # If the bed slips later than this, the simulation shows no slip at that time.
    if slip_deg > report_deg:
        comparison += " So in this test the simulation disagrees with the article."
    return comparison


# --- Other parameters, the method, the tables -----------------------------------------


def make_other_parameters_section(study: Results) -> OtherParametersSection | None:
    """Describe the surrogate behind the sliders; None without a surrogate."""
    if study.surrogate is None:
        return None
    surrogate = unwrap_scales(study.surrogate)
    return OtherParametersSection(
        surrogate.name,
        has_network(surrogate),
        constraints=", ".join(
            constraint.text for constraint in study.parameters.constraints
        ),
    )


def make_method_section(study: Results) -> MethodSection:
    """Describe the steps to the answer, with their figures."""
    return MethodSection(
        steps=_list_steps(study),
        search_result=_describe_search_result(study),
        sets_found=_make_table_of_sets_found(study),
        figures=embed_captioned_pictures(study.files, study.captions),
    )


def _describe_search_result(study: Results) -> str:
    """Describe how many parameter sets the search kept."""
    kind = "meet the targets" if study.summary["feasible"] else "come nearest"
    return (
        f"The search kept {len(study.solutions)} parameter sets that are predicted to "
        f"{kind}."
    )


def _make_table_of_sets_found(study: Results) -> Table | None:
    """Tabulate the ranges of the parameters in the sets that the search kept.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    Table or None
        A row for each free parameter; None if the search kept fewer than two sets.
    """
    if len(study.solutions) < 2:
        return None
    rows = []
    for name, (low, high) in parameter_ranges(study.parameters).items():
        values = study.solutions[name]
        searched = f"{low:.3g} to {high:.3g}"
        rows.append([name, f"{values.min():.3g} to {values.max():.3g}", searched])
    return Table(["parameter", "smallest to largest value", "searched"], rows, "lines")


def _list_steps(study: Results) -> list[str]:
    """List the steps to the answer, in one sentence each."""
    if study.simulator is not None:
        return [*_list_strategy_steps(study), OTHER_PROGRAM_STEP]
    return _list_strategy_steps(study)


def _list_strategy_steps(study: Results) -> list[str]:
    """List the steps that the strategy reports, or those of the article's method.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    list of str
        The steps in their order.
    """
    if "steps" in study.summary:
        return list(study.summary["steps"])

    keys = {"by_status": dict, "runs_by_status": dict}
    simulated = read_json(study.files["dataset_summary"], keys)
    counts = describe_counts(simulated["by_status"], simulated["runs_by_status"])
    steps = []
    if study.settings is not None:
        steps.append(_describe_design(study, study.settings.design))
    steps.append(f"{_describe_simulation(study)}: {counts}")
    if study.surrogate is not None:
        surrogate = study.surrogate.name.replace("_", " ")
        steps.append(f"Surrogate ({surrogate}): {_describe_accuracy(study)}")
    steps.append(f"Search: {study.summary['message']}")
    n_runs = study.answer_row.get("n_seeds", 0)
    steps.append(
        f"Check: {len(study.checked_sets)} of the sets found were simulated again with "
        f"new seeds; the answer {n_runs:.0f} times."
    )
    return steps


def _describe_simulation(study: Results) -> str:
    """Describe what was simulated, or by which other program."""
    if study.simulator is not None:
        return f"Simulation by {study.simulator}"
    bench_tests = " and ".join(study.targets.apparatus).replace("_", " ")
    return f"Simulation of the bench test ({bench_tests})"


def _describe_design(study: Results, design: DesignSettings) -> str:
    """Describe the parameter sets of the design."""
    n_free = study.parameters.dimensions
    n_parameters = len(study.parameters.names)
    searched = f"{n_free} parameters"
    if n_free < n_parameters:
        searched = f"{n_free} of {n_parameters} parameters, the others fixed"
    method = METHOD_LABELS[design.method]
    return f"Design: {design.samples} parameter sets over {searched} ({method})."


def _describe_accuracy(study: Results) -> str:
    """Describe the accuracy of the surrogate on samples that it was not trained on.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    str
        The end of a sentence about the surrogate, and possibly a further sentence.
    """
    test_metrics = read_json(study.files["metrics"]).get("test") or {}
    accuracies = []
    for response in study.targets.responses:
        metrics = test_metrics.get(response.name, {})
        # The error may be missing or null in the file.
        rmse = metrics.get("rmse") or np.nan
        if np.isfinite(rmse):
            accuracies.append(
                f"{response.label} to {format_significant(rmse, 2)} {response.unit} "
                f"(R² {metrics['r2']:.2f})"
            )
    if not accuracies:
        return "its accuracy was not tested."
    predictions = " and the ".join(accuracies)
    return (
        f"on samples that it had not learned from, it predicts the {predictions}."
        f"{_describe_noise_of_samples(study)}"
    )


def _describe_noise_of_samples(study: Results) -> str:
    """Describe the standard errors of the samples.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    str
        One sentence, which begins with a space. It is empty if no standard errors are
        known, for example because each sample has a single run.
    """
    clauses = []
    for target in study.targets:
        errors = study.samples.get(target.response.standard_error)
        if errors is None or errors.isna().all():
            continue
        noise = np.sqrt((errors**2).mean())
        clauses.append(f"{noise:.2g} {target.response.unit}".rstrip())
    if not clauses:
        return ""
    return (
        f" The means of the samples have standard errors of {' and '.join(clauses)}, "
        "which no model can predict."
    )


def fold_tables(tables: Mapping[str, pd.DataFrame]) -> list[FoldedTable]:
    """Prepare the tables, by title, so that each can be unfolded by a click."""
    return [fold_table(title, frame) for title, frame in tables.items()]


def make_template_values(
    study: Results, tables: Mapping[str, pd.DataFrame]
) -> dict[str, Any]:
    """Make all sections of the page, by their names in the templates."""
    return {
        "answer": make_answer_section(study),
        "material": make_material_section(study),
        "check": make_check_section(study),
        "drum": make_drum_section(study),
        "other_parameters": make_other_parameters_section(study),
        "method": make_method_section(study),
        "tables": fold_tables(tables),
    }
