"""A strategy's answer in the files of the chain: material card, final message and report read one format."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.runs import error_of, mean_and_error, of_bench
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.strategies.base import Answer, Studied
from repose.calibrate.targets import Target, Targets
from repose.common.files import Path_, write_json, write_table
from repose.measure.angles import MEAN_KEYS
from repose.stages import validate


def content(best: Answer, study: Studied) -> dict[str, Any]:
    """Return an answer as `repose.stages.batches` keeps it until it is simulated again."""
    targets = study.targets
    # The mean of an answer that was simulated is of these runs; the check compares them with the model.
    if best.simulated and best.model is not None:
        point = best.values[None]
        mean, covariance = best.model.predict(point)[0], best.model.covariance(point)[0]
        best = replace(best, mean=mean, covariance=covariance)
    feasible, message = verdict(best, targets, best.notes.get("note", ""))
    table = solutions(best, feasible, study.parameters, targets)
    found = {"feasible": feasible, "message": message, "predicted_error": best.error}
    return found | {"solutions": table, "simulated": best.simulated}


def write(
    found: Mapping[str, Any], checked: pd.DataFrame, study: Studied, out_dir: Path_
) -> pd.DataFrame:
    """Write solutions.csv, table4.csv, representative.csv, check.csv and summary.json; return the table of check.csv.

    `found` is a proposal as `repose.stages.batches` keeps it, `checked` holds the single runs of the answer.
    """
    targets, notes, pours = (
        study.targets,
        found["notes"],
        len(checked) // len(study.targets.apparatus),
    )
    table = pd.DataFrame(found["solutions"])
    best = (
        table.loc[0, [*study.parameters.names, *targets.predicted]]
        .astype(float)
        .to_dict()
    )
    row = {
        "sample": 1,
        "solution": "1",
        "role": "representative",
        **best,
        **_simulated(checked, targets),
    }
    own = notes.get("check")
    check = (
        _check(row, found["predicted_error"], targets)
        if own is None
        else pd.DataFrame(own)
    )
    summary = {name: found[name] for name in ("feasible", "message", "why", "pours")}
    summary |= {
        "representative": best,
        "check_pours": pours,
        **notes.get("summary", {}),
    }
    summary["steps"] = [
        *notes.get("steps", ()),
        f"Check: {pours} pours of the answer that were in no fit.",
    ]
    runs = {
        bench: of_bench(checked, bench).to_dict("records")
        for bench in targets.apparatus
    }
    measure = study.config.get("measure")
    physical = validate.against_physical(pd.Series(row), targets, measure)
    tables = {
        "solutions": table,
        "table4": validate.table4(pd.DataFrame([row]), targets.responses, measure),
    }
    tables |= {
        "representative": validate.with_chances(physical, runs, targets),
        "check": check,
    }
    for name, one in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", one)
    write_json(Path(out_dir) / "summary.json", summary)
    return check


def _check(
    row: Mapping[str, Any], errors: Sequence[float], targets: Targets
) -> pd.DataFrame:
    """Compare the answer as predicted and as simulated, a row for each response."""
    table = pd.DataFrame({"response": targets.names, "target": targets.aim})
    table["predicted"] = [row[name] for name in targets.predicted]
    table["predicted_error"] = list(errors)
    table["simulated"] = [row[target.response.simulated] for target in targets]
    table["simulated_error"] = [row[name] for name in targets.errors]
    table["deviation_percent"] = list(
        map(Target.off_percent, targets, table["simulated"])
    )
    return table


def separated(unit: np.ndarray, section: MigaSettings) -> np.ndarray:
    """Choose the first points (n, d) of the unit cube that keep `distance` from all before them: their row numbers."""
    from scipy.spatial.distance import cdist

    kept: list[int] = []
    for k, point in enumerate(unit):
        if not kept or 2 * cdist(unit[kept], point[None]).min() >= section.distance:
            kept.append(k)
        if len(kept) == section.solutions:
            break
    return np.array(kept, dtype=int)


def verdict(best: Answer, targets: Targets, note: str = "") -> tuple[bool, str]:
    """Judge whether the answer is predicted inside all ranges, and say it in a message."""
    feasible = bool(((best.mean >= targets.low) & (best.mean <= targets.high)).all())
    words = targets.in_words([f"{value:.4g}" for value in best.mean])
    ranges = targets.in_words([f"{target.low:g}-{target.high:g}" for target in targets])
    message = f"The answer is predicted {words}, {'inside' if feasible else 'NOT inside'} {ranges}."
    return feasible, f"{message} {note}".rstrip()


def solutions(
    best: Answer, feasible: bool, space: ParameterSpace, targets: Targets
) -> pd.DataFrame:
    """List the answer, then the other parameter sets.

    Columns: `solution` from 1, parameters, predicted responses, `feasible`, `representative`.
    """
    table = pd.DataFrame(
        np.vstack([best.values, best.others]), columns=list(space.names)
    )
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table[list(targets.predicted)] = np.vstack([best.mean, best.others_mean])
    table["feasible"] = [feasible] + [True] * len(best.others)
    table["representative"] = table["solution"] == 1
    return table


def _simulated(runs: pd.DataFrame, targets: Targets) -> dict[str, Any]:
    """Compute mean, standard error and number of the answer's runs, as in a row of Table 4."""
    row: dict[str, Any] = {}
    counts, ok = [], runs[runs["status"] == "ok"]
    for target in targets:
        values = of_bench(ok, target.response.apparatus)[target.name].to_numpy(float)
        counts.append(len(values))
        row[target.response.simulated], row[target.response.error] = np.array(
            mean_and_error(values), dtype=float
        )
    piles = of_bench(ok, UNNAMED)
    for name in (name for name in MEAN_KEYS.values() if name in piles):
        row[name], row[error_of(name)] = mean_and_error(
            piles[name].dropna().to_numpy(float)
        )
    trouble = runs.loc[runs["status"] != "ok", "status"].value_counts()
    reason = ", ".join(f"{number} runs {status}" for status, number in trouble.items())
    return row | {
        "n_seeds": min(counts),
        "status": "ok" if min(counts) else trouble.index[0],
        "reason": reason,
    }
