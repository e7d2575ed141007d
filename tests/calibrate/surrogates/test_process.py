"""Gaussian processes, ensembles of networks, and the support of the samples."""

import numpy as np
import pandas as pd
import pytest
from known_responses import noisy_data
from refusals import input_error, value_error
from shared import says

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.surrogates import network_ensemble
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.levenberg_marquardt import CONVERGED
from repose.calibrate.surrogates.network_ensemble import NetworkEnsemble
from repose.calibrate.surrogates.process import (
    Process,
    SampleNoise,
    make_linear_kernel,
    make_smooth_kernel,
)
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.support import Support, compute_quadratic_terms

KERNEL = make_smooth_kernel(2.0, [0.4, 0.9])
NAMES = ("a", "b")
SETTINGS = NetworkSettings.from_keys(
    {"hidden": 3, "starts": 5, "epochs": 200, "goal": 0.0, "seed": 1, "prior": "inputs"}
)
COVARIANCE = np.array([[0.25, 0.3], [0.3, 1.0]])


def covariance(a, b):
    """2 exp(-r^2 / 2), r in lengths."""
    return 2 * np.exp(-0.5 * (((a[:, None] - b) / [0.4, 0.9]) ** 2).sum(axis=2))


@pytest.fixture(params=["errors", "noise of the kernel"])
def noise_of(request):
    """Noise of variance 0.3 over the precision of a value, in either form."""
    if request.param == "errors":
        return lambda precision: {"noise_variances": 0.3 / precision}
    return lambda precision: {"noise": SampleNoise(0.3, "fixed", precision)}


def test_moments_are_those_of_the_conditional_distribution(noise_of):
    random = np.random.default_rng(1)
    x = random.random((9, 2))
    new = random.random((5, 2))
    precision = random.uniform(1, 4, 9)
    values = random.normal(size=9)
    process = Process(KERNEL, x, values, **noise_of(precision))
    gain = covariance(new, x) @ np.linalg.inv(
        covariance(x, x) + np.diag(0.3 / precision)
    )
    mean, variance = process.moments(new)
    assert mean == pytest.approx(gain @ values)
    assert process.mean(new) == pytest.approx(mean)
    assert variance == pytest.approx(2 - (gain * covariance(new, x)).sum(axis=1))
    random = np.random.default_rng(2)
    x = random.random((9, 2))
    precision = random.uniform(1, 4, 9)
    values = random.normal(size=9)
    means, variances = Process(
        KERNEL, x, values, **noise_of(precision)
    ).predict_left_out()
    for i in range(9):
        rest = np.arange(9) != i
        mean, variance = Process(
            KERNEL, x[rest], values[rest], **noise_of(precision[rest])
        ).moments(x[i : i + 1])
        assert means[i] == pytest.approx(mean[0], rel=1e-6)
        assert variances[i] == pytest.approx(variance[0], rel=1e-6)


def test_a_process_of_known_hyperparameters_has_the_bits_of_scikit_learns():
    random = np.random.default_rng(3)
    for n in (2, 7, 40):
        x = random.random((n, 2))
        values = random.normal(size=n)
        errors = random.uniform(0.01, 0.1, n)
        # The bounds of this kernel leave scikit-learn nothing to estimate.
        slow = Process(KERNEL, x, values, errors)
        process = Process(KERNEL, x, values, errors, optimizer=None)
        np.testing.assert_array_equal(process.cholesky, slow.cholesky)
        np.testing.assert_array_equal(process.weights, slow.weights)
        assert process.log_likelihood == slow.log_likelihood
        assert (process.noise_level, slow.noise_level) == (0.0, 0.0)


