"""Collect what each section of the report says, as plain values for its template."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.bench.parameters import LABELS
from repose.calibrate.answer import (
    NEAR_BOUNDS_INTRODUCTION,
    Check,
    describe_differences,
    describe_optimism,
)
from repose.calibrate.bounds import describe_near_bound
from repose.calibrate.card import add_remark, make_interval_entry
from repose.calibrate.designs.latin_hypercube import METHOD_LABELS
from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.determination import Determination, judge_determination
from repose.calibrate.responses import compute_deviation_percent
from repose.calibrate.runs import describe_overlaps, name_error_column
from repose.calibrate.samples_inside import describe_samples_inside, find_samples_inside
from repose.calibrate.targets import Target
from repose.calibrate.uncertainty.posterior import MAX_R_HAT
from repose.common.files import read_json, read_table
from repose.common.numbers import format_percent, format_significant, format_with_error
from repose.common.statuses import describe_failures
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import describe_line_of_response, line_of
from repose.report.page import captions
from repose.report.page.material import (
    describe_size,
    tabulate_laws,
    tabulate_material,
)
from repose.report.page.pictures import (
    EmbeddedPicture,
    embed_captioned_pictures,
    embed_picture,
)
from repose.report.page.prediction import has_network, unwrap_scales
from repose.report.page.study import Results
from repose.report.page.tables import (
    ROUNDING_FRACTION,
    CollapsibleTable,
    Table,
    make_collapsible_table,
)
from repose.report.page.verdict import (
    VerdictText,
    make_checks,
    make_verdict,
)
from repose.report.study_view import parameter_ranges
from repose.stages.card import read_card as read_card
from repose.stages.dataset import count_views, describe_counts, describe_views
from repose.stages.published import REPRESENTATIVE

# The last step of a study whose runs another program made
OTHER_PROGRAM_STEP = (
    "The runs were made by another program, so this report has no grain, no drum, no "
    "published sets and no pictures of piles."
)
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
    note: str | None  # what its configuration says about the data
    verdict: VerdictText
    impossible_targets: list[str]
    origin: str  # when, and by which version and machine, the results were made
    determination: str  # how many parameters are determined; empty without intervals
    samples_meeting_targets: str  # how many there are; empty if there are few
    # How far the simulated means are from the measured ones; empty if the answer was
    # not simulated again
    differences: str
    near_bounds: str  # parameters that may be at a bound; empty without any
    table: Table
    published_source: str  # of the answer in the table; empty if there is none
    leading_figure: EmbeddedPicture | None  # shown beside the verdict
    has_intervals: bool
    intervals_are_unsettled: bool


@dataclass(frozen=True)
class CheckSection:
    """Measured, predicted and simulated responses, and the pile."""

    responses: Table
    has_simulations: bool  # whether the answer was simulated again
    failures: str  # of these simulations; empty without any
    overlaps: str  # a warning of deep overlaps in them
    views: str  # how many of their side views are doubtful; empty without piles
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
    disagrees: bool  # whether the comparison shows a disagreement with the article
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


def make_answer_section(results: Results) -> AnswerSection:
    """Describe the parameters, their intervals, and whether they meet the targets."""
    posterior = results.posterior
    is_unsettled = posterior is not None and posterior["r_hat"].max() > MAX_R_HAT
    return AnswerSection(
        label=results.label,
        note=results.note,
        verdict=make_verdict(results),
        impossible_targets=list_warnings_of_impossible_targets(results.files),
        origin=_describe_origin(results),
        determination=_describe_determination(results),
        samples_meeting_targets=_describe_samples_meeting_targets(results),
        differences=_describe_differences(results),
        near_bounds=_describe_near_bounds(results),
        table=_make_parameter_table(results),
        published_source=_find_published_source(results),
        leading_figure=_embed_leading_figure(results),
        has_intervals=posterior is not None,
        intervals_are_unsettled=bool(is_unsettled),
    )


def _find_leading_figure(results: Results) -> str | None:
    """Return the name of the figure for the top of the page; None if there is none."""
    for name in captions.LEADING_FIGURES:
        if name in results.files and name in results.captions:
            return name
    return None


def _embed_leading_figure(results: Results) -> EmbeddedPicture | None:
    """Embed the figure for the top of the page; None if there is none."""
    name = _find_leading_figure(results)
    if name is None:
        return None
    return embed_picture(results.files[name], results.captions[name])


def list_warnings_of_impossible_targets(files: Mapping[str, str]) -> list[str]:
    """List the card's warnings about target angles that no pile can have.

    Such an angle is impossible for a pile of the measured height. Without a material
    card, the list is empty.
    """
    if "card" not in files:
        return []
    # A bench test has the key `reach` if the card compares its targets with the angles
    # that are possible.
    sentences = []
    for test in read_card(files["card"])["tests"]:
        if "reach" in test and not test["reach"]["possible"]:
            sentences.append(test["reach"]["sentence"])
    return sentences


def _describe_origin(results: Results) -> str:
    """State when the results were made, and by which version and processor.

    If the piles were simulated by our own engine, also warn that another type of
    processor rounds differently, and therefore gives other piles.
    """
    version = results.origin.get("repose")
    processor = results.origin.get("processor")
    commit = ""
    if results.origin.get("commit"):
        commit = f", commit {results.origin['commit']}"
    warning = ""
    if results.settings is not None and results.simulator is None:
        warning = (
            " On another type of processor, the same study gives other piles, and "
            "therefore other parameters."
        )
    return (
        f"Results of {results.date}, by repose {version}{commit}, on {processor}."
        f"{warning}"
    )


def _describe_determination(results: Results) -> str:
    """Describe for how many parameters the measurements narrow the 95 % interval.

    `repose.calibrate.determination` says when an interval does not determine its
    parameter.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    str
        One sentence. It is empty if the study has no intervals of the parameters.
    """
    if results.posterior is None:
        return ""
    # Width of each interval, divided by its width without the measurements.
    width_fractions = results.posterior["width_ratio"]
    n_parameters = len(width_fractions)
    n_narrowed = sum(
        _judge_determination(row) is not Determination.NOT
        for _, row in results.posterior.iterrows()
    )
    # The intervals are estimates, so this fraction may slightly exceed 1.
    narrowest = 100 * min(width_fractions.min(), 1.0)
    condition = (
        f"With the assumed error of the simulator{_list_assumed_errors(results)}"
    )
    if n_narrowed == 0:
        return (
            f"{condition}, the measurements determine none of the {n_parameters} "
            f"parameters: each 95 % interval has {narrowest:.0f} % or more of the "
            "width that it would have without the measurements."
        )
    return (
        f"{condition}, the measurements narrow the intervals of {n_narrowed} of the "
        f"{n_parameters} parameters: the narrowest 95 % interval has "
        f"{narrowest:.0f} % of the width that it would have without the measurements."
    )


def _list_assumed_errors(results: Results) -> str:
    """List the assumed errors in brackets, such as `` (2 deg, 2.5 mm)``."""
    if not results.assumed_errors:
        return ""
    errors = [
        _format_with_unit(error, target.response.unit)
        for target, error in zip(results.targets, results.assumed_errors, strict=True)
    ]
    return f" ({', '.join(errors)})"


def _describe_samples_meeting_targets(results: Results) -> str:
    """Describe how many samples meet all targets, and how far apart they are.

    A sample is a simulated parameter set.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    str
        One sentence. It is empty if fewer than two samples meet all targets.
    """
    found = find_samples_inside(results.samples, results.parameters, results.targets)
    return describe_samples_inside(found)


def _describe_differences(results: Results) -> str:
    """Describe how far the simulated means are from the measured ones.

    Further sentences name the means that miss their aim, and state the scatter of
    single simulations and the standard errors of the measured means.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    str
        The sentences; empty if the answer was not simulated again.
    """
    if not results.get_number("n_seeds"):
        return ""  # without new seeds, the answer was not simulated again
    checks = list(make_checks(results))
    # Name the responses by their labels, which readers understand.
    named_checks = [replace(check, response=check.label) for check in checks]
    sentences = [describe_differences(named_checks)]
    sentences += _describe_missed_means(checks)
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
    # The errors above are those of the simulation alone. That of a measured mean
    # follows from the standard deviation of its repetitions.
    errors = [
        _format_with_unit(check.sd / math.sqrt(check.repetitions), check.unit)
        for check in checks
    ]
    sentences.append(
        f"The standard errors of the measured means, {' and '.join(errors)}, are not "
        "included in these numbers."
    )
    return " ".join(sentences)


# From this many standard errors on, a simulated mean misses the measured one.
MISSED_STANDARD_ERRORS = 2.0


def _describe_missed_means(checks: Iterable[Check]) -> list[str]:
    """Describe the simulated means that differ from the measured ones beyond chance.

    Only the error of the simulated mean decides, because the aim of a calibration is
    the measured mean itself.

    Parameters
    ----------
    checks : iterable of Check
        One for each target.

    Returns
    -------
    list of str
        A sentence for each mean that is `MISSED_STANDARD_ERRORS` or more away.
    """
    sentences = []
    for check in checks:
        if check.simulated is None or not check.standard_error:
            continue
        difference = check.simulated - check.measured
        errors = abs(difference) / check.standard_error
        if errors < MISSED_STANDARD_ERRORS:
            continue
        error_of_measured = check.sd / math.sqrt(check.repetitions)
        error_of_both = math.hypot(check.standard_error, error_of_measured)
        side = "below" if difference < 0 else "above"
        sentences.append(
            f"The mean {check.label} misses its aim, the measured mean: it lies "
            f"{errors:.1f} of its standard errors {side} it. With the error of the "
            f"measurement, the distance is {abs(difference) / error_of_both:.1f} "
            "standard errors."
        )
    return sentences


def _describe_near_bounds(results: Results) -> str:
    """Describe which parameters may lie at a bound; empty if there are none."""
    clauses = [
        describe_near_bound(near) for near in results.summary.get("near_bounds", ())
    ]
    return f"{NEAR_BOUNDS_INTRODUCTION}: {'; '.join(clauses)}." if clauses else ""


def _make_parameter_table(results: Results) -> Table:
    """Tabulate the parameters of the answer."""
    columns = ["parameter", "meaning", "value"]
    if results.published_answer is not None:
        columns.append("published answer")
    if results.posterior is not None:
        columns += ["95 % interval", "left open"]
    columns.append("searched")
    rows = [
        _make_parameter_row(results, name, value)
        for name, value in zip(
            results.parameters.names, results.answer.tolist(), strict=True
        )
    ]
    return Table(columns, rows, style="answer")


def _find_published_source(results: Results) -> str:
    """Find the work from which the published answer is; empty if there is none."""
    if results.published_answer is None:
        return ""
    source = results.published_answer.get("source")
    return source if isinstance(source, str) else "source not stated"


def _format_with_unit(value: float, unit: str) -> str:
    """Write a number with two digits and its unit, which may be empty."""
    return f"{format_significant(value, 2)} {unit}".rstrip()


def _make_parameter_row(results: Results, name: str, value: float) -> list[str]:
    """Make the cells of one parameter in the table of the answer.

    The cells must match the columns of `_make_parameter_table`. One of the columns has
    the value of the published answer. Two describe the 95 % interval of the parameter,
    and exist only if the study has intervals.

    Parameters
    ----------
    results : Results
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
    parameters = results.parameters
    label = LABELS.get(name, "")  # empty for parameters of another simulator
    published_cells = []
    if results.published_answer is not None:
        published = results.published_answer[name]
        published_cells.append(format_significant(published, 3))
    if name in parameters.fixed:
        empty_cells = [] if results.posterior is None else ["", ""]
        cells = [name, label, format_significant(value)]
        return [*cells, *published_cells, *empty_cells, "fixed"]

    low = value
    high = value
    row = None if results.posterior is None else results.posterior.loc[name]
    if row is not None:
        low = float(row["credible_low"])
        high = float(row["credible_high"])
    # Widen the interval, if necessary, so that it contains the value. The result also
    # contains remarks: that the interval was widened, or that the value lies at an end
    # of its range. Without a posterior, only these remarks are used.
    interval = make_interval_entry(parameters, name, value=value, low=low, high=high)
    interval_cells: list[str] = []
    if row is not None:
        interval_cells = [
            _format_ends(interval["low"], interval["high"]),
            _describe_fraction_left_open(row),
        ]
    searched = _format_ends(*parameter_ranges(parameters)[name])
    # `add_remark` separates label and remark by "; ". Remove it after an empty label.
    meaning = add_remark(label, interval).removeprefix("; ")
    cells = [name, meaning, format_significant(value, 3)]
    return [*cells, *published_cells, *interval_cells, searched]


