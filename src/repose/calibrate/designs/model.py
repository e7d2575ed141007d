"""Polynomial models of a response in coded factors, fitted by ordinary least squares."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np
from numpy.typing import ArrayLike

Term = tuple[int, ...]  # factors that are multiplied: (0,), (0, 1), (0, 0)
ORDERS = ("linear", "interaction", "quadratic")


def terms_of(factors: int, order: str) -> tuple[Term, ...]:
    """List the terms of a model but its constant: single factors, then products of two, then squares."""
    numbers = range(factors)
    groups: list[Iterable[Term]] = [
        ((k,) for k in numbers),
        combinations(numbers, 2),
        ((k, k) for k in numbers),
    ]
    return tuple(chain(*groups[: ORDERS.index(order) + 1]))


def columns(coded: ArrayLike, terms: Sequence[Term]) -> np.ndarray:
    """Compute the terms (n, terms) at coded points (n, k)."""
    coded = np.asarray(coded, dtype=float)
    return np.column_stack([coded[:, list(term)].prod(axis=1) for term in terms])


def label(term: Term, factors: Sequence[str]) -> str:
    """Name a term: ``A``, ``A*B``, ``A^2``."""
    is_square = len(term) == 2 and term[0] == term[1]
    return f"{factors[term[0]]}^2" if is_square else "*".join(factors[k] for k in term)


@dataclass(frozen=True)
class Model:
    """A polynomial fitted to runs."""

    factors: tuple[str, ...]
    terms: tuple[Term, ...]
    coded: np.ndarray  # (n, k), the runs
    response: np.ndarray  # (n,)
    matrix: np.ndarray  # (n, p), columns: constant, terms
    inverse: np.ndarray  # (p, p), of matrix' matrix
    fitted: np.ndarray  # (p,), the coefficients of all columns

    @property
    def labels(self) -> list[str]:
        """The terms in words."""
        return [label(term, self.factors) for term in self.terms]

    @property
    def coefficients(self) -> np.ndarray:
        """Coefficients of the terms, shape (terms,)."""
        return self.fitted[1:]

    @property
    def constant(self) -> float:
        """The response at the centre."""
        return float(self.fitted[0])

    @property
    def residuals(self) -> np.ndarray:
        """Responses less the fitted ones, (n,)."""
        return self.response - self.matrix @ self.fitted

    @property
    def residual(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def df(self) -> int:
        """Degrees of freedom of the residuals."""
        return len(self.response) - self.matrix.shape[1]

    @property
    def variance(self) -> float:
        """Mean square of the residuals; nan without a degree of freedom."""
        return self.residual / self.df if self.df else math.nan

    def predict(self, coded: ArrayLike) -> np.ndarray:
        """Predict the response (n,) at points (n, k) in coded units."""
        return self.constant + columns(coded, self.terms) @ self.coefficients

    def standard_error(self, coded: ArrayLike) -> np.ndarray:
        """Compute the standard error (n,) of the mean at coded points (n, k); nan without degrees of freedom."""
        values = columns(coded, self.terms)
        rows = np.hstack([np.ones((len(values), 1)), values])
        return np.sqrt(
            np.einsum("ni,ij,nj->n", rows, self.variance * self.inverse, rows)
        )


def fit(
    coded: ArrayLike,
    response: ArrayLike,
    factors: Sequence[str],
    order: str | Sequence[Term],
) -> Model:
    """Fit a polynomial to runs (n, k) in coded units."""
    coded, response = np.asarray(coded, dtype=float), np.asarray(response, dtype=float)
    terms = terms_of(len(factors), order) if isinstance(order, str) else tuple(order)
    matrix = np.hstack([np.ones((len(coded), 1)), columns(coded, terms)])
    rank = int(np.linalg.matrix_rank(matrix))
    if rank < matrix.shape[1]:
        raise ValueError(
            f"{len(coded)} runs determine {rank} coefficients; expected all {matrix.shape[1]}"
        )
    inverse = np.linalg.pinv(matrix)
    return Model(
        tuple(factors),
        terms,
        coded,
        response,
        matrix,
        inverse @ inverse.T,
        inverse @ response,
    )
