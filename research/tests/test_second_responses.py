"""Information of a further response: noise, surrogates and information on linear models with closed forms."""

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
from repose.common.errors import InputError
from repose.report.figures import style
from research.figures import second_look
from research.responses import (
    further_runs,
    information,
    response_sets,
    responses_over_design,
    second_responses,
)
from research.responses.__main__ import script
from research.responses.offered import offered

SPACE = contact_space(dict.fromkeys(PARAMETERS, (0.0, 1.0)))


def target(name, low, high, repetitions=4):
    value = (low + high) / 2
    return {
        "response": name,
        "value": value,
        "sd": 1.0,
        "repetitions": repetitions,
        "range": [low, high],
    }


ANGLE = target("aor_deg", 29.0, 31.0)
HEIGHT = target("height_mm", 58.0, 62.0)
TARGETS = Targets.of([ANGLE, HEIGHT])
SETTINGS = {
    "points": 2**13,
    "truths": 6,
    "folds": 2,
    "starts": 1,
    "seed": 1,
    "discrepancy_percent": 2.0,
    "hidden": 2,
    "epochs": 40,
    "smallest_discrepancy": {},
}
SETTINGS["minutes"] = {
    "profile": 5,
    "above": 10,
    "loose": 20,
    "packing": 20,
    "stopwatch": 5,
    "drum": 100,
}


def test_means_have_the_error_of_their_number_of_runs():
    groups = np.repeat([3, 1, 2], 130)
    values = groups * 10.0 + np.random.default_rng(1).normal(0, 2, 390)
    values[5] = np.nan
    known = responses_over_design.over_design(values, groups, np.array([1, 2, 3, 4]))
    assert known.mean[:3] == pytest.approx([10, 20, 30], abs=0.6)
    assert known.error[:3] == pytest.approx(2 / np.sqrt([130, 130, 129]), rel=0.1)
    assert np.isnan([known.mean[3], known.error[3]]).all()
    # sd 10 of 10, 20, 30, over 2
    assert known.row["signal_to_noise"] == pytest.approx(5, rel=0.1)


def test_noise_correlation_is_about_the_samples_means_and_none_with_the_drum():
    random = np.random.default_rng(2)
    shared = random.multivariate_normal([0, 0], [[1, 0.9], [0.9, 1]], size=4000)
    sample = np.repeat(np.arange(1000), 4)
    runs = pd.DataFrame(
        {
            "sample": sample,
            "aor_deg": shared[:, 0] - 9 * sample,
            "height_mm": shared[:, 1],
        }
    )
    found = responses_over_design.noise_correlation(
        runs, ["aor_deg", "drum_slip_deg", "height_mm"]
    )
    expected = np.array([[1, 0, 0.9], [0, 1, 0], [0.9, 0, 1]])
    assert found == pytest.approx(expected, abs=0.02)


def test_noise_of_two_bench_tests_comes_from_their_own_runs():
    random = np.random.default_rng(2)
    shared = random.multivariate_normal([0, 0], [[1, 0.7], [0.7, 1]], size=4000)
    sample = np.repeat(np.arange(1000), 4)
    nothing = np.full(4000, np.nan)
    pile = {
        "sample": sample,
        "aor_deg": shared[:, 0],
        "height_mm": shared[:, 1],
        "drum_slip_deg": nothing,
    }
    drum = {
        "sample": sample,
        "aor_deg": nothing,
        "height_mm": nothing,
        "drum_slip_deg": shared[:, 0],
    }
    runs = pd.concat([pd.DataFrame(pile), pd.DataFrame(drum)])
    found = responses_over_design.noise_correlation(
        runs, ["aor_deg", "height_mm", "drum_slip_deg"]
    )
    expected = np.array([[1, 0.7, 0], [0.7, 1, 0], [0, 0, 1]])
    assert found == pytest.approx(expected, abs=0.02)


