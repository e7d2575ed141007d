import json

import numpy as np
import pytest
from known_responses import known_function, noisy_data
from refusals import input_error, value_error
from shared import run_python

from repose.calibrate.surrogates import (
    bayesian_bp,
    evidence,
    levenberg_marquardt,
    load,
    two_layer,
)
from repose.calibrate.surrogates.accuracy import compute_r2
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.sklearn_estimator import BayesianBPRegressor


@pytest.fixture(scope="module")
def fitted():
    X, Y = noisy_data(95, 0)
    return BayesianBP(starts=2).fit(X, Y), X, Y


def score(model, X, Y):
    pairs = zip(
        Y.reshape(len(X), -1).T, model.predict(X).reshape(len(X), -1).T, strict=True
    )
    return np.mean([compute_r2(y, predicted) for y, predicted in pairs])


def test_a_jacobian_is_that_of_central_differences():
    random = np.random.RandomState(1)
    x = random.uniform(0.1, 0.9, (7, 3))
    w = random.normal(size=4 * 3 + 4 + 2 * 4 + 2)
    _, J = two_layer.compute_jacobian(w, x, 2)
    step = 1e-6
    for k in range(w.size):
        shift = np.zeros(w.size)
        shift[k] = step
        above, _ = two_layer.compute_jacobian(w + shift, x, 2)
        below, _ = two_layer.compute_jacobian(w - shift, x, 2)
        np.testing.assert_allclose(J[:, :, k], (above - below) / (2 * step), atol=1e-8)


def test_a_forward_pass_is_that_of_loops(fitted):
    """Inputs and outputs are scaled to 0.1 to 0.9; the hidden layer has tansig, the last none."""
    model, X, _ = fitted
    slow = np.zeros(2)
    x = 0.1 + 0.8 * (X[5] - model.input_min_) / (model.input_max_ - model.input_min_)
    for k in range(2):
        total = model.b2_[k]
        for j in range(12):
            z = sum(model.W1_[j, i] * x[i] for i in range(6)) + model.b1_[j]
            tansig = 2 / (1 + np.exp(-2 * z)) - 1
            total += model.W2_[k, j] * tansig
        width = model.output_max_[k] - model.output_min_[k]
        slow[k] = model.output_min_[k] + (total - 0.1) / 0.8 * width
    np.testing.assert_allclose(model.predict(X[5:6])[0], slow, rtol=1e-12)


def test_hyperparameters_are_at_their_fixed_point_on_known_functions(fitted):
    model, X, Y = fitted
    fresh = np.random.RandomState(9).uniform(-1, 1, (300, 6))
    assert score(model, fresh, known_function(fresh)) > 0.97
    assert score(model, X, Y) < 0.99  # it has not learnt the noise
    assert 15 < model.gamma_ < 60
    assert model.stop_reason_ in ("mu", "gradient")
    random = np.random.RandomState(4)
    J = random.normal(size=(8, 3))
    t = random.normal(size=8)
    alpha = 0.7
    beta = 2.0
    w = np.linalg.solve(beta * J.T @ J + alpha * np.eye(3), beta * J.T @ t)
    e = J @ w - t
    C = np.eye(8) / (2 * beta) + J @ J.T / (2 * alpha)
    exact = -0.5 * t @ np.linalg.solve(C, t) - 0.5 * np.linalg.slogdet(2 * np.pi * C)[1]
    assert evidence.compute_log_evidence(
        alpha, beta, e @ e, w @ w, J.T @ J, 8
    ) == pytest.approx(exact, rel=1e-12)
    assert evidence.compute_log_evidence(0.0, 1.0, 1.0, 1.0, np.eye(2), 3) == -np.inf
    assert evidence.compute_log_evidence(1.0, np.nan, 1.0, 1.0, np.eye(2), 3) == -np.inf
    w = np.concatenate([model.W1_.ravel(), model.b1_, model.W2_.ravel(), model.b2_])
    x = 0.1 + 0.8 * (X - model.input_min_) / (model.input_max_ - model.input_min_)
    t = 0.1 + 0.8 * (Y - model.output_min_) / (model.output_max_ - model.output_min_)
    y, J = two_layer.compute_jacobian(w, x, 2)
    J = J.reshape(-1, w.size)
    Ed = np.sum((y - t) ** 2)
    Ew = w @ w
    eigenvalues = np.linalg.eigvalsh(2 * model.beta_ * J.T @ J)
    assert model.alpha_ == pytest.approx(model.gamma_ / (2 * Ew), rel=1e-9)
    assert model.beta_ == pytest.approx((190 - model.gamma_) / (2 * Ed), rel=1e-9)
    expected = np.sum(eigenvalues / (eigenvalues + 2 * model.alpha_))
    assert model.gamma_ == pytest.approx(expected, rel=1e-3)
    gradient = 2 * model.beta_ * J.T @ (y - t).ravel() + 2 * model.alpha_ * w
    assert np.linalg.norm(gradient) < 1e-3


