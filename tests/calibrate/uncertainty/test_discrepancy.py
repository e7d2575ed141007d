"""The discrepancy of the model, and the noise of its runs."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from refusals import input_error, value_error
from shared import ROOT, TARGETS, targets_of

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty import discrepancy, implausibility, noise
from repose.calibrate.uncertainty.likelihood import make_observation
from repose.calibrate.variance import variance_components
from repose.stages import next_measurement

PILE = targets_of(aor_deg=30.0, height_mm=60.0)
OWN = {"slope": 30.0, "time": 4.0}
SPACE = contact_space({name: [0.0, 1.0] for name in PARAMETERS})
TWO = Targets.of(TARGETS)
FOUR = targets_of(
    aor_deg=32.0, height_mm=64.0, base_radius_mm=110.0, drum_slip_deg=40.0
)


def design(*slopes):
    """Runs of ten samples along one line; each response follows it with its slope."""
    along = np.repeat(np.arange(10.0), 2)
    table = pd.DataFrame(
        {"sample": along, "aor_deg": slopes[0] * along, "height_mm": slopes[1] * along}
    )
    return table.assign(drum_slip_deg=along)


def combinations(folder, differences, errors=(0.0, 0.0), eligible=True, distance=1.0):
    table = pd.DataFrame(
        differences, columns=["aor_difference_deg", "height_difference_mm"]
    )
    table = table.assign(
        aor_se_deg=errors[0],
        height_se_mm=errors[1],
        eligible=eligible,
        distance=distance,
    )
    table = table.assign(particle=range(len(table)), tension="keep", filling="open")
    table.to_csv(folder / "combinations.csv", index=False)
    return folder / "combinations.csv"


def test_a_stated_discrepancy_is_a_share_of_each_target():
    targets = targets_of(aor_deg=30.0, height_mm=60.0, drum_slip_deg=40.0)
    found = discrepancy.compute_stated_covariance(targets, design(1.0, 2.0), 10.0, 0.9)
    assert found == pytest.approx(np.array([[9, 16.2, 0], [16.2, 36, 0], [0, 0, 16]]))
    assert discrepancy.compute_stated_covariance(targets, design(1.0, -2.0), 10.0, 0.9)[
        0, 1
    ] == pytest.approx(-16.2)


def test_the_discrepancy_is_the_spread_of_a_shape_study(tmp_path):
    random = np.random.default_rng(1)
    known = np.array([[9.0, 12.0], [12.0, 25.0]])
    models = random.multivariate_normal([-3, 5], known, 4000) + random.normal(
        size=(4000, 2)
    ) * [0.5, 2.0]
    outliers = random.normal(100, 50, (50, 2))
    path = combinations(
        tmp_path, np.vstack([models, outliers]), (0.5, 2.0), np.arange(4050) < 4000
    )
    result = discrepancy.estimate_from_shape_study(path, PILE)
    assert result.models == pytest.approx(4000)
    assert result.mean == pytest.approx([-3, 5], abs=0.2)
    found = result.covariance
    assert np.sqrt(np.diag(found)) == pytest.approx([3, 5], rel=0.05)
    raw = known + np.diag([0.25, 4.0])
    correlation = found[0, 1] / np.sqrt(found[0, 0] * found[1, 1])
    assert correlation == pytest.approx(12 / np.sqrt(raw[0, 0] * raw[1, 1]), abs=0.03)
    assert discrepancy.estimate_from_shape_study(
        path, targets_of(height_mm=60.0)
    ).covariance == pytest.approx(found[1:, 1:])


def test_a_model_counts_by_its_piles(tmp_path):
    values = np.repeat([0.0, 2.0, 40.0], [5, 5, 10])
    path = combinations(
        tmp_path, np.column_stack([values, values]), distance=np.repeat([0.0, 4.0], 10)
    )
    result = discrepancy.estimate_from_shape_study(path, PILE)
    share = np.exp(-8.0)
    mean = (1 + 40 * share) / (1 + share)
    assert result.mean == pytest.approx([mean, mean])
    assert result.models == pytest.approx(10 * (1 + share) ** 2 / (1 + share**2))
    spread = (((0 - mean) ** 2 + (2 - mean) ** 2) / 2 + share * (40 - mean) ** 2) / (
        1 + share
    )
    assert result.covariance[0, 0] == pytest.approx(spread / (1 - 1 / result.models))
    table = pd.read_csv(path)
    pd.concat([table, table]).to_csv(path, index=False)
    assert discrepancy.estimate_from_shape_study(path, PILE).models == pytest.approx(
        result.models
    )


def test_a_study_that_says_too_little_is_refused(tmp_path):
    values = np.repeat([0.0, 2.0, 40.0], [5, 5, 10])
    path = combinations(
        tmp_path, np.column_stack([values, values]), distance=np.repeat([0.0, 4.0], 10)
    )
    pd.read_csv(path).assign(aor_se_deg=50.0).to_csv(path, index=False)
    input_error(
        r"aor_difference_deg is 'of variance .*above 2500, of its errors",
        discrepancy.estimate_from_shape_study,
        path,
        PILE,
    )
    few = combinations(tmp_path, np.ones((6, 2)), eligible=[True] * 4 + [False] * 2)
    message = r"combinations.csv: eligible is '4.0 models.*'; expected at least 5"
    input_error(message, discrepancy.estimate_from_shape_study, few, PILE)
    input_error(
        "drum_slip_difference_deg",
        discrepancy.estimate_from_shape_study,
        few,
        targets_of(drum_slip_deg=40.0),
    )


@pytest.mark.parametrize(
    ("column", "value", "allowed"),
    [
        ("eligible", "yes", "True or False"),
        ("eligible", "", "True or False"),
        ("distance", "far", "a number from 0"),
        ("distance", -1.0, "a number from 0"),
        ("aor_se_deg", -1000.0, "a number from 0"),
        ("aor_difference_deg", "inf", "a finite number"),
        ("height_difference_mm", "much", "a finite number"),
    ],
)
def test_a_cell_that_cannot_be_is_refused_with_its_row(
    tmp_path, column, value, allowed
):
    path = combinations(tmp_path, np.arange(40.0).reshape(20, 2))
    table = pd.read_csv(path, dtype=str)
    table.loc[2, column] = str(value)
    table.to_csv(path, index=False)
    input_error(
        rf"row 3: {column} is .*{allowed}",
        discrepancy.estimate_from_shape_study,
        path,
        PILE,
    )


def test_the_published_study_has_a_discrepancy_and_so_have_responses_of_a_users_simulator():
    published = ROOT / "results" / "published" / "shape_study" / "combinations.csv"
    expected = published.read_bytes()
    assert ((ROOT / "resources" / "shape_study.csv").read_bytes()) == expected
    content = {
        "simulator": "mine",
        "label": "own",
        "seed": 1,
        "parameters": {"friction": [0.2, 0.8]},
    }
    content["targets"] = {
        name: {"value": value, "sd": 1.0, "repetitions": 5}
        for name, value in OWN.items()
    }
    study_targets = Study.own(content).targets
    runs = pd.DataFrame(
        {"sample": [1, 2, 3], "slope": [29.0, 30.0, 31.0], "time": [3.0, 4.0, 5.0]}
    )
    found = discrepancy.compute_stated_covariance(study_targets, runs, 10.0, 0.5)
    expected = np.array([[9.0, 0.5 * 3.0 * 0.4], [0.5 * 3.0 * 0.4, 0.16]])
    assert found == pytest.approx(expected)


class Linear:
    """Responses that each follow one parameter, known without error."""

    def __init__(self, *slopes):
        self.slopes = np.array(slopes)

    def predict(self, X):
        return 40 + X[:, : len(self.slopes)] * self.slopes

    def covariance(self, X):
        return np.zeros((len(X), len(self.slopes), len(self.slopes)))


def observed(targets):
    runs = pd.DataFrame(
        {"sample": [1, 2, 3]} | {name: [1.0, 2.0, 3.0] for name in targets.names}
    )

    def of(percent, between=0.0):
        return make_observation(
            targets,
            np.eye(len(targets)),
            discrepancy.compute_stated_covariance(targets, runs, percent, between),
        )

    return of


def curve_of(model, targets, study=None):
    points = implausibility.PriorPoints(model, SPACE)
    return points, implausibility.compute_information_curve(
        points, targets, observed(targets), study
    )


def test_bits_and_interval_by_hand():
    """One response with slope 40 in one parameter: its sd is that of the response over 40, the bits those of a normal."""
    targets = targets_of(height_mm=60.0)
    _, table = curve_of(Linear(40.0), targets)
    assert table["discrepancy_percent"].tolist() == list(implausibility.STATED_PERCENTS)
    assert (np.diff(table["information_bits"]) < 0).all()
    for row in table.iloc[:3].itertuples():
        discrepancy = row.discrepancy_percent / 100 * 60
        sd = math.hypot(targets.standard_error[0], discrepancy) / 40
        bits = -math.log2(sd * math.sqrt(2 * math.pi * math.e))
        assert row.information_bits == pytest.approx(bits, abs=0.01)
        first = PARAMETERS[0]
        assert getattr(row, f"{first}_low") == pytest.approx(0.5 - 1.96 * sd, abs=0.005)
        expected = 0.5 + 1.96 * sd
        assert getattr(row, f"{first}_high") == pytest.approx(expected, abs=0.005)
        assert getattr(row, f"{first}_bits") == pytest.approx(bits, abs=0.1)
        assert getattr(row, f"{PARAMETERS[1]}_bits") < 0.02


def test_a_correlated_discrepancy_leaves_the_contrast():
    """Where two responses are wrong together, their difference still tells something."""
    targets = targets_of(aor_deg=30.0, height_mm=60.0)
    _, table = curve_of(Linear(20.0, 40.0), targets)
    bits = table.pivot(
        index="discrepancy_percent",
        columns="discrepancy_correlation",
        values="information_bits",
    )
    assert bits.loc[0.0, 0.0] == pytest.approx(bits.loc[0.0, 0.9])
    assert bits.loc[10.0, 0.9] > bits.loc[10.0, 0.0] + 0.5
    _, table = curve_of(Linear(20.0, 40.0), targets, observed(targets)(5.0, 0.9))
    is_stated = table["discrepancy_percent"] == 5.0
    is_stated &= table["discrepancy_correlation"] == 0.9
    stated = table[is_stated].iloc[0]
    study = table.iloc[-1]
    assert study["evidence"] == "shape study"
    assert stated["evidence"] == "stated"
    # the shape study found what is stated in the other row
    known = stated.drop("evidence").astype(float).to_numpy()
    assert study.drop("evidence").astype(float).to_numpy() == pytest.approx(known)


def test_the_region_is_where_the_response_is_within_three_standard_deviations():
    targets = targets_of(height_mm=60.0)
    points = implausibility.PriorPoints(Linear(40.0), SPACE)
    mean, covariance = observed(targets)(2.0)
    share, table = implausibility.find_region(
        points, implausibility.compute_implausibility(points, mean, covariance)
    )
    half = 3 * math.sqrt(covariance[0, 0]) / 40
    assert share == pytest.approx(2 * half, abs=0.002)
    assert len(table) == 15 * implausibility.N_CELLS**2
    pair = table[(table["x"] == PARAMETERS[0]) & (table["y"] == PARAMETERS[1])]
    outside = (pair["x_quantile"] - 0.5).abs() > half + 1 / implausibility.N_CELLS
    assert (pair.loc[outside, "share"] == 0).all()
    assert (pair.loc[outside, "least_implausibility"] > 3).all()
    others = table[(table["x"] == PARAMETERS[2]) & (table["y"] == PARAMETERS[3])]
    assert others["share"].to_numpy() == pytest.approx(share, abs=0.15)


def made_up_runs(seeds=4, samples=30):
    random = np.random.default_rng(1)
    count = samples * seeds
    runs = pd.DataFrame(
        {
            "sample": np.repeat(np.arange(1, samples + 1), seeds),
            "seed": np.arange(count),
        }
    )
    runs["status"] = "ok"
    runs["apparatus"] = "funnel"
    runs["aor_deg"] = (
        25 + np.repeat(random.normal(size=samples), seeds) + random.normal(size=count)
    )
    runs["height_mm"] = 2 * runs["aor_deg"] + random.normal(size=count)
    runs["base_radius_mm"] = 150 - runs["aor_deg"] + 2 * random.normal(size=count)
    failed = ["status", "aor_deg", "height_mm", "base_radius_mm"]
    runs.loc[[0, 1, 2, 3], failed] = ["jammed", np.nan, np.nan, np.nan]
    other = runs[["sample", "seed"]].assign(status="ok", apparatus="drum")
    other["drum_slip_deg"] = 40 + 3 * random.normal(size=count)
    return pd.concat([runs, other], ignore_index=True)


def write_runs(folder, seeds=4):
    runs = made_up_runs(seeds)
    runs[runs["apparatus"] == "funnel"].to_csv(folder / "runs.csv", index=False)
    return folder / "runs.csv"


def test_tables_of_a_study_with_failed_pours(tmp_path):
    summary = noise.write_noise_floor(write_runs(tmp_path), TWO, tmp_path / "out")
    row = pd.read_csv(tmp_path / "out/noise.csv").iloc[0]
    assert row["samples"] == 29
    assert row["runs"] == 116
    assert row["failed_runs"] == 4
    assert row["samples_without_runs"] == 1
    seeds = pd.read_csv(tmp_path / "out/seeds.csv")
    assert seeds["seeds"].tolist() == list(range(1, 65))
    assert seeds["aor_se_deg"][3] == pytest.approx(row["sd_within"] / 2)
    assert seeds["aor_reachable_r2"][0] == pytest.approx(row["icc"])
    assert (
        100 * seeds["aor_se_deg"] / seeds["aor_se_percent"]
    ).to_numpy() == pytest.approx(TWO[0].value)
    assert (
        seeds["aor_se_percent"][row["seeds_for_1_percent"] - 1]
        <= 1
        < seeds["aor_se_percent"][0]
    )
    assert json.loads((tmp_path / "out/noise.json").read_text()) == summary
    # height is twice the angle plus noise of one: 2 / sqrt(5)
    assert (
        summary["correlation"]["low"] < 2 / np.sqrt(5) < summary["correlation"]["high"]
    )


def test_the_verb_writes_the_tables(tmp_path, command):
    arguments = [
        "--runs",
        write_runs(tmp_path),
        "--config",
        "config/quick.yaml",
        "--out",
        tmp_path / "verb",
    ]
    assert "height_mm: sd 2." in command("noise", *arguments).out
    assert len(pd.read_csv(tmp_path / "verb/seeds.csv")) == 64


def test_targets_of_one_bench_test_alone_have_correlations():
    found = noise.compute_noise_floor(made_up_runs(), targets_of(drum_slip_deg=40.0))
    reachable = [f"drum_slip_reachable_r2{end}" for end in ("", "_low", "_high")]
    expected = [
        "seeds",
        "drum_slip_se_deg",
        "drum_slip_se_percent",
        *reachable,
    ]
    assert list(found.seeds.columns) == expected
    assert found.responses["sd_within"][0] == pytest.approx(3, rel=0.2)
    assert found.responses["failed_runs"][0] == 0, (
        "runs of the other bench test do not count"
    )
    assert found.summary["correlation"] == {}
    matrix, pairs = noise.estimate_within_correlation(made_up_runs(), FOUR)
    assert list(pairs) == [
        "aor_deg, height_mm",
        "aor_deg, base_radius_mm",
        "height_mm, base_radius_mm",
    ]
    expected = np.array([[1, 0.89, -0.45], [0.89, 1, -0.4], [-0.45, -0.4, 1]])
    assert matrix[:3, :3] == pytest.approx(expected, abs=0.15)
    assert matrix[3].tolist() == [0, 0, 0, 1]
    assert (np.linalg.eigvalsh(matrix) > 0).all()
    assert len(noise.compute_noise_floor(made_up_runs(), FOUR).responses) == 4


def test_too_few_runs_are_refused(tmp_path):
    input_error(
        r"runs per sample is 1; expected at least two samples",
        noise.write_noise_floor,
        write_runs(tmp_path, 1),
        TWO,
        tmp_path / "out",
    )
    made_up_runs(2, 4).query("apparatus == 'funnel'").to_csv(
        tmp_path / "runs.csv", index=False
    )
    few = r"runs\.csv: runs is '2 degrees of freedom within samples"
    input_error(
        few, noise.write_noise_floor, tmp_path / "runs.csv", TWO, tmp_path / "out"
    )
    input_error(
        "4 sets or more with two runs",
        next_measurement.rank_responses,
        made_up(1.0, 1.0, sets=3),
        10,
        2.0,
    )


def made_up(
    between, within, sets=16, runs=2, seed=0, response="turning_deg", mean=40.0
):
    """Runs of a response whose sets differ by `between` and whose runs scatter by `within` (standard deviations)."""
    random = np.random.default_rng(seed)
    value = (
        mean
        + np.repeat(between * random.normal(size=sets), runs)
        + within * random.normal(size=sets * runs)
    )
    sample = np.repeat(np.arange(1, sets + 1), runs)
    return pd.DataFrame(
        {"apparatus": "turning", "sample": sample, "response": response, "value": value}
    )


@pytest.mark.parametrize(
    ("between", "within", "percent"),
    [(1.0, 0.5, 0.0), (0.3, 1.0, 0.0), (1.0, 0.5, 2.0)],
)
def test_bits_of_known_variances(between, within, percent):
    """A measurement of 10 runs brings 0.5 log2(1 + signal / noise) bits; the mean response is 40."""
    noise = within**2 / 10 + (percent / 100 * 40) ** 2
    known = 0.5 * np.log2(1 + between**2 / noise)
    runs = [made_up(between, within, sets=64, seed=k) for k in range(100)]
    rows = [
        next_measurement.rank_responses(pours, 10, percent).iloc[0] for pours in runs
    ]
    bits = np.array([row.bits for row in rows])
    assert bits.mean() == pytest.approx(known, abs=3 * bits.std() / 10 + 0.02 * known)
    # the interval is exact without a discrepancy
    if percent == 0.0:
        covered = np.mean([row.bits_low <= known <= row.bits_high for row in rows])
        assert covered == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 100))


def test_bits_of_the_next_measurement_by_hand():
    runs = made_up(1.0, 0.5)
    parts = variance_components(runs["value"], runs["sample"])
    signal = parts.within * parts.icc / (1 - parts.icc)
    noise = parts.within / 10 + (0.2 * parts.mean) ** 2
    bits = next_measurement.rank_responses(runs, 10, 20.0)["bits"].iloc[0]
    assert bits == pytest.approx(0.5 * np.log2(1 + signal / noise), rel=1e-9)


def test_the_most_informative_measurement_is_first():
    runs = [
        made_up(0.0, 1.0, response="flow_g_s"),
        made_up(2.0, 0.5),
        made_up(0, 0, response="emptying_s"),
    ]
    table = next_measurement.rank_responses(pd.concat(runs), 10, 0.0)
    # a constant response is left out
    assert list(table["response"]) == [
        "turning_deg",
        "flow_g_s",
    ]
    assert table["bits_low"].iloc[1] == 0.0


def test_plausible_sets_are_draws_of_the_posterior(tmp_path):
    draws = pd.DataFrame(
        np.random.default_rng(1).random((50, 6)), columns=list(PARAMETERS)
    )
    draws.to_csv(tmp_path / "draws.csv", index=False)
    samples = next_measurement.draw_plausible_sets(
        tmp_path / "draws.csv", 3, tmp_path / "samples.csv"
    )
    assert list(samples.columns) == ["sample", *PARAMETERS]
    assert len(samples) == next_measurement.N_PLAUSIBLE_SETS
    for values in pd.read_csv(tmp_path / "samples.csv")[list(PARAMETERS)].to_numpy():
        assert np.isclose(draws.to_numpy(), values, rtol=1e-9).all(axis=1).sum() == 1
    draws[:3].to_csv(tmp_path / "draws.csv", index=False)
    files = tmp_path / "draws.csv", 3, tmp_path / "samples.csv"
    input_error(
        "rows is 3; expected 16 or more", next_measurement.draw_plausible_sets, *files
    )


@pytest.mark.parametrize(
    ("values", "groups", "message"),
    [
        ([[1.0, 2.0]], [[1, 1]], r"values has shape \(1, 2\), groups \(1, 2\)"),
        ([1.0, 2.0], [1], r"values has shape \(2,\), groups \(1,\)"),
        ([1.0, np.inf], [1, 1], "values must be finite"),
    ],
)
def test_components_of_variance_need_a_group_for_each_finite_value(
    values, groups, message
):
    value_error(message, variance_components, values, groups)
