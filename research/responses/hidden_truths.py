"""Coverage of the intervals: how often they hold parameters that were known, and hidden.

A hidden truth is a sample of the design. Its responses are the means of its own pours, with a discrepancy drawn for
them; its direct tests are drawn, too. The surrogates have not seen it: they are those of the cross-validation's fold
that left it out. So the surrogates' errors and the noise of the pours are real.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from research.responses.design_surrogates import Surrogates
from research.responses.observables import (
    Tests,
    direct,
    discrepancy_of,
    with_parameters,
)
from research.responses.plausible import prior_points
from research.responses.responses_over_design import Data


def coverage(
    data: Data,
    surrogates: Surrogates,
    tests: Tests,
    space: ParameterSpace,
    settings: Mapping[str, Any],
    sets: Mapping[str, Sequence[str]],
) -> pd.DataFrame:
    """Share of the 95 % intervals that hold the hidden truth.

    A row for each set and parameter, and a row ``all`` for each set: ``coverage``, its standard error over the truths,
    mean width over the range, number of truths, and the posteriors' effective number of points. `sets` holds the tests
    of each set by a label; `settings` holds ``hidden_truths`` and the keys of `prior_points` and `discrepancy_of`.
    """
    k = len(surrogates.names)
    names = surrogates.names
    tested = [i for i, name in enumerate(space.free) if direct(name) in tests.columns]
    spread = discrepancy_of(data, names, settings)
    means = np.column_stack([data.known[name].mean for name in names])
    errors = np.column_stack([data.known[name].error for name in names])
    random = np.random.default_rng(settings["seed"] + 2)
    truths = _drawn(random, len(data.X), settings["hidden_truths"])
    held: dict[str, list] = {label: [] for label in sets}
    for fold, predict in enumerate(surrogates.without):
        rows = truths[surrogates.fold[truths] == fold]
        if not len(rows):
            continue
        prior = prior_points(space, settings, predict)
        with_parameters(prior, tested)
        for row in rows:
            place = space.unit(data.X[[row]])[0]
            covariance = tests.covariance.copy()
            noise = np.outer(errors[row], errors[row]) * surrogates.correlation
            covariance[:k, :k] = noise + surrogates.covariance + spread
            observed = np.concatenate([means[row], place[tested]])
            observed[:k] += random.multivariate_normal(
                np.zeros(k), spread, method="eigh"
            )
            observed[k:] += random.normal(size=len(tested)) * np.sqrt(
                np.diag(covariance)[k:]
            )
            for label, chosen in sets.items():
                columns = [
                    column
                    for column in tests.of(chosen)
                    if np.isfinite(observed[column])
                ]
                weight = prior.weights(observed, columns, covariance)
                low, high = prior.intervals(weight)
                held[label].append(
                    (
                        (low <= place) & (place <= high),
                        high - low,
                        1 / (weight**2).sum(),
                    )
                )
    return pd.DataFrame(
        [
            row
            for label, intervals in held.items()
            for row in _rows(label, intervals, space.free)
        ]
    )


def _drawn(random, samples, count):
    """Rows of the samples, each as often as any other, or once more."""
    whole = [random.permutation(samples) for _ in range(math.ceil(count / samples))]
    return np.concatenate(whole)[:count]


def _rows(label, intervals, free):
    """Rows of one set."""
    inside, width, effective = (
        np.array(part, float) for part in zip(*intervals, strict=True)
    )
    count = len(inside)
    facts = {"truths": count, "median_effective_points": np.median(effective)}
    rows = [
        {
            "set": label,
            "parameter": name,
            "coverage": inside[:, k].mean(),
            "coverage_se": inside[:, k].std(ddof=1) / math.sqrt(count),
            "mean_width": width[:, k].mean(),
        }
        | facts
        for k, name in enumerate(free)
    ]
    by_truth = inside.mean(axis=1)
    rows.append(
        {
            "set": label,
            "parameter": "all",
            "coverage": by_truth.mean(),
            "coverage_se": by_truth.std(ddof=1) / math.sqrt(count),
            "mean_width": width.mean(),
        }
        | facts
    )
    return rows
