"""The likelihood of physical measurements, with the errors of measurement, model and surrogate.

The physical means of the k targets, y (k,), are taken as normal about the surrogate's prediction f(theta):

    y ~ N(f(theta), S_y + S_d + S_w(theta))

    S_y
        Of the physical means: sd / sqrt(repetitions) of each response. Responses of one bench test are correlated,
        as simulated runs of one sample are unless something else is known; responses of different bench tests are
        independent. S_y holds the scatter from run to run, so the surrogate's noise term is left out.
    S_d
        Discrepancy, which no parameters of the model remove: `repose.calibrate.uncertainty.discrepancy` (Kennedy & O'Hagan
        2001, J. R. Stat. Soc. B 63, 425, with a constant in place of a process).
    S_w
        Of the surrogate's prediction of the mean.

S_w varies over the parameters, so the density keeps its determinant.
"""

import math

import numpy as np
from scipy import stats

from repose.calibrate.targets import Targets

Observed = tuple[np.ndarray, np.ndarray]  # of `observation`


def observation(
    targets: Targets, correlation: np.ndarray, discrepancy: np.ndarray
) -> Observed:
    """Return the physical means (k,) and the part S_y + S_d (k, k) of their covariance that no parameter changes."""
    correlation = np.asarray(correlation, dtype=float)
    if np.linalg.eigvalsh(correlation)[0] <= 0:
        raise ValueError(
            f"correlation is {correlation.tolist()}; expected a positive definite matrix"
        )
    error = targets.standard_error
    return targets.value, np.outer(error, error) * correlation + discrepancy


def log_likelihood(
    responses: np.ndarray, covariances: np.ndarray, observed: Observed
) -> np.ndarray:
    """Compute the log (n,) of the normal density N(mean; responses, covariance + covariances) of `observed`."""
    mean, covariance = observed
    total = covariance + covariances
    off = mean - responses
    distance = _squared_distance(off, total)
    _, log_det = np.linalg.slogdet(total)
    return -0.5 * (distance + log_det + off.shape[1] * math.log(2 * math.pi))


def misfit(
    responses: np.ndarray, covariances: np.ndarray, observed: Observed
) -> dict[str, float]:
    """Measure how far the best draw is from the measurements; arguments as for `log_likelihood`."""
    mean, covariance = observed
    off = mean - responses
    best = float(_squared_distance(off, covariance + covariances).min())
    return {
        "squared_distance": best,
        "p_value": float(stats.chi2.sf(best, off.shape[1])),
    }


def _squared_distance(off: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Square the distances (n,) of deviations (n, k), in standard deviations of their covariances (n, k, k)."""
    return np.einsum("ni,ni->n", off, np.linalg.solve(total, off[:, :, None])[:, :, 0])
