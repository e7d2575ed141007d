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


class Found(NamedTuple):
    """Result of a strategy."""

    values: np.ndarray  # (6,), the answer
    predicted: np.ndarray  # (k,), its predicted responses
    others: np.ndarray  # (n, 6), sets that are predicted inside all ranges, the best first
    others_predicted: np.ndarray  # (n, k)
    steps: Sequence[str]  # how it was found, a sentence each
    note: str = ""  # a further sentence of the message


def write(
    found: Found,
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
    row |= dict(zip(space.names, found.values.tolist(), strict=True))
    row |= dict(zip(targets.predicted, found.predicted.tolist(), strict=True))
    row |= _simulated(checked, targets)
    feasible, message = verdict(found, targets)
    summary = {
        "feasible": feasible,
        "message": message,
        "representative": {name: row[name] for name in (*space.names, *targets.predicted)},
        "steps": list(found.steps),
    }
    out = Path(out_dir)
    write_table(out / "solutions.csv", solutions(found, feasible, space, targets))
    write_table(out / "table4.csv", validate.table4(pd.DataFrame([row]), targets.responses))
    table = validate.against_physical(pd.Series(row), targets)
    write_table(
        out / "representative.csv", validate.with_chances(table, _by_bench(checked, targets), targets)
    )
    write_json(out / "summary.json", summary | dict(more))


def apart(unit: np.ndarray, distance: float, most: int) -> np.ndarray:
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


def verdict(found: Found, targets: Targets) -> tuple[bool, str]:
    """Whether the answer is predicted inside all ranges, and a message."""
    feasible = bool(((found.predicted >= targets.low) & (found.predicted <= targets.high)).all())
    words = targets.in_words([f"{value:.4g}" for value in found.predicted])
    ranges = targets.in_words([f"{one.low:g}-{one.high:g}" for one in targets])
    message = f"The answer is predicted {words}, {'inside' if feasible else 'NOT inside'} {ranges}."
    message = message if feasible else f"No feasible solution. {message}"
    return feasible, f"{message} {found.note}".rstrip()


def solutions(found: Found, feasible: bool, space: ParameterSpace, targets: Targets) -> pd.DataFrame:
    """The answer, then the other parameter sets.

    Columns: `solution` from 1, parameters, predicted responses, `feasible`, `representative`.
    """
    table = pd.DataFrame(np.vstack([found.values, found.others]), columns=list(space.names))
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table[list(targets.predicted)] = np.vstack([found.predicted, found.others_predicted])
    table["feasible"] = [feasible] + [True] * len(found.others)
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
    for one in targets:
        own = runs[runs["apparatus"] == one.response.apparatus] if "apparatus" in runs else runs
        values = own.loc[own["status"] == "ok", one.name].to_numpy(float)
        counts.append(len(values))
        row[one.response.simulated] = values.mean() if len(values) else np.nan
        row[one.response.error] = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    trouble = runs.loc[runs["status"] != "ok", "status"].value_counts()
    told = ", ".join(f"{number} runs {status}" for status, number in trouble.items())
    return row | {"n_seeds": min(counts), "status": "ok" if min(counts) else trouble.index[0], "reason": told}
