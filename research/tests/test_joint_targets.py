"""Several tests at once: discrepancies, direct tests, widths and hidden truths on models with closed forms."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from scipy import stats

import repose.bench  # noqa: F401  (makes the responses known)
from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.targets import Targets
from research.responses import (
    discrepancies,
    further_runs,
    information,
    joint_targets,
    observables,
    responses_over_design,
)
from research.responses.offered import offered

SPACE = contact_space(dict.fromkeys(PARAMETERS, (0.0, 2.0)))
TARGETS = Targets.of(
    [
        {
            "response": "height_mm",
            "value": 60.0,
            "sd": 1.0,
            "repetitions": 4,
            "range": [55.0, 65.0],
        }
    ]
)
DIRECT = {"e_gp": {"sd": 0.1, "minutes": 30.0}, "mus_gp": {"sd": 0.1, "minutes": 60.0}}
SETTINGS = {
    "points": 2**13,
    "truths": 5,
    "folds": 2,
    "seed": 1,
    "surrogate": "quadratic",
    "minutes": {"pile": 5, "discharge": 20},
    "smallest_discrepancy": {"mm": 1.0},
    "direct_tests": DIRECT,
    "discrepancy_percent": 2.0,
    "discrepancy_correlation": 0.9,
    "most_tests": 2,
    "parameters": 2,
    "width_percent": 25.0,
    "hidden_truths": 90,
}


def test_a_small_response_has_the_smallest_discrepancy():
    names = ("loose_percent", "height_mm", "radius_90_mm")
    means = np.array([5.0, 60.0, -100.0])
    found = discrepancies.sizes(names, means, 2.0, {"%": 1.0, "mm": 1.5})
    # 0.1 % points and 1.2 mm would be less
    assert found == pytest.approx([1.0, 1.5, 2.0])
    # an exact simulator
    assert discrepancies.sizes(names, means, 0.0, {"%": 1.0}) == pytest.approx(0.0)
    percents = {"loose_percent": 40.0, "height_mm": 2.0, "radius_90_mm": 0.0}
    assert discrepancies.sizes(names, means, percents, {}) == pytest.approx(
        [2.0, 1.2, 0.0]
    )


def test_discrepancies_are_correlated_in_a_bench_test_with_the_signs_of_the_design():
    names = ("height_mm", "radius_90_mm", "flow_g_s", "packing_percent")
    steep = np.linspace(0, 1, 9)
    means = np.column_stack([60 + 9 * steep, 100 - 20 * steep, 5 * steep, 55 + steep])
    means[2, 2] = np.nan  # not all samples are run in every bench test
    sd = np.array([1.0, 2.0, 3.0, 4.0])
    found = discrepancies.covariance(names, sd, means, 0.9)
    expected = np.array(
        [[1, -1.8, 0, 3.6], [-1.8, 4, 0, -7.2], [0, 0, 9, 0], [3.6, -7.2, 0, 16]]
    )
    assert found == pytest.approx(expected)
    assert discrepancies.covariance(names, sd, means, 0.0) == pytest.approx(
        np.diag(sd**2)
    )


def test_a_direct_test_has_the_information_of_a_normal_posterior():
    tests = observables.tests_of(["height_mm"], np.eye(1), SPACE, SETTINGS)
    assert tests.columns == {"pile": [0], "direct e_gp": [1], "direct mus_gp": [2]}
    # places in a range of 2
    assert np.diag(tests.covariance) == pytest.approx([1.0, 0.05**2, 0.05**2])
    unit = stats.qmc.Sobol(6, rng=1).random(2**15)
    prior = information.Prior(unit, np.zeros((len(unit), 1)))
    observables.with_parameters(prior, [3, 4])
    observed = np.array([0.0, 0.5, 0.5])
    bits = prior.posterior(observed, tests.of(("direct e_gp",)), tests.covariance)[0]
    bits_of_one = -0.5 * math.log2(2 * math.pi * math.e * 0.05**2)
    assert bits == pytest.approx(bits_of_one, abs=0.02)
    both = prior.posterior(
        observed, tests.of(("direct e_gp", "direct mus_gp")), tests.covariance
    )[0]
    assert both == pytest.approx(2 * bits_of_one, abs=0.05)


def test_widths_of_a_linear_model_are_those_of_its_normal_posterior():
    unit = stats.qmc.Sobol(6, rng=1).random(2**14)
    prior = information.Prior(
        unit, np.column_stack([unit[:, 0], unit[:, 1] + unit[:, 2]])
    )
    covariance = np.diag([0.05, 0.05]) ** 2
    found = joint_targets.approximate_widths(prior, [0], covariance)
    # the prior of a place has the variance 1 / 12
    assert found[0] == pytest.approx(2 * 1.96 / math.sqrt(12 + 1 / 0.05**2), rel=1e-3)
    assert found[1:] == pytest.approx(0.95)
    assert joint_targets.merit(found, 1) == found[0]
    assert joint_targets.merit(found, 2) == pytest.approx(0.95)
    exact = prior.posterior(np.array([0.5, 1.0]), [0], covariance)[2] * prior.widths
    assert found[0] == pytest.approx(exact[0], rel=0.05)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """The Height follows e_gg, the rate of discharge mus_gg; other responses are noise."""
    folder = tmp_path_factory.mktemp("joint")
    random = np.random.default_rng(5)
    table = pd.DataFrame(random.uniform(0, 2, size=(90, 6)), columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(1, 91))
    table["status"] = "ok"
    table.to_csv(folder / "dataset.csv", index=False)
    place = table.loc[table.index.repeat(3), list(PARAMETERS)].to_numpy()
    runs = pd.DataFrame(
        {"sample": np.repeat(table["sample"], 3), "seed": 1, "status": "ok"}
    )
    for name in offered((), "secant"):
        runs[name] = 50 + random.normal(0, 1, 270)
    runs["height_mm"] = 50 + 10 * place[:, 0] + random.normal(0, 1.0, 270)
    runs.to_csv(folder / "runs.csv", index=False)
    jobs = folder / "discharge_runs"
    jobs.mkdir()
    for k in range(90):
        flow = 500.0 + 400.0 * table["mus_gg"][k] + random.normal(0, 10.0, 2)
        discharges = [
            {"status": "ok", "flow_g_s": rate, "emptying_s": random.normal(1, 0.01)}
            for rate in flow
        ]
        # it is no target
        discharges[0]["emptying_s"] = discharges[0]["emptying_s"] if k else None
        discharges.append({"status": "jammed", "flow_g_s": None, "emptying_s": None})
        (jobs / f"{k + 1:03d}.json").write_text(
            json.dumps({"apparatus": "discharge", "sample": k + 1, "runs": discharges})
        )
    (jobs / "001.pours.json").write_text("{}")  # beside every job
    whole = responses_over_design.read(
        folder / "runs.csv", folder / "dataset.csv", TARGETS, "secant"
    )
    samples = table["sample"].to_numpy()
    found = further_runs.read_jobs(further_runs.jobs_in([jobs]), samples)
    return further_runs.with_jobs(whole, samples, found)


def test_jobs_of_further_bench_tests_come_beside_the_pile(data):
    assert data.known["flow_g_s"].row["runs"] == 180  # a jam is no run
    assert data.known["emptying_s"].row["runs"] == 179
    untapped = pd.DataFrame(
        {
            "sample": [1, 1, 2],
            "bulk_density_kg_m3": [480.0, 500.0, 520.0],
            "tapped_density_kg_m3": np.nan,
        }
    )
    found = further_runs.with_jobs(data, np.arange(1, 91), {"cylinder": untapped})
    assert set(found.known) - set(data.known) == {"bulk_density_kg_m3"}
    assert data.known["flow_g_s"].row["sd_within"] == pytest.approx(10.0, rel=0.2)
    assert np.isfinite(data.known["flow_g_s"].mean).all()


def test_the_study_finds_which_tests_narrow_which_parameters(data, tmp_path):
    output = joint_targets.run(data, TARGETS, SPACE, SETTINGS, tmp_path)
    summary = json.loads((tmp_path / "joint.json").read_text())
    assert summary["modelled"] == ["height_mm", "flow_g_s"]
    tests = pd.read_csv(tmp_path / "tests.csv").set_index("set")
    assert tests.filter(regex="^width_[em]").loc["pile"].idxmin() == "width_e_gg"
    assert tests.filter(regex="^width_[em]").loc["discharge"].idxmin() == "width_mus_gg"
    expected = tests.loc["direct mus_gp", "bits"]
    assert tests.loc["direct e_gp", "bits"] == pytest.approx(expected, abs=0.3)
    # it is the target
    assert tests.loc["pile", "gain_bits"] == pytest.approx(0.0, abs=1e-9)
    # half the work for the same bits
    ratio = (
        tests.loc["direct e_gp", "bits_a_minute"]
        / tests.loc["direct mus_gp", "bits_a_minute"]
    )
    assert ratio == pytest.approx(2.0, rel=0.2)
    pairs = pd.read_csv(tmp_path / "pairs.csv").set_index("set")
    assert len(pairs) == 6
    pair = pairs.loc["direct e_gp + direct mus_gp"]
    assert pair["bits"] == pytest.approx(2 * tests.loc["direct e_gp", "bits"], rel=0.1)
    sets = pd.read_csv(tmp_path / "sets.csv")
    assert summary["met"]
    assert sets["narrow"].max() >= 2
    assert "hidden truths" in output


def test_intervals_hold_the_hidden_truths_of_a_model_that_is_right(data, tmp_path):
    wide = {"e_gp": {"sd": 0.4, "minutes": 30.0}}
    joint_targets.run(
        data,
        TARGETS,
        SPACE,
        SETTINGS | {"points": 2**14, "direct_tests": wide},
        tmp_path,
    )
    coverage = (
        pd.read_csv(tmp_path / "coverage.csv")
        .query("parameter == 'all'")
        .set_index("set")
    )
    assert (coverage["truths"] == 90).all()
    assert coverage["median_effective_points"].min() > 50
    assert coverage["coverage"].to_numpy() == pytest.approx(0.95, abs=0.03)


def test_too_few_points_are_reported(data, tmp_path):
    """A posterior that rests on a handful of points has intervals that are too narrow."""
    sharp = {name: {"sd": 0.03, "minutes": 30.0} for name in PARAMETERS}
    output = joint_targets.run(
        data,
        TARGETS,
        SPACE,
        SETTINGS | {"direct_tests": sharp, "most_tests": 1},
        tmp_path,
    )
    assert "FEW POINTS" in output
    assert "too narrow" in output


def test_bad_jobs_are_refused(tmp_path):
    input_error(r"NUMBER\.json", further_runs.jobs_in, [tmp_path])
    pile = tmp_path / "001.json"
    pile.write_text(json.dumps({"apparatus": "funnel", "sample": 1, "runs": []}))
    input_error(
        "another bench test than that of the pile",
        further_runs.read_jobs,
        [pile],
        np.array([1]),
    )
    other = tmp_path / "007.json"
    other.write_text(json.dumps({"apparatus": "turning", "sample": 7, "runs": []}))
    input_error(
        "a usable sample of the design", further_runs.read_jobs, [other], np.array([1])
    )
    other.write_text(
        json.dumps({"apparatus": "turning", "sample": 7, "runs": [{"status": "ok"}]})
    )
    input_error(
        "measured by the verb measure_runs",
        further_runs.read_jobs,
        [other],
        np.array([7]),
    )