def test_surrogates_error_is_what_the_noise_of_the_means_does_not_explain():
    random = np.random.default_rng(3)
    noise = np.array([[1, 0.8], [0.8, 1]])
    lack = np.array([[0.5, -0.2], [-0.2, 0.25]])
    residuals = random.multivariate_normal([0, 0], noise, 20_000)
    residuals += random.multivariate_normal([0, 0], lack, 20_000)
    errors = np.ones((20_000, 2))
    assert responses_over_design.surrogate_covariance(
        residuals, errors, noise
    ) == pytest.approx(lack, abs=0.05)
    nothing = responses_over_design.surrogate_covariance(residuals, 2 * errors, noise)
    assert (np.linalg.eigvalsh(nothing) > 0).all()


def test_information_of_a_linear_response_is_that_of_its_normal_posterior():
    """y = theta_1 with sd 0.05: entropy of the normal; a second response on theta_2 adds its own bits, no more."""
    unit = stats.qmc.Sobol(6, rng=1).random(2**16)
    prior = information.Prior(unit, unit[:, :3])
    covariance = np.diag([0.05, 0.02, 0.05]) ** 2
    observed = np.array([0.5, 0.5, 0.5])

    def bits(sd):
        return -0.5 * math.log2(2 * math.pi * math.e * sd**2)

    joint, bits_of, widths, effective = prior.posterior(observed, [0], covariance)
    assert joint == pytest.approx(bits(0.05), abs=0.02)
    assert bits_of[0] == pytest.approx(bits(0.05), abs=0.05)
    assert (bits_of[1:] < 0.01).all()
    assert widths[0] == pytest.approx(2 * 1.96 * 0.05 / 0.95, rel=0.03)
    assert widths[1:] == pytest.approx(1, abs=0.02)
    assert effective == pytest.approx(2**16 * 2 * math.sqrt(math.pi) * 0.05, rel=0.05)
    both = prior.posterior(observed, [0, 1], covariance)[0]
    assert both == pytest.approx(bits(0.05) + bits(0.02), abs=0.05)


def test_weights_and_bits_are_those_of_the_normal_density():
    random = np.random.default_rng(4)
    unit = random.uniform(size=(300, 6))
    covariance = np.array([[1.0, 0.5, 0.2], [0.5, 2.0, -0.3], [0.2, -0.3, 0.5]]) * 0.01
    prior = information.Prior(unit, unit[:, :3])
    observed = np.array([0.2, 0.5, 0.9])
    density = stats.multivariate_normal(
        observed[[0, 2]], covariance[np.ix_([0, 2], [0, 2])]
    )
    expected = density.pdf(unit[:, [0, 2]])
    expected /= expected.sum()
    weight = prior.weights(observed, [0, 2], covariance)
    assert weight == pytest.approx(expected)
    assert information.compute_joint_bits(weight) == pytest.approx(
        stats.entropy(expected, np.full(300, 1 / 300), 2)
    )
    assert information.compute_joint_bits(np.array([1.0, 0.0, 1e-300, 0.0])) == 2.0


def test_shared_noise_is_separated():
    """Two responses of one parameter each, noises of correlation 0.99: their difference is exact."""
    unit = stats.qmc.Sobol(6, rng=1).random(2**15)
    prior = information.Prior(unit, np.column_stack([unit[:, 0], np.zeros(len(unit))]))
    alone = 0.01 * np.array([[1, 0.0], [0.0, 1]])
    shared = 0.01 * np.array([[1, 0.99], [0.99, 1]])
    observed = np.array([0.5, 0.0])
    first = prior.posterior(observed, [0, 1], alone)[0]
    second = prior.posterior(observed, [0, 1], shared)[0]
    assert second - first == pytest.approx(-0.5 * math.log2(1 - 0.99**2), abs=0.2)


