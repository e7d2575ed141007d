"""Poured points as arrays: parameters, and the responses of every run."""

from typing import NamedTuple

import numpy as np

from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.core.variance import within_covariance
from repose.surrogate.bayesian_bp import RESPONSES


class Points(NamedTuple):
    """Points of a design with their runs.

    X (points, 6): parameters; values (points, seeds, 2): angle in deg and Height in mm of each run, NaN where a
    run gave no pile. Every point has at least one that did.
    """

    X: np.ndarray
    values: np.ndarray

    def means(self):
        """Mean over the runs of each point, (points, 2)."""
        return np.nanmean(self.values, axis=1)

    def counts(self):
        """Runs of each point that gave a pile, (points,)."""
        return np.isfinite(self.values[:, :, 0]).sum(axis=1)

    def errors(self):
        """Standard errors of the means, (points, 2), from each point's own runs; NaN for a single run."""
        spread = np.full((len(self.X), 2), np.nan)
        several = self.counts() > 1
        spread[several] = np.nanstd(self.values[several], axis=1, ddof=1)
        return spread / np.sqrt(self.counts())[:, None]

    def known_errors(self):
        """The same, a single run given the noise of all points; zeros where no point has two runs."""
        covariance, errors = self.covariance(), self.errors()
        pooled = np.zeros(2) if covariance is None else np.sqrt(np.diagonal(covariance))
        return np.where(np.isfinite(errors), errors, pooled / np.sqrt(self.counts())[:, None])

    def covariance(self):
        """Covariance (2, 2) of a single run about the mean of its point, None where no rank can be had."""
        ok = np.isfinite(self.values[:, :, 0])
        covariance, freedom = within_covariance(self.values[ok], np.nonzero(ok)[0])
        return covariance if freedom > 2 and np.linalg.eigvalsh(covariance)[0] > 0 else None

    def simulations(self):
        """Runs poured for them, those without a pile included."""
        return self.values.shape[0] * self.values.shape[1]

    def take(self, rows, seeds=None):
        """Some points, with all runs or with their first ones; points that are left without any run are dropped."""
        values = self.values[rows, :seeds]
        kept = np.isfinite(values[:, :, 0]).any(axis=1)
        return Points(self.X[rows][kept], values[kept])

    def with_seeds_drawn(self, seeds, rng):
        """The same points with `seeds` of their runs, drawn at random for each."""
        order = rng.permuted(np.tile(np.arange(self.values.shape[1]), (len(self.X), 1)), axis=1)[:, :seeds]
        values = np.take_along_axis(self.values, order[:, :, None], axis=1)
        kept = np.isfinite(values[:, :, 0]).any(axis=1)
        return Points(self.X[kept], values[kept])


def read_sets(files):
    """Points of the main design, of the pool and the fresh ones, a list.

    files: mapping with main_dataset, main_runs, pool_dataset, pool_runs, fresh_dataset, fresh_runs. Raises as `read`.
    """
    return [read(files[f"{name}_dataset"], files[f"{name}_runs"]) for name in ("main", "pool", "fresh")]


def read(dataset_csv, runs_csv):
    """Points of the tables that the verb dataset wrote; those that are not ok are left out.

    Raises InputError for a missing column, or where no point is left.
    """
    dataset = read_table(dataset_csv, ("sample", "status", *PARAMETERS))
    runs = read_table(runs_csv, ("sample", "seed", "status", *RESPONSES))
    usable = dataset[dataset["status"] == "ok"].reset_index(drop=True)
    runs = runs[runs["sample"].isin(usable["sample"])]
    if usable.empty or runs.empty:
        raise InputError(dataset_csv, "usable samples", 0, "some with status ok, with their runs")
    place = runs.groupby("sample").cumcount().to_numpy()
    row = usable.set_index("sample").index.get_indexer(runs["sample"])
    values = np.full((len(usable), place.max() + 1, len(RESPONSES)), np.nan)
    responses = runs[list(RESPONSES)].to_numpy(float)
    responses[runs["status"].to_numpy() != "ok"] = np.nan
    values[row, place] = responses
    return Points(usable[list(PARAMETERS)].to_numpy(float), values)