def test_the_root_of_a_posterior_covariance_is_that_of_the_inverse_hessian():
    J = np.random.RandomState(5).normal(size=(8, 3))
    alpha = np.array([0.3, 0.7, 5.0])
    beta = 2.0
    root = evidence.compute_posterior_root(alpha, beta, J.T @ J)
    hessian = 2 * beta * J.T @ J + 2 * np.diag(alpha)
    np.testing.assert_allclose(root @ root.T, np.linalg.inv(hessian), rtol=1e-12)


def test_first_weights_are_those_of_nguyen_and_widrow():
    """Rows of W1 have the length 0.7 H^(1 / d), over half the interval of 0.8, for H = 12 neurons and d = 6 inputs."""
    W1, b1, W2, b2 = two_layer.unpack_weights(
        two_layer.draw_first_weights(6, 12, 2, (0.1, 0.9), 3), 6, 12, 2
    )
    length = 0.7 * 12 ** (1 / 6)
    np.testing.assert_allclose(np.linalg.norm(W1, axis=1) * 0.4, length)
    assert (np.abs(W1 @ np.full(6, 0.5) + b1) <= length).all()  # at the inputs' middle
    assert (np.abs(W2) <= 0.5).all()
    assert b2.shape == (2,)


def test_the_best_of_several_starts_is_kept(monkeypatch):
    nguyen_widrow = two_layer.draw_first_weights

    def dead(inputs, hidden, outputs, interval, seed):
        """First weights of which only start 1 can learn anything."""
        w = nguyen_widrow(inputs, hidden, outputs, interval, seed)
        if seed[1] != 1:
            w[:-outputs] = 0.0
        return w

    monkeypatch.setattr(bayesian_bp, "draw_first_weights", dead)
    X, Y = noisy_data(95, 2, noise=(0.2, 0.4))
    model = BayesianBP(starts=3).fit(X, Y)
    assert model.best_start_ == 1
    others = min(model.starts_[0]["mse"], model.starts_[2]["mse"])
    assert model.starts_[1]["mse"] < 0.1 * others


def test_a_start_keeps_its_largest_evidence_and_is_at_the_minimum_there(monkeypatch):
    """The re-estimation of several alpha passes it: without patience the start ends far below."""
    random = np.random.RandomState(3)
    X = random.uniform(-1, 1, (60, 3))
    y = X @ [1, 0.5, 0.2] + 0.2 * random.normal(size=60)
    settings = {"hidden": 4, "starts": 1, "epochs": 300, "goal": 0.0, "prior": "inputs"}
    kept = BayesianBP(**settings).fit(X, y)
    assert kept.stop_reason_ == "evidence"
    assert kept.epochs_ > levenberg_marquardt.PATIENCE
    assert kept.starts_[0]["decrement"] < levenberg_marquardt.CONVERGED
    monkeypatch.setattr(
        levenberg_marquardt, "NEAR_MINIMUM", -1.0
    )  # no state is ever kept
    assert kept.log_evidence_ > BayesianBP(**settings).fit(X, y).log_evidence_ + 3


def test_starts_that_have_not_converged_do_not_compete(monkeypatch):
    honest = bayesian_bp.train_start
    X, Y = noisy_data(40, 2)
    settings = {"hidden": 3, "starts": 3, "epochs": 100, "goal": 0.0}
    best = BayesianBP(**settings).fit(X, Y).best_start_
    calls = []

    def far_from_the_minimum(**arguments):
        calls.append(1)
        return honest(**arguments) | {
            "decrement": 1.0 if unconverged(len(calls) - 1) else 0.0
        }

    monkeypatch.setattr(bayesian_bp, "train_start", far_from_the_minimum)
    unconverged = best.__eq__
    found = BayesianBP(**settings).fit(X, Y)
    assert found.best_start_ != best
    assert found.report()["converged_starts"] == 2
    calls.clear()
    unconverged = bool(1).__or__
    found = BayesianBP(**settings).fit(X, Y)
    assert found.best_start_ == best
    assert found.converged_starts_ == 0


def test_classes_of_weights_have_a_cap(monkeypatch):
    X, Y = noisy_data(60, 3)
    settings = {"hidden": 3, "starts": 1, "epochs": 60, "goal": 0.0, "prior": "inputs"}
    model = BayesianBP(**settings).describe("abcdef", ("y", "z"))
    monkeypatch.setattr(levenberg_marquardt, "MAX_ALPHA", np.inf)
    assert model.fit(X, Y).report()["at_cap"] == []
    monkeypatch.setattr(levenberg_marquardt, "MAX_ALPHA", 1e-9)
    names = [
        *(f"weights of {name}" for name in "abcdef"),
        "hidden biases",
        "output weights",
    ]
    assert model.fit(X, Y).report()["at_cap"] == names
    assert model.start_rows()[0]["at_cap"] == 8


