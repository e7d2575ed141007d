"""Information that observed responses hold about the parameters, by importance sampling over the prior.

The points are a Sobol sequence over the prior, weighted by the likelihood. They are the same for all sets of responses,
truths and draws of the noise, so two sets differ only by their responses. The result is deterministic.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.uncertainty.implausibility import (
    CREDIBLE_PROBABILITY,
    compute_joint_bits,
)
from repose.calibrate.uncertainty.sampler import N_BINS


def places_of(space: ParameterSpace, quantile: np.ndarray) -> np.ndarray:
    """Places (n, d) in the ranges, from 0 to 1, of quantiles (n, d) of the prior of each free parameter.

    A parameter without a prior of its own is uniform over its range: its place is its quantile.
    """
    place = quantile.copy()
    for name, distribution in _normal_priors(space).items():
        k = space.free.index(name)
        place[:, k] = distribution.ppf(quantile[:, k])
    return place


def prior_widths(space: ParameterSpace) -> np.ndarray:
    """Widths (d,) of the prior's 95 % intervals, over the ranges."""
    widths = np.full(space.dimensions, CREDIBLE_PROBABILITY)
    tails = [(1 - CREDIBLE_PROBABILITY) / 2, (1 + CREDIBLE_PROBABILITY) / 2]
    for name, distribution in _normal_priors(space).items():
        widths[space.free.index(name)] = np.diff(distribution.ppf(tails))[0]
    return widths


def _normal_priors(space):
    """Distributions over the range, 0 to 1, of the parameters that have a normal prior; cut to the range."""
    found = {}
    for name, (mean, sd) in space.prior.items():
        k = space.free.index(name)
        width = space.high[k] - space.low[k]
        middle = (mean - space.low[k]) / width
        scale = sd / width
        found[name] = stats.truncnorm(
            -middle / scale, (1 - middle) / scale, middle, scale
        )
    return found


class Prior:
    """Points of the prior, all of one weight, with the surrogates' predictions there.

    `quantile` (n, d) are quantiles of the prior, evenly spread; `predicted` (n, k) are responses. `place` (n, d) are
    places in the ranges; None means the quantiles, for uniform priors. `widths` (d,) are those of the prior's 95 %
    intervals, in places; None means uniform priors.
    """

    def __init__(
        self,
        quantile: np.ndarray,
        predicted: np.ndarray,
        place: np.ndarray | None = None,
        widths: np.ndarray | None = None,
    ):
        self.predicted = predicted
        self.place = quantile if place is None else place
        self.widths = (
            np.full(quantile.shape[1], CREDIBLE_PROBABILITY)
            if widths is None
            else widths
        )
        self.bin = np.minimum((quantile * N_BINS).astype(int), N_BINS - 1)
        self.order = np.argsort(self.place, axis=0)

    def weights(
        self, observed: np.ndarray, columns: Sequence[int], covariance: np.ndarray
    ) -> np.ndarray:
        """Posterior probability (n,) of each point; arguments as for `posterior`."""
        return Likelihood(self, columns, covariance).weights(observed)

    def posterior(
        self, observed: np.ndarray, columns: Sequence[int], covariance: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray, float]:
        """Return the result of `summary` for an observation of some responses.

        `observed` (k,) and `covariance` (k, k) are of all responses; `columns` are the numbers of the observed ones.
        """
        return self.summary(self.weights(observed, columns, covariance))

    def summary(
        self, weight: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray, float]:
        """Information in weighted points: bits, bits and widths (d,) of the parameters, effective number of points.

        `weight` (n,) is the posterior probability of each point. Bits are Kullback-Leibler divergences from the prior:
        of the joint posterior, and of each parameter alone as in
        `repose.calibrate.uncertainty.sampler.compute_information_bits`. A width is
        that of the 95 % interval over the prior's.
        """
        effective = 1 / (weight**2).sum()
        bits = []
        for k in range(self.place.shape[1]):
            share = np.bincount(self.bin[:, k], weight, N_BINS)
            filled = share[share > 1e-12]
            excess = (len(filled) - 1) / (2 * effective * math.log(2))
            bits.append(max(0.0, float(filled @ np.log2(filled * N_BINS)) - excess))
        widths = np.diff(self.intervals(weight), axis=0)[0] / self.widths
        return compute_joint_bits(weight), np.array(bits), widths, effective

    def intervals(self, weight: np.ndarray) -> np.ndarray:
        """Lower and upper ends (2, d) of the central 95 % intervals, in places; `weight` (n,) is the posterior."""
        tail = (1 - CREDIBLE_PROBABILITY) / 2
        found = []
        for k, order in enumerate(self.order.T):
            ends = np.searchsorted(np.cumsum(weight[order]), [tail, 1 - tail])
            found.append(self.place[order[np.minimum(ends, len(order) - 1)], k])
        return np.array(found).T


