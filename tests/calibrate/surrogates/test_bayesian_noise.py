"""The network's error bars, and noise that its outputs share, against closed forms and brute force."""

import numpy as np
import pytest
from known_responses import known_function, noisy_data
from refusals import value_error

from repose.calibrate.surrogates import bayesian_bp, levenberg_marquardt, two_layer
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.levenberg_marquardt import train_start

CORRELATED = np.array([[0.25, 0.475], [0.475, 1.0]])  # correlation 0.95


def linear_features(x):
    """Nine fixed functions of two inputs: a model linear in as many weights as a 2-2-1 network has."""
    return np.sin(4 * x @ np.random.RandomState(20).normal(size=(2, 9)) + np.arange(9))


def linear_jacobian(w, x, outputs):
    """As `two_layer.compute_jacobian`."""
    p = linear_features(x)
    return p @ w[..., None], np.tile(p[:, None, :], (*w.shape[:-1], 1, 1, 1))


@pytest.fixture
def linear(monkeypatch):
    for module in (levenberg_marquardt, bayesian_bp):
        monkeypatch.setattr(module, "compute_jacobian", linear_jacobian)

    def residuals(w, x, t, root):
        return (linear_features(x) @ w - t[:, 0]) * root[:, 0]

    monkeypatch.setattr(levenberg_marquardt, "compute_residuals", residuals)
    random = np.random.RandomState(21)
    X = np.concatenate([[[0, 0], [1, 1]], random.uniform(0, 1, (50, 2))])
    y = linear_features(X) @ random.normal(size=9) + 0.3 * random.normal(size=52)
    y = (y - y.min()) / np.ptp(y)
    return BayesianBP(hidden=2, starts=1, goal=0.0, scaled_range=(0, 1)).fit(X, y), X, y


def test_on_a_linear_model_gamma_is_its_closed_form_and_all_else_that_of_bayesian_ridge(
    linear,
):
    from sklearn.linear_model import BayesianRidge

    model, X, y = linear
    eigenvalues = np.linalg.eigvalsh(
        2 * model.beta_ * linear_features(X).T @ linear_features(X)
    )
    exact = np.sum(eigenvalues / (eigenvalues + 2 * model.alpha_))
    assert 3 < exact < 8.99
    assert model.gamma_ == pytest.approx(exact, rel=1e-6)
    flat = dict.fromkeys(("alpha_1", "alpha_2", "lambda_1", "lambda_2"), 0.0)
    ridge = BayesianRidge(max_iter=5000, tol=1e-12, fit_intercept=False, **flat).fit(
        linear_features(X), y
    )
    assert 2 * model.beta_ == pytest.approx(ridge.alpha_, rel=1e-5)
    assert 2 * model.alpha_ == pytest.approx(ridge.lambda_, rel=1e-5)
    np.testing.assert_allclose(
        model.posterior_root_ @ model.posterior_root_.T, ridge.sigma_, rtol=1e-4
    )
    fresh = np.random.RandomState(22).uniform(0, 2, (40, 2))
    std = model.predict(fresh, return_std=True)[1]
    expected = ridge.predict(linear_features(fresh), return_std=True)[1]
    np.testing.assert_allclose(std, expected, rtol=1e-4)


@pytest.mark.parametrize("noise_covariance", [None, CORRELATED])
def test_error_bars_of_the_mean_are_those_of_networks_drawn_from_the_posterior(
    noise_covariance,
):
    """Brute force: weights from the Laplace approximation, each sent through the whole network.

    Drawn a hundred times closer to the best ones: along directions that the data leave open the network is
    no longer linear over the whole width of the posterior, a limit of the approximation itself.
    """
    X, Y = noisy_data(400, 14, noise=(0.2, 0.4))
    model = BayesianBP(hidden=4, starts=3).fit(X, Y, noise_covariance=noise_covariance)
    fresh = np.random.RandomState(15).uniform(-0.9, 0.9, (30, 6))
    mean, std = model.predict(fresh, return_std=True, noise=False)
    w = np.concatenate([model.W1_.ravel(), model.b1_, model.W2_.ravel(), model.b2_])
    normal = np.random.RandomState(16).normal(size=(4000, w.size))
    stored = model.to_dict()
    drawn = []
    for weights in w + 0.01 * normal @ model.posterior_root_.T:
        stored["W1"], stored["b1"], stored["W2"], stored["b2"] = (
            two_layer.unpack_weights(weights, 6, 4, 2)
        )
        drawn.append(two_layer.evaluate_network(stored, fresh))
    ratio = np.std(drawn, axis=0) / (0.01 * std)
    assert ratio.mean() == pytest.approx(1.0, abs=0.03)
    assert np.abs(ratio - 1).max() < 0.1
    expected = std**2 + model.noise_std_**2
    np.testing.assert_allclose(model.predict(fresh, return_std=True)[1] ** 2, expected)
    assert mean.shape == std.shape == (30, 2)


