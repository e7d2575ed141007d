"""The mean of several networks: its moments, and which networks take part."""

import numpy as np
import pytest
from known_responses import noisy_data

from repose.surrogate import network_ensemble
from repose.surrogate.bayesian_bp import BayesianBP
from repose.surrogate.levenberg_marquardt import CONVERGED
from repose.surrogate.network_ensemble import NetworkEnsemble
from repose.surrogate.settings import NetworkSettings

SETTINGS = NetworkSettings.of({"hidden": 3, "starts": 5, "epochs": 200, "goal": 0.0, "seed": 1, "prior": "inputs"})
COVARIANCE = np.array([[0.25, 0.3], [0.3, 1.0]])


@pytest.fixture(scope="module")
def fitted():
    X, Y = noisy_data(40, 3)
    noise = {"precision": np.full(40, 2.0), "noise_covariance": COVARIANCE, "noise_freedom": 40.0}
    model = NetworkEnsemble.of(SETTINGS).fit(X, Y, **noise)
    return model, BayesianBP.of(SETTINGS).fit(X, Y, **noise), X, Y


def test_mean_and_covariance_are_those_of_the_mixture_written_as_loops(fitted):
    """E[y y'] of the mixture is the mean of C + m m' over the networks."""
    model, best, _, _ = fitted
    fresh = np.random.RandomState(2).uniform(-1, 1, (6, 6))
    networks = [best.of_start(k) for k in model.near_]
    assert len(networks) == len(model.members_) > 1
    mean, covariance = model.predict(fresh), model.covariance(fresh)
    for i in range(len(fresh)):
        first, second = np.zeros(2), np.zeros((2, 2))
        for one in networks:
            m = one.predict(fresh[i : i + 1])[0]
            first += m / len(networks)
            second += (one.covariance(fresh[i : i + 1])[0] + np.outer(m, m)) / len(networks)
        assert mean[i] == pytest.approx(first)
        assert covariance[i] == pytest.approx(second - np.outer(first, first), rel=1e-5)
    own = np.mean([np.diagonal(network.covariance(fresh), axis1=1, axis2=2) for network in networks], axis=0)
    std = model.predict(fresh, return_std=True, noise=False)[1]
    assert (std**2 > own).all()


def test_converged_starts_of_like_evidence_take_part_the_best_first(fitted, monkeypatch):
    model, best, X, Y = fitted
    assert model.members_[0].best_start_ == best.best_start_
    monkeypatch.setattr(network_ensemble, "NATS", 3.0)
    few = NetworkEnsemble.of(SETTINGS).fit(X, Y)
    starts = few.members_[0].starts_
    largest = max(start["log_evidence"] for start in starts if start["decrement"] < CONVERGED)
    near = [start["log_evidence"] > largest - 3 and start["decrement"] < CONVERGED for start in starts]
    assert [row["member"] for row in few.start_rows()] == near
    assert few.report()["members"] == sum(near)


def test_one_network_is_that_network(fitted):
    _, _, X, Y = fitted
    settings = SETTINGS.model_copy(update={"starts": 1})
    one, alone = NetworkEnsemble.of(settings).fit(X, Y), BayesianBP.of(settings).fit(X, Y)
    assert one.predict(X) == pytest.approx(alone.predict(X), rel=1e-12)
    assert one.covariance(X) == pytest.approx(alone.covariance(X))
    assert one.predict(X, return_std=True)[1] == pytest.approx(alone.predict(X, return_std=True)[1])
