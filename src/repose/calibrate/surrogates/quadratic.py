"""Predict responses by a quadratic surface, fitted by weighted least squares.

Its terms are a constant, linear terms, squares and products of two inputs.

Sources, named where they are used
  (MM09)  Myers, Montgomery & Anderson-Cook 2009, Response Surface Methodology:
          second-order model, sections 2.3-2.7
  (A35)   Aitken 1935, on least squares and linear combination of observations: weights
  (Z62)   Zellner 1962, an efficient method of estimating seemingly unrelated
          regressions, J. Am. Stat. Assoc. 57, 348
"""

from collections.abc import Mapping
from typing import Any, NamedTuple, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.surrogates.base import Noise, Surrogate, register
from repose.calibrate.surrogates.samples import (
    check_points,
    check_samples,
    compute_decorrelating_mixing,
)
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.support import compute_quadratic_terms
from repose.calibrate.surrogates.two_layer import compute_widths


@register("quadratic")
class QuadraticSurface(Surrogate):
    """Second-order model y = A b + noise (MM09).

    A are the terms at the samples, b are the coefficients of one response. An input
    that does not vary has no terms.
    """

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        return cls()

    @staticmethod
    def least_samples(inputs: int) -> int:
        """Return the smallest number of samples, if all inputs vary."""
        return (inputs + 1) * (inputs + 2) // 2 + 1

    def fit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Fit the surface to samples, and estimate the noise from its residuals.

        Parameters
        ----------
        X : array (n, d)
            Parameter sets.
        Y : array (n, k)
            Their responses.
        **noise
            As in `Surrogate.fit`. `noise_covariance` is only checked: correlated noise
            does not change the coefficients, because all responses have the same terms
            (Zellner 1962).

        Returns
        -------
        QuadraticSurface
            This object, now fitted.

        Raises
        ------
        ValueError
            If there are no more samples than terms.
        """
        X, Y, _, precision = check_samples(X, Y, **noise)
        n_outputs = Y.shape[1]
        # This call only checks the covariance. Its result, the combinations of outputs
        # with independent noise, is not needed here.
        compute_decorrelating_mixing(
            noise.get("noise_covariance"), np.ones(n_outputs), precision
        )
        self.training_ = {"inputs": X, "outputs": Y, "precision": precision}
        self.offset_ = np.zeros(n_outputs)  # `shifted` changes it in a copy
        low = X.min(axis=0)
        high = X.max(axis=0)
        self.low_ = low
        self.width_ = compute_widths(low, high)
        self.varies_ = high > low  # which parameters are not constant

        # The noise is estimated from residuals, so there must be more samples than
        # terms.
        terms = self._compute_terms(X)
        n_samples, n_terms = terms.shape
        degrees_of_freedom = n_samples - n_terms
        if degrees_of_freedom < 1:
            raise ValueError(
                f"{n_samples} samples; "
                f"expected at least {n_terms + 1}, one more than the terms"
            )

        # There is one fit for each response, or a single fit of all responses.
        fits = _fit_responses(terms, Y, precision)
        self.coefficients_ = np.hstack([fit.coefficients for fit in fits])
        residuals = np.hstack([fit.residuals for fit in fits])
        # List the factor of each response. After a single fit, all have the same one.
        n_responses_per_fit = n_outputs // len(fits)
        self._factors = [fit.factor for fit in fits] * n_responses_per_fit
        # The variances are the diagonal of the covariance, but for rounding errors.
        self.residual_covariance_ = residuals.T @ residuals / degrees_of_freedom
        self._variances = (residuals**2).sum(axis=0) / degrees_of_freedom
        return self

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        a = self._compute_terms(check_points(X, len(self.low_)))
        mean = a @ self.coefficients_ + self.offset_
        if not return_std:
            return mean
        # The variance of the mean is leverage times residual variance (MM09), and the
        # noise adds the residual variance once. `noise` is True or False, which count
        # as 1 and 0.
        leverage = np.column_stack(
            [((a @ factor) ** 2).sum(axis=1) for factor in self._factors]
        )
        return mean, np.sqrt((leverage + noise) * self._variances)

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (n, k, k) of the predicted means (Zellner 1962).

        For responses k and l it is S_kl a' R_k R_l' a, where S is the covariance of the
        residuals, and R_k is the factor of response k from `_fit_weighted`.
        """
        a = self._compute_terms(check_points(X, len(self.low_)))
        products = np.stack([a @ factor for factor in self._factors], axis=1)
        return products @ products.transpose(0, 2, 1) * self.residual_covariance_

    def report(self) -> dict[str, Any]:
        """Report the number of terms, degrees of freedom, and the residual scatter."""
        n_terms = len(self.coefficients_)
        return {
            "n_terms": n_terms,
            "degrees_of_freedom": len(self.training_["inputs"]) - n_terms,
            "residual_sd": np.sqrt(self._variances).tolist(),
        }

    def to_dict(self) -> dict[str, Any]:
        """Collect the samples, from which the fit is computed again.

        The coefficients are only meant for readers of the file.
        """
        return {
            "coefficients": self.coefficients_.tolist(),
            "offset": self.offset_.tolist(),
            "training": {key: value.tolist() for key, value in self.training_.items()},
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Restore the surface from the result of `to_dict`."""
        training = content["training"]
        model = cls().fit(
            training["inputs"], training["outputs"], precision=training["precision"]
        )
        model.offset_ = np.asarray(content["offset"], dtype=float)
        return model

    def terms(self, unit: np.ndarray) -> np.ndarray:
        """Compute the terms (n, terms) of the model at points (n, d) in [0, 1]."""
        return compute_quadratic_terms(unit)

    def _compute_terms(self, X: np.ndarray) -> np.ndarray:
        """Compute the terms (n, terms) at parameter sets."""
        return self.terms(((X - self.low_) / self.width_)[:, self.varies_])


class _Fit(NamedTuple):
    """Result of weighted least squares."""

    coefficients: np.ndarray  # (terms, k)
    residuals: np.ndarray  # (n, k), weighted
    factor: np.ndarray  # R (terms, n) with R R' = (A' W A)^-1


def _fit_responses(A: np.ndarray, Y: np.ndarray, precision: np.ndarray) -> list[_Fit]:
    """Fit the terms A (n, terms) to responses Y (n, k) with precisions (n, k).

    There is a single fit for all responses, unless their precisions differ.
    """
    if not np.ptp(precision, axis=1).any():
        return [_fit_weighted(A, Y, np.sqrt(precision[:, 0]))]
    return [
        _fit_weighted(A, Y[:, k : k + 1], np.sqrt(precision[:, k]))
        for k in range(Y.shape[1])
    ]


def _fit_weighted(A: np.ndarray, Y: np.ndarray, root_precision: np.ndarray) -> _Fit:
    """Fit coefficients of the terms A (n, terms) to responses Y (n, k).

    Weighted least squares (Aitken 1935): the rows of A and Y are multiplied by the
    square roots (n,) of their precisions. In `_Fit`, W is the diagonal matrix of the
    precisions.
    """
    root_W = root_precision[:, None]
    weighted = A * root_W
    coefficients, *_ = np.linalg.lstsq(weighted, Y * root_W, rcond=None)
    return _Fit(
        coefficients=coefficients,
        residuals=(Y - A @ coefficients) * root_W,
        factor=np.linalg.pinv(weighted),
    )
