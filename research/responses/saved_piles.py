"""Further responses of the piles that a study has saved."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from repose.common.errors import InputError, NoFlankError
from repose.common.files import read_table, write_table
from repose.grain.particle import Particle
from repose.measure import pile, saved_pours
from repose.measure.further_responses import BENCH, RESPONSE_NAMES, measure_pour
from research.responses.offered import offered


def of_pours(
    pours_json: Iterable[str | Path],
    good: set[tuple[int, int]],
    particle: Particle,
    settings: pile.MeasureSettings,
    plate_mm: float,
) -> dict[tuple[int, int], dict[str, float]]:
    """`MEASURED` of the good runs in files of pours, by (sample, seed); empty for a run without a pile.

    Each ``NAME.pours.json`` has its ``NAME.npz`` in the same folder.
    """
    found = {}
    for path in map(Path, pours_json):
        job = saved_pours.read_pours(path)
        arrays = saved_pours.read_positions(saved_pours.positions_file(path))
        for record in job["pours"]:
            key = (job["sample"], record["seed"])
            if key in good:
                saved = saved_pours.select_pour(arrays, record["seed"], path)
                found[key] = _or_nothing(saved, particle, settings, plate_mm)
    return found


def joined(
    runs: pd.DataFrame, found: Mapping[tuple[int, int], Mapping[str, float]]
) -> pd.DataFrame:
    """Add the columns of `MEASURED` to the table of runs, NaN for runs without a result.

    `runs` has ``sample``, ``seed`` and, with several bench tests, ``apparatus``; `found` comes from `of_pours`.
    """
    keys = runs[["sample", "seed"]].itertuples(index=False, name=None)
    of_run = [
        found.get(key, {}) if of_pile else {}
        for key, of_pile in zip(keys, _of_the_pile(runs), strict=True)
    ]
    return runs.assign(
        **{name: [run.get(name, math.nan) for run in of_run] for name in RESPONSE_NAMES}
    )


def run(
    config: Mapping[str, Any],
    pours_json: Iterable[str | Path],
    runs_csv: str | Path,
    particle: Particle,
    berry: Mapping[str, Any],
    out_csv: str | Path,
) -> pd.DataFrame:
    """Measure every good run of a study's pours and write the table: ``sample``, ``seed``, ``status``, all responses.

    `runs_csv` holds the single runs from the verb dataset, `berry` the result of the verb berry. Raises InputError if
    a run has no pour.
    """
    targets = [target["response"] for target in config["targets"]]
    known = (*targets, *offered(targets, config["measure"]["response"]))
    known = (
        "sample",
        "seed",
        "status",
        *(name for name in known if name not in RESPONSE_NAMES),
    )
    runs = read_table(runs_csv, known)
    runs = runs[[column for column in runs if column in (*known, "apparatus")]]
    poured = (runs["status"] == "ok") & _of_the_pile(runs)
    good = set(map(tuple, runs.loc[poured, ["sample", "seed"]].to_numpy()))
    settings = pile.MeasureSettings.with_defaults(**config["measure"]).for_grain(berry)
    found = of_pours(
        pours_json, good, particle, settings, config["funnel"]["plate_diameter_mm"]
    )
    missing = sorted(good - set(found))
    if missing:
        raise InputError(
            runs_csv,
            "runs without a pour",
            missing[:3],
            "runs of the pours that are given",
        )
    table = joined(runs, found)
    write_table(out_csv, table)
    return table


def _of_the_pile(runs):
    """Mark each run of the funnel; all runs if there is only one bench test."""
    return (
        runs["apparatus"] == BENCH
        if "apparatus" in runs
        else pd.Series(True, index=runs.index)
    )


def _or_nothing(saved, particle, settings, plate_mm):
    """Measure the responses of a pour; empty without a pile."""
    try:
        return measure_pour(saved, particle, settings, plate_mm)
    except NoFlankError:
        return {}
