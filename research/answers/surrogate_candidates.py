"""Surrogates that `answers_by_data_set.py` puts beside the registered ones; what `kriging` lacks is a file.

network_of_part   `network_ensemble`, fitted to the training part alone
network_resampled 16 networks of one start each, each of samples drawn with replacement; the scatter is the error
network_process   `network_ensemble` plus a Gaussian process of its residuals, whose error is added
process_of_part   `gaussian_process`, fitted to the training part alone
kriging           Gaussian process of Matern 5/2, noise from the replicates, lengths and variances drawn
kriging_smooth    the same, squared exponential
"""

import numpy as np
from scipy import linalg, optimize

from repose.calibrate.surrogates import Surrogate, make, register
from repose.calibrate.surrogates.gaussian_process import GaussianProcess
from repose.calibrate.surrogates.network_ensemble import NetworkEnsemble
from repose.calibrate.surrogates.samples import check_points, check_samples
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.two_layer import compute_widths

REFITS = 16


class Candidate(Surrogate):
    """Methods that a candidate lacks: it is neither saved nor searched by the island search."""

    settings: dict

    @classmethod
    def of(cls, settings):
        model = cls()
        model.settings = dict(settings)
        return model

    def to_dict(self):
        raise NotImplementedError

    @classmethod
    def from_dict(cls, content):
        raise NotImplementedError


@register("network_of_part")
class NetworkOfPart(NetworkEnsemble):
    """`network_ensemble` of the training part."""

    of_all_samples = False


@register("process_of_part")
class ProcessOfPart(GaussianProcess):
    """`gaussian_process` of the training part."""

    of_all_samples = False


@register("network_resampled")
class NetworkResampled(Candidate):
    """Networks of samples drawn with replacement."""

    def fit(self, X, Y, **noise):
        X = np.asarray(X)
        Y = np.asarray(Y)
        random = np.random.default_rng(self.settings["seed"])
        self.members = []
        for k in range(REFITS):
            count = np.bincount(random.integers(len(X), size=len(X)), minlength=len(X))
            network = make(
                "network",
                NetworkSettings.from_keys(
                    self.settings | {"starts": 1, "seed": self.settings["seed"] + k}
                ),
            )
            self.members.append(network.fit(X, Y, count, **noise))
        return self

    def _means(self, X):
        return np.array([member.predict(X) for member in self.members])

    def predict(self, X, return_std=False, noise=True):
        return self._means(X).mean(axis=0)

    def covariance(self, X):
        deviations = self._means(X)
        deviations = deviations - deviations.mean(axis=0)
        return np.einsum("mni,mnj->nij", deviations, deviations) / (REFITS - 1)


@register("network_process")
class NetworkProcess(Candidate):
    """Networks and a process of their residuals."""

    def fit(self, X, Y, **noise):
        self.network = make(
            "network_ensemble", NetworkSettings.from_keys(self.settings)
        ).fit(X, Y, **noise)
        self.process = make("gaussian_process").fit(
            X, np.asarray(Y) - self.network.predict(X), **noise
        )
        return self

    def predict(self, X, return_std=False, noise=True):
        return self.network.predict(X) + self.process.predict(X)

    def covariance(self, X):
        return self.network.covariance(X) + self.process.covariance(X)


# prior of lengths, variance and noise: as in `repose.calibrate.strategies.sequential.kriging`
LENGTH_LOG_MEAN = np.sqrt(2) - 3
LENGTH_LOG_SD = np.sqrt(3)
VARIANCE_LOG_SD = 1.0
NOISE_LOG_MEAN = np.log(0.1)
NOISE_LOG_SD = 3.0
FIRST_LENGTHS = (0.5, 3.0)
LIMIT = np.log(1e4)
STEP = 1e-3
HALF_DRAWS = 4
CHUNK = 4096


def matern(square):
    """Matern 5/2 of squared distances, and its derivative by half their logarithm over the square."""
    r = np.sqrt(5 * square)
    decay = np.exp(-r)
    return (1 + r + r * r / 3) * decay, 5 / 3 * (1 + r) * decay


def squared_exponential(square):
    """The same of the squared exponential."""
    value = np.exp(-0.5 * square)
    return value, value


