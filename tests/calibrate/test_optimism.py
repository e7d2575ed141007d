"""The expected optimism of predictions, on fits whose optimism is known in closed form."""

import numpy as np
import pandas as pd
import pytest
import shared
from known_responses import noisy_data

from repose.calibrate.optimism import ReplicateRuns, estimate_optimism
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.gaussian_process import GaussianProcess
from repose.calibrate.surrogates.network_ensemble import NetworkEnsemble
from repose.calibrate.surrogates.quadratic import QuadraticSurface
from repose.calibrate.targets import Targets

TARGETS = Targets.of(shared.TARGETS)
NAMES = list(TARGETS.names)
# Expected maximum of five standard normal numbers (Harter 1961).
LARGEST_OF_FIVE = 1.16296
SD = 2.0


class Means(Surrogate):
    """Predicts the mean of the sample whose number the parameter is."""

    name = "means"

    @classmethod
    def of(cls, settings):
        return cls()

    def fit(self, X, Y, **noise):
        self.means = np.asarray(Y)
        return self

    def predict(self, X, return_std=False, noise=True):
        return self.means[np.asarray(X)[:, 0].astype(int)]

    def covariance(self, X):
        raise NotImplementedError

    def to_dict(self):
        return {}

    @classmethod
    def from_dict(cls, content):
        return cls()


def tables_of(values):
    """Tables of samples and runs; values (samples, runs, responses)."""
    samples = pd.DataFrame({"sample": np.arange(1, len(values) + 1)})
    samples["x"] = np.arange(len(values), dtype=float)
    samples[NAMES] = values.mean(axis=1)
    runs = pd.DataFrame(values.reshape(-1, len(NAMES)), columns=NAMES)
    runs.insert(0, "sample", np.repeat(samples["sample"], values.shape[1]).to_numpy())
    return samples.assign(status="ok"), runs.assign(status="ok")


def fitted(values):
    samples, runs = tables_of(values)
    model = Means().fit(None, samples[NAMES].to_numpy())
    model.describe(["x"], NAMES, {}, samples["sample"])
    return model, ReplicateRuns.collect(model, samples, runs, TARGETS)


def highest(model):
    """The search for the highest first response among five equal samples."""
    return np.array([[float(model.means[:, 0].argmax())], [0.0]]), ["best", "fixed"]


def test_the_optimism_of_the_best_of_five_equal_means_is_known():
    # five samples with equal true means, 400 runs: the scatter of a sample is that of all
    random = np.random.default_rng(1)
    noise = random.normal(0, SD, (5, 400, 2))
    noise -= noise.mean(axis=1, keepdims=True)
    model, pours = fitted(30.0 + noise)
    table = estimate_optimism(model, pours, highest, TARGETS, replicates=1500, seed=3)
    row = table.set_index(["role", "response"]).loc[("best", NAMES[0])]
    known = LARGEST_OF_FIVE * SD / np.sqrt(400)
    assert abs(row["optimism"] - known) < 3 * row["optimism_se"] + 0.02 * known
    assert row["optimism_se"] < 0.03 * known
    assert row["replicates"] == 1500
    # a set that is not chosen for its prediction has none
    row = table.set_index(["role", "response"]).loc[("fixed", NAMES[0])]
    assert abs(row["optimism"]) < 3 * row["optimism_se"]


def test_drawn_means_scatter_as_means_of_single_runs_do():
    random = np.random.default_rng(2)
    values = random.normal(0, SD, (3, 4, 2))
    _, pours = fitted(values)
    drawn = np.array([pours.draw_means(np.random.default_rng(k)) for k in range(4000)])
    # twin: the unbiased variance of a run over the number of runs
    slow = [[np.var(values[i, :, k], ddof=1) / 4 for k in range(2)] for i in range(3)]
    np.testing.assert_allclose(drawn.var(axis=0), slow, rtol=0.12)
    np.testing.assert_allclose(drawn.mean(axis=0), values.mean(axis=1), atol=0.06)


def test_responses_of_one_run_are_drawn_together():
    random = np.random.default_rng(4)
    values = random.normal(0, SD, (3, 5, 2))
    values[:, :, 1] = 3 * values[:, :, 0] + random.normal(0, 1e-6, (3, 5))
    _, pours = fitted(values)
    drawn = pours.draw_means(random) - pours.means
    np.testing.assert_allclose(drawn[:, 1], 3 * drawn[:, 0], atol=1e-5)


