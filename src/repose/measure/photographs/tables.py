"""Results of photographs as tables: each photograph, the mean of all, and the targets of a configuration."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from repose.calibrate.targets import range_about
from repose.common.files import write_table, write_text
from repose.measure.angles import DEFINITIONS, MEAN_KEYS
from repose.measure.photographs.photograph import Photograph
from repose.measure.settings import MeasureSettings, line_of

MEANT = ("aor_deg", "height_mm")  # numbers that become targets
LINE = ("response", "fit_from", "fit_to", "flank", "smallest_window")
NO_SCATTER = "one pile gives no scatter: photograph more piles, or fill in sd and range in targets.yaml yourself"


class Tables(NamedTuple):
    """Results of photographs."""

    photographs: (
        pd.DataFrame
    )  # one row each; empty cells if refused, column `refused` has the reason
    summary: (
        pd.DataFrame
    )  # a row per definition: response, value (mean), sd, repetitions
    doubtful: bool = False  # whether the summary counts doubtful photographs


def tables(
    measured: Sequence[Photograph], how: MeasureSettings, doubtful: bool = False
) -> Tables:
    """Tables of photographs, at least one of which was measured; `doubtful` counts those with a doubt, too."""
    rows = []
    for photograph in measured:
        numbers: dict[str, Any] = (
            photograph.measurement.record()
            if photograph.measurement is not None
            else {}
        )
        facts = {name: round(value, 5) for name, value in photograph.facts.items()}
        words = {"refused": photograph.refused, "note": photograph.remarks}
        rows.append(
            {"photograph": photograph.path.name}
            | numbers
            | facts
            | {"grain_mm": how.berry_height_mm}
            | words
        )
    photographs = pd.DataFrame(rows)
    counted = (
        photographs
        if doubtful
        else photographs[[not photograph.doubts for photograph in measured]]
    )
    return Tables(
        photographs, mean_rows(counted, (*MEANT, *MEAN_KEYS.values())), doubtful
    )


def mean_rows(photographs: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Summarize the columns that were measured."""
    means = (
        photographs[list(columns)]
        .astype(float)
        .agg(["mean", "std", "count"])
        .T.round(3)
    )
    means = (
        means.set_axis(["value", "sd", "repetitions"], axis=1)
        .rename_axis("response")
        .reset_index()
    )
    return means[means["repetitions"] > 0].astype({"repetitions": int})


def write_tables(
    made: Tables,
    how: MeasureSettings,
    out: Path,
    bench: str,
    responses: Mapping[str, str],
) -> None:
    """Write photographs.csv, summary.csv and, if there is a mean, targets.yaml into the folder `out`.

    `responses` has the bench test's response for each number of the summary that becomes a target.
    """
    write_table(out / "photographs.csv", made.photographs)
    write_table(out / "summary.csv", made.summary)
    if made.summary.empty:
        (out / "targets.yaml").unlink(missing_ok=True)
    else:
        write_text(out / "targets.yaml", targets(made, how, bench, responses))


def targets(
    made: Tables, how: MeasureSettings, bench: str, responses: Mapping[str, str]
) -> str:
    """Write the measured responses as YAML, an overlay for the configuration of a study.

    The range is the mean and its standard error to each side, at least 1 % of the mean. A single pile has no scatter:
    its standard deviation and range are null, and a study refuses them until the user gives values.
    """
    line = ", ".join(f"{key}: {getattr(how, key)}" for key in LINE)
    grain = (
        ""
        if how.berry_height_mm is None
        else f", berry_height_mm: {how.berry_height_mm:.6g}"
    )
    lines = ["# Measured on photographs; summary.csv lies beside it."]
    lines += [f"measure: {{{line}{grain}}} # the line: {line_of(how)}", "targets:"]
    for row in made.summary[
        made.summary["response"].isin(list(responses))
    ].itertuples():
        single = math.isnan(row.sd)
        low, high = range_about(row.value, row.sd, row.repetitions)
        lines += [
            f"  - response: {responses[row.response]}",
            f"    apparatus: {bench}",
            f"    value: {row.value:.3f}",
            "    sd: null # one pile gives no scatter"
            if single
            else f"    sd: {row.sd:.3f}",
            f"    repetitions: {row.repetitions}",
            "    range: [null, null] # what counts as met"
            if single
            else f"    range: [{low:.3f}, {high:.3f}]",
        ]
    return "\n".join(lines) + "\n"


def as_record(made: Tables) -> dict[str, list]:
    """Turn the tables into lists of rows; a missing number is None."""
    return {
        name: [
            {k: None if pd.isna(v) else v for k, v in row.items()}
            for row in table.to_dict("records")
        ]
        for name, table in (
            ("photographs", made.photographs),
            ("summary", made.summary),
        )
    }


def describe(
    photographs: Sequence[Photograph], made: Tables, how: MeasureSettings, out: Path
) -> str:
    """Write the text that the command prints; `out` is the folder of the overlays."""
    wide = max(len(photograph.path.name) for photograph in photographs)
    lines = []
    for photograph in photographs:
        seen = photograph.measurement
        if seen is None:
            text = f"refused: {photograph.refused}"
        else:
            text = f"left {seen.angle.left_deg:.2f} deg, right {seen.angle.right_deg:.2f} deg, "
            text += f"angle of repose {seen.aor_deg:.2f} deg, Height {seen.height_mm:.2f} mm"
            missing = (f"no {name}: {reason}" for name, reason in seen.reasons.items())
            text = "; ".join([text, *missing, *photograph.doubts])
        lines.append(f"{photograph.path.name:<{wide}}  {text}")
    by_name = made.summary.set_index("response")
    lines.append("mean, standard deviation, number of photographs:")
    rows = [
        ("Height", "height_mm", "mm"),
        *((name, MEAN_KEYS[name], "deg") for name in DEFINITIONS),
    ]
    for name, column, unit in rows:
        if column in by_name.index:
            row = by_name.loc[column]
            sd = "not known" if math.isnan(row.sd) else f"{row.sd:.2f}"
            mark = "  <- angle of repose" if name == how.response else ""
            lines.append(
                f"{name:>10}: {row.value:.2f} {unit}, {sd}, {row.repetitions:.0f}{mark}"
            )
    grain = (
        "not known" if how.berry_height_mm is None else f"{how.berry_height_mm:.2f} mm"
    )
    lines.append(f"height of a grain: {grain}")
    if made.summary["sd"].isna().any():
        lines.append(NO_SCATTER)
    lines += sorted(
        {f"note: {photograph.note}" for photograph in photographs if photograph.note}
    )
    doubtful = sum(bool(photograph.doubts) for photograph in photographs)
    if doubtful:
        counted = (
            "the mean counts them"
            if made.doubtful
            else "not in the mean; --doubtful counts them"
        )
        lines.append(f"doubtful photographs: {doubtful}, {counted}")
    targeted = f"the targets of a study: {out / 'targets.yaml'}"
    there = "no targets: no photograph counts" if made.summary.empty else targeted
    lines.append(f"look at the overlays in {out}; {there}")
    return "\n".join(lines)