def test_a_normal_prior_counts_as_known():
    """A response that repeats the prior's width: half a bit, for the variance halves."""
    ranges = dict.fromkeys(PARAMETERS, (0.0, 1.0)) | {
        "mus_gg": {"prior": {"mean": 0.5, "sd": 0.05}, "range": [0, 1]}
    }
    space = contact_space(ranges)
    quantile = stats.qmc.Sobol(6, rng=1).random(2**15)
    place = information.places_of(space, quantile)
    expected = np.delete(quantile, 1, axis=1)
    assert np.delete(place, 1, axis=1) == pytest.approx(expected, abs=0)
    assert place[:, 1].std() == pytest.approx(0.05, rel=0.01)
    widths = information.prior_widths(space)
    expected = [0.95, 2 * 1.96 * 0.05, 0.95, 0.95, 0.95, 0.95]
    assert widths == pytest.approx(expected, rel=1e-3)
    prior = information.Prior(quantile, place, place, widths)
    joint, _, ratio, _ = prior.posterior(np.full(6, 0.5), [1], np.eye(6) * 0.05**2)
    # KL of N(m, s^2 / 2) from N(m, s^2), in bits
    expected = 0.5 * (math.log2(2) + (0.5 - 1) / math.log(2))
    assert joint == pytest.approx(expected, abs=0.02)
    assert ratio[1] == pytest.approx(math.sqrt(0.5), rel=0.02)


def test_sets_hold_the_base_and_the_drum_apart():
    names = ["aor_deg", "height_mm", "loose_percent", "drum_slip_deg"]
    sets = response_sets.sets_of(names, TARGETS.responses)
    assert list(sets)[:2] == ["AoR alone", "AoR and Height"]
    assert sets["AoR and Height"] == ("aor_deg", "height_mm")
    assert sets["whole pile"] == ("aor_deg", "height_mm", "loose_percent")
    assert sets["pile and other bench tests"] == tuple(names)
    assert "pile and other bench tests" not in response_sets.sets_of(
        names[:3], TARGETS.responses
    )


def test_sets_of_one_and_of_three_targets():
    height = Targets.of([HEIGHT]).responses
    assert list(response_sets.sets_of(["height_mm", "loose_percent"], height)) == [
        "Height",
        "loose_percent",
        "whole pile",
    ]
    three = Targets.of([ANGLE, HEIGHT, target("drum_slip_deg", 30, 50)]).responses
    assert response_sets.base_label(three) == "AoR, Height and slip"


def test_means_share_the_repetitions_of_the_one_measured_less_often():
    targets = Targets.of(
        [
            target("aor_deg", 0, 1, repetitions=4),
            target("height_mm", 0, 1, repetitions=9),
        ]
    )
    names = ["aor_deg", "height_mm", "loose_percent"]
    known = {
        name: responses_over_design.Known(None, None, {"sd_within": sd, "mean": 50.0})
        for name, sd in zip(names, (2.0, 3.0, 1.0), strict=True)
    }
    correlation = np.full((3, 3), 0.5) + 0.5 * np.eye(3)
    model = second_responses.Modelled(names, {}, correlation, np.zeros((3, 3)))
    data = responses_over_design.Data(None, known, None)
    found = second_responses.observed_covariance(data, model, targets, 2.0)
    expected = np.array(
        [[1 + 1, 3 / 9, 1 / 4], [3 / 9, 1 + 1, 1.5 / 9], [1 / 4, 1.5 / 9, 1 / 4 + 1]]
    )
    assert found == pytest.approx(expected)
    expected[2, 2] = 1 / 4 + 25
    found = second_responses.observed_covariance(
        data, model, targets, 2.0, {"loose_percent": 10.0}
    )
    assert found == pytest.approx(expected)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """AoR and Height follow the first two parameters; packing the third; loose berries nothing at all."""
    folder = tmp_path_factory.mktemp("study")
    random = np.random.default_rng(5)
    table = pd.DataFrame(random.uniform(size=(40, 6)), columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(1, 41))
    table["status"] = "ok"
    table.to_csv(folder / "dataset.csv", index=False)
    place = table.loc[table.index.repeat(3), list(PARAMETERS)].to_numpy()
    runs = pd.DataFrame(
        {"sample": np.repeat(table["sample"], 3), "seed": 1, "status": "ok"}
    )
    for name in offered((), "secant"):
        runs[name] = 50 + random.normal(0, 1, 120)
    runs["aor_deg"] = 25 + 10 * place[:, 0] + random.normal(0, 0.5, 120)
    runs["height_mm"] = 50 + 20 * place[:, 1] + random.normal(0, 1.0, 120)
    runs["packing_percent"] = 50 + 20 * place[:, 2] + random.normal(0, 1.0, 120)
    runs.to_csv(folder / "runs.csv", index=False)
    drum = folder / "drum_runs"
    drum.mkdir()
    for k in range(0, 40, 2):
        slips = 40 + 10 * table["e_gp"][k] + random.normal(0, 1, 2)
        made = [
            {"status": "ok", "drum_slip_deg": slip, "drum_rest_deg": slip - 5}
            for slip in slips
        ]
        job = {"apparatus": "drum", "sample": k + 1, "runs": made}
        (drum / f"{k + 1:03d}.json").write_text(json.dumps(job))
    return (folder / "runs.csv", folder / "dataset.csv"), drum


