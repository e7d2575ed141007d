"""Quadratic response surface: a constant, linear terms, squares and products of two, by weighted least squares.

Sources of the lines, named where they are used
  (MM09)  Myers, Montgomery & Anderson-Cook 2009, Response Surface Methodology: second-order model, sections 2.3-2.7
  (A35)   Aitken 1935, on least squares and linear combination of observations: weights
  (Z62)   Zellner 1962, an efficient method of estimating seemingly unrelated regressions, J. Am. Stat. Assoc. 57, 348
"""

from collections.abc import Mapping
from typing import Any, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.surrogates.base import Noise, Surrogate, register
from repose.calibrate.surrogates.samples import (
    checked_points,
    checked_samples,
    independent_mixing,
)
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.support import quadratic_terms
from repose.calibrate.surrogates.two_layer import width


@register("quadratic")
class QuadraticSurface(Surrogate):
    """Second-order model y = A b + noise, one vector of coefficients b for each response (MM09).

    An input that does not vary has no terms.
    """

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        return cls()

    @staticmethod
    def least_samples(inputs: int) -> int:
        """Count the fewest samples for so many inputs that vary: one more than the terms."""
        return (inputs + 1) * (inputs + 2) // 2 + 1

    def fit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Learn from samples; residuals give the noise.

        `noise_covariance` is only checked: all responses have the same terms, and then correlated noise does not change
        the coefficients (Z62).
        """
        X, Y, _, precision = checked_samples(X, Y, **noise)
        independent_mixing(
            noise.get("noise_covariance"), np.ones(Y.shape[1]), precision
        )
        self.training_ = {"inputs": X, "outputs": Y, "precision": precision}
        self.offset_ = np.zeros(Y.shape[1])
        self.low_, self.width_ = X.min(axis=0), width(X.min(axis=0), X.max(axis=0))
        self.varies_ = X.max(axis=0) > self.low_
        A = self._terms(X)
        freedom = len(A) - A.shape[1]
        if freedom < 1:
            raise ValueError(
                f"{len(A)} samples; expected at least {A.shape[1] + 1}, one more than the terms"
            )
        # one system of equations for all responses, unless their precisions differ
        groups = (
            [slice(k, k + 1) for k in range(Y.shape[1])]
            if np.ptp(precision, axis=1).any()
            else [slice(None)]
        )
        fits = [
            _weighted(A, Y[:, group], np.sqrt(precision[:, group][:, 0]))
            for group in groups
        ]
        self.coefficients_ = np.hstack([fit[0] for fit in fits])
        residuals = np.hstack([fit[1] for fit in fits])
        self._roots = [fit[2] for fit in fits] * (Y.shape[1] // len(fits))
        self.residual_covariance_ = residuals.T @ residuals / freedom
        self._variances = (residuals**2).sum(axis=0) / freedom
        return self

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        a = self._terms(checked_points(X, len(self.low_)))
        mean = a @ self.coefficients_ + self.offset_
        if not return_std:
            return mean
        # variance of the mean: leverage times residual variance (MM09)
        leverage = np.column_stack(
            [((a @ root) ** 2).sum(axis=1) for root in self._roots]
        )
        return mean, np.sqrt((leverage + noise) * self._variances)

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Covariance of the predicted means: S_kl a'(R_k R_l')a with S of the residuals (Z62)."""
        a = self._terms(checked_points(X, len(self.low_)))
        paths = np.stack([a @ root for root in self._roots], axis=1)
        return paths @ paths.transpose(0, 2, 1) * self.residual_covariance_

    def report(self) -> dict[str, Any]:
        """Report the number of terms, degrees of freedom, standard deviation of the residuals."""
        terms = len(self.coefficients_)
        freedom, spread = (
            len(self.training_["inputs"]) - terms,
            np.sqrt(self._variances).tolist(),
        )
        return {"n_terms": terms, "degrees_of_freedom": freedom, "residual_sd": spread}

    def to_dict(self) -> dict[str, Any]:
        """Collect the samples, from which the fit is computed again, and the coefficients for a reader."""
        training = {key: value.tolist() for key, value in self.training_.items()}
        return {
            "coefficients": self.coefficients_.tolist(),
            "offset": self.offset_.tolist(),
            "training": training,
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Make the surface of a `to_dict`."""
        training = content["training"]
        model = cls().fit(
            training["inputs"], training["outputs"], precision=training["precision"]
        )
        model.offset_ = np.asarray(content["offset"], dtype=float)
        return model

    def terms(self, unit: np.ndarray) -> np.ndarray:
        """Terms of the model: 1, x_i and x_i x_j."""
        return quadratic_terms(unit)

    def _terms(self, X: np.ndarray) -> np.ndarray:
        """Compute the terms at points, (n, terms)."""
        return self.terms(((X - self.low_) / self.width_)[:, self.varies_])


def _weighted(
    A: np.ndarray, Y: np.ndarray, root_precision: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit coefficients (terms, k), weighted residuals (n, k), and R (terms, n) with R R' = (A'WA)^-1 (A35)."""
    weighted = A * root_precision[:, None]
    coefficients, *_ = np.linalg.lstsq(
        weighted, Y * root_precision[:, None], rcond=None
    )
    return (
        coefficients,
        (Y - A @ coefficients) * root_precision[:, None],
        np.linalg.pinv(weighted),
    )
