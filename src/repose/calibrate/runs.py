"""Summarise the runs of a parameter set: their statuses and mean responses."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.calibrate.responses import name_derived_column
from repose.common.statuses import describe_failure

if TYPE_CHECKING:
    import pandas as pd

# Key of a run whose bodies overlap deeply: the largest overlap, as a share of a grain.
OVERLAP_SHARE = "overlap_share"


def name_error_column(column: str) -> str:
    """Return the name of the column with the standard error of a quantity.

    ``se`` is inserted before the unit, as in ``aor_se_deg``.
    """
    return name_derived_column(column, "se")


@dataclass(frozen=True)
class Recorded:
    """Names of the columns that the runs of a bench test record.

    Attributes
    ----------
    means : tuple of str
        Quantities that are averaged over the runs of a sample.
    without_error : tuple of str
        Those of `means` without a column for the standard error.
    single : tuple of str
        Columns of the table of single runs.
    """

    means: tuple[str, ...]
    without_error: tuple[str, ...] = ()
    single: tuple[str, ...] = ()

    def put_targets_first(self, targets: Sequence[str]) -> "Recorded":
        """Return a copy whose columns begin with the targets, each with an error."""
        return Recorded(
            means=tuple(dict.fromkeys((*targets, *self.means))),
            without_error=tuple(
                name for name in self.without_error if name not in targets
            ),
            single=tuple(dict.fromkeys((*targets, *self.single))),
        )

    @property
    def summary(self) -> tuple[str, ...]:
        """Keys of `summarise_runs`, in its order."""
        keys = ["status", "reason", "n_seeds"]
        for name in self.means:
            keys.append(name)
            if name not in self.without_error:
                keys.append(name_error_column(name))
        return tuple(keys)


def select_bench_runs(runs: "pd.DataFrame", apparatus: str) -> "pd.DataFrame":
    """Select the runs of a bench test.

    A table without the column `apparatus` has a single bench test.
    """
    if "apparatus" not in runs:
        return runs
    return runs[runs["apparatus"] == apparatus]


def summarise_runs(
    runs: Sequence[Mapping[str, Any]], recorded: Recorded
) -> dict[str, Any]:
    """Summarise the runs of a sample.

    A sample is ok if at least half of its runs are ok, and at least one of them is.
    Otherwise it gets the most common status of its failed runs, and its means and
    standard errors are None.

    Parameters
    ----------
    runs : sequence of mapping
        `status` and responses of each run.
    recorded : Recorded
        Names of the numbers of the summary.

    Returns
    -------
    dict
        `status`, `reason`, `n_seeds` (number of ok runs), then means and standard errors.

    Raises
    ------
    ValueError
        If there are no runs.
    """
    if not runs:
        raise ValueError("runs is empty; expected at least one run")
    ok = [run for run in runs if run["status"] == "ok"]
    failed = [run for run in runs if run["status"] != "ok"]
    is_usable = len(ok) > 0 and 2 * len(ok) >= len(runs)
    # Begin with None for all keys. The numbers of an unusable sample stay None.
    summary: dict[str, Any] = dict.fromkeys(recorded.summary)
    texts = [describe_failures(failed, len(runs)), describe_overlaps(runs)]
    summary["reason"] = "; ".join(filter(None, texts))
    summary["n_seeds"] = len(ok)
    if not is_usable:
        statuses = Counter(run["status"] for run in failed)
        summary["status"] = statuses.most_common(1)[0][0]
        return summary
    summary["status"] = "ok"

    # Average the responses of the good runs.
    for name in recorded.means:
        values = [run[name] for run in ok if run.get(name) is not None]
        summary[name], error = mean_and_error(values)
        if name not in recorded.without_error:
            summary[name_error_column(name)] = error
    return summary


def mean_and_error(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Compute the mean of values and its standard error, sd / sqrt(n).

    Parameters
    ----------
    values : sequence of float

    Returns
    -------
    float or None
        The mean; None without values.
    float or None
        The standard error; None for fewer than two values.
    """
    numbers = np.array(values, dtype=float)
    n = len(numbers)
    if n == 0:
        return None, None
    mean = float(numbers.mean())
    if n == 1:
        return mean, None
    return mean, float(numbers.std(ddof=1) / math.sqrt(n))


def describe_failures(failed: Sequence[Mapping[str, Any]], total: int) -> str:
    """Describe the failed runs by cause, as in ``2 of 8 runs jammed (no discharge)``.

    The text is empty if no run failed.

    Parameters
    ----------
    failed : sequence of mapping
        The runs that failed: `status`, and `reason` if it is known.
    total : int
        Number of all runs.
    """
    causes = []
    for status, count in Counter(run["status"] for run in failed).most_common():
        # Each reason once, in the order of the runs.
        reasons: list[str] = []
        for run in failed:
            if run["status"] != status:
                continue
            run_reason = run.get("reason")
            if run_reason and run_reason not in reasons:
                reasons.append(run_reason)
        cause = f"{count} of {total} runs {status}"
        if reasons:
            cause += f" ({'; '.join(reasons)})"
        causes.append(cause)
    return "; ".join(causes)


def describe_run(run: Mapping[str, Any], template: str) -> str:
    """Describe a run in a line: its responses, or why it failed.

    Parameters
    ----------
    run : mapping
        `seed`, `status`, and responses or `reason`.
    template : str
        Text with a placeholder for each response, which `str.format` fills.
    """
    if run["status"] != "ok":
        failure = describe_failure(run["status"], run["reason"])
        return f"seed {run['seed']}: {failure}"
    warning = ""
    if overlaps := describe_overlaps([run]):
        warning = f"; WARNING: {overlaps}"
    try:
        responses = template.format(**run)
    except (KeyError, TypeError):
        # The template may name a response that was not measured, because it is no
        # target.
        return f"seed {run['seed']}: ok{warning}"
    return f"seed {run['seed']}: {responses}{warning}"


def describe_overlaps(runs: Sequence[Mapping[str, Any]]) -> str:
    """Describe the deepest overlap in the ok runs; empty if no run overlaps deeply.

    A run with deep overlaps has the key `OVERLAP_SHARE`: the largest overlap divided by
    the smallest extent of the grain.
    """
    shares = [
        run[OVERLAP_SHARE]
        for run in runs
        if run["status"] == "ok" and OVERLAP_SHARE in run
    ]
    if not shares:
        return ""
    return (
        f"bodies overlap by up to {100 * max(shares):.0f} % of the smallest extent of a "
        "grain; a higher berry.shear_modulus_pa lessens it"
    )
