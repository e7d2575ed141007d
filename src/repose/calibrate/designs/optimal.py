"""Runs of a design at allowed places, chosen by D-optimality.

A textbook design has runs at places that constraints may forbid. Its allowed runs stay.
In place of the others come as many new ones for which the determinant of X'X of the model
is largest, so all coefficients stay estimable and together are determined best. The
search is the coordinate exchange of Meyer and Nachtsheim (Technometrics 37 (1995) 60-69).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from repose.calibrate.designs.model import Term, columns, terms_of
from repose.calibrate.designs.region import Region

# Levels of a factor among which the exchange chooses.
LEVELS = np.linspace(-1.0, 1.0, 21)
# Searches from different runs; the best result counts.
STARTS = 10
# Rounds of exchanges through all new runs, at most.
MOST_ROUNDS = 100
# An exchange that raises the log determinant by less is not made.
LEAST_GAIN = 1e-9
# Added to the diagonal of X'X, which is singular as long as there are too few runs.
RIDGE = 1e-8


class AllowedDesign(NamedTuple):
    """A design whose runs are all allowed."""

    coded: np.ndarray  # (n, factors)
    is_new: np.ndarray  # (n,), whether a run took the place of a forbidden one


def replace_forbidden(
    coded: np.ndarray, region: Region | None, order: str
) -> AllowedDesign:
    """Replace the forbidden runs of a design.

    Parameters
    ----------
    coded : numpy.ndarray, (n, factors)
        The design, without runs of its centre.
    region : Region or None
        What is allowed; None where all is.
    order : str
        Of the model, one of `repose.calibrate.designs.model.ORDERS`.

    Returns
    -------
    AllowedDesign
        With as many runs, those that were allowed at their places.

    Raises
    ------
    ValueError
        If the runs do not determine all coefficients of the model.
    """
    if region is None:
        return AllowedDesign(coded, np.zeros(len(coded), dtype=bool))
    is_new = ~region.is_allowed(coded)
    if not is_new.any():
        return AllowedDesign(coded, is_new)
    terms = terms_of(coded.shape[1], order)
    new_runs = added_runs(coded[~is_new], int(is_new.sum()), region, terms)
    runs = coded.copy()
    runs[is_new] = new_runs
    rank = int(np.linalg.matrix_rank(_rows(runs, terms)))
    if rank < len(terms) + 1:
        raise ValueError(
            f"{len(runs)} allowed runs determine {rank} coefficients; expected all "
            f"{len(terms) + 1}"
        )
    return AllowedDesign(runs, is_new)


def added_runs(
    kept: np.ndarray, count: int, region: Region, terms: Sequence[Term]
) -> np.ndarray:
    """Choose runs (count, factors) that determine a model best, together with others.

    Parameters
    ----------
    kept : numpy.ndarray, (n, factors)
        The other runs.
    count : int
    region : Region
        Where runs are allowed.
    terms : sequence of tuple
        Terms of the model besides the constant.
    """
    best = np.empty((0, kept.shape[1]))
    best_value = -np.inf
    for start in range(STARTS):
        # Each start is another part of the points that are spread over the region.
        rows = (start * count + np.arange(count)) % len(region.points)
        runs = region.points[rows].copy()
        _exchange(runs, kept, region, terms)
        value = log_determinant(np.vstack([kept, runs]), terms)
        if value > best_value + LEAST_GAIN:
            best_value = value
            best = runs
    return best


def _exchange(
    runs: np.ndarray, kept: np.ndarray, region: Region, terms: Sequence[Term]
) -> None:
    """Exchange coordinates of runs, in place, until none raises the determinant."""
    for _ in range(MOST_ROUNDS):
        is_changed = False
        for row in range(len(runs)):
            others = np.vstack([kept, np.delete(runs, row, axis=0)])
            # A run with the row f of the model multiplies the determinant of the
            # others, that of M, by 1 + f' M^-1 f.
            inverse = np.linalg.inv(_information(others, terms))
            for factor in range(runs.shape[1]):
                candidates = np.repeat(runs[row][None], len(LEVELS) + 1, axis=0)
                candidates[1:, factor] = LEVELS
                candidates = candidates[region.is_allowed(candidates)]
                rows = _rows(candidates, terms)
                gains = np.log1p((rows @ inverse * rows).sum(axis=1))
                best = gains.argmax()
                # The first candidate is the run as it is.
                if gains[best] > gains[0] + LEAST_GAIN:
                    runs[row] = candidates[best]
                    is_changed = True
        if not is_changed:
            return


def log_determinant(coded: np.ndarray, terms: Sequence[Term]) -> float:
    """Compute the logarithm of the determinant of X'X of runs (n, factors)."""
    return float(np.linalg.slogdet(_information(coded, terms)).logabsdet)


def _information(coded: np.ndarray, terms: Sequence[Term]) -> np.ndarray:
    """Compute X'X (p, p) of runs (n, factors), with the ridge."""
    X = _rows(coded, terms)
    return X.T @ X + RIDGE * np.eye(X.shape[1])


def _rows(coded: np.ndarray, terms: Sequence[Term]) -> np.ndarray:
    """Compute the rows (n, p) of the model at points: the constant and the terms."""
    return np.hstack([np.ones((len(coded), 1)), columns(coded, terms)])
