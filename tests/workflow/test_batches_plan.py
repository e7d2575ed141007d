"""The workflow of strategies with several batches: a batch is known when those before it are analysed."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from plans import MIXED, as_ours, planned, snakemake
from shared import says
from stage_runs import propose
from synthetic import SPACE, write_poured
from synthetic import Study as Given

from repose.calibrate import strategies
from repose.calibrate.strategies import base
from repose.calibrate.strategies.base import samples_of
from repose.calibrate.targets import Targets
from repose.common.files import write_text
from repose.config.pipeline import PipelineConfig

pytestmark = pytest.mark.slow

# Samples of each batch in the small study, the check of the answer last. The screening has corners and the centre, then
# come the path, a Box-Behnken design in three factors, and the check.
SAMPLES = {"sequential": [8, 2, 2, 1], "response_surface": [8 + 3, 2 + 1, 12 + 3, 2]}
SECTIONS = {"sequential": {"probability": 0.99}, "response_surface": {}}
# The refined answer has a card and a page of its own; the page shows a pour of it.
END = {"conclude_refined", "card_refined", "strategy_trajectory", "page_refined"}
END |= {"refined", "total"}
ROUND = {"propose", "batch_pour", "measure_batch_runs", "batch_dataset"} | END
JOBS = {1001: 1, 1002: 1, 1003: 1, 1004: 1}  # places near the targets, a pour at each


def poured(folder, seed):
    """Files of a batch's pours as if it had run, with responses of a simulator of one line."""
    table = pd.read_csv(folder / "samples.csv")
    (folder / "heaps").mkdir()
    for sample in table["sample"]:
        for kind in ("pours.json", "npz", "json"):
            (folder / "heaps" / f"{sample:03d}.{kind}").touch()
    write_poured(folder, table, 4.0, seed, int(table["seeds"].iloc[0]))
    (folder / "dataset_summary.json").write_text("{}")
    as_ours(folder)


@pytest.mark.parametrize("strategy", list(SAMPLES))
def test_batches_follow_until_the_answer_and_a_kill_between_them_loses_nothing(
    strategy, finished
):
    project, arguments = finished
    folder = project / "results/quick" / strategy
    config = PipelineConfig.load(project / "config/quick.yaml").config
    config |= {strategy: config[strategy] | SECTIONS[strategy]}
    study = Given(SPACE, Targets.of(config["targets"]), config)
    arguments = (
        *arguments,
        f"{strategy}={json.dumps(SECTIONS[strategy])}",
        "--",
        strategy,
    )
    folders = []
    sizes = []
    found = {"answer": False}
    while not found["answer"]:
        # everything before is kept: all that is planned is to read what was poured
        jobs = planned(project, *arguments)
        assert not {"pour", "batch_pour"} & set(jobs), (
            "none of the published method either"
        )
        assert jobs["propose"] == 1
        folders.append(folder / f"batch_{len(folders)}")
        found = propose(strategy, study, folders[:-1], folders[-1])
        jobs = planned(project, *arguments)
        assert jobs[f"conclude_{strategy}"] == jobs[f"card_{strategy}"] == 1
        assert not {"card", "page"} & set(jobs), "those of the first answer stay"
        if found.get("simulated"):
            break
        sizes.append(len(pd.read_csv(folders[-1] / "samples.csv")))
        assert jobs["batch_pour"] == jobs["measure_batch_runs"] == sizes[-1]
        poured(folders[-1], [1, len(folders)])
    assert sizes == SAMPLES[strategy]
    jobs = planned(project, *arguments)
    assert not {"propose", "batch_pour", "batch_dataset"} & set(jobs)
    assert f"conclude_{strategy}" in jobs
    next((folders[0] / "heaps").glob("*.npz")).unlink()
    lost = planned(project, *arguments)["batch_pour"]
    assert lost == 1 + sum(sizes[1:]), (
        "a lost file is made again, then what follows from it"
    )
    shutil.rmtree(folder)


@pytest.mark.essential
@pytest.mark.parametrize("strategy", list(SAMPLES))
def test_the_strategy_chooses_what_a_study_makes(strategy, project):
    arguments = (
        "--configfile",
        "config/quick.yaml",
        "--config",
        f"strategy={strategy}",
    )
    first = project / f"results/quick/{strategy}/batch_0"
    jobs = planned(project, *arguments)
    assert jobs["propose"] == 1
    assert not {"pour", "network", "miga", "drum_run"} & set(jobs)
    assert {"page", "card", "strategy_trajectory"} <= set(jobs), (
        "what every calibration ends with"
    )
    snakemake(
        project,
        "--cores",
        "1",
        *arguments,
        "--",
        str((first / "samples.csv").relative_to(project)),
        status=0,
    )
    assert planned(project, *arguments)["batch_pour"] == SAMPLES[strategy][0]
    # the times of a job are no output: snakemake never has a record of them
    made_by = {
        "verb": "pour",
        "apparatus": "funnel",
        "seed": 1,
        "settings": "",
        "origin": "",
        "engine": "",
    }
    write_text(first / "heaps/timings/001.json", json.dumps({"provenance": made_by}))
    assert planned(project, *arguments)["batch_pour"] == SAMPLES[strategy][0]
    records = (project / ".snakemake").rename(project / "lost")
    other = snakemake(project, "-n", *arguments, f"{strategy}={{checks: 3}}", status=2)
    assert f"{strategy}/batch_0/proposal.json: {strategy}.checks is " in other.stderr
    shutil.rmtree(project / ".snakemake", ignore_errors=True)
    records.rename(project / ".snakemake")
    assert not {"propose", "batch_pour"} & set(
        planned(project, "--configfile", "config/quick.yaml")
    )
    # all bench tests of the targets are run, with seeds of the strategy's own
    (project / "mine.yaml").write_text(
        json.dumps({"targets": MIXED, "posterior": {"shape_study": None}})
    )
    mixed = ("--configfile", "config/quick.yaml", "mine.yaml", "--", strategy)
    kept = snakemake(project, "-n", "--rerun-triggers", "mtime", *mixed, status=2)
    assert f"{strategy}/batch_0/proposal.json: targets." in kept.stderr
    samples = str((first / "samples.csv").relative_to(project))
    snakemake(project, "--cores", "1", *mixed[:-1], samples, status=0)
    assert planned(project, *mixed)["batch_pour"] == 2 * SAMPLES[strategy][0]
    says(
        snakemake(project, "-n", "-p", *mixed).stdout,
        "--apparatus drum ",
        f"--purpose {strategy} ",
    )
    shutil.rmtree(first.parent)