def test_independent_outputs_change_nothing():
    X, Y = noisy_data(60, 31)
    plain = BayesianBP(hidden=3, starts=2).fit(X, Y)
    equal = BayesianBP(hidden=3, starts=2).fit(
        X, Y, noise_covariance=7 * np.diag(np.ptp(Y, axis=0) ** 2)
    )
    np.testing.assert_allclose(equal.predict(X), plain.predict(X), rtol=1e-6)
    np.testing.assert_allclose(equal.noise_std_, plain.noise_std_, rtol=1e-6)
    assert equal.log_evidence_ == pytest.approx(plain.log_evidence_)


def test_mixed_outputs_are_those_of_a_mixed_last_layer():
    random = np.random.RandomState(32)
    x = random.uniform(size=(9, 3))
    w = random.normal(size=26)
    mixing = random.normal(size=(2, 2))
    mixed = two_layer.mix_outputs(w, mixing, 4)
    expected = two_layer.compute_jacobian(w, x, 2)[0] @ mixing
    np.testing.assert_allclose(two_layer.compute_jacobian(mixed, x, 2)[0], expected)
    columns = two_layer.mix_outputs(np.column_stack([w, 2 * w]), mixing, 4)
    np.testing.assert_allclose(columns, np.column_stack([mixed, 2 * mixed]))


def test_shared_noise_is_learned():
    """The mean gain over ten data sets is above zero by two standard errors."""
    root = np.linalg.cholesky(CORRELATED / 4)
    fresh = np.random.RandomState(40).uniform(-1, 1, (500, 6))
    gain = []
    found = []
    for seed in range(10):
        random = np.random.RandomState(50 + seed)
        X = random.uniform(-1, 1, (95, 6))
        Y = known_function(X) + random.normal(size=(95, 2)) @ root.T
        errors = []
        for covariance in (None, CORRELATED):
            model = BayesianBP(hidden=8, starts=1, goal=0, epochs=100, seed=seed)
            P = model.fit(X, Y, noise_covariance=covariance).predict(fresh)
            errors.append(np.mean(((P - known_function(fresh)) / (1.0, 2.0)) ** 2))
        gain.append(np.log(errors[0] / errors[1]))
        found.append(model.noise_std_)
    assert np.mean(gain) > 2 * np.std(gain, ddof=1) / np.sqrt(len(gain)) > 0
    np.testing.assert_allclose(np.mean(found, axis=0), (0.25, 0.5), rtol=0.2)


def test_means_with_the_scatter_of_replicates_train_as_the_single_runs_do():
    """A sample with n runs counts by sqrt(n); what its runs scatter about their mean enters the noise alone."""
    random = np.random.RandomState(60)
    x = random.uniform(0.1, 0.9, (25, 2))
    w = random.normal(size=17)
    runs = np.arange(25) % 4 + 1
    sample = np.repeat(np.arange(25), runs)
    noise = 0.05 * random.normal(size=(len(sample), 2))
    t = 0.5 + 0.2 * np.sin(4 * x[sample]) + noise
    means = np.array([t[sample == i].mean(axis=0) for i in range(25)])
    settings = levenberg_marquardt.TrainingSettings(
        80, 0.0, 0.005, 0.1, 10.0, 1e10, 1e-7, "inputs"
    )
    single = train_start(w, x[sample], t, np.ones(t.shape), t.size, settings)
    weights = np.sqrt(np.column_stack([runs, runs]))
    # sum of squares within the samples, and its degrees of freedom
    scatter = float(np.sum((t - means[sample]) ** 2)), float(t.size - means.size)
    pooled = train_start(w, x, means, weights, means.size, settings, scatter)
    for key in ("w", "alpha", "beta", "gamma", "log_evidence"):
        np.testing.assert_allclose(pooled[key], single[key], rtol=1e-5)
    assert pooled["epochs"] == single["epochs"]


def test_a_known_noise_is_kept():
    X, Y = noisy_data(20, 61, noise=(0.5, 1.0))
    covariance = np.diag([0.25, 1.0]) + 0.25
    model = BayesianBP(hidden=4, starts=2, goal=0.0, prior="inputs", epochs=200)
    model.fit(X, Y, noise_covariance=covariance, noise_freedom=1e6)
    expected = np.sqrt(np.diagonal(covariance))
    np.testing.assert_allclose(model.noise_std_, expected, rtol=1e-3)
    value_error(
        r"noise_freedom is 3; expected 0 or more, and 0 without noise_cov",
        model.fit,
        X,
        Y,
        noise_freedom=3,
    )


@pytest.mark.parametrize(
    ("covariance", "allowed"),
    [
        (np.eye(3), r"a symmetric matrix of shape \(2, 2\)"),
        ([[1.0, 0.5], [0.4, 1.0]], "a symmetric matrix"),
        ([[1.0, 2.0], [2.0, 1.0]], "positive definite"),
    ],
)
def test_what_is_no_covariance_is_refused(covariance, allowed):
    X, Y = noisy_data(20, 33)
    value_error(
        rf"(?s)noise_covariance is .*expected {allowed}",
        BayesianBP().fit,
        X,
        Y,
        noise_covariance=covariance,
    )
