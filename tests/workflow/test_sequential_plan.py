"""The workflow of `strategy: sequential`: a batch is known when the one before is poured."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from plans import as_ours, planned, snakemake
from synthetic import SPACE, responses
from synthetic import Study as Given

from repose.config.study import Study
from repose.core.targets import Targets
from repose.strategies.sequential import files

pytestmark = pytest.mark.slow

TARGET = ("--", "sequential")


def poured(folder, table, section, targets, seed):
    """Files of a batch's pours as if it had run, with responses of a simulator of one line."""
    (folder / "heaps").mkdir(parents=True)
    for sample in table["sample"]:
        for kind in ("pours.json", "npz", "json"):
            (folder / "heaps" / f"{sample:03d}.{kind}").touch()
    every = table.loc[table.index.repeat(section["seeds"])].reset_index(drop=True)
    runs = every[["sample"]].assign(seed=np.arange(len(every)), status="ok")
    runs[list(targets.names)] = responses(every, 4.0, seed)
    of_sample = runs.groupby("sample")[list(targets.names)]
    data = table.assign(status="ok", reason="", n_seeds=section["seeds"])
    data[list(targets.names)] = of_sample.mean().to_numpy()
    data[list(targets.errors)] = of_sample.sem().to_numpy()
    data.to_csv(folder / "dataset.csv", index=False)
    runs.to_csv(folder / "runs.csv", index=False)
    (folder / "dataset_summary.json").write_text("{}")
    as_ours(folder)


def test_batches_follow_until_they_suffice_and_a_kill_between_them_loses_nothing(finished):
    project, words = finished
    folder = project / "results/quick/sequential"
    config = Study.load(project / "config/quick.yaml").config
    section, targets = config["sequential"] | {"probability": 0.99}, Targets.of(config["targets"])
    study = Given(SPACE, targets, config | {"sequential": section})
    words = (*words, "sequential={probability: 0.99}", *TARGET)

    jobs = planned(project, *words)
    assert "pour" not in jobs, "no pour of the published method"
    assert jobs["batch_pour"] == jobs["measure_batch_runs"] == section["start_samples"]
    table = files.run_start(study, folder / "batch_0/samples.csv")

    folders, budget = [], section["start_samples"]
    while True:
        folders.append(folder / f"batch_{len(folders)}")
        poured(folders[-1], table, section, targets, [1, len(folders)])
        # everything before is kept: all that is planned is to read what was poured
        jobs = planned(project, *words)
        assert "batch_pour" not in jobs
        assert jobs["sequential_batch"] == 1
        found = files.run_batch(folders, study, folders[-1])
        table = pd.read_csv(folders[-1] / "next.csv")
        jobs = planned(project, *words)
        assert jobs["batch_pour"] == jobs["measure_batch_runs"] == len(table)
        if found["stop"]:
            break
        budget += len(table)
        assert "sequential_check" not in jobs or jobs["sequential_check"] == 1
    assert found["stop"] == "budget"
    assert len(folders) == 3
    assert 2 * budget == section["most_pours"]
    assert table["sample"].tolist() == [budget + 1], "the answer is poured again"
    shutil.rmtree(folder)


@pytest.mark.essential
def test_the_strategy_chooses_what_a_study_makes(project):
    words = ("--configfile", "config/quick.yaml", "--config", "strategy=sequential")
    jobs = planned(project, *words)
    assert jobs["batch_pour"] == 8
    assert not {"pour", "network", "miga", "turn", "response_design"} & set(jobs)
    assert {"page", "card", "strategy_trajectory"} <= set(jobs), "what every calibration ends with"
    assert "batch_pour" not in planned(project, "--configfile", "config/quick.yaml")


def test_every_bench_test_of_the_targets_is_run(project):
    targets = [
        {"response": name, "apparatus": apparatus, "value": 40, "sd": 2, "repetitions": 5, "range": [38, 42]}
        for name, apparatus in (("height_mm", "funnel"), ("drum_slip_deg", "drum"))
    ]
    own = {"targets": targets, "posterior": {"shape_study": None}}
    (project / "mine.yaml").write_text(json.dumps(own))
    words = ("--configfile", "config/quick.yaml", "mine.yaml", *TARGET)
    assert planned(project, *words)["batch_pour"] == 16
    assert "--purpose sequential " in snakemake(project, "-n", "-p", *words).stdout
