"""Replace the forbidden runs of a design by D-optimal ones.

Constraints may forbid some runs of a textbook design. The allowed runs stay, and each
forbidden run is replaced by a new one. The new runs maximise the determinant of X'X,
where X is the matrix of the model. The coefficients of the model can then be estimated,
and their joint uncertainty is as small as possible. The search is the coordinate
exchange of Meyer and Nachtsheim (Technometrics 37 (1995) 60-69).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from repose.calibrate.designs.model import Term, compute_terms, list_terms
from repose.calibrate.designs.region import Region

# Levels of a factor among which the exchange chooses.
LEVELS = np.linspace(-1.0, 1.0, 21)
# Number of searches, each from different runs. The best result is used.
N_STARTS = 10
# Largest number of rounds, each of which tries exchanges in all new runs.
MAX_ROUNDS = 100
# An exchange must raise the log determinant by more than this. So must a search over
# the best one before it. A smaller rise may be a rounding error.
MIN_GAIN = 1e-9
# Added to the diagonal of X'X, which is singular as long as there are too few runs.
RIDGE = 1e-8


class AllowedDesign(NamedTuple):
    """A design whose runs are all allowed."""

    coded: np.ndarray  # (n, factors)
    is_new: np.ndarray  # (n,), whether a run took the place of a forbidden one


def replace_forbidden(
    coded: np.ndarray, region: Region | None, order: str
) -> AllowedDesign:
    """Replace the runs of a design that constraints forbid with allowed ones.

    Parameters
    ----------
    coded : numpy.ndarray, (n, factors)
        The runs of the design, in coded units.
    region : Region or None
        The allowed part of the cube; None if all of it is allowed.
    order : str
        Order of the model, one of `repose.calibrate.designs.model.ORDERS`.

    Returns
    -------
    AllowedDesign
        As many runs as `coded`, and which of them are new. The allowed runs keep their
        rows.

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

    # Put new runs into the rows of the forbidden ones.
    terms = list_terms(coded.shape[1], order)
    n_new = int(is_new.sum())
    runs = coded.copy()
    runs[is_new] = choose_added_runs(coded[~is_new], n_new, region, terms)

    # A narrow region may not have enough different runs for the model.
    rank = int(np.linalg.matrix_rank(_make_model_rows(runs, terms)))
    if rank < len(terms) + 1:
        raise ValueError(
            f"{len(runs)} allowed runs determine {rank} coefficients; expected all "
            f"{len(terms) + 1}"
        )
    return AllowedDesign(runs, is_new)


def choose_added_runs(
    fixed_runs: np.ndarray, count: int, region: Region, terms: Sequence[Term]
) -> np.ndarray:
    """Choose D-optimal runs to add to a design.

    They maximise the determinant of X'X, where the matrix X of the model has a row for
    each fixed and each new run. The search starts from several sets of points of the
    region, and the best result is returned.

    Parameters
    ----------
    fixed_runs : numpy.ndarray, (n, factors)
        The runs of the design that stay as they are.
    count : int
        Number of runs to add.
    region : Region
        The part of the cube where runs are allowed.
    terms : sequence of tuple
        Terms of the model besides the constant.

    Returns
    -------
    numpy.ndarray, (count, factors)
        The new runs in coded units.
    """
    # Any finite determinant is better than the first one here, so the first search
    # replaces the empty array. The logarithm of the determinant rises with it.
    best_runs = np.empty((0, fixed_runs.shape[1]))
    best_log_determinant = -np.inf
    for start in range(N_STARTS):
        # Start from the next `count` of the points that are spread over the region.
        rows = (start * count + np.arange(count)) % len(region.points)
        runs = _exchange_coordinates(region.points[rows], fixed_runs, region, terms)
        log_determinant = compute_log_determinant(np.vstack([fixed_runs, runs]), terms)
        if log_determinant > best_log_determinant + MIN_GAIN:
            best_log_determinant = log_determinant
            best_runs = runs
    return best_runs


def _exchange_coordinates(
    start_runs: np.ndarray,
    fixed_runs: np.ndarray,
    region: Region,
    terms: Sequence[Term],
) -> np.ndarray:
    """Change coordinates of the new runs until no change raises the determinant.

    An exchange moves one factor of a run to another of the `LEVELS`.

    Parameters
    ----------
    start_runs : numpy.ndarray, (count, factors)
        The new runs with which the search begins. They must be allowed.
    fixed_runs, region, terms
        See `choose_added_runs`.

    Returns
    -------
    numpy.ndarray, (count, factors)
        The improved new runs.
    """
    runs = start_runs.copy()
    for _ in range(MAX_ROUNDS):
        is_changed = False
        for row in range(len(runs)):
            other_runs = np.vstack([fixed_runs, np.delete(runs, row, axis=0)])
            # Let M be the matrix X'X of the other runs. A run whose row in X is f
            # multiplies the determinant of M by 1 + f' M^-1 f. So the inverse of M
            # stays the same while only this run changes.
            inverse = np.linalg.inv(_compute_information(other_runs, terms))
            for factor in range(runs.shape[1]):
                # The first candidate is the unchanged run. It is allowed, so it stays
                # the first one below, where forbidden candidates are dropped.
                candidates = np.repeat(runs[row][None], len(LEVELS) + 1, axis=0)
                candidates[1:, factor] = LEVELS
                candidates = candidates[region.is_allowed(candidates)]
                model_rows = _make_model_rows(candidates, terms)
                # Rise of the log determinant by each candidate, log(1 + f' M^-1 f).
                gains = np.log1p((model_rows @ inverse * model_rows).sum(axis=1))
                best = gains.argmax()
                if gains[best] > gains[0] + MIN_GAIN:
                    runs[row] = candidates[best]
                    is_changed = True
        if not is_changed:
            break
    return runs


def compute_log_determinant(coded: np.ndarray, terms: Sequence[Term]) -> float:
    """Compute the logarithm of the determinant of X'X of runs (n, factors)."""
    return float(np.linalg.slogdet(_compute_information(coded, terms)).logabsdet)


def _compute_information(coded: np.ndarray, terms: Sequence[Term]) -> np.ndarray:
    """Compute X'X (p, p) of runs (n, factors), with the ridge."""
    X = _make_model_rows(coded, terms)
    return X.T @ X + RIDGE * np.eye(X.shape[1])


def _make_model_rows(coded: np.ndarray, terms: Sequence[Term]) -> np.ndarray:
    """Compute the rows (n, p) of the model at points: the constant and the terms."""
    return np.hstack([np.ones((len(coded), 1)), compute_terms(coded, terms)])
