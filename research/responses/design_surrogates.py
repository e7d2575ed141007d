"""Surrogates of many responses over a design, one for each, and their errors on samples they have not seen."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from repose.calibrate.surrogates import make
from repose.calibrate.surrogates.settings import NetworkSettings
from research.responses.responses_over_design import (
    Data,
    Known,
    cross_validated_r2,
    noise_correlation,
    surrogate_covariance,
)

NOISY = 0.5  # a response with less signal than this share of its noise is not modelled
WORST_R2 = 0.2  # nor is a response whose surrogate explains less

Predict = Callable[[np.ndarray], np.ndarray]


def fitted(X: np.ndarray, known: Known, settings: Mapping[str, Any]) -> Predict:
    """Fit a surrogate of one response on all samples that have it: from parameter sets (n, 6) to the response (n,).

    X (samples, 6) are parameters; `settings` holds ``surrogate``, its name, and the settings of that surrogate.
    """
    has_mean = np.isfinite(known.mean)
    model = make(settings["surrogate"], NetworkSettings.from_keys(settings)).fit(
        X[has_mean], known.mean[has_mean][:, None]
    )
    return lambda points: model.predict(points)[:, 0]


class Surrogates(NamedTuple):
    """The responses that have a surrogate; k is their number."""

    names: tuple[str, ...]
    predict: Predict  # parameter sets (n, 6) to all responses (n, k)
    fold: np.ndarray  # (samples,), the fold that leaves each sample out
    # one `predict` for each fold, by surrogates that have not seen its samples
    without: list[Predict]
    correlation: np.ndarray  # (k, k), of the noise from run to run
    # (k, k), S_s of the surrogates' own errors, by cross-validation
    covariance: np.ndarray
    # R2 of each response that was tried, by cross-validation on the means
    r2: dict[str, float]
    left_out: list[str]  # responses with too little signal, or too bad a surrogate

    @classmethod
    def of(
        cls, data: Data, base: Sequence[str], settings: Mapping[str, Any]
    ) -> "Surrogates":
        """Surrogates of all responses with enough signal; those of `base` are kept in any case.

        `settings` holds ``surrogate``, ``folds``, ``seed`` and the settings of that surrogate.
        """
        count = len(data.X)
        folds = settings["folds"]
        fold = np.random.default_rng(settings["seed"]).permutation(count) % folds
        errors_of = {}
        models = {}
        r2 = {}
        for name, known in data.known.items():
            if name not in base and known.row["signal_to_noise"] < NOISY:
                continue
            fold_models = []
            predicted = np.full(count, np.nan)
            for k in range(folds):
                fold_models.append(fitted(data.X, _without(known, fold == k), settings))
                predicted[fold == k] = fold_models[-1](data.X[fold == k])
            predicted[~np.isfinite(known.mean)] = np.nan
            r2[name] = cross_validated_r2(known, predicted)
            if name in base or r2[name] >= WORST_R2:
                errors_of[name] = predicted - known.mean
                models[name] = fold_models
        names = tuple(errors_of)
        correlation = noise_correlation(data.runs, names)
        residuals = np.column_stack([errors_of[name] for name in names])
        errors = np.column_stack([data.known[name].error for name in names])
        whole = [fitted(data.X, data.known[name], settings) for name in names]
        return cls(
            names=names,
            predict=_together(whole),
            fold=fold,
            without=[
                _together([models[name][k] for name in names]) for k in range(folds)
            ],
            correlation=correlation,
            covariance=surrogate_covariance(residuals, errors, correlation),
            r2=r2,
            left_out=[name for name in data.known if name not in names],
        )


def _without(known, hidden):
    """Take a response over the samples that are not hidden."""
    return known._replace(mean=np.where(hidden, np.nan, known.mean))


def _together(models):
    """Make a single function for all responses."""
    return lambda points: np.column_stack([model(points) for model in models])
