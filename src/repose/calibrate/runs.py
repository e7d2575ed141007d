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

# Key of a run whose grains overlap deeply: the largest overlap, as a fraction of the
# smallest extent of the grain.
OVERLAP_SHARE = "overlap_share"


def name_error_column(column: str) -> str:
    """Return the name of the column with the standard error of a quantity.

    ``se`` is inserted before the unit, as in ``aor_se_deg``.
    """
    return name_derived_column(column, "se")


@dataclass(frozen=True)
class Recorded:
    """Names of the columns with the recorded results of a bench test.

    Attributes
    ----------
    means : tuple of str
        Quantities that are averaged over the runs of a sample.
    without_error : tuple of str
        The quantities of `means` that have no column for the standard error.
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
    """Compute the status and the mean responses of a sample from its runs.

    A sample is ok if at least half of its runs are ok. Otherwise it gets the most
    common status of its failed runs, and its means and standard errors are None.

    Parameters
    ----------
    runs : sequence of mapping
        The runs, each with its `status` and its responses.
    recorded : Recorded
        Names of the responses to average.

    Returns
    -------
    dict
        `status`, `reason` (why runs failed, and how deeply grains overlap), `n_seeds`
        (number of ok runs), and the mean and the standard error of each response.

    Raises
    ------
    ValueError
        If there are no runs.
    """
    if not runs:
        raise ValueError("runs is empty; expected at least one run")
    ok = [run for run in runs if run["status"] == "ok"]
    failed = [run for run in runs if run["status"] != "ok"]
    remarks = [describe_failures(failed, len(runs)), describe_overlaps(runs)]
    # All keys begin with None, in the order of the result. The means and errors of an
    # unusable sample stay None.
    summary: dict[str, Any] = dict.fromkeys(recorded.summary)
    summary["reason"] = "; ".join(filter(None, remarks))
    summary["n_seeds"] = len(ok)
    # There is at least one run, so half of them is more than none.
    is_usable = 2 * len(ok) >= len(runs)
    if is_usable:
        summary["status"] = "ok"
        summary |= _average_responses(ok, recorded)
    else:
        statuses = Counter(run["status"] for run in failed)
        summary["status"] = statuses.most_common(1)[0][0]
    return summary


def _average_responses(
    runs: Sequence[Mapping[str, Any]], recorded: Recorded
) -> dict[str, float | None]:
    """Compute the mean of each response over runs, and its standard error.

    A run without a number for a response is left out of its mean. The quantities of
    `recorded.without_error` get a mean, but no standard error.
    """
    averages: dict[str, float | None] = {}
    for name in recorded.means:
        values = [run[name] for run in runs if run.get(name) is not None]
        averages[name], error = mean_and_error(values)
        if name not in recorded.without_error:
            averages[name_error_column(name)] = error
    return averages


def mean_and_error(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Compute the mean of some values, and the standard error of the mean.

    The standard error is the standard deviation divided by the root of the number of
    values.

    Parameters
    ----------
    values : sequence of float
        The values.

    Returns
    -------
    mean : float or None
        It is None if there are no values.
    error : float or None
        It is None if there are fewer than two values.
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
    """Describe how many runs failed with each status, and why.

    Parameters
    ----------
    failed : sequence of mapping
        The runs that failed, each with its `status`, and its `reason` if that is known.
    total : int
        Number of all runs.

    Returns
    -------
    str
        Text such as ``2 of 8 runs jammed (no discharge)``. It begins with the most
        common status, and is empty if no run failed.
    """
    descriptions = []
    for status, count in Counter(run["status"] for run in failed).most_common():
        reasons = [run.get("reason") for run in failed if run["status"] == status]
        # List each reason once, in the order of the runs.
        different_reasons = list(dict.fromkeys(filter(None, reasons)))
        description = f"{count} of {total} runs {status}"
        if different_reasons:
            description += f" ({'; '.join(different_reasons)})"
        descriptions.append(description)
    return "; ".join(descriptions)


def describe_run(run: Mapping[str, Any], template: str) -> str:
    """Describe the responses of a run, or why it failed.

    Parameters
    ----------
    run : mapping
        The run with its `seed`, its `status`, and its responses or its `reason`.
    template : str
        Text with a placeholder for each response, which `str.format` fills.

    Returns
    -------
    str
        A single line.
    """
    if run["status"] != "ok":
        failure = describe_failure(run["status"], run["reason"])
        return f"seed {run['seed']}: {failure}"
    overlaps = describe_overlaps([run])
    warning = f"; WARNING: {overlaps}" if overlaps else ""
    try:
        responses = template.format(**run)
    except (KeyError, TypeError):
        # Only targets are measured, so the run may lack a response of the template, or
        # have None in its place. Then report just that the run is ok.
        responses = "ok"
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