def _format_ends(low: float, high: float) -> str:
    """Write both ends of an interval with three digits."""
    return f"{format_significant(low, 3)} to {format_significant(high, 3)}"


def _describe_fraction_left_open(row: pd.Series) -> str:
    """Write how much of a parameter's range the measurements leave open, in percent.

    `row` is that of posterior.csv. Its `width_ratio` is the width of the 95 % interval
    over its width without the measurements. The intervals are estimates, so the ratio
    may slightly exceed 1.
    """
    percent = f"{100 * min(row['width_ratio'], 1.0):.0f} %"
    determination = _judge_determination(row)
    if determination is Determination.NOT:
        return f"{percent}: {determination}"
    return percent


def _judge_determination(row: pd.Series) -> Determination:
    """Judge how well the measurements determine the parameter of a row of posterior.csv."""
    return judge_determination(row["width_ratio"], row["information_bits"])


# --- The material ---------------------------------------------------------------------


def make_material_section(results: Results) -> MaterialSection | None:
    """Describe the material and the contact laws.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    MaterialSection or None
        The section. It is None if the study has no card, or if another program
        simulated the study.
    """
    if "card" not in results.files:
        return None
    card = read_card(results.files["card"])
    # The card of another simulator has no contact laws.
    if "laws" not in card:
        return None
    if "simulation" not in card and results.settings is not None:
        # Cards of earlier versions have neither gravity nor time step. Add both to the
        # card in memory, from the configuration.
        simulation = results.settings.simulation
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