def test_study_finds_the_response_that_adds_information(study, tmp_path):
    files, drum = study
    data = further_runs.read(*files, TARGETS, "secant", [drum])
    assert "packing" in second_responses.run(data, TARGETS, SPACE, SETTINGS, tmp_path)
    summary = json.loads((tmp_path / "responses.json").read_text())
    assert summary["modelled"][:3] == ["aor_deg", "height_mm", "packing_percent"]
    assert "loose_percent" in summary["left_out"]
    information = pd.read_csv(tmp_path / "information.csv")
    exact = information[information["discrepancy_percent"] == 0].set_index("set")
    assert exact.loc["packing_percent", "gain_bits"] > 1
    # nothing is added by the discrepancy
    loose = information[information["discrepancy_percent"] == 2].set_index("set")
    assert (loose["bits"] < exact["bits"]).all()
    narrowing = pd.read_csv(tmp_path / "narrowing.csv").query(
        "discrepancy_percent == 0"
    )
    ratio = narrowing.pivot(index="set", columns="parameter", values="over_base")
    assert ratio.loc["packing_percent", "mur_gg"] < 0.5
    assert ratio.loc[
        "packing_percent", ["e_gg", "mus_gg", "mus_gp"]
    ].to_numpy() == pytest.approx(1, abs=0.2)
    assert ratio.loc["drum_slip_deg"].idxmin() == "e_gp"
    order = pd.read_csv(tmp_path / "order.csv").query("discrepancy_percent == 0")
    best = order.iloc[0]["response"]
    assert best == "packing_percent" or best.startswith("drum")
    ways = (
        pd.read_csv(tmp_path / "ways.csv")
        .query("discrepancy_percent == 0")
        .set_index("way")
    )
    assert set(ways.index) == {"packing", "drum"}
    packing = ways.loc["packing"]
    expected = exact.loc["packing_percent", "gain_bits"]
    assert packing["gain_bits"] == pytest.approx(expected)
    assert packing["bits_a_minute"] == pytest.approx(packing["gain_bits"] / 20)
    table = pd.read_csv(tmp_path / "responses.csv").set_index("response")
    assert table.loc["packing_percent", "r2_noise_corrected"] > 0.9
    assert table.loc["drum_slip_deg", "samples"] == 20