def test_a_covariance_is_that_of_the_textbook():
    """Matérn's covariance of smoothness 5/2 is s^2 (1 + r + r^2 / 3) exp(-r), r: sqrt(5) times the scaled distance."""
    random = np.random.default_rng(3)
    a = random.random((4, 2))
    b = random.random((5, 2))
    r = np.sqrt(5 * (((a[:, None] - b) / [0.4, 0.9]) ** 2).sum(axis=2))
    assert KERNEL(a, b) == pytest.approx(covariance(a, b))
    expected = 2 * (1 + r + r**2 / 3) * np.exp(-r)
    assert make_smooth_kernel(2.0, [0.4, 0.9], smoothness=2.5)(a, b) == pytest.approx(
        expected
    )
    assert make_linear_kernel(3.0)(a, b) == pytest.approx(1 + 9 * a @ b.T)


def test_an_ensemble_of_one_network_is_that_network(fitted):
    _, _, X, Y = fitted
    settings = SETTINGS.model_copy(update={"starts": 1})
    ensemble = NetworkEnsemble.of(settings).fit(X, Y)
    alone = BayesianBP.of(settings).fit(X, Y)
    assert ensemble.predict(X) == pytest.approx(alone.predict(X), rel=1e-12)
    assert ensemble.covariance(X) == pytest.approx(alone.covariance(X))
    expected = alone.predict(X, return_std=True)[1]
    assert ensemble.predict(X, return_std=True)[1] == pytest.approx(expected)


@pytest.fixture(scope="module")
def fitted():
    X, Y = noisy_data(40, 3)
    noise = {
        "precision": np.full(40, 2.0),
        "noise_covariance": COVARIANCE,
        "noise_freedom": 40.0,
    }
    return (
        NetworkEnsemble.of(SETTINGS).fit(X, Y, **noise),
        BayesianBP.of(SETTINGS).fit(X, Y, **noise),
        X,
        Y,
    )


def test_the_mixture_is_that_of_loops_over_converged_starts(fitted):
    """Mean E[m] and covariance E[C + m m'] - E[m] E[m]' over the networks, each with the same weight."""
    model, best, _, _ = fitted
    fresh = np.random.RandomState(2).uniform(-1, 1, (6, 6))
    networks = [best.get_network_of_start(k) for k in model.member_starts_]
    assert len(networks) == len(model.members_) > 1
    mean = model.predict(fresh)
    covariance = model.covariance(fresh)
    for i in range(len(fresh)):
        first = np.zeros(2)
        second = np.zeros((2, 2))
        for member in networks:
            m = member.predict(fresh[i : i + 1])[0]
            first += m / len(networks)
            C = member.covariance(fresh[i : i + 1])[0]
            second += (C + np.outer(m, m)) / len(networks)
        assert mean[i] == pytest.approx(first)
        assert covariance[i] == pytest.approx(second - np.outer(first, first), rel=1e-5)
    # the networks differ, so the mixture varies more than one of them does on average
    within = np.mean(
        [
            np.diagonal(network.covariance(fresh), axis1=1, axis2=2)
            for network in networks
        ],
        axis=0,
    )
    _, error = model.predict(fresh, return_std=True, noise=False)
    assert (error**2 > within).all()


def test_members_are_the_converged_starts_near_the_largest_evidence(
    fitted, monkeypatch
):
    model, best, X, Y = fitted
    assert model.members_[0].best_start_ == best.best_start_
    monkeypatch.setattr(network_ensemble, "MAX_EVIDENCE_GAP", 3.0)
    few = NetworkEnsemble.of(SETTINGS).fit(X, Y)
    starts = few.members_[0].starts_
    largest = max(
        start["log_evidence"] for start in starts if start["decrement"] < CONVERGED
    )
    near = [
        start["log_evidence"] > largest - 3 and start["decrement"] < CONVERGED
        for start in starts
    ]
    assert [row["member"] for row in few.start_rows()] == near
    assert few.report()["members"] == sum(near)


def grid():
    """A grid of 6 x 6 samples, 0.1 apart, from 0.2 to 0.7."""
    side = np.linspace(0.2, 0.7, 6)
    return np.array([(x, y) for x in side for y in side])