def make_check_section(results: Results) -> CheckSection:
    """Describe measured, predicted and simulated responses, and the pile."""
    return CheckSection(
        responses=_make_response_table(results),
        has_simulations=results.get_number("n_seeds") is not None,
        failures=_describe_failures(results),
        overlaps=describe_overlaps(results.runs_of_answer),
        views=describe_views(count_views(results.runs_of_answer)),
        angle_definitions=_make_table_of_angle_definitions(results),
        has_view="trajectory" in results.files,
        pile_pictures=embed_captioned_pictures(results.files, captions.PILE_PICTURES),
        checked_sets=_make_table_of_checked_sets(results),
        abbreviations=_explain_abbreviations(results),
        has_published_sets=len(results.published_sets) > 0,
    )


def _describe_failures(results: Results) -> str:
    """Describe how many of the answer's runs failed and why; empty if none did."""
    statuses = [run["status"] for run in results.runs_of_answer]
    failures = Counter(status for status in statuses if status != "ok")
    if not failures:
        return ""
    return f"Of these {len(statuses)} simulations, {describe_failures(failures, 'failed')}."


def _make_response_table(results: Results) -> Table:
    """Tabulate the responses of the answer.

    Without new simulations, the last column contains the predictions.
    """
    columns = ["response", "measured", "target range", "predicted"]
    if results.get_number("n_seeds") is not None:
        columns += ["simulated", "difference", "inside"]
    # Each row is made for all columns. Drop the cells of columns that are not shown.
    rows = [
        _make_response_row(results, target)[: len(columns)]
        for target in results.targets
    ]
    return Table(columns, rows, style="check")