def test_a_discrepancy_of_its_own_lowers_the_gain_of_that_response_alone(study):
    files, _ = study
    data = responses_over_design.read(*files, TARGETS, "secant")
    found = {}
    for percent in (2.0, 50.0):
        settings = SETTINGS | {"discrepancies": {"packing_percent": percent}}
        tables, summary = second_responses.study(data, TARGETS, SPACE, settings)
        assert summary["discrepancies"] == {"packing_percent": percent}
        found[percent] = tables["information"].set_index(
            ["discrepancy_percent", "set"]
        )["bits"]
    # the exact simulator, and sets without the response, are the same
    assert found[2.0][0.0].to_dict() == found[50.0][0.0].to_dict()
    assert found[2.0][2.0, "AoR and Height"] == found[50.0][2.0, "AoR and Height"]
    base = found[2.0][2.0, "AoR and Height"]
    assert found[2.0][2.0, "packing_percent"] > base + 1
    assert found[50.0][2.0, "packing_percent"] == pytest.approx(base, abs=0.1)


@pytest.mark.parametrize(
    ("entry", "allowed"),
    [
        ("packing=10", "a response of aor_deg, height_mm"),
        ("packing_percent=much", "a number from 0 to 100"),
        ("packing_percent=101", "a number from 0 to 100"),
        ("packing_percent", "a number from 0 to 100"),
    ],
)
def test_the_script_refuses_a_discrepancy_of_no_response_or_no_share(
    study, entry, allowed, tmp_path, capsys
):
    (runs, dataset), _ = study
    arguments = [
        "second",
        "--config",
        "config/quick.yaml",
        "--runs",
        str(runs),
        "--dataset",
        str(dataset),
    ]
    with pytest.raises(SystemExit):
        script.run(
            [*arguments, "--discrepancy", entry, "--out", str(tmp_path / "none")]
        )
    assert allowed in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    "names", [["height_mm"], ["aor_deg", "height_mm", "packing_percent", "upper_deg"]]
)
def test_study_with_one_target_and_with_four(study, tmp_path, names):
    files, _ = study
    wide = {
        "packing_percent": target("packing_percent", 55, 65),
        "upper_deg": target("upper_deg", 40, 60),
    }
    targets = Targets.of(
        [{"aor_deg": ANGLE, "height_mm": HEIGHT, **wide}[name] for name in names]
    )
    data = responses_over_design.read(*files, targets, "secant")
    assert tuple(data.known)[: len(names)] == targets.names
    second_responses.run(data, targets, SPACE, SETTINGS, tmp_path)
    found = pd.read_csv(tmp_path / "information.csv")
    label = response_sets.base_label(targets.responses)
    assert label in set(found["set"])
    first = found[found["discrepancy_percent"] == 0].set_index("set")
    assert first.loc[label, "gain_bits"] == 0
    if len(names) == 1:
        assert first.loc["packing_percent", "gain_bits"] > 1
    inputs = {
        name: tmp_path / f"{name}.csv"
        for name in ("responses", "information", "narrowing", "ways")
    }
    config = {
        "targets": [
            {
                "response": target.name,
                "value": target.value,
                "sd": target.sd,
                "repetitions": 4,
            }
            | {"range": [target.low, target.high]}
            for target in targets
        ]
    }
    with style.applied():
        figure = second_look.what_to_measure_next(inputs, config)
    assert figure.axes[0].get_xlabel() == f"bits gained beside {label}"


def test_work_that_is_not_said_is_asked_for(study):
    files, _ = study
    data = responses_over_design.read(*files, TARGETS, "secant")
    with pytest.raises(InputError, match="minutes of work for packing"):
        second_responses.study(
            data, TARGETS, SPACE, SETTINGS | {"minutes": {"drum": 1.0}}
        )


def test_drum_of_another_design_and_a_target_out_of_reach_are_refused(study, tmp_path):
    files, _ = study
    (tmp_path / "999.json").write_text(
        json.dumps({"apparatus": "drum", "sample": 999, "runs": []})
    )
    input_error("999", further_runs.read, *files, TARGETS, "secant", [tmp_path])
    unreachable = Targets.of([target("aor_deg", 80, 81), HEIGHT])
    data = responses_over_design.read(*files, unreachable, "secant")
    input_error(
        "feasible points", second_responses.study, data, unreachable, SPACE, SETTINGS
    )
