"""Simulated points as arrays: parameters, and the responses of every run."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS
from repose.calibrate.variance import estimate_within_covariance
from repose.common.errors import InputError
from repose.common.files import read_table

SETS = ("main", "pool", "fresh")


class Points(NamedTuple):
    """Points of a design with their runs."""

    X: np.ndarray  # (points, d), parameters or places in their ranges
    # (points, seeds, k), NaN where a run failed; a good run at every point
    values: np.ndarray

    @property
    def responses(self) -> int:
        """Number of responses k."""
        return self.values.shape[2]

    def good(self) -> np.ndarray:
        """Mask (points, seeds) of the runs that have all responses."""
        return np.isfinite(self.values).all(axis=2)

    def means(self) -> np.ndarray:
        """Mean over the runs of each point, (points, k)."""
        return np.nanmean(self.values, axis=1)

    def counts(self) -> np.ndarray:
        """Good runs of each point, (points,)."""
        return self.good().sum(axis=1)

    def errors(self) -> np.ndarray:
        """Give standard errors of the means, (points, k), from each point's own runs; NaN for a single run."""
        spread = np.full((len(self.X), self.responses), np.nan)
        several = self.counts() > 1
        spread[several] = np.nanstd(self.values[several], axis=1, ddof=1)
        return spread / np.sqrt(self.counts())[:, None]

    def known_errors(self) -> np.ndarray:
        """Like `errors`; for single runs from the noise of all points, or 0 where `covariance` is None."""
        covariance = self.covariance()
        errors = self.errors()
        pooled = (
            np.zeros(self.responses)
            if covariance is None
            else np.sqrt(np.diagonal(covariance))
        )
        return np.where(
            np.isfinite(errors), errors, pooled / np.sqrt(self.counts())[:, None]
        )

    def covariance(self) -> np.ndarray | None:
        """Covariance (k, k) of a single run about the mean of its point; None where the runs do not determine it."""
        good = self.good()
        covariance, freedom = estimate_within_covariance(
            self.values[good], np.nonzero(good)[0]
        )
        enough = freedom > self.responses and np.linalg.eigvalsh(covariance)[0] > 0
        return covariance if enough else None

    def replicates(self) -> dict[str, Any]:
        """Keyword arguments for `Surrogate.fit` about the noise; empty where `covariance` is None."""
        covariance = self.covariance()
        counts = self.counts()
        if covariance is None:
            return {}
        freedom = float(np.maximum(counts - 1, 0).sum())
        return {
            "precision": counts,
            "noise_covariance": covariance,
            "noise_freedom": freedom,
        }

    def simulations(self) -> int:
        """Count the runs, failed ones included."""
        return self.values.shape[0] * self.values.shape[1]

    def take(
        self, rows: np.ndarray | Sequence[int] | slice, seeds: int | None = None
    ) -> "Points":
        """Take some points with the first `seeds` runs (None: all); points without a good run in them are left out."""
        return Points(self.X[rows], self.values[rows, :seeds])._with_runs()

    def with_seeds_drawn(self, seeds: int, rng: np.random.Generator) -> "Points":
        """Take the points with `seeds` runs of each drawn at random; points without a good run are left out."""
        order = rng.permuted(
            np.tile(np.arange(self.values.shape[1]), (len(self.X), 1)), axis=1
        )[:, :seeds]
        return Points(
            self.X, np.take_along_axis(self.values, order[:, :, None], axis=1)
        )._with_runs()

    def _with_runs(self):
        """Keep the points that have a good run."""
        kept = self.good().any(axis=1)
        return Points(self.X[kept], self.values[kept])


def joined(sets: Sequence[Points]) -> Points:
    """All points of several sets; where a set has fewer runs than another, NaN fills the gap."""
    seeds = max(points.values.shape[1] for points in sets)
    padded = [
        np.pad(
            points.values,
            ((0, 0), (0, seeds - points.values.shape[1]), (0, 0)),
            constant_values=np.nan,
        )
        for points in sets
    ]
    return Points(np.concatenate([points.X for points in sets]), np.concatenate(padded))


def read_sets(files: Mapping[str, str | Path], names: Sequence[str]) -> list[Points]:
    """Points of the main design, of the pool and the fresh ones.

    `files` holds the paths ``main_dataset``, ``main_runs``, ``pool_dataset``, ``pool_runs``, ``fresh_dataset`` and
    ``fresh_runs``.
    """
    return [
        read(files[f"{name}_dataset"], files[f"{name}_runs"], names) for name in SETS
    ]


def read(dataset_csv: str | Path, runs_csv: str | Path, names: Sequence[str]) -> Points:
    """Points of the tables that the verb dataset wrote; those that are not ok are left out.

    Responses of several bench tests come from runs of their own (column ``apparatus``). The first run of each bench
    test makes the first run of the point, and so on; these runs are independent, so any pairing will do. InputError if
    a column is missing, no point is left, or a usable point has no good run.
    """
    dataset = read_table(dataset_csv, ("sample", "status", *PARAMETERS))
    runs = read_table(runs_csv, ("sample", "status", *names))
    usable = dataset[dataset["status"] == "ok"].reset_index(drop=True)
    runs = runs[runs["sample"].isin(usable["sample"])]
    if usable.empty or runs.empty:
        raise InputError(
            dataset_csv, "usable samples", 0, "some with status ok, with their runs"
        )
    # the number of each run among those of its sample and bench test
    keys = ["sample", "apparatus"] if "apparatus" in runs else ["sample"]
    place = runs.groupby(keys).cumcount().to_numpy()
    row = usable.set_index("sample").index.get_indexer(runs["sample"])
    values = np.full((len(usable), place.max() + 1, len(names)), np.nan)
    responses = runs[list(names)].to_numpy(float, copy=True)
    responses[runs["status"].to_numpy() != "ok"] = np.nan
    if "apparatus" in runs:
        bench_tests = runs["apparatus"]
    else:
        bench_tests = pd.Series("", index=runs.index)
    for test in bench_tests.unique():
        measured = (bench_tests == test).to_numpy()
        cell = row[measured], place[measured]
        # a bench test does not replace what another one measured
        values[cell] = np.where(
            np.isfinite(responses[measured]), responses[measured], values[cell]
        )
    found = Points(usable[list(PARAMETERS)].to_numpy(float), values)
    without = usable.loc[found.counts() == 0, "sample"]
    if len(without):
        allowed = f"runs of each usable sample of {dataset_csv}"
        raise InputError(runs_csv, "sample", int(without.iloc[0]), allowed)
    return found