def _make_response_row(results: Results, target: Target) -> list[str]:
    """Make the cells of one target in the table of the responses.

    The cells are in the order of the columns of `_make_response_table`. The last three
    cells are about new simulations. They are made in any case, and the table drops them
    if the answer was not simulated again.

    Parameters
    ----------
    results : Results
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
    target_range = (
        f"{format_significant(target.low)} to {format_significant(target.high)} {unit}"
    )

    # Write the simulated mean, and its difference from the measured mean.
    simulated = results.get_number(response.simulated)
    error = results.get_number(response.standard_error)
    simulated_text = _format_mean_with_error(simulated, error, f" {unit}")
    difference = ""
    if simulated is not None:
        # `whole_value` counts as 100 %. For most targets it is the measured value.
        percent = 100 * (simulated - target.value) / target.whole_value
        difference = f"{percent:+.1f} %"

    probability_inside = format_percent(results.probability[target.name])
    return [
        response.label,
        measured,
        target_range,
        _format_prediction(results, target),
        simulated_text,
        difference,
        probability_inside,
    ]


def _format_prediction(results: Results, target: Target) -> str:
    """Write the predicted response of the answer, with its expected optimism.

    Parameters
    ----------
    results : Results
        The results of the study.
    target : Target
        The target of the response.

    Returns
    -------
    str
        The prediction; empty if there is none.
    """
    response = target.response
    predicted = results.get_number(response.predicted)
    if predicted is None:
        return ""
    text = f"{format_significant(predicted)} {response.unit}"
    optimism = results.get_number(response.optimism)
    if optimism is None:
        return text
    expected = describe_optimism(optimism, results.get_number(response.optimism_error))
    return f"{text} ({expected.replace('+-', '±')})"


def _make_table_of_angle_definitions(results: Results) -> Table | None:
    """Tabulate the angle of repose of the answer's piles, by each of its definitions.

    The angle is the slope of a line through the side of a pile. Each definition draws
    this line through other points of the side.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    Table or None
        A row for each definition. The table is None if the study has no piles, or if
        its results do not contain all of these angles.
    """
    measure = results.measure
    # `MEAN_KEYS` contains the column of the mean angle for each definition.
    has_all_angles = set(MEAN_KEYS.values()) <= set(results.answer_row.index)
    if measure is None or not has_all_angles:
        return None
    calibrated_lines = {
        describe_line_of_response(measure, name) for name in results.targets.names
    }
    rows = []
    for definition, column in MEAN_KEYS.items():
        line = line_of(measure, definition)
        mean = results.get_number(column)
        error = results.get_number(name_error_column(column))
        remark = "calibrated" if line in calibrated_lines else ""
        rows.append([line, _format_mean_with_error(mean, error, " deg"), remark])
    # The column of the remarks needs no header.
    return Table(["line", "simulated", ""], rows, style="lines")


class _Cell(NamedTuple):
    """A cell of a table with the header of its column."""

    header: str
    value: Any


def _make_table_of_checked_sets(results: Results) -> Table | None:
    """Tabulate the parameter sets that were simulated again, with their responses.

    Published sets follow in further rows, with the numbers from their publication. The
    result is None if no parameter set but the answer was simulated again.
    """
    if len(results.checked_sets) < 2:
        return None
    cells_of_rows = [
        _make_cells_of_set(results, row) for _, row in results.checked_sets.iterrows()
    ]
    for _, row in results.published_sets.iterrows():
        published = _mark_as_published(row)
        cells_of_rows.append(
            _make_cells_of_set(results, published, placeholder="not published")
        )
    return Table(
        # All rows have the same headers.
        columns=[cell.header for cell in cells_of_rows[0]],
        rows=[[cell.value for cell in cells] for cells in cells_of_rows],
        style="sets",
        # Do not print the published sets, which are the last rows.
        screen_rows=len(results.published_sets),
    )


def _mark_as_published(row: pd.Series) -> pd.Series:
    """Return a copy of a published set whose name and role say that it is published.

    Published sets are numbered, as are the sets of the study. So the number alone would
    not tell them apart in one table.
    """
    name = row["solution"]
    marked = row.copy()
    # This name stands for the set that the publication recommends.
    if name == REPRESENTATIVE:
        marked["solution"] = "published answer"
    else:
        marked["solution"] = f"published {name}"
    marked["role"] = "published"
    return marked


def _explain_abbreviations(results: Results) -> str:
    """Explain the symbols of those responses whose label is different."""
    sentences = []
    for response in results.targets.responses:
        if response.symbol != response.label:
            sentences.append(f"{response.symbol}: {response.label}.")
    return " ".join(sentences)


def _make_cells_of_set(
    results: Results, row: pd.Series, placeholder: str = "no result"
) -> list[_Cell]:
    """Make the cells of one parameter set, from left to right.

    All sets must get the same headers, because they become rows of one table. So the
    headers depend only on the study and on the columns of `checked_sets`.

    Parameters
    ----------
    results : Results
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
    for name in results.parameters.names:
        cells.append(_Cell(name, format_significant(row[name], 3)))
    for response in results.targets.responses:
        symbol = response.symbol
        unit = response.unit or "–"
        predicted = row.get(response.predicted)
        simulated = row.get(response.simulated)
        cells.append(_Cell(f"{symbol} predicted ({unit})", predicted))
        # The expected optimism is by how much a prediction probably exceeds the truth.
        # It is not known in every study, and never for published sets.
        if response.optimism in results.checked_sets:
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