class Likelihood:
    """Likelihood of some responses at all points of a prior; made once, for many observations.

    `columns` are the numbers of the observed responses; `covariance` (k, k) is of all responses.
    """

    def __init__(self, prior: Prior, columns: Sequence[int], covariance: np.ndarray):
        self.columns = list(columns)
        self.root = np.linalg.cholesky(covariance[np.ix_(columns, columns)])
        self.predicted = np.linalg.solve(self.root, prior.predicted[:, self.columns].T)

    def weights(self, observed: np.ndarray) -> np.ndarray:
        """Posterior probability (n,) of each point; `observed` (k,) are all responses."""
        deviations = (
            self.predicted - np.linalg.solve(self.root, observed[self.columns])[:, None]
        )
        log_weight = -0.5 * np.einsum("kn,kn->n", deviations, deviations)
        weight = np.exp(log_weight - log_weight.max())
        return weight / weight.sum()


def averaged(
    prior: Prior,
    truths: np.ndarray,
    errors: np.ndarray,
    columns: Sequence[int],
    covariance: np.ndarray,
) -> dict[str, Any]:
    """Information in some responses: means over plausible truths, with their standard errors.

    `truths` (t,) are row numbers of the prior's points; `errors` (t, k) are unit normal numbers for the noise;
    `columns` and `covariance` are as for `Likelihood`. Keys: ``bits``, ``bits_se``; ``parameter_bits``, ``widths``,
    ``widths_se``, each (d,); ``effective``, the least effective number of points; ``all``, the joint bits (t,) of every
    truth.
    """
    root = np.linalg.cholesky(covariance)
    likelihood = Likelihood(prior, columns, covariance)
    found = [
        prior.summary(likelihood.weights(prior.predicted[row] + root @ error))
        for row, error in zip(truths, errors, strict=True)
    ]
    joint, bits, widths, effective = (
        np.array([outcome[i] for outcome in found]) for i in range(4)
    )
    count = math.sqrt(len(truths))
    return {
        "bits": joint.mean(),
        "bits_se": joint.std(ddof=1) / count,
        "parameter_bits": bits.mean(axis=0),
        "widths": widths.mean(axis=0),
        "widths_se": widths.std(axis=0, ddof=1) / count,
        "effective": effective.min(),
        "all": joint,
    }


def in_order(
    prior: Prior,
    truths: np.ndarray,
    errors: np.ndarray,
    names: Sequence[str],
    base: Sequence[str],
    covariance: np.ndarray,
) -> list[dict[str, Any]]:
    """Greedy order of the responses beside the base: at each place the response that adds most.

    Rows have ``place``, ``response``, ``bits`` of it with all before it, and ``gain_bits``. `base` is known already;
    the other arguments are as for `averaged`.
    """
    root = np.linalg.cholesky(covariance)
    rows: list[dict[str, Any]] = []
    observed = prior.predicted[truths] + errors @ root.T

    def bits(columns):
        likelihood = Likelihood(prior, columns, covariance)
        return np.mean([compute_joint_bits(likelihood.weights(y)) for y in observed])

    names = list(names)
    columns = [names.index(name) for name in base]
    before = bits(columns)
    left = [name for name in names if name not in base]
    while left:
        tried = {name: bits([*columns, names.index(name)]) for name in left}
        best = max(left, key=lambda name: tried[name])
        rows.append(
            {
                "place": len(rows) + 1,
                "response": best,
                "bits": tried[best],
                "gain_bits": tried[best] - before,
            }
        )
        before = tried[best]
        columns.append(names.index(best))
        left.remove(best)
    return rows