def test_a_misfit_is_reported_before_any_work(project):
    arguments = (
        "--configfile",
        "config/quick.yaml",
        "--config",
        "strategy=response_surface",
    )
    done = snakemake(
        project, "-n", "--quiet", "all", *arguments, "response_surface={centres: 2}"
    )
    assert done.returncode != 0
    assert (
        "centres is 2; expected at least 3 where surface is box_behnken" in done.stderr
    )


def proposed(folder, answer=False):
    rows = "".join(f"{sample},{seeds}\n" for sample, seeds in JOBS.items())
    write_text(folder / "samples.csv", f"sample,seeds\n{rows}")
    simulated = [1001, 1002] if answer else []
    write_text(
        folder / "proposal.json", json.dumps({"answer": answer, "simulated": simulated})
    )


def test_bench_tests_of_the_targets_are_run_by_stages_until_the_answer(finished):
    project, arguments = finished
    (project / "mine.yaml").write_text(
        json.dumps({"targets": MIXED, "posterior": {"shape_study": None}})
    )
    arguments = (
        *arguments[:2],
        "mine.yaml",
        *arguments[2:],
        "--rerun-triggers",
        "mtime",
        "--",
        "refined",
    )
    folder = project / "results/quick/refined"
    proposed(folder / "batch_1")
    jobs = planned(project, *arguments)
    assert (jobs["batch_pour"], jobs["measure_batch_runs"]) == (8, 8), (
        "four jobs in each bench test"
    )
    shown = snakemake(project, "-n", "-p", *arguments).stdout
    for runs, name in (("heaps", "funnel"), ("drum_runs", "drum")):
        out = f"results/quick/refined/batch_1/{runs}"
        poured = [
            line
            for line in shown.splitlines()
            if f"--out {out} " in line and "stage pour" in line
        ]
        assert len(poured) == 4
        assert all(
            f"--apparatus {name} " in line and "--purpose refined " in line
            for line in poured
        )
        assert all("--seeds 1 " in line for line in poured)
    shutil.rmtree(folder)
    project, arguments = finished
    arguments = (*arguments, "--", "refined")
    assert set(planned(project, *arguments)) == {"propose", *END}, (
        "until the second stage is proposed no answer is planned"
    )
    assert not (ROUND - {"total"}) & set(
        planned(project, *arguments[:-2], "--forceall")
    )
    folder = project / "results/quick/refined/batch_1"
    proposed(folder)
    jobs = planned(project, *arguments)
    assert set(jobs) == ROUND
    assert jobs["batch_pour"] == jobs["measure_batch_runs"] == 4
    (folder / "heaps").mkdir()
    heaps = [
        f"heaps/{job}.{kind}" for job in JOBS for kind in ("pours.json", "npz", "json")
    ]
    for name in (*heaps, "dataset.csv", "runs.csv", "dataset_summary.json"):
        (folder / name).touch()
    as_ours(folder)
    assert set(planned(project, *arguments)) == {"propose", *END}
    proposed(folder.with_name("batch_2"))
    assert set(planned(project, *arguments)) == ROUND
    proposed(folder.with_name("batch_2"), answer=True)
    assert set(planned(project, *arguments)) == END
    shutil.rmtree(folder.parent)


class Probe(strategies.Strategy):
    name = "probe"

    def propose(self, study, data):
        return strategies.Batch(
            samples_of(
                study.parameters, np.full((3, study.parameters.dimensions), 0.5), 2, 1
            )
        )


def test_a_strategy_of_a_file_of_its_own_is_run_by_the_same_rules(
    finished, monkeypatch
):
    monkeypatch.setitem(base._REGISTRY, "probe", Probe())
    project, arguments = finished
    arguments = (*arguments, "strategy=probe")
    jobs = planned(project, *arguments)
    assert {"propose", "conclude_probe", "page", "card"} <= set(jobs)
    assert not {"pour", "network"} & set(jobs)
    folder = project / "results/quick/probe/batch_0"
    config = PipelineConfig.load(project / "config/quick.yaml").config
    propose("probe", Given(SPACE, Targets.of(config["targets"]), config), [], folder)
    assert planned(project, *arguments)["batch_pour"] == 3
    assert (
        "--seeds 2 --purpose batches "
        in snakemake(project, "-n", "-p", *arguments).stdout
    )
    shutil.rmtree(folder.parent)
