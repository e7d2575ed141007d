"""Runs of a parameter set: their final statuses, and the means of their responses with errors."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.calibrate.responses import derived

if TYPE_CHECKING:
    import pandas as pd


def error_of(column: str) -> str:
    """Name the column of a quantity's standard error, with ``se`` before the unit: ``aor_se_deg``."""
    return derived(column, "se")


@dataclass(frozen=True)
class Recorded:
    """Columns that the runs of a bench test record."""

    means: tuple[str, ...]  # averaged over a sample's runs
    without_error: tuple[str, ...] = ()  # means without a standard error
    single: tuple[str, ...] = ()  # columns of the table of single runs

    def beginning_with(self, targets: Sequence[str]) -> "Recorded":
        """Put these targets before the columns, each target with its standard error."""
        return Recorded(
            tuple(dict.fromkeys((*targets, *self.means))),
            tuple(mean for mean in self.without_error if mean not in targets),
            tuple(dict.fromkeys((*targets, *self.single))),
        )

    @property
    def summary(self) -> tuple[str, ...]:
        """Keys of a summary of runs, in its order; see `summarise_runs`."""
        pairs = (
            (mean,) if mean in self.without_error else (mean, error_of(mean))
            for mean in self.means
        )
        return (
            "status",
            "reason",
            "n_seeds",
            *(column for pair in pairs for column in pair),
        )


def of_bench(runs: "pd.DataFrame", apparatus: str) -> "pd.DataFrame":
    """Select the runs of one bench test; a table without the column apparatus has a single bench test."""
    return runs[runs["apparatus"] == apparatus] if "apparatus" in runs else runs


def summarise_runs(
    runs: Sequence[Mapping[str, Any]], recorded: Recorded
) -> dict[str, Any]:
    """Summarise a sample: `status`, `reason`, `n_seeds` (number of ok runs), then means and standard errors.

    A sample is ok when at least half of its runs, and at least one, are ok. Otherwise its status is the commonest
    status of its failed runs, and its numbers are None.
    """
    if not runs:
        raise ValueError("runs is empty; expected at least one run")
    ok = [run for run in runs if run["status"] == "ok"]
    failed = [run for run in runs if run["status"] != "ok"]
    usable = len(ok) > 0 and 2 * len(ok) >= len(runs)
    statuses = Counter(run["status"] for run in failed)
    summary: dict[str, Any] = dict.fromkeys(recorded.summary)
    summary["status"] = "ok" if usable else statuses.most_common(1)[0][0]
    summary["reason"] = reason(failed, len(runs))
    summary["n_seeds"] = len(ok)
    if usable:
        for column in recorded.means:
            summary[column], error = mean_and_error(
                [run[column] for run in ok if run.get(column) is not None]
            )
            if column not in recorded.without_error:
                summary[error_of(column)] = error
    return summary


def mean_and_error(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Compute mean and standard error sd / sqrt(n); both None without values, the error None for a single value."""
    numbers = np.array(values, dtype=float)
    if len(numbers) == 0:
        return None, None
    error = (
        float(numbers.std(ddof=1) / math.sqrt(len(numbers)))
        if len(numbers) > 1
        else None
    )
    return float(numbers.mean()), error


def reason(failed: Sequence[Mapping[str, Any]], total: int) -> str:
    """Count the failed runs by cause, as in ``2 of 8 runs jammed (no discharge for 3 s)``; may be empty."""
    parts = []
    for status, count in Counter(run["status"] for run in failed).most_common():
        why = dict.fromkeys(
            run["reason"]
            for run in failed
            if run["status"] == status and run.get("reason")
        )
        parts.append(
            f"{count} of {total} runs {status}"
            + (f" ({'; '.join(why)})" if why else "")
        )
    return "; ".join(parts)


def describe(run: Mapping[str, Any], template: str) -> str:
    """Describe a measured run by its bench test's `template`, a failed run by its reason."""
    if run["status"] != "ok":
        return f"seed {run['seed']}: {run['status']}: {run['reason']}"
    try:
        return f"seed {run['seed']}: {template.format(**run)}"
    except (
        KeyError,
        TypeError,
    ):  # a response that is no target and could not be measured
        return f"seed {run['seed']}: ok"
