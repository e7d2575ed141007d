"""The posterior and its likelihood."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from linear import Linear
from refusals import input_error, value_error
from scipy import stats
from shared import study_of, targets_of
from stage_runs import trained
from synthetic import Study, write_tables

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate import training as train
from repose.calibrate.surrogates import names
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.uncertainty import implausibility, likelihood, posterior
from repose.calibrate.uncertainty.likelihood import make_observation
from repose.calibrate.uncertainty.settings import PosteriorSettings

# standard errors of the means 1 deg and 2 mm
TARGETS = targets_of(sd_percent=20 / 3, aor_deg=30.0, height_mm=60.0)
UNIT = {name: [0.0, 1.0] for name in PARAMETERS}
SETTINGS = {
    "shape_study": None,
    "discrepancy_percent": 2.0,
    "discrepancy_correlation": 0.0,
    "measured_correlation": "simulated",
    "walkers": 24,
    "steps": 1000,
    "seed": 1,
}
GIVEN = Study(contact_space(UNIT), TARGETS, {"posterior": SETTINGS})
# Many walkers take few steps for as many draws.
WIDE = {"walkers": 128, "steps": 250}


def test_statements_and_a_reference_interval_by_its_share_of_the_prior():
    row = {
        "parameter": "e_gp",
        "information_bits": 0.05,
        "width_ratio": 0.98,
        "below_centre": 0.45,
        "credible_low": 0.21,
        "credible_high": 0.49,
    }
    assert (
        posterior.state_determination(row)
        == "e_gp is not determined: 98 % of the prior's width, 0.05 bits"
    )
    row |= {"information_bits": 0.6}
    assert "e_gp is not determined: 98 %" in posterior.state_determination(row)
    row |= {"width_ratio": 0.89}
    assert (
        "weakly determined, in the high half with probability 0.55"
        in posterior.state_determination(row)
    )
    row |= {"information_bits": 1.5, "width_ratio": 0.98}
    assert (
        "e_gp lies in one of several places within 0.21 to 0.49"
        in posterior.state_determination(row)
    )
    row |= {"width_ratio": 0.4}
    assert "e_gp is determined, 0.21 to 0.49" in posterior.state_determination(row)
    space = contact_space(UNIT | {"mus_gg": [0.4, 0.8]})
    found = posterior._assess_reference(
        "other",
        space,
        "mus_gg",
        np.array([0.4, 0.6, 0.8]),
        posterior.Interval(0.5, 0.7),
    )
    assert found["other_prior_probability"] == pytest.approx(0.5)
    assert found["other_probability"] == pytest.approx(1 / 3)
    space = contact_space(
        UNIT | {"mus_gg": {"prior": {"mean": 0.6, "sd": 0.05}, "range": [0.4, 0.8]}}
    )
    found = posterior._assess_reference(
        "other",
        space,
        "mus_gg",
        np.array([0.5]),
        posterior.Interval(0.6, 0.8),
    )
    assert found["other_prior_probability"] == pytest.approx(0.5)


# Any number of targets, priors and fixed parameters, on a surrogate with a closed form


class Everywhere:
    def is_sparse(self, X):
        return np.zeros(len(X), bool)


def runs_of(targets, seeds=4, samples=20):
    random = np.random.default_rng(1)
    runs = pd.DataFrame(
        {"sample": np.repeat(np.arange(samples), seeds), "status": "ok"}
    )
    return runs.assign(
        **{name: random.normal(30, 1, len(runs)) for name in targets.names}
    )


def inferred(targets, slopes, space=UNIT, runs=None, **changes):
    beside = {
        name: pd.DataFrame({"low": 0.4, "high": 0.6}, index=PARAMETERS)
        for name in ("published", "miga")
    }
    model = Linear(targets.names, slopes, error=0.1)
    settings = PosteriorSettings.model_construct(
        **SETTINGS | {"discrepancy_percent": 0.0} | changes
    )
    runs = runs_of(targets) if runs is None else runs
    return posterior.infer_posterior(
        model,
        Everywhere(),
        parameters=contact_space(space),
        targets=targets,
        measurement=posterior.make_measurement(targets, runs, settings),
        settings=settings,
        references=beside,
    )


@pytest.mark.usefixtures("short_search")
def test_correlations_need_their_runs():
    targets = targets_of(
        sd_percent=4.0, aor_deg=30.0, height_mm=30.0, base_radius_mm=30.0
    )
    few = runs_of(targets, seeds=2, samples=4)
    slopes = [{name: 12.0} for name in ("e_gg", "mus_gg", "mur_gg")]
    freedom = "4 degrees of freedom within samples of funnel; expected at least 5"
    value_error(freedom, inferred, targets, slopes, runs=few)
    drum = targets_of(
        sd_percent=4.0,
        aor_deg=30.0,
        height_mm=30.0,
        drum_slip_deg=30.0,
        drum_rest_deg=30.0,
    )
    one_each = [{name: 12.0} for name in ("e_gg", "mus_gg", "mur_gg", "e_gp")]
    drums = few.assign(
        drum_slip_deg=few["height_mm"], drum_rest_deg=few["base_radius_mm"]
    )
    short = {"walkers": 14, "steps": 60}  # what is drawn is not asked for
    assert inferred(drum, one_each, runs=drums, **short)
    for runs, changes in (
        (few, {"measured_correlation": 0.0}),
        (runs_of(targets, seeds=2, samples=5), {}),
    ):
        assert inferred(targets, slopes, runs=runs, **changes, **short).summary[
            "correlation"
        ]


@pytest.mark.usefixtures("short_search")
def test_one_target_determines_one_parameter():
    targets = targets_of(sd_percent=4.0, drum_slip_deg=30.0)
    found = inferred(targets, [{"mus_gp": 12.0}], **WIDE)
    table = found.parameters.set_index("parameter")
    # standard error 0.6, of the prediction 0.1
    expected = math.hypot(0.6, 0.1) / 12
    assert table.loc["mus_gp", "sd"] == pytest.approx(expected, rel=0.1)
    assert (table["information_bits"].drop("mus_gp") < 0.1).all()
    expected = [
        *PARAMETERS,
        "drum_slip_predicted_deg",
        "drum_slip_linear_se_deg",
    ]
    assert list(found.draws.columns) == expected
    assert found.summary["correlation"] == {}
    assert found.summary["linear_se"] == pytest.approx([0.1])


@pytest.mark.slow
def test_four_targets_of_two_bench_tests_determine_four_parameters():
    moved = {
        "aor_deg": "e_gg",
        "height_mm": "mus_gg",
        "base_radius_mm": "mur_gg",
        "drum_slip_deg": "e_gp",
    }
    targets = targets_of(sd_percent=4.0, **dict.fromkeys(moved, 30.0))
    found = inferred(targets, [{name: 12.0} for name in moved.values()])
    table = found.parameters.set_index("parameter")
    assert (table.loc[list(moved.values()), "information_bits"] > 1).all()
    assert (table.loc[["mus_gp", "mur_gp"], "information_bits"] < 0.1).all()
    assert set(found.summary["predicted"]) == set(moved)
    assert len(found.summary["correlation"]) == 3


@pytest.mark.usefixtures("short_search")
def test_a_prior_narrows_its_parameter():
    space = UNIT | {"e_gg": {"prior": {"mean": 0.3, "sd": 0.05}, "range": [0.0, 1.0]}}
    space["mus_gp"] = {"prior": {"mean": 0.4, "sd": 0.1}, "range": [0.0, 1.0]}
    targets = targets_of(sd_percent=4.0, drum_slip_deg=30.0)
    found = inferred(targets, [{"mus_gp": 6.0}], space, **WIDE)
    table = found.parameters.set_index("parameter")
    assert table.loc["e_gg", ["mean", "sd"]].tolist() == pytest.approx(
        [0.3, 0.05], abs=0.006
    )
    assert table.loc["e_gg", "width_ratio"] == pytest.approx(1, abs=0.07)
    assert table.loc["e_gg", "information_bits"] < 0.1
    assert table.loc["e_gg", "published_prior_probability"] == pytest.approx(
        stats.norm.sf(2), abs=1e-3
    )
    # two measurements of one number: the prior, and the target through its slope
    precision = np.array([1 / 0.1**2, 6**2 / (0.6**2 + 0.1**2)])
    expected = precision @ [0.4, 0.5] / precision.sum()
    assert table.loc["mus_gp", "mean"] == pytest.approx(expected, abs=0.01)
    assert table.loc["mus_gp", "sd"] == pytest.approx(precision.sum() ** -0.5, rel=0.1)


@pytest.mark.usefixtures("short_search")
def test_fixed_parameters_are_not_sampled():
    space = UNIT | {
        name: {"fixed": 0.5} for name in PARAMETERS if name not in ("mus_gp", "e_gg")
    }
    found = inferred(
        targets_of(sd_percent=4.0, drum_slip_deg=30.0),
        [{"mus_gp": 12.0}],
        space,
        walkers=128,
        steps=100,
    )
    assert list(found.parameters["parameter"]) == ["e_gg", "mus_gp"]
    assert (found.draws["mur_gg"] == 0.5).all()
    expected = math.hypot(0.6, 0.1) / 12
    assert found.draws["mus_gp"].std() == pytest.approx(expected, rel=0.1)
    assert "mur_gg is fixed at 0.5" in posterior.describe_posterior(found.summary)
    alone = inferred(
        targets_of(drum_slip_deg=30.0),
        [{"mus_gp": 12.0}],
        space | {"e_gg": {"fixed": 0.5}},
        walkers=128,
        steps=50,
    )
    assert alone.summary["correlations"] == [[1.0]]
    for summary in (found.summary, alone.summary):
        r_hat = summary["largest_r_hat"]
        draws = summary["least_effective_draws"]
        assert summary["converged"] == (r_hat <= 1.01 and draws >= 400), summary


def test_a_published_range_is_shown_for_the_parameters_that_have_one():
    space = contact_space(UNIT | {"gamma_gg": [0.0, 0.1], "gamma_gp": {"fixed": 0.0}})
    published = pd.DataFrame({"low": 0.4, "high": 0.6}, index=PARAMETERS)
    unit = np.random.default_rng(1).uniform(size=(500, 7))
    table = posterior._tabulate_parameters(
        space,
        unit,
        posterior.Convergence(*np.ones((3, 7))),
        {"published": published},
    )
    assert table["published_low"].isna().tolist() == [False] * 6 + [True]


def bits_on_a_grid(slopes, target, sd):
    """Bits of one response 30 + slopes (u - 1/2), u uniform in the unit cube: convolution of six boxes, on a grid."""
    step = 0.001
    density = np.ones(1)
    for slope in slopes:
        density = np.convolve(density, np.ones(max(1, round(abs(slope) / step))))
        density /= density.sum()
    values = 30 + step * (np.arange(len(density)) - (len(density) - 1) / 2)
    likelihood = np.exp(-0.5 * ((values - target) / sd) ** 2)
    evidence = density @ likelihood
    positive = likelihood > 0
    weighted = density[positive] * likelihood[positive] / evidence
    return float(weighted @ np.log2(likelihood[positive] / evidence))


@pytest.mark.slow
def test_sampler_and_weighted_points_have_the_bits_of_a_grid():
    """Six parameters move one response, and the box cuts the posterior: nothing in it is normal."""
    slopes = dict(zip(PARAMETERS, (5.0, 2.0, 5.0, -4.0, 0.5, -4.0), strict=True))
    targets = targets_of(sd_percent=9.0, drum_slip_deg=31.0)
    exact = bits_on_a_grid(
        slopes.values(),
        31.0,
        math.hypot(float(targets.standard_error[0]), 0.02 * 31, 0.1),
    )
    found = inferred(targets, [slopes], discrepancy_percent=2.0, steps=2000).summary
    assert 0.003 < found["information_se_bits"] < 0.03
    assert found["information_bits"] == pytest.approx(
        exact, abs=3 * found["information_se_bits"]
    )
    model = Linear(targets.names, [slopes], error=0.1)
    space = contact_space(UNIT)
    points = implausibility.PriorPoints(model, space)

    def observed(percent, between):
        return make_observation(
            targets, np.eye(1), np.array([[(percent / 100 * 31.0) ** 2]])
        )

    curve = implausibility.compute_information_curve(points, targets, observed)
    assert curve.set_index("discrepancy_percent").loc[
        2.0, "information_bits"
    ] == pytest.approx(exact, abs=0.01)


# From files


TRAINING = {
    "hidden": 3,
    "epochs": 200,
    "goal": 0.0,
    "starts": 3,
    "seed": 1,
    "replicates": True,
    "prior": "inputs",
}
TRAINING = NetworkSettings.from_keys(TRAINING)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    random = np.random.default_rng(1)
    table = pd.DataFrame(random.uniform(size=(60, 6)), columns=list(PARAMETERS)).clip(
        lower=0.01
    )
    table.insert(0, "sample", np.arange(1, 61))
    runs = table.loc[table.index.repeat(4), ["sample"]].reset_index(drop=True)
    runs["seed"] = np.arange(len(runs))
    runs["status"] = "ok"
    runs["aor_deg"] = (
        20 + 20 * table["mus_gp"].repeat(4).to_numpy() + random.normal(0, 0.5, 240)
    )
    runs["height_mm"] = (
        40 + 40 * table["mur_gg"].repeat(4).to_numpy() + random.normal(0, 1.0, 240)
    )
    write_tables(folder, table, runs)
    trained(
        folder / "dataset.csv",
        folder / "runs.csv",
        study_of(TARGETS, network=TRAINING),
        folder,
    )
    cloud = pd.DataFrame(random.uniform(0.4, 0.6, (10, 6)), columns=list(PARAMETERS))
    cloud.to_csv(folder / "feasible.csv", index=False)
    pd.DataFrame({"parameter": PARAMETERS, "low": 0.4, "high": 0.6}).to_csv(
        folder / "table3.csv", index=False
    )
    files = {"network": "network.json", "metrics": "metrics.json"}
    files |= {
        key: f"{key}.csv"
        for key in ("predictions", "dataset", "runs", "feasible", "table3")
    }
    return {key: folder / name for key, name in files.items()}


def posterior_of(files, study, folder, *source):
    """The posterior of a study from its files, which may have further ones."""
    names = posterior.InputFiles._fields
    return posterior.infer_from_files(
        posterior.InputFiles(**{name: files[name] for name in names}),
        parameters=study.parameters,
        targets=study.targets,
        definitions=study.definitions,
        settings=study.settings.posterior,
        out_dir=folder,
        **dict(zip(["source"], source, strict=False)),
    )


@pytest.mark.usefixtures("short_search")
def test_a_study_determines_what_moves_its_responses_and_says_what_it_does_not(
    study, tmp_path
):
    given = GIVEN._replace(config={"posterior": SETTINGS | WIDE})
    summary = posterior_of(study, given, tmp_path)
    table = pd.read_csv(tmp_path / "posterior.csv").set_index("parameter")
    assert table.loc[["mus_gp", "mur_gg"], "median"].to_numpy() == pytest.approx(
        [0.5, 0.5], abs=0.03
    )
    # 20 units of AoR over a range: se 1 and discrepancy 0.6 are 0.058 of it
    assert table.loc["mus_gp", "sd"] == pytest.approx(math.sqrt(1.36) / 20, rel=0.15)
    assert (table.loc[["mus_gp", "mur_gg"], "information_bits"] > 1).all()
    others = ["e_gg", "mus_gg", "e_gp", "mur_gp"]
    assert (table.loc[others, "information_bits"] < 0.1).all()
    assert all(
        f"{name} is not determined" in posterior.describe_posterior(summary)
        for name in others
    )
    assert table.loc["e_gg", "published_prior_probability"] == pytest.approx(0.2)
    assert table.loc["mus_gp", "published_probability"] > 0.8
    assert summary["misfit"]["p_value"] > 0.9
    assert len(pd.read_csv(tmp_path / "draws.csv")) == posterior.MAX_KEPT_DRAWS


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in names() if name != "network"])
def test_every_surrogate_gives_the_same_answer(name, study, tmp_path):
    trained(
        study["dataset"],
        study["runs"],
        study_of(TARGETS, network=TRAINING, surrogate=name),
        tmp_path,
    )
    files = study | {
        "network": tmp_path / "network.json",
        "predictions": tmp_path / "predictions.csv",
    }
    few = GIVEN._replace(config={"posterior": SETTINGS | {"walkers": 14, "steps": 400}})
    summary = posterior_of(files, few, tmp_path)
    table = pd.read_csv(tmp_path / "posterior.csv").set_index("parameter")
    assert table.loc[["mus_gp", "mur_gg"], "median"].to_numpy() == pytest.approx(
        [0.5, 0.5], abs=0.04
    )
    assert table.loc["mus_gp", "sd"] == pytest.approx(math.sqrt(1.36) / 20, rel=0.25)
    assert len(summary[f"{name}_se"]) == 2


def test_other_responses_and_definitions_are_refused(study, tmp_path):
    other = targets_of(height_mm=60.0, aor_deg=30.0)
    message = r"network\.json: outputs is .*the responses of the targets, height_mm"
    input_error(message, posterior_of, study, GIVEN._replace(targets=other), tmp_path)
    made_with = json.loads(study["network"].read_text()) | {
        "definitions": {"aor_deg": {"measure.response": "flank"}}
    }
    (tmp_path / "network.json").write_text(json.dumps(made_with))
    files = study | {"network": tmp_path / "network.json"}
    other = GIVEN._replace(definitions={"aor_deg": {"measure.response": "secant"}})
    message = r"definition of aor_deg is .*flank.*secant.*as in my\.yaml"
    input_error(message, posterior_of, files, other, tmp_path, "my.yaml")


def test_a_restored_network_has_its_error_bars(study):
    table = pd.read_csv(study["dataset"])
    rows = train.split_samples(60, [0.7, 0.15, 0.15], 1)["train"]
    X = table[list(PARAMETERS)].to_numpy()
    Y = table[["aor_deg", "height_mm"]].to_numpy()
    metrics = json.loads(study["metrics"].read_text())
    assert metrics["prior"] == "inputs"
    assert len(metrics["alpha"]) == 8
    covariance = np.array(metrics["noise_covariance"])
    assert covariance == pytest.approx(np.diag([0.25, 1.0]), abs=0.25)
    trained = BayesianBP(
        hidden=3, epochs=200, goal=0.0, starts=3, seed=1, prior="inputs"
    )
    noise = {"noise_covariance": covariance, "noise_freedom": metrics["noise_freedom"]}
    trained.fit(X[rows], Y[rows], precision=table["n_seeds"].to_numpy()[rows], **noise)
    again = train.restore_surrogate(
        *(study[key] for key in ("network", "predictions", "dataset"))
    )
    for noise in (True, False):
        expected = trained.predict(X, return_std=True, noise=noise)
        found = again.predict(X, return_std=True, noise=noise)
        assert found[0] == pytest.approx(expected[0], rel=1e-9)
        assert found[1] == pytest.approx(expected[1], rel=1e-5)
    covariance = again.covariance(X)
    assert np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)) == pytest.approx(found[1])
    assert (np.linalg.det(covariance) > 0).all()


def correlated(value):
    return np.array([[1.0, value], [value, 1.0]])


def test_the_covariance_of_an_observation():
    mean, covariance = likelihood.make_observation(
        TARGETS, correlated(0.5), np.diag([0.36, 1.44])
    )
    assert mean.tolist() == [30.0, 60.0]
    # standard errors 1 and 2, discrepancies 0.6 and 1.2
    assert covariance == pytest.approx(np.array([[1 + 0.36, 1.0], [1.0, 4 + 1.44]]))
    singular = TARGETS, correlated(1.0), np.zeros((2, 2))
    value_error(
        "expected a positive definite matrix", likelihood.make_observation, *singular
    )
    targets = targets_of(aor_deg=30.0, height_mm=60.0, drum_slip_deg=40.0)
    assert targets.correlated(0.3).tolist() == [[1, 0.3, 0], [0.3, 1, 0], [0, 0, 1]]


def test_the_likelihood_is_a_normal_density_about_the_observation():
    mean, covariance = likelihood.make_observation(
        TARGETS, correlated(0.3), np.diag([0.36, 1.44])
    )
    responses = np.array([[29.0, 62.0], [33.0, 55.0]])
    weights = np.array([[[0.5, 0.1], [0.1, 0.7]], [[2.0, 0.0], [0.0, 3.0]]])
    found = likelihood.compute_log_likelihood(responses, weights, (mean, covariance))
    for k in range(2):
        known = stats.multivariate_normal(responses[k], covariance + weights[k]).logpdf(
            mean
        )
        assert found[k] == pytest.approx(known)


def test_the_misfit_has_the_probability_of_chi_squared():
    mean, covariance = likelihood.make_observation(TARGETS, np.eye(2), np.zeros((2, 2)))
    found = likelihood.compute_misfit(
        np.array([[32.0, 60.0], [31.0, 62.0]]), np.zeros((2, 2, 2)), (mean, covariance)
    )
    expected = {
        "squared_distance": pytest.approx(2),
        "p_value": pytest.approx(stats.chi2.sf(2, 2)),
    }
    assert found == expected