def make_drum_section(results: Results) -> DrumSection | None:
    """Describe the check of the answer in the drum.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    DrumSection or None
        The section; None if the study does not include this check.
    """
    if "drum_summary" not in results.files:
        return None
    summary = read_table(results.files["drum_summary"], ("quantity", "key", "mean"))
    summary = summary.set_index("key")
    rows = []
    for key, unit in DRUM_QUANTITIES.items():
        if key in summary.index:
            quantity = summary.loc[key]
            mean = _format_mean_with_error(
                quantity["mean"], quantity["standard_error"], f" {unit}"
            )
            rows.append([quantity["quantity"], mean, f"{quantity['runs']:.0f}"])
    # Only the study of the article's grain has published sets. Other studies have
    # nothing to compare.
    comparison = ""
    disagrees = False
    if len(results.published_sets) > 0:
        comparison, disagrees = _compare_slip_with_article(summary)
    return DrumSection(
        comparison=comparison,
        disagrees=disagrees,
        table=Table(["quantity", "simulated", "runs"], rows, style="drum"),
        figures=embed_captioned_pictures(results.files, captions.DRUM_FIGURES),
    )


def _compare_slip_with_article(summary: pd.DataFrame) -> tuple[str, bool]:
    """Compare the first slip of the bed of grains in the simulation and in the article.

    Parameters
    ----------
    summary : DataFrame
        Means of the drum's quantities, by their keys.

    Returns
    -------
    sentences : str
        The comparison. It is empty if one of two angles is missing: `SLIP_ANGLE`, at
        the first slip, or `REPORT_ANGLE`, at the end of the article's run.
    disagrees : bool
        Whether the simulated bed first slips after the end of the article's run.
    """
    if SLIP_ANGLE not in summary.index or REPORT_ANGLE not in summary.index:
        return "", False
    slip_deg = summary.loc[SLIP_ANGLE, "mean"]
    report_deg = summary.loc[REPORT_ANGLE, "mean"]
    comparison = (
        "According to the times in the article, the drum has turned by "
        f"{report_deg:.0f}° at the end of its run. The article shows the bed after a "
        "slip, but does not state the angle of the slip. Here the bed first slips at "
        f"{slip_deg:.0f}°."
    )
    # If the bed slips at a larger angle, it has not slipped yet when the article's run
    # ends, but the bed in the article has.
    disagrees = bool(slip_deg > report_deg)
    if disagrees:
        comparison += " So in this test the simulation disagrees with the article."
    return comparison, disagrees


