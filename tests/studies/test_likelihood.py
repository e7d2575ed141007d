"""The likelihood: its covariances and its density."""

import numpy as np
import pytest
from scipy import stats
from shared import targets_of

from repose.studies import likelihood

# standard errors of the means 1 deg and 2 mm
TARGETS = targets_of(sd_percent=20 / 3, aor_deg=30.0, height_mm=60.0)


def correlated(value):
    return np.array([[1.0, value], [value, 1.0]])


def test_observation_adds_discrepancy_to_the_error_of_the_mean():
    mean, covariance = likelihood.observation(TARGETS, correlated(0.5), np.diag([0.36, 1.44]))
    assert mean.tolist() == [30.0, 60.0]
    # standard errors 1 and 2, discrepancies 0.6 and 1.2
    assert covariance == pytest.approx(np.array([[1 + 0.36, 1.0], [1.0, 4 + 1.44]]))
    with pytest.raises(ValueError, match="expected a positive definite matrix"):
        likelihood.observation(TARGETS, correlated(1.0), np.zeros((2, 2)))


def test_the_correlation_of_measured_responses_is_that_of_simulated_runs_or_stated():
    targets = targets_of(aor_deg=30.0, height_mm=60.0, drum_slip_deg=40.0)
    simulated = np.diag([1.0, 1.0, 1.0]) + 0.5 * np.eye(3)[[1, 0, 2]] * [[1], [1], [0]]
    assert (likelihood.measured_correlation(targets, simulated, "simulated") == simulated).all()
    found = likelihood.measured_correlation(targets, simulated, 0.3)
    assert found.tolist() == [[1, 0.3, 0], [0.3, 1, 0], [0, 0, 1]]


def test_likelihood_is_a_normal_density_with_its_determinant():
    mean, covariance = likelihood.observation(TARGETS, correlated(0.3), np.diag([0.36, 1.44]))
    responses = np.array([[29.0, 62.0], [33.0, 55.0]])
    weights = np.array([[[0.5, 0.1], [0.1, 0.7]], [[2.0, 0.0], [0.0, 3.0]]])
    found = likelihood.log_likelihood(responses, weights, mean, covariance)
    for k in range(2):
        known = stats.multivariate_normal(responses[k], covariance + weights[k]).logpdf(mean)
        assert found[k] == pytest.approx(known)


def test_misfit_is_that_of_the_best_draw():
    mean, covariance = likelihood.observation(TARGETS, np.eye(2), np.zeros((2, 2)))
    found = likelihood.misfit(np.array([[32.0, 60.0], [31.0, 62.0]]), np.zeros((2, 2, 2)), mean, covariance)
    assert found == {"squared_distance": pytest.approx(2), "p_value": pytest.approx(stats.chi2.sf(2, 2))}
