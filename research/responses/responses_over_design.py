"""Responses over the samples of a design: means, errors, noise, and one network for each response."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS
from repose.calibrate import variance
from repose.calibrate.responses import response
from repose.calibrate.surrogates.accuracy import compute_r2
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import read_table
from research.responses.offered import offered

FEWEST_SAMPLES = 12
EPOCHS = 300  # of the surrogates, at most


class Known(NamedTuple):
    """A response over the design."""

    mean: np.ndarray  # (samples,), NaN where the sample has no run
    error: np.ndarray  # (samples,), standard error of the mean
    # mean, sd_within, sd_between, signal_to_noise, icc, samples, runs
    row: dict[str, Any]


class Data(NamedTuple):
    """Responses over a design, the input of a study."""

    X: np.ndarray  # (samples, 6), parameters
    known: dict[str, Known]  # by response; the targets come first
    runs: pd.DataFrame  # good single runs: ``sample`` and the responses


def over_design(values: np.ndarray, groups: np.ndarray, samples: np.ndarray) -> Known:
    """Means and errors of a response over the samples, and its signal to noise.

    `values` (n,) are single runs, NaN left out, and `groups` (n,) their samples; `samples` (m,) is the order of the
    result. The errors come from the variance within samples, pooled over all of them: a sample has too few runs for its
    own.
    """
    good = np.isfinite(values)
    values = values[good]
    groups = groups[good]
    found = variance.variance_components(values, groups)
    mean, error, count = _means(values, groups, samples, found.within)
    signal = math.sqrt(found.between / found.within) if found.within > 0 else math.inf
    row = {
        "mean": found.mean,
        "sd_within": math.sqrt(found.within),
        "sd_between": math.sqrt(found.between),
        "signal_to_noise": signal,
        "icc": found.icc,
        "samples": int((count > 0).sum()),
        "runs": found.n_values,
    }
    return Known(mean, error, row)


def _means(values, groups, samples, within):
    """Means of single runs over their samples, their errors by the variance within, and the number of runs.

    Mean and error are NaN without a run.
    """
    count = np.array([np.count_nonzero(groups == sample) for sample in samples])
    total = np.array([values[groups == sample].sum() for sample in samples])
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return (
        mean,
        np.where(count > 0, np.sqrt(within / np.maximum(count, 1)), np.nan),
        count,
    )


def read(
    runs_csv: str | Path, dataset_csv: str | Path, targets: Targets, definition: str
) -> Data:
    """Read the study's data, of the pile alone.

    `runs_csv` is of `saved_piles.run`, `definition` is `measure.response`. InputError if fewer than 12 samples
    can be used, or too few samples have two runs.
    """
    table = read_table(dataset_csv, ("sample", *PARAMETERS, "status"))
    table = table[table["status"] == "ok"]
    if len(table) < FEWEST_SAMPLES:
        raise InputError(
            dataset_csv,
            "usable samples",
            len(table),
            f"at least {FEWEST_SAMPLES} with status ok",
        )
    names = (*targets.names, *offered(targets.names, definition))
    runs = read_table(runs_csv, ("sample", "seed", "status", *names))
    runs = runs[(runs["status"] == "ok") & runs["sample"].isin(table["sample"])]
    samples = table["sample"].to_numpy()
    groups = runs["sample"].to_numpy()
    try:
        known = {
            name: over_design(runs[name].to_numpy(float), groups, samples)
            for name in names
        }
    except ValueError as error:
        raise InputError(
            runs_csv, "runs", str(error), "two or more of most samples"
        ) from None
    return Data(table[list(PARAMETERS)].to_numpy(float), known, runs)


def noise_correlation(runs: pd.DataFrame, names: Sequence[str]) -> np.ndarray:
    """Correlation (k, k) of responses from run to run within samples.

    It is 0 for a response that is not in the table, and for responses of different bench tests, which come from
    different runs.
    """
    found = np.eye(len(names))
    for test in dict.fromkeys(response(name).apparatus for name in names):
        columns = [
            name for name in names if name in runs and response(name).apparatus == test
        ]
        if not columns:
            continue
        table = runs[["sample", *columns]].dropna()
        deviations = table[columns] - table.groupby("sample")[columns].transform("mean")
        rows = [list(names).index(name) for name in columns]
        found[np.ix_(rows, rows)] = np.corrcoef(deviations.to_numpy().T)
    return found


# --- surrogates -----------------------------------------------------------------------------------


def trained(X: np.ndarray, known: Known, settings: Mapping[str, Any]) -> BayesianBP:
    """Train a network of one response on all samples that have it; X (samples, 6) are parameters.

    `settings` holds ``hidden``, ``epochs``, ``starts`` and ``seed``.
    """
    has_mean = np.isfinite(known.mean)
    model = BayesianBP(
        hidden=settings["hidden"],
        epochs=min(EPOCHS, settings["epochs"]),
        goal=0.0,
        starts=settings["starts"],
        seed=settings["seed"],
        prior="inputs",
    )
    return model.fit(X[has_mean], known.mean[has_mean])


def left_out(X: np.ndarray, known: Known, settings: Mapping[str, Any]) -> np.ndarray:
    """Predictions (samples,) of each sample by networks trained without it; NaN where it has no run.

    `settings` are as in `trained`, with ``folds``.
    """
    usable = np.flatnonzero(np.isfinite(known.mean))
    fold = (
        np.random.RandomState(settings["seed"]).permutation(len(usable))
        % settings["folds"]
    )
    predicted = np.full(len(known.mean), np.nan)
    for k in range(settings["folds"]):
        mean = np.full(len(known.mean), np.nan)
        mean[usable[fold != k]] = known.mean[usable[fold != k]]
        model = trained(X, known._replace(mean=mean), settings)
        predicted[usable[fold == k]] = model.predict(X[usable[fold == k]])
    return predicted


def cross_validated_r2(known: Known, predicted: np.ndarray) -> float:
    """R2 of the predictions of `left_out`; NaN where all means are alike."""
    has_prediction = np.isfinite(predicted)
    found = compute_r2(known.mean[has_prediction], predicted[has_prediction])
    return math.nan if found is None else found


def surrogate_covariance(
    residuals: np.ndarray, errors: np.ndarray, correlation: np.ndarray
) -> np.ndarray:
    """Covariance S_s (k, k) of the surrogates' own errors.

    The covariance of the residuals less the noise of the means, made positive definite. Two responses are compared over
    the samples that have both. `residuals` (samples, k) are of the cross-validation, NaN where a sample has no run;
    `errors` (samples, k) are standard errors of the means, and `correlation` (k, k) is of their noise.
    """
    k = residuals.shape[1]
    found = np.zeros((k, k))
    for i in range(k):
        for j in range(k):
            both = np.isfinite(residuals[:, i] * residuals[:, j])
            noise_part = correlation[i, j] * errors[both, i] * errors[both, j]
            found[i, j] = np.mean(residuals[both, i] * residuals[both, j] - noise_part)
    scale = np.sqrt(np.nanmean(residuals**2, axis=0))
    values, vectors = np.linalg.eigh(found / np.outer(scale, scale))
    # pairwise estimates need not be consistent; an error of 1 % of a residual is as good as none
    values = np.maximum(values, 1e-4)
    return (vectors * values) @ vectors.T * np.outer(scale, scale)
