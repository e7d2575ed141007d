"""The noise of a study, and what to measure next."""

import json

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from shared import TARGETS, targets_of

from repose.cli import main
from repose.core import places
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.core.targets import Targets
from repose.core.variance import variance_components
from repose.studies import next_measurement, noise

TWO = Targets.of(TARGETS)
FOUR = targets_of(aor_deg=32.0, height_mm=64.0, base_radius_mm=110.0, drum_slip_deg=40.0)


def made_up_runs(seeds=4, samples=30):
    random = np.random.default_rng(1)
    count = samples * seeds
    runs = pd.DataFrame({"sample": np.repeat(np.arange(1, samples + 1), seeds), "seed": np.arange(count)})
    runs["status"], runs["apparatus"] = "ok", "funnel"
    runs["aor_deg"] = 25 + np.repeat(random.normal(size=samples), seeds) + random.normal(size=count)
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


def test_tables_of_a_study_with_failed_pours_by_function_and_verb(tmp_path, capsys):
    summary = noise.run(write_runs(tmp_path), TWO, tmp_path / "out")
    row = pd.read_csv(tmp_path / "out/noise.csv").iloc[0]
    assert (row["samples"], row["runs"], row["failed_runs"], row["samples_without_runs"]) == (29, 116, 4, 1)
    seeds = pd.read_csv(tmp_path / "out/seeds.csv")
    assert seeds["seeds"].tolist() == list(range(1, 65))
    assert seeds["aor_se_deg"][3] == pytest.approx(row["sd_within"] / 2)
    assert seeds["aor_reachable_r2"][0] == pytest.approx(row["icc"])
    assert seeds["aor_se_percent"][row["seeds_for_1_percent"] - 1] <= 1 < seeds["aor_se_percent"][0]
    assert json.loads((tmp_path / "out/noise.json").read_text()) == summary
    assert "height_mm: sd 2." in noise.message(summary, TWO)
    # height is twice the angle plus noise of one: 2 / sqrt(5)
    assert summary["correlation"]["low"] < 2 / np.sqrt(5) < summary["correlation"]["high"]
    out = tmp_path / "verb"
    words = ["--config", str(places.root() / "config/quick.yaml"), "--out", str(out)]
    assert main(["noise", "--runs", str(write_runs(tmp_path)), *words]) == 0
    assert "height_mm: sd 2." in capsys.readouterr().out
    assert len(pd.read_csv(out / "seeds.csv")) == 64


def test_one_target_has_no_correlation():
    one = targets_of(drum_slip_deg=40.0)
    found = noise.noise_floor(made_up_runs(), one)
    reachable = [f"drum_slip_reachable_r2{end}" for end in ("", "_low", "_high")]
    assert list(found.seeds.columns) == ["seeds", "drum_slip_se_deg", "drum_slip_se_percent", *reachable]
    assert found.responses["sd_within"][0] == pytest.approx(3, rel=0.2)
    assert found.responses["failed_runs"][0] == 0, "runs of the other bench test do not count"
    assert found.summary["correlation"] == {}


def test_responses_of_different_bench_tests_are_independent():
    matrix, pairs = noise.within_correlation(made_up_runs(), FOUR)
    assert list(pairs) == ["aor_deg, height_mm", "aor_deg, base_radius_mm", "height_mm, base_radius_mm"]
    assert matrix[:3, :3] == pytest.approx(np.array([[1, 0.89, -0.45], [0.89, 1, -0.4], [-0.45, -0.4, 1]]), abs=0.15)
    assert matrix[3].tolist() == [0, 0, 0, 1]
    assert (np.linalg.eigvalsh(matrix) > 0).all()
    assert len(noise.noise_floor(made_up_runs(), FOUR).responses) == 4


def test_too_few_runs_of_either_are_reported(tmp_path):
    input_error(r"runs a sample is 1; expected 2 or more", noise.run, write_runs(tmp_path, 1), TWO, tmp_path / "out")
    runs = made_up_runs(2, 4).query("apparatus == 'funnel'")
    runs.to_csv(tmp_path / "runs.csv", index=False)
    with pytest.raises(InputError, match=r"runs\.csv: runs is '2 degrees of freedom within samples"):
        noise.run(tmp_path / "runs.csv", TWO, tmp_path / "out")
    input_error("4 sets or more with two runs", next_measurement.information, made_up(1.0, 1.0, sets=3), 10, 2.0)


def made_up(between, within, sets=16, runs=2, seed=0, response="turning_deg", mean=40.0):
    """Runs of a response whose sets differ by `between` and whose runs scatter by `within` (standard deviations)."""
    random = np.random.default_rng(seed)
    value = mean + np.repeat(between * random.normal(size=sets), runs) + within * random.normal(size=sets * runs)
    sample = np.repeat(np.arange(1, sets + 1), runs)
    return pd.DataFrame({"apparatus": "turning", "sample": sample, "response": response, "value": value})


@pytest.mark.parametrize(("between", "within", "percent"), [(1.0, 0.5, 0.0), (0.3, 1.0, 0.0), (1.0, 0.5, 2.0)])
def test_bits_of_known_variances(between, within, percent):
    known = 0.5 * np.log2(1 + between**2 / (within**2 / 10 + (percent / 100 * 40) ** 2))
    runs = [made_up(between, within, sets=64, seed=k) for k in range(100)]
    rows = [next_measurement.information(one, 10, percent).iloc[0] for one in runs]
    bits = np.array([row.bits for row in rows])
    assert bits.mean() == pytest.approx(known, abs=3 * bits.std() / 10 + 0.02 * known)
    if not percent:  # the interval is exact without a discrepancy
        covered = np.mean([row.bits_low <= known <= row.bits_high for row in rows])
        assert covered == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 100))


def test_bits_with_a_discrepancy_by_hand_and_the_most_informative_first():
    runs = made_up(1.0, 0.5)
    parts = variance_components(runs["value"], runs["sample"])
    ratio = parts.within * parts.icc / (1 - parts.icc) / (parts.within / 10 + (0.2 * parts.mean) ** 2)
    bits = next_measurement.information(runs, 10, 20.0)["bits"].iloc[0]
    assert bits == pytest.approx(0.5 * np.log2(1 + ratio), rel=1e-9)
    runs = [made_up(0.0, 1.0, response="flow_g_s"), made_up(2.0, 0.5), made_up(0, 0, response="emptying_s")]
    table = next_measurement.information(pd.concat(runs), 10, 0.0)
    assert list(table["response"]) == ["turning_deg", "flow_g_s"]  # a constant response is left out
    assert table["bits_low"].iloc[1] == 0.0


def test_plausible_sets_are_draws(tmp_path):
    draws = pd.DataFrame(np.random.default_rng(1).random((50, 6)), columns=list(PARAMETERS))
    draws.to_csv(tmp_path / "draws.csv", index=False)
    samples = next_measurement.plausible_sets(tmp_path / "draws.csv", 3, tmp_path / "samples.csv")
    assert list(samples.columns) == ["sample", *PARAMETERS]
    assert len(samples) == next_measurement.SETS
    written = pd.read_csv(tmp_path / "samples.csv")
    for values in written[list(PARAMETERS)].to_numpy():
        assert np.isclose(draws.to_numpy(), values, rtol=1e-9).all(axis=1).sum() == 1
    draws[:3].to_csv(tmp_path / "draws.csv", index=False)
    with pytest.raises(InputError, match="rows is 3; expected 16 or more"):
        next_measurement.plausible_sets(tmp_path / "draws.csv", 3, tmp_path / "samples.csv")
