"""What the simulator cannot do with any parameters: the covariance of its discrepancies, for responses nobody measured.

A share of each response's mean, but no less than a smallest one in the response's unit: two percent of a share of five
percent would be half a berry. Within a bench test the discrepancies are correlated, for one wrong shape or filling
moves all numbers of a pile at once. They have the signs with which the responses vary together over the design: a
steeper pile is higher and narrower.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from repose.core.responses import response


def sizes(
    names: Sequence[str],
    means: np.ndarray,
    percent: Mapping[str, float] | float,
    smallest: Mapping[str, float],
) -> np.ndarray:
    """Standard deviation of the discrepancy of each response.

    Parameters
    ----------
    names : sequence of str, (k,)
        Responses.
    means : numpy.ndarray, (k,)
        Their means.
    percent : float, or mapping of float
        Of each mean; by name, where they differ.
    smallest : mapping of float
        The smallest one by unit, as in ``{"deg": 0.5}``; a unit that is not there has none.

    Returns
    -------
    numpy.ndarray, (k,)
        In the responses' units. A response with 0 percent has none at all.
    """
    found = []
    for name, mean in zip(names, means, strict=True):
        own = percent[name] if isinstance(percent, Mapping) else percent
        least = smallest.get(response(name).unit, 0.0)
        found.append(max(own / 100 * abs(mean), least) if own > 0 else 0.0)
    return np.array(found)


def covariance(names: Sequence[str], sd: np.ndarray, means: np.ndarray, correlation: float) -> np.ndarray:
    """Covariance S_d of the discrepancies.

    Parameters
    ----------
    names : sequence of str, (k,)
        Responses.
    sd : numpy.ndarray, (k,)
        Of `sizes`.
    means : numpy.ndarray, (samples, k)
        Means of the samples, for the signs; NaN where a sample has no run.
    correlation : float
        Of two responses of one bench test, without its sign; from 0 to below 1.

    Returns
    -------
    numpy.ndarray, (k, k)
        Discrepancies of different bench tests are independent.
    """
    found = np.diag(sd**2)
    apparatus = [response(name).apparatus for name in names]
    for test in dict.fromkeys(apparatus):
        rows = np.flatnonzero([one == test for one in apparatus])
        along = _signs(means[:, rows]) * sd[rows]
        own = correlation * np.outer(along, along)
        np.fill_diagonal(own, sd[rows] ** 2)
        found[np.ix_(rows, rows)] = own
    return found


def _signs(means):
    """Signs (k,) of the responses in their first principal component, the first response's +1."""
    there = means[np.isfinite(means).all(axis=1)]
    if there.shape[1] == 1 or len(there) < 2:
        return np.ones(means.shape[1])
    spread = there.std(axis=0)
    scaled = (there - there.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    loading = np.linalg.svd(scaled, full_matrices=False)[2][0]
    signs = np.where(loading < 0, -1.0, 1.0)
    return signs * signs[0]
