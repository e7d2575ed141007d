"""What a finished run of config/quick.yaml has written; skipped where there is none and none is required."""

import json
import os
import re

import cv2
import numpy as np
import pandas as pd
import pytest
from plans import ROOT, declared
from shared import says

from repose.bench.parameters import PARAMETERS
from repose.calibrate.seeds import draw_run_seeds
from repose.calibrate.surrogates import load
from repose.common import ledger
from repose.config.pipeline import PipelineConfig

RESULTS = ROOT / "results" / "quick"
FIGURES = [f"figure{number:02d}" for number in (2, 5, 6, 7, 8, 10, 13, 14, 15)]
FIGURES += ["design", "dataset", "validation", "drum", "definitions"]


if not (RESULTS / "validation" / "table4.csv").is_file():
    if os.environ.get("REPOSE_QUICK_RUN") == "required":
        raise FileNotFoundError(f"{RESULTS} holds no finished run of config/quick.yaml")
    pytest.skip("no results of config/quick.yaml to read", allow_module_level=True)


@pytest.fixture(scope="module")
def config():
    return PipelineConfig.load(RESULTS / "config.json").config


@pytest.fixture(scope="module")
def dataset():
    return pd.read_csv(RESULTS / "dataset.csv")


def test_the_design_is_a_latin_hypercube(config):
    assert config == PipelineConfig.load(ROOT / "config" / "quick.yaml").config
    assert config["small_run"] is True
    samples = pd.read_csv(RESULTS / "design" / "samples.csv")
    count = config["design"]["samples"]
    assert list(samples["sample"]) == list(range(1, count + 1))
    for name in PARAMETERS:
        low, high = config["parameters"][name]
        assert sorted(
            np.floor((samples[name] - low) / (high - low) * count).astype(int)
        ) == list(range(count))


def test_every_pour_has_all_berries(config, dataset):
    berries = config["funnel"]["berries"]
    for sample in dataset["sample"]:
        job = json.loads((RESULTS / "heaps" / f"{sample:03d}.json").read_text())
        seeds = draw_run_seeds(
            config["design"]["seed"], "design", sample, config["funnel"]["seeds"]
        )
        assert [run["seed"] for run in job["runs"]] == seeds
        with np.load(RESULTS / "heaps" / f"{sample:03d}.npz") as arrays:
            for seed in seeds:
                assert arrays[f"position_{seed}"].shape == (berries, 3)
                assert arrays[f"quaternion_{seed}"].shape == (berries, 4)


def test_piles_are_piles(config, dataset):
    good = dataset[dataset["status"] == "ok"]
    assert len(good) >= 0.8 * len(dataset)
    # a mean of two pours has its error, and which pours they are differs between processors
    error = np.sqrt((good["aor_se_deg"] ** 2).mean())
    assert good["aor_deg"].between(10 - 3 * error, 40 + 3 * error).all()
    assert good["height_mm"].between(25, 110).all()
    poured_s = config["funnel"]["berries"] / config["funnel"]["rate_per_s"]
    assert (
        good["discharge_s"]
        .between(0.85 * poured_s, config["funnel"]["duration_s"])
        .all()
    )
    assert good["aor_deg"].std() > 0.5
    friction = (
        good["mur_gg"] / good["mur_gg"].mean() + good["mus_gp"] / good["mus_gp"].mean()
    )
    assert np.corrcoef(friction, good["height_mm"])[0, 1] > 0


def test_the_network_predicts_from_its_file_and_a_picture_was_measured(dataset):
    network = load(RESULTS / "network" / "network.json")
    predictions = pd.read_csv(RESULTS / "network" / "predictions.csv")
    X = (
        dataset.set_index("sample")
        .loc[predictions["sample"], list(PARAMETERS)]
        .to_numpy()
    )
    expected = predictions[["aor_final_deg", "height_final_mm"]]
    np.testing.assert_allclose(network.predict(X), expected, rtol=1e-6)
    metrics = json.loads((RESULTS / "network" / "metrics.json").read_text())
    assert {
        "train",
        "validation",
        "test",
        "gamma",
        "alpha",
        "beta",
        "epochs",
        "stop_reason",
    } <= set(metrics)
    measured = json.loads((RESULTS / "measure" / "measured.json").read_text())
    # the secant of a lopsided pile is no mean of its sides, yet lies between them
    low, high = sorted((measured["left_deg"], measured["right_deg"]))
    assert low - 0.01 <= measured["aor_deg"] <= high + 0.01
    assert 10 < measured["aor_deg"] < 45
    assert 25 < measured["height_mm"] < 110