# --- Other parameters, the method, the tables -----------------------------------------


def make_other_parameters_section(results: Results) -> OtherParametersSection | None:
    """Describe the surrogate behind the sliders; None without a surrogate."""
    if results.surrogate is None:
        return None
    surrogate = unwrap_scales(results.surrogate)
    return OtherParametersSection(
        surrogate.name,
        has_network(surrogate),
        constraints=", ".join(
            constraint.text for constraint in results.parameters.constraints
        ),
    )


def make_method_section(results: Results) -> MethodSection:
    """Describe the steps to the answer, with their figures."""
    # The first figure is at the top of the page already.
    leading_name = _find_leading_figure(results)
    further_captions = {
        name: caption
        for name, caption in results.captions.items()
        if name != leading_name
    }
    return MethodSection(
        steps=_list_steps(results),
        search_result=_describe_search_result(results),
        sets_found=_make_table_of_sets_found(results),
        figures=embed_captioned_pictures(results.files, further_captions),
    )


def _describe_search_result(results: Results) -> str:
    """Describe how many parameter sets the search kept."""
    kind = "meet the targets" if results.summary["feasible"] else "come nearest"
    return (
        f"The search kept {len(results.solutions)} parameter sets that are predicted to "
        f"{kind}."
    )


def _make_table_of_sets_found(results: Results) -> Table | None:
    """Tabulate between which values each parameter lies in the sets of the search.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    Table or None
        A row for each free parameter; None if the search kept fewer than two sets.
    """
    if len(results.solutions) < 2:
        return None
    rows = []
    for name, (low, high) in parameter_ranges(results.parameters).items():
        values = results.solutions[name]
        found = _format_ends(values.min(), values.max())
        rows.append([name, found, _format_ends(low, high)])
    columns = ["parameter", "smallest to largest value", "searched"]
    return Table(columns, rows, style="lines")