def test_training_on_pure_noise_ends(monkeypatch):
    """Here mu falls for more than 320 steps and then has to rise: from 0 it could not."""
    honest = levenberg_marquardt.compute_residuals
    trials = []

    def counted(*arguments):
        trials.append(1)
        assert len(trials) < 5000, "the training does not end"
        return honest(*arguments)

    monkeypatch.setattr(levenberg_marquardt, "compute_residuals", counted)
    monkeypatch.setattr(levenberg_marquardt, "PATIENCE", 10**6)
    random = np.random.RandomState(0)
    X = random.uniform(size=(60, 6))
    y = random.normal(size=(60, 1))
    epochs = (
        BayesianBP(hidden=8, starts=1, prior="layers", goal=0.0, seed=5)
        .fit(X, y)
        .epochs_
    )
    assert len(trials) > epochs
    trials.clear()
    assert (
        BayesianBP(hidden=8, starts=1, goal=0.0, mu=0.0, epochs=30).fit(X, y).epochs_
        == 30
    )


def test_training_stops_as_it_says_and_equal_weights_change_no_start(fitted):
    X, Y = noisy_data(60, 3)
    assert BayesianBP(starts=1, epochs=2).fit(X, Y).stop_reason_ == "epochs"
    assert BayesianBP(starts=1, goal=0.05).fit(X, Y).stop_reason_ == "goal"
    assert BayesianBP(starts=1, min_gradient=1e9).fit(X, Y).epochs_ == 0
    assert BayesianBP(starts=1, mu_max=1e-9).fit(X, Y).stop_reason_ == "mu"
    X, Y = noisy_data(20, 5)
    model = BayesianBP(starts=3).fit(X, Y)
    assert 0 < model.gamma_ < 40
    fresh = np.random.RandomState(9).uniform(-1, 1, (300, 6))
    assert score(model, fresh, known_function(fresh)) > 0.6
    model, X, Y = fitted
    again = BayesianBP(starts=1).fit(
        X, Y, sample_weight=np.ones(95), precision=np.ones(Y.shape)
    )
    assert again.starts_ == model.starts_[:1]


def test_samples_of_large_errors_count_little_by_their_weights():
    X, Y = noisy_data(95, 7, noise=(0.05, 0.1))
    Y[::2] += np.random.RandomState(8).normal(size=Y[::2].shape) * (2.0, 4.0)
    errors = np.full(Y.shape, 0.05)
    errors[::2] = 2.0
    weight = np.where(errors > 1, 0.01, 1.0)
    fresh = np.random.RandomState(9).uniform(-1, 1, (300, 6))
    truth = known_function(fresh)
    plain = score(BayesianBP(starts=1).fit(X, Y), fresh, truth)
    weighted = score(BayesianBP(starts=1).fit(X, Y, precision=weight), fresh, truth)
    assert 1 - weighted < 0.5 * (1 - plain)


def test_a_weight_of_n_is_that_of_n_equal_samples():
    X, Y = noisy_data(30, 12)
    count = np.random.RandomState(1).randint(0, 3, 30)
    settings = {"hidden": 2, "starts": 2, "epochs": 100}
    weighted = BayesianBP(**settings).fit(X, Y, sample_weight=count)
    repeated = BayesianBP(**settings).fit(
        np.repeat(X, count, axis=0), np.repeat(Y, count, axis=0)
    )
    mean, error = weighted.predict(X, return_std=True)
    expected_mean, expected_error = repeated.predict(X, return_std=True)
    np.testing.assert_allclose(mean, expected_mean, rtol=1e-5)
    np.testing.assert_allclose(error, expected_error, rtol=1e-5)


def test_weights_count_by_their_ratios():
    X, Y = noisy_data(40, 13)
    precision = np.random.RandomState(2).uniform(0.5, 2, Y.shape)
    model = BayesianBP(hidden=3, starts=1).fit(X, Y, precision=precision)
    scaled = BayesianBP(hidden=3, starts=1).fit(X, Y, precision=7 * precision)
    np.testing.assert_allclose(model.predict(X), scaled.predict(X), rtol=1e-4)
    assert model.gamma_ == pytest.approx(scaled.gamma_, rel=1e-2)
    assert model.beta_ == pytest.approx(7 * scaled.beta_, rel=1e-2)


