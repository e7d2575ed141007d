"""The posterior: sampler and diagnostics on closed forms, and one small study from files."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from repose.chain import train
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.studies import posterior

TARGET = {
    "physical_aor_deg": 30.0,
    "physical_aor_sd_deg": 2.0,
    "physical_height_mm": 60.0,
    "physical_height_sd_mm": 4.0,
    "physical_piles": 4,
}


def test_observation_adds_discrepancy_to_the_error_of_the_mean():
    mean, covariance = posterior.observation(TARGET, 0.5, 2.0)
    assert mean.tolist() == [30.0, 60.0]
    # standard errors 1 and 2, discrepancies 0.6 and 1.2
    assert covariance == pytest.approx(np.array([[1 + 0.36, 1.0], [1.0, 4 + 1.44]]))
    with pytest.raises(ValueError, match="correlation is 1"):
        posterior.observation(TARGET, 1, 2.0)


def test_likelihood_is_a_normal_density_with_its_determinant():
    mean, covariance = posterior.observation(TARGET, 0.3, 2.0)
    responses = np.array([[29.0, 62.0], [33.0, 55.0]])
    weights = np.array([[[0.5, 0.1], [0.1, 0.7]], [[2.0, 0.0], [0.0, 3.0]]])
    found = posterior.log_likelihood(responses, weights, mean, covariance)
    for k in range(2):
        known = stats.multivariate_normal(responses[k], covariance + weights[k]).logpdf(mean)
        assert found[k] == pytest.approx(known)


@pytest.fixture(scope="module")
def linear():
    """y = A theta + c with noise: the posterior of theta, well inside the cube, is normal in closed form."""
    A, c = np.array([[8.0, 3.0], [-2.0, 10.0]]), np.array([20.0, 50.0])
    truth = np.array([0.45, 0.55])
    mean, covariance = A @ truth + c, np.array([[0.3, 0.1], [0.1, 0.4]])
    known = np.linalg.inv(A.T @ np.linalg.solve(covariance, A))

    def log_density(theta):
        return posterior.log_likelihood(theta @ A.T + c, np.zeros((len(theta), 2, 2)), mean, covariance)

    chains, times = posterior.sample(log_density, 2, 24, 1200, 3)
    return log_density, chains, times, truth, known


def test_linear_model_has_its_closed_form_posterior(linear):
    _, chains, times, truth, known = linear
    draws, effective = chains.reshape(-1, 2), chains[:, :, 0].size / times.max()
    assert effective > 1000
    error = np.sqrt(np.diag(known) / effective)
    assert draws.mean(axis=0) == pytest.approx(truth, abs=4 * error.max())
    assert np.cov(draws.T) == pytest.approx(known, abs=5 * known.max() * math.sqrt(2 / effective))
    assert (posterior.split_r_hat(chains) < 1.01).all()


def test_information_of_the_linear_model(linear):
    """KL(normal || uniform on the cube) = -entropy, since the uniform density is one."""
    log_density, chains, times, _, known = linear
    draws = chains.reshape(-1, 2)
    joint = -0.5 * np.log2((2 * math.pi * math.e) ** 2 * np.linalg.det(known))
    found, error = posterior.joint_information_bits(log_density, draws, 1)
    assert found == pytest.approx(joint, abs=0.03)
    assert error < 0.05
    for k in range(2):
        marginal = -0.5 * math.log2(2 * math.pi * math.e * known[k, k])
        effective = draws[:, k].size / times[k]
        assert posterior.information_bits(draws[:, k], effective) == pytest.approx(marginal, abs=0.06)


def test_prior_ends_at_its_bounds():
    """A slope of 3 over [0, 1]: a truncated exponential, mean 1 / (1 - e^-3) - 1 / 3."""
    chains, _ = posterior.sample(lambda u: 3 * u[:, 0], 1, 16, 1500, 1)
    assert chains.min() >= 0
    assert chains.max() <= 1
    assert chains.mean() == pytest.approx(1 / (1 - math.exp(-3)) - 1 / 3, abs=0.01)


def test_same_seed_same_draws():
    first, second, other = (posterior.sample(lambda u: -u[:, 0], 2, 16, 100, seed)[0] for seed in (1, 1, 2))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)


def test_r_hat_of_known_chains():
    random = np.random.default_rng(1)
    good = random.normal(size=(4, 2000, 1))
    assert posterior.split_r_hat(good) == pytest.approx(1, abs=0.005)
    apart = good + np.array([0, 0, 0, 3.0])[:, None, None]
    # means 0, 0, 0, 3 twice each: variance 18 - 9 * 8 / 16 over 7 beside one within
    assert posterior.split_r_hat(apart) == pytest.approx(math.sqrt(1 + (18 - 4.5) / 7), rel=0.02)
    drifting = good + np.linspace(0, 3, 2000)[None, :, None]
    # halves' means 0.75 and 2.25 four times each, and a ramp of 1.5 within each
    assert posterior.split_r_hat(drifting) == pytest.approx(
        math.sqrt(1 + 4.5 / 7 / (1 + 1.5**2 / 12)), rel=0.02
    )
    with pytest.raises(ValueError, match=r"shape \(4, 3, 1\)"):
        posterior.split_r_hat(good[:, :3])


def test_information_of_known_draws():
    """Uniform: none. Density 2u: 1 - 1 / (2 ln 2) bits. A quarter of the range: two."""
    random = np.random.default_rng(2)
    u = random.uniform(size=40_000)
    assert posterior.information_bits(u, 40_000) < 0.002
    assert posterior.information_bits(np.sqrt(u), 40_000) == pytest.approx(
        1 - 1 / (2 * math.log(2)), abs=0.01
    )
    assert posterior.information_bits(u / 4, 40_000) == pytest.approx(2, abs=0.01)
    few = [posterior.information_bits(random.uniform(size=400), 400) for _ in range(200)]
    assert np.mean(few) < 0.02  # 0.07 without the correction


def test_statements():
    row = {"parameter": "e_gp", "information_bits": 0.05, "width_ratio": 0.98, "below_centre": 0.45}
    row |= {"credible_low": 0.21, "credible_high": 0.49}
    assert posterior.statement(row) == "e_gp is not determined: 98 % of the prior's width, 0.05 bits"
    row |= {"information_bits": 0.6}
    assert "weakly determined, in the high half with probability 0.55" in posterior.statement(row)
    row |= {"information_bits": 1.5}
    assert "e_gp is determined, 0.21 to 0.49" in posterior.statement(row)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study in which AoR follows mus_gp alone and Height mur_gg alone, with its trained network."""
    folder = tmp_path_factory.mktemp("study")
    random = np.random.default_rng(1)
    table = pd.DataFrame(random.uniform(size=(60, 6)), columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(1, 61))
    runs = table.loc[table.index.repeat(4), ["sample"]].reset_index(drop=True)
    runs["seed"], runs["status"] = np.arange(len(runs)), "ok"
    runs["aor_deg"] = 20 + 20 * table["mus_gp"].repeat(4).to_numpy() + random.normal(0, 0.5, 240)
    runs["height_mm"] = 40 + 40 * table["mur_gg"].repeat(4).to_numpy() + random.normal(0, 1.0, 240)
    groups = runs.groupby("sample")
    for column, error in (("aor_deg", "aor_se_deg"), ("height_mm", "height_se_mm")):
        table[column] = groups[column].mean().to_numpy()
        table[error] = groups[column].std().to_numpy() / 2
    table["status"] = "ok"
    table.to_csv(folder / "dataset.csv", index=False)
    runs.to_csv(folder / "runs.csv", index=False)
    settings = {"hidden": 3, "epochs": 200, "goal": 0.0, "starts": 3, "seed": 1}
    settings |= {"split": [0.7, 0.15, 0.15], "weights_from_errors": True}
    settings |= {"correlated_noise": True, "prior": "inputs"}
    train.run(folder / "dataset.csv", folder / "runs.csv", settings, folder)
    cloud = pd.DataFrame(random.uniform(0.4, 0.6, (10, 6)), columns=list(PARAMETERS))
    cloud.to_csv(folder / "feasible.csv", index=False)
    pd.DataFrame({"parameter": PARAMETERS, "low": 0.4, "high": 0.6}).to_csv(
        folder / "table3.csv", index=False
    )
    names = {"network": "network.json", "metrics": "metrics.json"}
    names |= {key: f"{key}.csv" for key in ("predictions", "dataset", "runs", "feasible", "table3")}
    return {key: folder / name for key, name in names.items()}


