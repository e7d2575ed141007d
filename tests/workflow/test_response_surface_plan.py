"""The workflow of `strategy: response_surface`: the points of a step are known when the step before is analysed."""

import json
import shutil

import pandas as pd
import pytest
from plans import as_ours, planned, snakemake
from synthetic import SPACE, write_poured
from synthetic import Study as Given

from repose.config.study import Study
from repose.core.targets import Targets
from repose.strategies.response_surface import files
from repose.strategies.response_surface.steps import STEPS

pytestmark = pytest.mark.slow

TARGET = ("--", "response_surface")


def poured(folder, step, folders=("heaps",)):
    """Files of a step's pours as if it had run, with responses of a simulator of one line."""
    table = pd.read_csv(folder / step / "samples.csv")
    for name in folders:
        (folder / step / name).mkdir()
        for sample in table["sample"]:
            for kind in ("pours.json", "npz", "json"):
                (folder / step / name / f"{sample}.{kind}").touch()
    write_poured(folder / step, table, 0.5)
    (folder / step / "dataset_summary.json").write_text("{}")
    as_ours(folder / step)


def test_each_step_pours_what_the_one_before_found(finished):
    project, words = finished
    folder = project / "results/quick/response_surface"
    config = Study.load(project / "config/quick.yaml").config
    section = config["response_surface"]
    study = Given(SPACE, Targets.of(config["targets"]), config)
    steps = [folder / name for name in STEPS]

    def analysed(count):
        files.run_step(steps[:count], study, steps[count - 1], steps[count] / "samples.csv")

    jobs = planned(project, *words, *TARGET)
    assert "pour" not in jobs, "no pour of the published method"
    assert jobs["response_design"] == 1
    assert jobs["batch_pour"] == jobs["measure_batch_runs"] == section["screening_runs"] + section["centres"]

    analysed(0)
    poured(folder, "screening")
    analysed(1)
    jobs = planned(project, *words, *TARGET)
    assert "after_screening" not in jobs
    assert jobs["batch_pour"] == section["steps"] + 1

    poured(folder, "ascent")
    analysed(2)
    jobs = planned(project, *words, *TARGET)
    assert jobs["batch_pour"] == 12 + section["centres"], "Box-Behnken in three factors"

    poured(folder, "surface")
    analysed(3)
    jobs = planned(project, *words, *TARGET)
    assert jobs["batch_pour"] == section["checks"]

    poured(folder, "check")
    jobs = planned(project, *words, *TARGET)
    assert "batch_pour" not in jobs
    assert {"response_check", "draw_contours"} <= set(jobs)
    shutil.rmtree(folder)


@pytest.mark.essential
def test_the_strategy_chooses_what_a_study_makes(project):
    words = ("--configfile", "config/quick.yaml", "--config", "strategy=response_surface")
    jobs = planned(project, *words)
    assert jobs["batch_pour"] == 8 + 3, "corners, and the centre"
    assert not {"pour", "network", "miga", "drum_run"} & set(jobs)
    assert "batch_pour" not in planned(project, "--configfile", "config/quick.yaml")


def test_every_bench_test_of_the_targets_is_run(project):
    targets = [
        {"response": name, "apparatus": apparatus, "value": 40, "sd": 2, "repetitions": 5, "range": [38, 42]}
        for name, apparatus in (("height_mm", "funnel"), ("drum_slip_deg", "drum"))
    ]
    own = {"targets": targets, "posterior": {"shape_study": None}}
    (project / "mine.yaml").write_text(json.dumps(own))
    words = ("--configfile", "config/quick.yaml", "mine.yaml", *TARGET)
    assert planned(project, *words)["batch_pour"] == 2 * (8 + 3)
    shown = snakemake(project, "-n", "-p", *words).stdout
    assert "--apparatus drum " in shown
    assert "--purpose response_surface " in shown


def test_a_misfit_is_reported_before_any_work(project):
    words = ("--configfile", "config/quick.yaml", "--config", "strategy=response_surface")
    done = snakemake(project, "-n", "--quiet", "all", *words, "response_surface={centres: 2}")
    assert done.returncode != 0
    assert "centres is 2; allowed: at least 3 where surface is box_behnken" in done.stderr
