"""A strategy's answer in the files of the chain: material card, final message and report read one format."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.chain import validate
from repose.core.files import write_json, write_table
from repose.core.parameter_space import ParameterSpace
from repose.core.targets import Targets


class Result(NamedTuple):
    """Result of a strategy."""

    values: np.ndarray  # (p,), the answer
    predicted: np.ndarray  # (k,), its predicted responses
    others: np.ndarray  # (n, p), sets that are predicted inside all ranges, the best first
    others_predicted: np.ndarray  # (n, k)
    steps: Sequence[str]  # how it was obtained, a sentence each
    note: str = ""  # a further sentence of the message


def write(
    result: Result,
    checked: pd.DataFrame,
    space: ParameterSpace,
    targets: Targets,
    out_dir: str | os.PathLike,
    more: Mapping[str, Any],
) -> None:
    """Write solutions.csv, table4.csv, representative.csv and summary.json.

    `checked` holds the single runs of the answer, simulated again; `more` is further content of summary.json.
    """
    row: dict[str, Any] = {"sample": 1, "solution": "1", "role": "representative"}
    row |= dict(zip(space.names, result.values.tolist(), strict=True))
    row |= dict(zip(targets.predicted, result.predicted.tolist(), strict=True))
    row |= _simulated(checked, targets)
    feasible, message = verdict(result, targets)
    summary = {
        "feasible": feasible,
        "message": message,
        "representative": {name: row[name] for name in (*space.names, *targets.predicted)},
        "steps": list(result.steps),
    }
    out = Path(out_dir)
    write_table(out / "solutions.csv", solutions(result, feasible, space, targets))
    write_table(out / "table4.csv", validate.table4(pd.DataFrame([row]), targets.responses))
    table = validate.against_physical(pd.Series(row), targets)
    write_table(
        out / "representative.csv", validate.with_chances(table, _by_bench(checked, targets), targets)
    )
    write_json(out / "summary.json", summary | dict(more))


def separated(unit: np.ndarray, distance: float, most: int) -> np.ndarray:
    """Row numbers of the first points (n, d) of the unit cube that keep a distance from all before them.

    At most `most` rows; `distance` is in half ranges, as `miga.distance`.
    """
    from scipy.spatial.distance import cdist

    kept: list[int] = []
    for k, point in enumerate(unit):
        if not kept or 2 * cdist(unit[kept], point[None]).min() >= distance:
            kept.append(k)
        if len(kept) == most:
            break
    return np.array(kept, dtype=int)


def verdict(result: Result, targets: Targets) -> tuple[bool, str]:
    """Whether the answer is predicted inside all ranges, and a message."""
    feasible = bool(((result.predicted >= targets.low) & (result.predicted <= targets.high)).all())
    words = targets.in_words([f"{value:.4g}" for value in result.predicted])
    ranges = targets.in_words([f"{target.low:g}-{target.high:g}" for target in targets])
    message = f"The answer is predicted {words}, {'inside' if feasible else 'NOT inside'} {ranges}."
    message = message if feasible else f"No feasible solution. {message}"
    return feasible, f"{message} {result.note}".rstrip()


def solutions(result: Result, feasible: bool, space: ParameterSpace, targets: Targets) -> pd.DataFrame:
    """The answer, then the other parameter sets.

    Columns: `solution` from 1, parameters, predicted responses, `feasible`, `representative`.
    """
    table = pd.DataFrame(np.vstack([result.values, result.others]), columns=list(space.names))
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table[list(targets.predicted)] = np.vstack([result.predicted, result.others_predicted])
    table["feasible"] = [feasible] + [True] * len(result.others)
    table["representative"] = table["solution"] == 1
    return table


def _by_bench(runs, targets):
    """Single runs of each bench test as rows."""
    benches = {
        bench: runs[runs["apparatus"] == bench] if "apparatus" in runs else runs
        for bench in targets.apparatus
    }
    return {bench: own.to_dict("records") for bench, own in benches.items()}


def _simulated(runs, targets):
    """Mean, standard error and number of the runs of the answer, as in a row of Table 4."""
    row: dict[str, Any] = {}
    counts = []
    for target in targets:
        own = runs[runs["apparatus"] == target.response.apparatus] if "apparatus" in runs else runs
        values = own.loc[own["status"] == "ok", target.name].to_numpy(float)
        counts.append(len(values))
        row[target.response.simulated] = values.mean() if len(values) else np.nan
        row[target.response.error] = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    trouble = runs.loc[runs["status"] != "ok", "status"].value_counts()
    reason = ", ".join(f"{number} runs {status}" for status, number in trouble.items())
    return row | {
        "n_seeds": min(counts),
        "status": "ok" if min(counts) else trouble.index[0],
        "reason": reason,
    }