@pytest.mark.parametrize(
    ("X", "y", "weights", "fault"),
    [
        (np.ones((3, 2)), np.ones(4), {}, r"y \(4,\); expected"),
        (np.full((3, 2), np.nan), np.ones(3), {}, "must be finite"),
        (
            np.ones((3, 2)),
            np.ones(3),
            {"sample_weight": np.ones(2)},
            r"sample_weight has shape \(2,\)",
        ),
        (
            np.ones((3, 2)),
            np.ones(3),
            {"sample_weight": -np.ones(3)},
            "must not be negative",
        ),
        (
            np.ones((3, 2)),
            np.ones(3),
            {"sample_weight": np.eye(3)[0]},
            "1 samples have a weight above zero",
        ),
        (
            np.ones((3, 2)),
            np.ones(3),
            {"precision": np.zeros(3)},
            "precision must be above zero",
        ),
        (
            np.ones((3, 2)),
            np.ones(3),
            {"precision": np.ones((3, 2))},
            r"precision has shape \(3, 2\)",
        ),
    ],
)
def test_bad_data_is_refused(X, y, weights, fault):
    value_error(fault, BayesianBP().fit, X, y, **weights)


@pytest.mark.parametrize(
    ("setting", "value", "allowed"),
    [
        *((name, 0, "at least 1") for name in ("hidden", "epochs", "starts")),
        ("goal", -1.0, "at least 0"),
        ("prior", "two", "one, layers, inputs"),
        ("scaled_range", (0.9, 0.1), "a lower end below an upper end"),
    ],
)
def test_bad_settings_are_named(setting, value, allowed):
    value_error(
        rf"{setting} is .*expected {allowed}",
        BayesianBP(**{setting: value}).fit,
        np.eye(3),
        np.ones(3),
    )


def test_predict_refuses_other_inputs_and_error_bars_hold_what_they_promise(fitted):
    value_error(
        r"shape \(4, 5\); expected \(samples, 6\)",
        BayesianBP.predict,
        fitted[0],
        np.ones((4, 5)),
    )
    value_error("before fit", BayesianBP().predict, np.ones((4, 5)))
    # One response, whose noise of 1 the network learns; intervals of any surrogate have a test of their own.
    X, Y = noisy_data(200, 17)
    model = BayesianBP(starts=4, hidden=6).fit(X, Y[:, 1])
    assert model.noise_std_[0] == pytest.approx(1.0, rel=0.25)
    mean, std = model.predict(X, return_std=True)
    assert mean.shape == std.shape == (200,)


def test_each_weight_is_in_one_class():
    w = np.arange(3 * 4 + 4 + 2 * 5)
    for prior, count in (("one", 1), ("layers", 3), ("inputs", 5)):
        classes = two_layer.list_weight_classes(prior, 3, 4, 2)
        assert len(classes) == count
        assert sorted(np.concatenate([w[c] for c in classes])) == list(w)
    W1, b1, W2, b2 = two_layer.unpack_weights(w, 3, 4, 2)
    np.testing.assert_array_equal(classes[1], W1[:, 1])
    np.testing.assert_array_equal(classes[3], b1)
    np.testing.assert_array_equal(classes[4], np.concatenate([W2.ravel(), b2]))


def test_a_prior_for_each_input_finds_the_inputs_without_effect():
    """Two of six inputs have an effect; the weights of the others shrink, which helps the prediction."""
    random = np.random.RandomState(19)
    X = random.uniform(-1, 1, (95, 6))
    y = np.sin(2 * X[:, 0]) + X[:, 1] ** 2 + 0.1 * random.normal(size=95)
    fresh = random.uniform(-1, 1, (500, 6))
    truth = np.sin(2 * fresh[:, 0]) + fresh[:, 1] ** 2
    settings = {"hidden": 5, "starts": 4, "epochs": 300, "goal": 0.0}
    model = BayesianBP(**settings, prior="inputs").fit(X, y)
    assert model.alpha_.shape == (8,)
    assert model.alpha_[2:6].min() > 30 * model.alpha_[:2].max()
    plain = BayesianBP(**settings).fit(X, y)
    assert 1 - score(model, fresh, truth) < 0.7 * (1 - score(plain, fresh, truth))


@pytest.mark.slow
def test_scikit_learn_finds_nothing_to_object_to():
    from sklearn.utils.estimator_checks import check_estimator

    results = check_estimator(
        BayesianBPRegressor(hidden=3, starts=2, epochs=200), on_skip=None
    )
    assert len(results) > 50
    assert {row["check_name"] for row in results if row["status"] != "passed"} <= {
        "check_array_api_input"
    }


def test_scikit_learn_is_not_imported_and_may_be_missing():
    run_python(
        "-c",
        "import repose.calibrate.surrogates.bayesian_bp, sys; assert 'sklearn' not in sys.modules",
    )


@pytest.mark.parametrize("samples", [[7], list(range(1000))])
def test_a_file_with_more_or_fewer_samples_than_inputs_is_refused(
    fitted, tmp_path, samples
):
    path = tmp_path / "network.json"
    fitted[0].save(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | {"samples": samples}))
    input_error(f"{len(samples)} numbers of samples for", load, path)
