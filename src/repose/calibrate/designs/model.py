"""Polynomial models of a response in coded factors, fitted by least squares."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

Term = tuple[int, ...]  # factors that are multiplied: (0,), (0, 1), (0, 0)
ORDERS = ("linear", "interaction", "quadratic")


def list_terms(factors: int, order: str) -> tuple[Term, ...]:
    """List the terms of a model without its constant.

    Parameters
    ----------
    factors : int
        Number of factors.
    order : str
        One of `ORDERS`. A "linear" model has the factors themselves, an "interaction"
        model also their products in pairs, a "quadratic" model also their squares.

    Returns
    -------
    tuple of Term
        A term is a tuple of the numbers, from 0, of the factors that are multiplied.
    """
    factor_numbers = range(factors)
    # A model has the terms of all simpler models, which come before it in `ORDERS`.
    position = ORDERS.index(order)
    terms: list[Term] = [(k,) for k in factor_numbers]
    if position >= ORDERS.index("interaction"):
        terms += combinations(factor_numbers, 2)
    if position >= ORDERS.index("quadratic"):
        terms += [(k, k) for k in factor_numbers]
    return tuple(terms)


def compute_terms(coded: ArrayLike, terms: Sequence[Term]) -> np.ndarray:
    """Compute the terms (n, terms) at coded points (n, k)."""
    coded = np.asarray(coded, dtype=float)
    return np.column_stack([coded[:, list(term)].prod(axis=1) for term in terms])


def format_term(term: Term, factors: Sequence[str]) -> str:
    """Name a term: ``A``, ``A*B``, ``A^2``."""
    is_square = len(term) == 2 and term[0] == term[1]
    if is_square:
        return f"{factors[term[0]]}^2"
    return "*".join(factors[k] for k in term)


@dataclass(frozen=True)
class Model:
    """A polynomial fitted to n runs; p is the number of its terms and the constant."""

    factors: tuple[str, ...]
    terms: tuple[Term, ...]
    coded: np.ndarray  # (n, k), the runs
    response: np.ndarray  # (n,)
    matrix: np.ndarray  # X (n, p), columns: constant, terms
    inverse: np.ndarray  # (X'X)^-1 (p, p), not the inverse of `matrix`
    all_coefficients: np.ndarray  # (p,), the constant, and the terms in their order

    @property
    def labels(self) -> list[str]:
        """Names of the terms."""
        return [format_term(term, self.factors) for term in self.terms]

    @property
    def coefficients(self) -> np.ndarray:
        """Coefficients of the terms, shape (terms,)."""
        return self.all_coefficients[1:]

    @property
    def constant(self) -> float:
        """The response at the centre."""
        return float(self.all_coefficients[0])

    @property
    def residuals(self) -> np.ndarray:
        """Responses minus predictions at the runs, (n,)."""
        return self.response - self.matrix @ self.all_coefficients

    @property
    def residual_squares(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def df(self) -> int:
        """Degrees of freedom of the residuals."""
        return len(self.response) - self.matrix.shape[1]

    @property
    def variance(self) -> float:
        """Mean square of the residuals; NaN if they have no degrees of freedom."""
        return self.residual_squares / self.df if self.df else math.nan

    def predict(self, coded: ArrayLike) -> np.ndarray:
        """Predict the response (n,) at points (n, k) in coded units."""
        return self.constant + compute_terms(coded, self.terms) @ self.coefficients

    def standard_error(self, coded: ArrayLike) -> np.ndarray:
        """Compute the standard error (n,) of the mean at points (n, k) in coded units.

        It is NaN if the residuals have no degrees of freedom.
        """
        rows = _prepend_ones(compute_terms(coded, self.terms))
        covariance = self.variance * self.inverse
        return np.sqrt(np.einsum("ni,ij,nj->n", rows, covariance, rows))


def fit_model(
    coded: ArrayLike,
    response: ArrayLike,
    factors: Sequence[str],
    order: str | Sequence[Term],
) -> Model:
    """Fit a polynomial to the responses of runs, by least squares.

    Parameters
    ----------
    coded : array (n, k)
        The runs in coded units.
    response : array (n,)
        The response of each run.
    factors : sequence of str
        Names of the k factors.
    order : str or sequence of Term
        One of `ORDERS`, which stands for the terms that `list_terms` returns, or the
        terms themselves.

    Returns
    -------
    Model

    Raises
    ------
    ValueError
        If the runs do not determine all coefficients.
    """
    coded = np.asarray(coded, dtype=float)
    response = np.asarray(response, dtype=float)
    terms = list_terms(len(factors), order) if isinstance(order, str) else tuple(order)
    matrix = _prepend_ones(compute_terms(coded, terms))
    rank = int(np.linalg.matrix_rank(matrix))
    n_coefficients = matrix.shape[1]
    if rank < n_coefficients:
        raise ValueError(
            f"{len(coded)} runs determine {rank} coefficients; "
            f"expected all {n_coefficients}"
        )
    # The pseudo-inverse P of X gives the coefficients P y, and (X'X)^-1 = P P'.
    pseudo_inverse = np.linalg.pinv(matrix)
    return Model(
        factors=tuple(factors),
        terms=terms,
        coded=coded,
        response=response,
        matrix=matrix,
        inverse=pseudo_inverse @ pseudo_inverse.T,
        all_coefficients=pseudo_inverse @ response,
    )


def _prepend_ones(values: np.ndarray) -> np.ndarray:
    """Put a column of ones before the terms (n, terms)."""
    return np.hstack([np.ones((len(values), 1)), values])