def _list_steps(results: Results) -> list[str]:
    """List the steps to the answer, in one sentence each."""
    if results.simulator is not None:
        return [*_list_strategy_steps(results), OTHER_PROGRAM_STEP]
    return _list_strategy_steps(results)


def _list_strategy_steps(results: Results) -> list[str]:
    """List the steps to the answer, from the design to the check.

    If the strategy reports its own steps, they are returned. Otherwise the steps are
    those of the default method, which follows the article.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    list of str
        The steps in their order.
    """
    if "steps" in results.summary:
        return list(results.summary["steps"])

    # Check that the file contains these keys, with values of these types.
    keys = {"by_status": dict, "runs_by_status": dict}
    simulated = read_json(results.files["dataset_summary"], keys)
    counts = describe_counts(
        simulated["by_status"], simulated["runs_by_status"], views=simulated
    )
    steps = []
    if results.settings is not None:
        steps.append(_describe_design(results, results.settings.design))
    steps.append(f"{_describe_simulation(results)}: {counts}")
    if results.surrogate is not None:
        surrogate = results.surrogate.name.replace("_", " ")
        steps.append(f"Surrogate ({surrogate}): {_describe_accuracy(results)}")
    steps.append(f"Search: {_describe_search(results)}{results.summary['message']}")
    n_runs = results.answer_row.get("n_seeds", 0)  # a run for each seed
    steps.append(
        f"Check: {len(results.checked_sets)} of the parameter sets found were "
        f"simulated again with new seeds. There were {n_runs:.0f} runs of the answer."
    )
    return steps


