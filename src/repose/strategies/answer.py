"""A strategy's answer in the files of the chain: material card, final message and report read one format."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.chain import validate
from repose.core.files import write_json, write_table
from repose.core.parameter_space import ParameterSpace
from repose.core.runs import of_bench
from repose.core.targets import Targets
from repose.strategies.base import Answer, Studied


def write(
    best: Answer,
    checked: pd.DataFrame,
    study: Studied,
    out_dir: str | os.PathLike,
    steps: Sequence[str],
    more: Mapping[str, Any],
    note: str = "",
) -> None:
    """Write solutions.csv, table4.csv, representative.csv and summary.json.

    `checked` holds the single runs of the answer, simulated again; `steps` says how it was obtained, a sentence each,
    and `note` is a further sentence of the message; `more` is further content of summary.json.
    """
    space, targets = study.parameters, study.targets
    row: dict[str, Any] = {"sample": 1, "solution": "1", "role": "representative"}
    row |= dict(zip(space.names, best.values.tolist(), strict=True))
    row |= dict(zip(targets.predicted, best.mean.tolist(), strict=True))
    row |= _simulated(checked, targets)
    feasible, message = verdict(best, targets, note)
    summary = {
        "feasible": feasible,
        "message": message,
        "representative": {name: row[name] for name in (*space.names, *targets.predicted)},
        "steps": list(steps),
    }
    out = Path(out_dir)
    write_table(out / "solutions.csv", solutions(best, feasible, space, targets))
    write_table(out / "table4.csv", validate.table4(pd.DataFrame([row]), targets.responses))
    table = validate.against_physical(pd.Series(row), targets)
    runs = {bench: of_bench(checked, bench).to_dict("records") for bench in targets.apparatus}
    write_table(out / "representative.csv", validate.with_chances(table, runs, targets))
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


def verdict(best: Answer, targets: Targets, note: str = "") -> tuple[bool, str]:
    """Whether the answer is predicted inside all ranges, and a message."""
    feasible = bool(((best.mean >= targets.low) & (best.mean <= targets.high)).all())
    words = targets.in_words([f"{value:.4g}" for value in best.mean])
    ranges = targets.in_words([f"{target.low:g}-{target.high:g}" for target in targets])
    message = f"The answer is predicted {words}, {'inside' if feasible else 'NOT inside'} {ranges}."
    message = message if feasible else f"No feasible solution. {message}"
    return feasible, f"{message} {note}".rstrip()


def solutions(best: Answer, feasible: bool, space: ParameterSpace, targets: Targets) -> pd.DataFrame:
    """The answer, then the other parameter sets.

    Columns: `solution` from 1, parameters, predicted responses, `feasible`, `representative`.
    """
    table = pd.DataFrame(np.vstack([best.values, best.others]), columns=list(space.names))
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table[list(targets.predicted)] = np.vstack([best.mean, best.others_mean])
    table["feasible"] = [feasible] + [True] * len(best.others)
    table["representative"] = table["solution"] == 1
    return table


def _simulated(runs, targets):
    """Mean, standard error and number of the runs of the answer, as in a row of Table 4."""
    row: dict[str, Any] = {}
    counts = []
    for target in targets:
        own = of_bench(runs, target.response.apparatus)
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