def test_distances_tell_what_few_samples_do_not_bear():
    support = Support(grid(), [0, 0], [1, 1], NAMES)
    assert support.usual_distance == pytest.approx(0.1)
    assert support.distance([[0.2, 0.25], [0.7, 0.85]]) == pytest.approx([0.05, 0.15])
    assert support.is_sparse([[0.45, 0.45], [0.7, 0.85]]).tolist() == [False, True]
    inside, bound, near, distant = support.make_warnings(
        [[0.45, 0.5], [0.005, 0.995], [0.012, 0.5], [0.45, 0.9]]
    )
    assert inside == ""
    assert bound.startswith("at a bound: a low, b high; nearest sample")
    assert "bound" not in near
    says(
        distant, "nearest sample 0.21 of a range away, usually at most 0.10", "leverage"
    )
    support = Support(grid() * [1, 10], [0, 0], [1, 10], NAMES)
    assert support.distance([[0.2, 2.5]]) == pytest.approx([0.05])


def test_leverage_is_that_of_the_hat_matrix():
    points = np.random.default_rng(1).uniform(size=(40, 2))
    support = Support(points, [0, 0], [1, 1], NAMES)
    X = np.column_stack([np.ones(40), points, points**2, points[:, 0] * points[:, 1]])
    hat = np.diag(X @ np.linalg.inv(X.T @ X) @ X.T)
    assert support.leverage(points) == pytest.approx(hat)
    assert hat.sum() == pytest.approx(6)
    assert support.largest_leverage == pytest.approx(hat.max())
    assert support.is_sparse([[1.6, 1.6]]).all()
    points = np.random.default_rng(1).uniform(size=(20, 6))
    support = Support(points, np.zeros(6), np.ones(6), "abcdef")
    assert compute_quadratic_terms(points).shape == (20, 28)
    assert support.leverage(points).tolist() == [0.0] * 20


def test_support_of_a_dataset_takes_usable_samples(tmp_path):
    table = pd.DataFrame(
        np.random.default_rng(1).uniform(size=(40, 6)), columns=list(PARAMETERS)
    )
    table["sample"] = np.arange(40)
    table["status"] = "ok"
    table.loc[0, "status"] = "jammed"
    table.to_csv(tmp_path / "dataset.csv", index=False)
    space = contact_space(dict.fromkeys(PARAMETERS, (0.0, 1.0)))
    support = Support.from_dataset(tmp_path / "dataset.csv", space)
    first = table.loc[[0, 1], list(PARAMETERS)].to_numpy()
    assert support.distance(first)[0] > 0
    assert support.distance(first)[1] == 0
    cohesive = contact_space(dict.fromkeys([*PARAMETERS, "gamma_gg"], (0.0, 1.0)))
    input_error(
        "column gamma_gg is 'missing'",
        Support.from_dataset,
        tmp_path / "dataset.csv",
        cohesive,
    )
    table["status"] = "jammed"
    table.to_csv(tmp_path / "dataset.csv", index=False)
    input_error(
        "usable samples is 0", Support.from_dataset, tmp_path / "dataset.csv", space
    )
    few = r"points has shape \(3, 2\); expected at least 2 rows of 6 numbers"
    value_error(few, Support, np.zeros((3, 2)), np.zeros(6), np.ones(6), PARAMETERS)


def test_support_leaves_out_fixed_parameters():
    fixed = Support(
        np.insert(grid(), 1, 0.3, axis=1), [0, 0.3, 0], [1, 0.3, 1], ("a", "fixed", "b")
    )
    free = Support(grid(), [0, 0], [1, 1], NAMES)
    points = np.array([[0.45, 0.5], [0.005, 0.995], [0.45, 0.9]])
    assert fixed.make_warnings(np.insert(points, 1, 0.3, axis=1)) == free.make_warnings(
        points
    )
    expected = [False] * 3
    assert fixed.at_bounds(np.insert(points, 1, 0.3, axis=1))[:, 1].tolist() == expected
    assert fixed.largest_leverage == free.largest_leverage