def _describe_search(results: Results) -> str:
    """Describe the search: its islands, its generations and its evaluations.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    str
        One sentence that ends with a blank. It is empty if the settings or the number
        of evaluations are unknown.
    """
    evaluations = results.summary.get("evaluations")
    if results.settings is None or evaluations is None:
        return ""
    search = results.settings.miga
    return (
        "a genetic algorithm with several populations (MIGA) improved "
        f"{search.islands} islands of {search.population} parameter sets over "
        f"{search.rounds * search.generations:,} generations. It evaluated the "
        f"surrogate {evaluations:,} times and kept {len(results.solutions)} parameter "
        "sets. "
    )


def _describe_simulation(results: Results) -> str:
    """Describe what was simulated, or by which other program."""
    if results.simulator is not None:
        return f"Simulation by {results.simulator}"
    bench_tests = " and ".join(results.targets.apparatus).replace("_", " ")
    return f"Simulation of the bench test ({bench_tests})"


def _describe_design(results: Results, design: DesignSettings) -> str:
    """Describe the parameter sets of the design."""
    n_free = results.parameters.dimensions
    n_parameters = len(results.parameters.names)
    searched = f"{n_free} parameters"
    if n_free < n_parameters:
        searched = f"{n_free} of {n_parameters} parameters, the others fixed"
    method = METHOD_LABELS[design.method]
    return f"Design: {design.samples} parameter sets over {searched} ({method})."


def _describe_accuracy(results: Results) -> str:
    """Describe the accuracy of the surrogate on samples that it was not trained on.

    The text continues a sentence that `_list_strategy_steps` begins.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    str
        The end of this sentence, and possibly a further sentence.
    """
    test_metrics = read_json(results.files["metrics"]).get("test") or {}
    accuracies = []
    for response in results.targets.responses:
        metrics = test_metrics.get(response.name, {})
        # The root mean square error may be missing or null in the file.
        rmse = metrics.get("rmse")
        if rmse is not None and np.isfinite(rmse):
            accuracies.append(
                f"{response.label} to {format_significant(rmse, 2)} {response.unit} "
                f"(R² {metrics['r2']:.2f})"
            )
    if not accuracies:
        return "its accuracy was not tested."
    predictions = " and the ".join(accuracies)
    sentences = [
        f"on samples that it had not learned from, it predicts the {predictions}."
    ]
    noise = _describe_noise_of_samples(results)
    if noise:
        sentences.append(noise)
    return " ".join(sentences)


def _describe_noise_of_samples(results: Results) -> str:
    """Describe the standard errors of the samples' means.

    For each response, the text states the root mean square of the errors.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    str
        One sentence. It is empty if no standard errors are known, for example because
        each sample has a single run.
    """
    clauses = []
    for target in results.targets:
        errors = results.samples.get(target.response.standard_error)
        if errors is None or errors.isna().all():
            continue
        noise = np.sqrt((errors**2).mean())
        clauses.append(_format_with_unit(noise, target.response.unit))
    if not clauses:
        return ""
    return (
        f"The means of the samples have standard errors of {' and '.join(clauses)}, "
        "which no model can predict."
    )


def make_collapsible_tables(
    tables: Mapping[str, pd.DataFrame],
) -> list[CollapsibleTable]:
    """Convert tables, by title, to tables that a click on the title shows or hides."""
    return [
        make_collapsible_table(title, frame, captions.TABLE_NOTES.get(title, ""))
        for title, frame in tables.items()
    ]


def make_template_values(
    results: Results, tables: Mapping[str, pd.DataFrame]
) -> dict[str, Any]:
    """Make all sections of the page, by their names in the templates."""
    return {
        "answer": make_answer_section(results),
        "material": make_material_section(results),
        "check": make_check_section(results),
        "drum": make_drum_section(results),
        "other_parameters": make_other_parameters_section(results),
        "method": make_method_section(results),
        "tables": make_collapsible_tables(tables),
    }