SETTINGS = {"discrepancy_percent": 2.0, "walkers": 24, "steps": 1000, "seed": 1}
RANGES = dict.fromkeys(PARAMETERS, (0.0, 1.0))


def test_a_study_determines_what_moves_its_responses_and_says_what_it_does_not(study, tmp_path):
    summary = posterior.run(study, RANGES, TARGET, SETTINGS, tmp_path)
    table = pd.read_csv(tmp_path / "posterior.csv").set_index("parameter")
    assert table.loc[["mus_gp", "mur_gg"], "median"].to_numpy() == pytest.approx([0.5, 0.5], abs=0.03)
    # 20 units of AoR over a range: se 1 and discrepancy 0.6 are 0.058 of it
    assert table.loc["mus_gp", "sd"] == pytest.approx(math.sqrt(1.36) / 20, rel=0.15)
    assert (table.loc[["mus_gp", "mur_gg"], "information_bits"] > 1).all()
    others = ["e_gg", "mus_gg", "e_gp", "mur_gp"]
    assert (table.loc[others, "information_bits"] < 0.1).all()
    assert all(f"{name} is not determined" in posterior.message(summary) for name in others)
    assert table.loc["e_gg", "published_prior_probability"] == pytest.approx(0.2)
    assert table.loc["mus_gp", "published_probability"] > 0.8
    assert summary["misfit"]["p_value"] > 0.9
    assert len(pd.read_csv(tmp_path / "draws.csv")) == posterior.DRAWS_KEPT