def test_the_same_seed_gives_the_same_table():
    values = np.random.default_rng(5).normal(30, SD, (5, 6, 2))
    model, pours = fitted(values)
    first = estimate_optimism(model, pours, highest, TARGETS, replicates=3, seed=1)
    again = estimate_optimism(model, pours, highest, TARGETS, replicates=3, seed=1)
    other = estimate_optimism(model, pours, highest, TARGETS, replicates=3, seed=2)
    pd.testing.assert_frame_equal(first, again)
    assert not first["optimism"].equals(other["optimism"])


def test_single_pours_alone_show_no_optimism():
    values = np.random.default_rng(6).normal(30, SD, (8, 1, 2))
    samples, runs = tables_of(values)
    model = Means().fit(None, samples[NAMES].to_numpy())
    model.describe(["x"], NAMES, {}, samples["sample"])
    assert ReplicateRuns.collect(model, samples, runs, TARGETS) is None


def test_a_sample_with_one_run_takes_its_deviation_from_the_others():
    values = np.random.default_rng(7).normal(30, SD, (5, 6, 2))
    samples, runs = tables_of(values)
    runs = runs.iloc[: 4 * 6 + 1]
    samples.loc[4, NAMES] = runs.loc[runs["sample"] == 5, NAMES].to_numpy()[0]
    model = Means().fit(None, samples[NAMES].to_numpy())
    model.describe(["x"], NAMES, {}, samples["sample"])
    pours = ReplicateRuns.collect(model, samples, runs, TARGETS)
    drawn = np.array(
        [pours.draw_means(np.random.default_rng(k))[4] for k in range(3000)]
    )
    within = np.mean([np.var(values[i], axis=0, ddof=1) for i in range(4)], axis=0)
    np.testing.assert_allclose(drawn.var(axis=0), within, rtol=0.12)


# --- refits ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def data():
    X, Y = noisy_data(60, 0)
    other = Y + np.random.default_rng(8).normal(0, 0.02 * Y.std(axis=0), Y.shape)
    return X, Y, other


def test_a_network_refitted_to_its_own_data_stays(data):
    X, Y, _ = data
    model = BayesianBP(starts=2, goal=0.0, prior="inputs").fit(X, Y)
    again = model.refit(X, Y)
    spread = Y.std(axis=0)
    assert np.abs((again.predict(X) - model.predict(X)) / spread).max() < 0.01


def test_a_refitted_network_is_at_the_minimum_of_its_objective(data):
    X, Y, other = data
    model = BayesianBP(starts=2, goal=0.0, prior="one").fit(X, Y)
    again = model.refit(X, other)
    assert np.abs(again.predict(X) - model.predict(X)).max() > 0
    # the objective by loops, at the found weights and a step to each side
    low, high = model.scaled_range
    span = model.output_max_ - model.output_min_
    scaled = low + (high - low) * (other - model.output_min_) / span

    def objective(network):
        outputs = low + (high - low) * (network.predict(X) - model.output_min_) / span
        w = network._weights()
        return model.beta_ * ((outputs - scaled) ** 2).sum() + model.alpha_ * (w @ w)

    found = objective(again)
    assert found < objective(model)
    for k in range(0, len(again.b1_), 3):
        for step in (-0.02, 0.02):
            moved = BayesianBP.from_dict(again.to_dict())
            moved.b1_[k] += step
            assert objective(moved) > found - 0.01


def test_an_ensemble_refits_each_member(data):
    X, Y, other = data
    model = NetworkEnsemble([BayesianBP(starts=3, goal=0.0, prior="inputs")])
    model.fit(X, Y)
    again = model.refit(X, other)
    members = [member.refit(X, other).predict(X) for member in model.members_]
    np.testing.assert_allclose(again.predict(X), np.mean(members, axis=0))


def test_a_refitted_process_keeps_its_hyperparameters(data):
    X, Y, other = data
    model = GaussianProcess().describe(list("abcdef"), ["y", "z"]).fit(X, Y)
    again = model.refit(X, other)
    for old, new in zip(
        model.report()["kernels"], again.report()["kernels"], strict=True
    ):
        assert new["lengths"] == pytest.approx(old["lengths"])
    np.testing.assert_allclose(model.refit(X, Y).predict(X), model.predict(X))


def test_other_surrogates_are_fitted_anew(data):
    X, Y, other = data
    model = QuadraticSurface().fit(X, Y)
    before = model.predict(X)
    again = model.refit(X, other)
    expected = QuadraticSurface().fit(X, other).predict(X)
    np.testing.assert_allclose(again.predict(X), expected)
    np.testing.assert_array_equal(model.predict(X), before)
