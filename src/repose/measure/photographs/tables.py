"""Write tables and a description of measured photographs, and targets made from them.

A table has a row for each photograph, and a summary has the means. The targets are
written in the form of a study's configuration.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from repose.common.files import write_table, write_text
from repose.common.numbers import format_decimals
from repose.common.target_range import compute_target_range
from repose.measure.definitions import DEFINITIONS, MEAN_KEYS
from repose.measure.outline_shape import LARGEST_SIDE_DIFFERENCE_DEG
from repose.measure.photographs.photograph import Photograph
from repose.measure.results import Measurement
from repose.measure.settings import MeasureSettings, line_of

DECIMALS_OF_GEOMETRY = 5  # of a scale or a tilt in the table of photographs
DECIMALS_OF_STATISTICS = 3
TARGETED_NUMBERS = ("aor_deg", "height_mm")  # numbers that become targets
TARGETS_FILE = "targets.yaml"
# Settings of the line whose slope is the angle. They are written above the targets,
# because a study must measure its piles by the same line.
LINE_SETTINGS = ("response", "fit_from", "fit_to", "flank", "smallest_window")
NO_SCATTER_NOTE = (
    "one pile gives no scatter: photograph more piles, or fill in sd and range in "
    "targets.yaml yourself"
)


class Tables(NamedTuple):
    """Results of photographs.

    Attributes
    ----------
    photographs : DataFrame
        A row for each photograph. A rejected photograph has empty cells, and the reason
        in the column `refused`.
    summary : DataFrame
        A row for each measured number, with the columns response (its name), value (the
        mean), sd (the standard deviation) and repetitions (the number of photographs).
    doubtful : bool
        Whether the summary includes all doubtful photographs. Otherwise it includes
        only those whose single doubt is that the two sides of the pile differ.
    """

    photographs: pd.DataFrame
    summary: pd.DataFrame
    doubtful: bool = False


def make_tables(
    measured: Sequence[Photograph], settings: MeasureSettings, doubtful: bool = False
) -> Tables:
    """Make a table with a row for each photograph, and a summary of its columns.

    Parameters
    ----------
    measured : sequence of Photograph
        The photographs, of which at least one was measured.
    settings : MeasureSettings
        Settings of the measurement.
    doubtful : bool
        Whether the summary includes all doubtful photographs. Otherwise it includes
        only those whose single doubt is that the two sides of the pile differ.

    Returns
    -------
    Tables
        Both tables.
    """
    rows = [_make_row(photograph, settings) for photograph in measured]
    table = pd.DataFrame(rows)
    is_counted = [doubtful or not photograph.warnings for photograph in measured]
    counted_rows = table[is_counted]
    summary = summarise_columns(counted_rows, (*TARGETED_NUMBERS, *MEAN_KEYS.values()))
    return Tables(table, summary, doubtful)


def _make_row(photograph: Photograph, settings: MeasureSettings) -> dict[str, Any]:
    """Make the row of a photograph in the table, with its numbers and remarks.

    Parameters
    ----------
    photograph : Photograph
        The result. A rejected photograph has no measured numbers.
    settings : MeasureSettings
        Settings of the measurement. Their height of a grain is written to the column
        ``grain_mm``.

    Returns
    -------
    dict
        The cells by column. The column ``refused`` has the reason why the photograph
        was rejected, and ``note`` has its remarks, which are its note and its warnings.
    """
    row: dict[str, Any] = {"photograph": photograph.path.name}
    if photograph.measurement is not None:
        row |= photograph.measurement.record()
    for name, value in photograph.geometry.items():
        row[name] = round(value, DECIMALS_OF_GEOMETRY)
    row["grain_mm"] = settings.berry_height_mm
    row["refused"] = "; ".join(photograph.all_rejection_reasons)
    row["note"] = photograph.remarks
    return row


def summarise_columns(
    photographs: pd.DataFrame, columns: Sequence[str]
) -> pd.DataFrame:
    """Compute the mean, the standard deviation and the number of values in columns.

    Parameters
    ----------
    photographs : DataFrame
        A row for each photograph. Values that were not measured are missing.
    columns : sequence of str
        The columns to summarise.

    Returns
    -------
    DataFrame
        A row for each column with at least one value: response (the name of the
        column), value (the mean), sd (the standard deviation) and repetitions (the
        number of values).
    """
    numbers = photographs[list(columns)].astype(float)
    statistics = numbers.agg(["mean", "std", "count"]).T
    statistics = statistics.round(DECIMALS_OF_STATISTICS)
    statistics.columns = ["value", "sd", "repetitions"]
    summary = statistics.rename_axis("response").reset_index()
    is_measured = summary["repetitions"] > 0
    return summary[is_measured].astype({"repetitions": int})


def write_tables(
    results: Tables,
    settings: MeasureSettings,
    out: Path,
    bench: str,
    responses: Mapping[str, str],
) -> None:
    """Write photographs.csv, summary.csv and, if there is a mean, targets.yaml.

    If there is no mean, a targets.yaml from an earlier call is removed, because it
    belongs to other results.

    Parameters
    ----------
    results : Tables
        The tables.
    settings : MeasureSettings
        Settings of the measurement.
    out : Path
        Folder to which the files are written.
    bench : str
        Name of the bench test to which the targets belong.
    responses : mapping
        Measured numbers that become targets, such as ``height_mm``, and the name that
        the bench test gives to each.
    """
    write_table(out / "photographs.csv", results.photographs)
    write_table(out / "summary.csv", results.summary)
    targets_yaml = out / TARGETS_FILE
    if results.summary.empty:
        targets_yaml.unlink(missing_ok=True)
    else:
        write_text(targets_yaml, format_targets(results, settings, bench, responses))


def format_targets(
    results: Tables, settings: MeasureSettings, bench: str, responses: Mapping[str, str]
) -> str:
    """Format the measured responses as targets in the YAML of a configuration.

    The range of a target follows from its mean and its standard error
    (`compute_target_range`). A single pile has no standard deviation. Its standard
    deviation and range are then null, and a study rejects the file until the user fills
    in values.

    Parameters
    ----------
    results : Tables
        The tables.
    settings : MeasureSettings
        Settings of the measurement, which are written above the targets.
    bench : str
        Name of the bench test to which the targets belong.
    responses : mapping
        Measured numbers that become targets, such as ``height_mm``, and the name that
        the bench test gives to each.

    Returns
    -------
    str
        The sections `measure` and `targets` of the configuration.
    """
    # `berry_height_mm` is the key for the height of a grain of any crop.
    measure_entries = [f"{key}: {getattr(settings, key)}" for key in LINE_SETTINGS]
    if settings.berry_height_mm is not None:
        measure_entries.append(f"berry_height_mm: {settings.berry_height_mm:.6g}")
    measure_section = "{" + ", ".join(measure_entries) + "}"
    lines = [
        "# Measured on photographs; summary.csv is in the same folder.",
        f"measure: {measure_section} # the line of the angle: {line_of(settings)}",
        "targets:",
    ]
    is_target = results.summary["response"].isin(list(responses))
    for row in results.summary[is_target].itertuples():
        lines += _format_target(row, bench, responses[row.response])
    return "\n".join(lines) + "\n"


def _format_target(row: Any, bench: str, response: str) -> list[str]:
    """Format a row of the summary as a target in YAML.

    Parameters
    ----------
    row : namedtuple
        A row of the summary, from `DataFrame.itertuples`: value (the mean), sd (NaN for
        a single pile) and repetitions.
    bench : str
        Name of the bench test to which the target belongs.
    response : str
        Name of the bench test's response.

    Returns
    -------
    list of str
        The lines of YAML.
    """
    if math.isnan(row.sd):
        # A comment in YAML tells the user what to fill in.
        sd = "null # one pile gives no scatter"
        target_range = "[null, null] # the values at which the target counts as met"
    else:
        low, high = compute_target_range(row.value, row.sd, row.repetitions)
        sd = f"{row.sd:.3f}"
        target_range = f"[{low:.3f}, {high:.3f}]"
    return [
        f"  - response: {response}",
        f"    apparatus: {bench}",
        f"    value: {row.value:.3f}",
        f"    sd: {sd}",
        f"    repetitions: {row.repetitions}",
        f"    range: {target_range}",
    ]


def convert_to_records(results: Tables) -> dict[str, list]:
    """Convert the tables to lists of rows by name; a missing number is None."""
    return {
        "photographs": _list_rows(results.photographs),
        "summary": _list_rows(results.summary),
    }


def _list_rows(table: pd.DataFrame) -> list[dict]:
    """List the rows of a table, with None for a missing value."""
    return [
        {column: None if pd.isna(value) else value for column, value in row.items()}
        for row in table.to_dict("records")
    ]


def describe_results(
    photographs: Sequence[Photograph],
    results: Tables,
    settings: MeasureSettings,
    out: Path,
) -> str:
    """Describe the results of photographs, as the command prints them.

    The description consists of a line for each photograph, the means, notes, and what
    the user should look at next.

    Parameters
    ----------
    photographs : sequence of Photograph
        The measured and the rejected photographs.
    results : Tables
        The tables of these photographs.
    settings : MeasureSettings
        Settings of the measurement.
    out : Path
        Output folder. It contains the targets and the overlays, which are the
        photographs with the lines drawn into them.

    Returns
    -------
    str
        The lines, without a line break at the end.
    """
    lines = _describe_photographs(photographs)
    lines.append("mean, standard deviation, number of photographs:")
    lines += _describe_means(results, settings)
    grain_mm = settings.berry_height_mm
    grain = "not known" if grain_mm is None else f"{grain_mm:.2f} mm"
    lines.append(f"height of a grain: {grain}")
    lines += _list_notes(photographs, results)
    if results.summary.empty:
        targets = "no targets, because no photograph counts"
    else:
        targets = f"the targets of a study: {out / TARGETS_FILE}"
    lines.append(f"look at the overlays in {out}; {targets}")
    return "\n".join(lines)


def _list_notes(photographs: Sequence[Photograph], results: Tables) -> list[str]:
    """List the notes on the numbers, each once and on its own line.

    There is a note if standard deviations are missing because there is a single pile.
    The notes of the photographs follow, and then the names of the doubtful photographs,
    which are those with a warning.

    Parameters
    ----------
    photographs : sequence of Photograph
        The measured and the rejected photographs.
    results : Tables
        The tables of these photographs.

    Returns
    -------
    list of str
        The lines.
    """
    lines = []
    if results.summary["sd"].isna().any():
        lines.append(NO_SCATTER_NOTE)
    notes = {photograph.note for photograph in photographs if photograph.note}
    lines += sorted(f"note: {note}" for note in notes)
    return lines + _list_doubtful(photographs, results.doubtful)


def _list_doubtful(photographs: Sequence[Photograph], all_in_mean: bool) -> list[str]:
    """Count and name the doubtful photographs in the mean, and those left out of it.

    Parameters
    ----------
    photographs : sequence of Photograph
        The measured and the rejected photographs.
    all_in_mean : bool
        Whether the mean includes all doubtful photographs. Otherwise it includes only
        those whose single doubt is that the two sides of the pile differ.

    Returns
    -------
    list of str
        At most two lines.
    """
    in_mean: list[str] = []
    left_out: list[str] = []
    for photograph in photographs:
        if not photograph.doubts:
            continue
        is_in_mean = all_in_mean or not photograph.warnings
        (in_mean if is_in_mean else left_out).append(photograph.path.name)
    lines = []
    if in_mean:
        reason = (
            ""
            if all_in_mean
            else f"; only the two sides differ, by more than "
            f"{LARGEST_SIDE_DIFFERENCE_DEG:g} degrees"
        )
        lines.append(
            f"doubtful photographs in the mean: {len(in_mean)} of {len(photographs)} "
            f"({', '.join(in_mean)}){reason}"
        )
    if left_out:
        lines.append(
            f"doubtful photographs left out: {len(left_out)} of {len(photographs)} "
            f"({', '.join(left_out)}); --doubtful counts them"
        )
    return lines


def _describe_photographs(photographs: Sequence[Photograph]) -> list[str]:
    """Describe each photograph: its numbers, or a line for each reason to reject it.

    Names are padded with spaces, so that the descriptions are aligned.

    Parameters
    ----------
    photographs : sequence of Photograph
        The measured and the rejected photographs, at least one.

    Returns
    -------
    list of str
        The lines, in the order of the photographs.
    """
    name_width = max(len(photograph.path.name) for photograph in photographs)
    lines = []
    for photograph in photographs:
        if photograph.measurement is None:
            texts = [f"refused: {text}" for text in photograph.all_rejection_reasons]
        else:
            numbers = _describe_measurement(photograph.measurement)
            texts = ["; ".join([*numbers, *photograph.doubts])]
        for text in texts:
            lines.append(f"{photograph.path.name:<{name_width}}  {text}")
    return lines


def _describe_measurement(measurement: Measurement) -> list[str]:
    """Describe a measured pile: its angles, its height, and why angles are missing."""
    numbers = (
        f"left {measurement.angle.left_deg:.2f} deg, "
        f"right {measurement.angle.right_deg:.2f} deg, "
        f"angle of repose {measurement.aor_deg:.2f} deg"
    )
    if math.isfinite(measurement.height_mm):
        numbers += f", Height {format_decimals(measurement.height_mm)} mm"
    reasons = [
        f"no {definition}: {reason}"
        for definition, reason in measurement.reasons.items()
    ]
    return [numbers, *reasons]


def _describe_means(results: Tables, settings: MeasureSettings) -> list[str]:
    """Describe the mean height and the mean angle by each definition, one line each.

    A line gives the mean, the standard deviation and the number of photographs. The
    angle that is calibrated is marked.

    Parameters
    ----------
    results : Tables
        The tables of the results.
    settings : MeasureSettings
        Settings of the measurement, which name the definition of the angle of repose.

    Returns
    -------
    list of str
        The lines. There is none for a quantity that could not be measured in any
        photograph.
    """
    # Name in the description, row of the summary, unit
    quantities = [("Height", "height_mm", "mm")]
    for definition in DEFINITIONS:
        quantities.append((definition, MEAN_KEYS[definition], "deg"))
    summary = results.summary.set_index("response")
    lines = []
    for name, column, unit in quantities:
        if column not in summary.index:
            continue
        row = summary.loc[column]
        sd = "not known" if math.isnan(row.sd) else format_decimals(row.sd)
        # The response is the definition of the calibrated angle.
        mark = "  <- angle of repose" if name == settings.response else ""
        lines.append(
            f"{name:>10}: {format_decimals(row.value)} {unit}, {sd}, {row.repetitions:.0f}{mark}"
        )
    return lines