def test_restored_network_has_the_error_bars_it_was_trained_with(study):
    table = pd.read_csv(study["dataset"])
    rows = train.split(60, [0.7, 0.15, 0.15], 1)["train"]
    errors = table[["aor_se_deg", "height_se_mm"]].to_numpy()
    X, Y = table[list(PARAMETERS)].to_numpy(), table[["aor_deg", "height_mm"]].to_numpy()
    metrics = json.loads(study["metrics"].read_text())
    assert metrics["prior"] == "inputs"
    assert len(metrics["alpha"]) == 8
    covariance = np.array(metrics["noise_covariance"])
    assert covariance == pytest.approx(np.diag([0.25, 1.0]), abs=0.25)
    precision = train.weights_from_errors(errors)[rows].mean(axis=1)
    trained = train.PlainBayesianBP(hidden=3, epochs=200, goal=0.0, starts=3, seed=1, prior="inputs")
    trained.fit(X[rows], Y[rows], precision=precision, noise_covariance=covariance)
    again = train.restore(*(study[key] for key in ("network", "predictions", "dataset")))
    for noise in (True, False):
        expected, found = (model.predict(X, return_std=True, noise=noise) for model in (trained, again))
        assert found[0] == pytest.approx(expected[0], rel=1e-9)
        assert found[1] == pytest.approx(expected[1], rel=1e-5)
    covariance = again.covariance(X)
    assert np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)) == pytest.approx(found[1])
    assert (np.linalg.det(covariance) > 0).all()


def test_files_of_different_trainings_are_refused(study, tmp_path):
    network = json.loads(study["network"].read_text())
    network["b2"][0] += 0.1
    (tmp_path / "other.json").write_text(json.dumps(network))
    with pytest.raises(
        InputError, match=r"predictions.csv: predictions is 'others'; allowed: those of .*other.json"
    ):
        train.restore(tmp_path / "other.json", study["predictions"], study["dataset"])