def test_the_search_is_printed(config):
    summary = json.loads((RESULTS / "miga" / "summary.json").read_text())
    feasible = pd.read_csv(RESULTS / "miga" / "feasible.csv")
    assert summary["message"]
    assert feasible["representative"].sum() == 1
    assert len(feasible) >= config["validation"]["solutions"] + 1
    for name in PARAMETERS:
        low, high = config["parameters"][name]
        assert feasible[name].between(low - 1e-9, high + 1e-9).all()
    expected = set(PARAMETERS)
    assert set(pd.read_csv(RESULTS / "miga" / "intervals.csv")["variable"]) == expected


def test_the_answers_of_the_search_are_simulated(config):
    table4 = pd.read_csv(RESULTS / "validation" / "table4.csv")
    published = pd.read_csv(RESULTS / "validation" / "published.csv")
    assert len(table4) == config["validation"]["solutions"] + 1
    assert published.empty == (config["validation"]["published_simulated"] is None)
    good = table4[table4["status"] == "ok"]
    assert len(good)
    error = (
        100
        * (good["aor_predicted_deg"] - good["aor_simulated_deg"]).abs()
        / good["aor_simulated_deg"]
    )
    np.testing.assert_allclose(good["aor_error_percent"], error, rtol=1e-6)


def test_the_drum_slips(config):
    runs = pd.read_csv(RESULTS / "drum" / "runs.csv")
    expected = sorted(
        draw_run_seeds(config["design"]["seed"], "drum", 1, config["drum"]["seeds"])
    )
    assert sorted(runs["seed"]) == expected
    assert (runs["status"] == "ok").all()
    assert runs["before_surface_deg"].between(25, 65).all()
    assert (runs["bed_drop_deg"] > config["drum"]["slip_drop_deg"]).all()
    turned = (
        np.degrees(config["drum"]["angular_velocity_rad_s"]) * runs["before_time_s"]
    )
    np.testing.assert_allclose(runs["before_turned_deg"], turned, rtol=1e-6)
    assert (RESULTS / "drum" / "drum.gif").stat().st_size < 4_000_000


@pytest.mark.parametrize("name", FIGURES)
def test_figures_show_something(name):
    picture = cv2.imread(str(RESULTS / "figures" / f"{name}.png"))
    assert min(picture.shape[:2]) > 200
    assert picture.std() > 5


def test_a_report_states_the_answer():
    text = (RESULTS / "report.html").read_text()
    says(
        text,
        "<b>A small run, its numbers are no calibration: targets ",
        'class="verdict',
    )
    assert "Three.js Authors" in text, "the pile in 3-D"
    assert len(text) < 5_000_000


def test_all_results_are_marked_as_written_by_repose():
    left = ("logs", "benchmarks")
    paths = [
        path
        for path in RESULTS.rglob("*")
        if path.is_file() and not set(left) & set(path.parts)
    ]
    ours = [
        path
        for path in paths
        if path.name.startswith(".")
        or not path.stat().st_size
        or ledger.is_own_file(path)
    ]
    assert len(ours) > 150
    # snakemake writes its own report, where one was asked for
    assert {path.name for path in set(paths) - set(ours)} <= {"figures.html"}


def test_jobs_declare_enough(tmp_path):
    rules = declared(tmp_path)
    seen = 0
    short = []
    for path in (RESULTS / "benchmarks").rglob("*.tsv"):
        name = path.relative_to(ROOT).as_posix()
        found = [rule for rule in rules if re.fullmatch(rule.benchmarks, name)]
        took = pd.read_csv(path, sep="\t").iloc[-1]
        seen += len(found)
        for rule in found:
            if (
                1.2 * took["max_rss"] > rule.memory_mb[0]
                or took["s"] > 60 * rule.minutes[0]
            ):
                short.append(f"{rule}: took {took['max_rss']} MB and {took['s']} s")
    assert seen > 50
    assert not short