@register("kriging")
class Kriging(Candidate):
    """Matern 5/2; draws of lengths, variance and noise."""

    covariance_of = staticmethod(matern)

    def fit(self, X, Y, *, precision=None, noise_covariance=None, noise_freedom=0.0):
        X, Y, _, precision = check_samples(X, Y, precision=precision)
        self.low = X.min(axis=0)
        self.span = compute_widths(X.min(axis=0), X.max(axis=0))
        self.x = (X - self.low) / self.span
        k = Y.shape[1]
        mixing = np.eye(k)
        if noise_covariance is not None:
            # combinations of the responses with independent noise of variance 1 ...
            whitening = np.linalg.inv(np.linalg.cholesky(noise_covariance)).T
            # ... turned so that they are uncorrelated over the samples, too
            covariance = np.cov((Y @ whitening).T, aweights=precision[:, 0])
            _, axes = np.linalg.eigh(np.atleast_2d(covariance))
            mixing = whitening @ axes
        values = Y @ mixing
        self.middle = values.mean(axis=0)
        self.scale = np.maximum(values.std(axis=0), 1e-12)
        self.unmixing = np.linalg.inv(mixing)
        self.draws = []
        for c in range(k):
            known = (1 / self.scale[c] ** 2, noise_freedom) if noise_freedom else None
            value = (values[:, c] - self.middle[c]) / self.scale[c]
            weight = 1 / precision[:, c]
            thetas = self.drawn(value, weight, known)
            self.draws.append(
                [(theta, *self.conditioned(theta, value, weight)) for theta in thetas]
            )
        return self

    def drawn(self, value, weight, known):
        """Logarithms of variance, lengths and noise."""
        d = self.x.shape[1]
        squares = (self.x[:, None] - self.x[None]) ** 2
        mean = np.array(
            [0.0] + [LENGTH_LOG_MEAN + 0.5 * np.log(d)] * d + [NOISE_LOG_MEAN]
        )
        sd = np.array([VARIANCE_LOG_SD] + [LENGTH_LOG_SD] * d + [NOISE_LOG_SD])

        def loss(theta):
            scaled = squares * np.exp(-2 * theta[1:-1])
            correlation, slope = self.covariance_of(scaled.sum(axis=2))
            signal = np.exp(theta[0])
            noise = np.exp(theta[-1])
            K = 1.0 + signal * correlation + np.diag(noise * weight)
            root = linalg.cholesky(K, lower=True, check_finite=False)
            inverse = linalg.cho_solve((root, True), np.eye(len(K)), check_finite=False)
            alpha = inverse @ value
            inner = inverse - np.outer(alpha, alpha)
            deviations = (theta - mean) / sd
            found = (
                0.5 * value @ alpha
                + np.log(np.diagonal(root)).sum()
                + 0.5 * deviations @ deviations
            )
            gradient = deviations / sd
            gradient[0] += 0.5 * signal * (inner * correlation).sum()
            gradient[1:-1] += (
                0.5 * signal * np.einsum("ij,ijk->k", inner * slope, scaled)
            )
            gradient[-1] += 0.5 * noise * np.diagonal(inner) @ weight
            if known:
                variance, freedom = known
                found += 0.5 * freedom * (theta[-1] + variance / noise)
                gradient[-1] += 0.5 * freedom * (1 - variance / noise)
            return found, gradient

        ends = []
        for length in FIRST_LENGTHS:
            noise = np.log(known[0]) if known else NOISE_LOG_MEAN
            start = np.array([0.0] + [np.log(length)] * d + [noise])
            ends.append(
                optimize.minimize(
                    loss,
                    start,
                    jac=True,
                    method="L-BFGS-B",
                    bounds=[(-LIMIT, LIMIT)] * len(start),
                )
            )
        best = min(ends, key=lambda end: end.fun).x
        curvature = np.array(
            [
                (loss(best + step)[1] - loss(best - step)[1]) / (2 * STEP)
                for step in STEP * np.eye(len(best))
            ]
        )
        size, axes = np.linalg.eigh((curvature + curvature.T) / 2)
        root = axes / np.sqrt(np.maximum(size, LENGTH_LOG_SD**-2))
        normal = np.random.default_rng(1).standard_normal((HALF_DRAWS, len(best)))
        return [
            np.clip(best + root @ z, -LIMIT, LIMIT)
            for z in np.vstack([normal, -normal])
        ]

    def between(self, theta, first, second):
        a = first / np.exp(theta[1:-1])
        b = second / np.exp(theta[1:-1])
        square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
        return 1.0 + np.exp(theta[0]) * self.covariance_of(np.maximum(square, 0.0))[0]

    def conditioned(self, theta, value, weight):
        K = self.between(theta, self.x, self.x) + np.diag(np.exp(theta[-1]) * weight)
        root = linalg.cholesky(K, lower=True)
        return linalg.cho_solve((root, True), value), linalg.solve_triangular(
            root, np.eye(len(K)), lower=True
        )

    def moments(self, X):
        x = (check_points(X, len(self.low)) - self.low) / self.span
        means = []
        variances = []
        for k, draws in enumerate(self.draws):
            m = []
            v = []
            for theta, alpha, inverse_root in draws:
                between = self.between(theta, x, self.x)
                m.append(between @ alpha)
                explained = ((between @ inverse_root.T) ** 2).sum(axis=1)
                v.append(np.maximum(1.0 + np.exp(theta[0]) - explained, 1e-12))
            means.append(np.mean(m, axis=0) * self.scale[k] + self.middle[k])
            variances.append(
                (np.mean(v, axis=0) + np.var(m, axis=0)) * self.scale[k] ** 2
            )
        return np.column_stack(means), np.column_stack(variances)

    def predict(self, X, return_std=False, noise=True):
        return self.moments(X)[0] @ self.unmixing

    def covariance(self, X):
        roots = np.sqrt(self.moments(X)[1])[:, :, None] * self.unmixing
        return roots.transpose(0, 2, 1) @ roots


@register("kriging_smooth")
class KrigingSmooth(Kriging):
    """Squared exponential."""

    covariance_of = staticmethod(squared_exponential)


NAMES = (
    "network_of_part",
    "network_resampled",
    "network_process",
    "process_of_part",
    "kriging",
    "kriging_smooth",
)
