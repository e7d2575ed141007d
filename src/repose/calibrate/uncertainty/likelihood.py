"""The likelihood of physical measurements.

It includes the errors of the measurement, of the simulator and of the surrogate. The
physical means y (k,) of the k targets are assumed to be normally distributed about the
surrogate's prediction f(theta):

    y ~ N(f(theta), S_y + S_d + S_w(theta))

    S_y
        Covariance of the physical means. The standard deviation of a mean is
        sd / sqrt(repetitions). Unless their correlation is known, responses of one
        bench test are correlated like the simulated runs of a sample. Responses of
        different bench tests are independent. S_y already includes the scatter from run
        to run, so the noise term of the surrogate is left out.
    S_d
        Covariance of the discrepancies, which no choice of the parameters can remove
        (`repose.calibrate.uncertainty.discrepancy`). They are those of Kennedy &
        O'Hagan 2001, J. R. Stat. Soc. B 63, 425, with a constant in place of a process.
    S_w
        Covariance of the surrogate's prediction of the mean.

S_w depends on the parameters, so the log likelihood must include the determinant of the
covariance.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy import stats

from repose.calibrate.targets import Targets


class Observation(NamedTuple):
    """The physical means, and the constant part of their covariance."""

    mean: np.ndarray  # y (k,)
    covariance: np.ndarray  # S_y + S_d (k, k)


def make_observation(
    targets: Targets, correlation: np.ndarray, discrepancy: np.ndarray
) -> Observation:
    """Combine the physical means of the targets with their uncertainty.

    Parameters
    ----------
    targets : Targets
        The targets of the study.
    correlation : array (k, k)
        Correlations of the measured responses.
    discrepancy : array (k, k)
        Covariance S_d of the discrepancies.

    Raises
    ------
    ValueError
        If the correlation is not positive definite.
    """
    correlation = np.asarray(correlation, dtype=float)
    if np.linalg.eigvalsh(correlation)[0] <= 0:
        raise ValueError(
            f"correlation is {correlation.tolist()}; "
            "expected a positive definite matrix"
        )
    error = targets.standard_error
    return Observation(
        targets.value, np.outer(error, error) * correlation + discrepancy
    )


def compute_log_likelihood(
    responses: np.ndarray, covariances: np.ndarray, observed: Observation
) -> np.ndarray:
    """Compute the log likelihood of the physical means, the means of the measurements.

    It is the log density of a normal distribution of k responses (see the module).

    Parameters
    ----------
    responses : array (n, k)
        Predicted means f(theta) of n parameter sets.
    covariances : array (n, k, k)
        Covariances of these predictions.
    observed : Observation
        The physical means, with the covariance of measurement and discrepancy.

    Returns
    -------
    array (n,)
        The log likelihood of each parameter set.
    """
    mean, covariance = observed
    total_covariances = covariance + covariances
    deviations = mean - responses
    squared_distances = _compute_squared_distances(deviations, total_covariances)
    _, log_det = np.linalg.slogdet(total_covariances)
    k = deviations.shape[1]
    return -0.5 * (squared_distances + log_det + k * math.log(2 * math.pi))


def compute_misfit(
    responses: np.ndarray, covariances: np.ndarray, observed: Observation
) -> dict[str, float]:
    """Compute the distance of the best parameter set from the measurements.

    The arguments are those of `compute_log_likelihood`. The result has the smallest
    `squared_distance`, in squared standard deviations, and its `p_value` by the chi^2
    distribution with k degrees of freedom.
    """
    mean, covariance = observed
    deviations = mean - responses
    squared_distances = _compute_squared_distances(deviations, covariance + covariances)
    smallest = float(squared_distances.min())
    return {
        "squared_distance": smallest,
        "p_value": float(stats.chi2.sf(smallest, deviations.shape[1])),
    }


def _compute_squared_distances(
    deviations: np.ndarray, covariances: np.ndarray
) -> np.ndarray:
    """Compute squared lengths (n,) of deviations (n, k), in squared standard deviations.

    The covariances have the shape (n, k, k).
    """
    scaled = np.linalg.solve(covariances, deviations[:, :, None])[:, :, 0]
    return np.einsum("ni,ni->n", deviations, scaled)
