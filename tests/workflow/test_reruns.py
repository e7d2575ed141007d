"""What runs again, and what does not: two workflows in one folder, an edited engine, lost files, changed targets."""

import json
import shutil

import pytest
from plans import planned, snakemake

from repose.core import sources
from repose.core.lock import joined_folder, take_folder
from repose.dem import cache

pytestmark = pytest.mark.slow

TARGET = "results/quick/design/samples.csv"
QUICK = ("--cores", "1", "--configfile", "config/quick.yaml")


def test_a_second_workflow_stops_with_one_message_before_it_writes(project):
    folder = project / "results" / "quick"
    lock = take_folder(folder)
    changed = (*QUICK, "--config", "simulation={gravity_m_s2: 1.62}")
    try:
        done = snakemake(project, TARGET, *changed)
    finally:
        lock.close()
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("repose: error: results/quick: workflow is 'process ")
    assert done.stderr.splitlines()[-1].endswith("; allowed: one at a time; wait until it has ended")
    assert {path.name for path in folder.iterdir()} == {".lock", ".jobs"}

    with joined_folder(folder):
        done = snakemake(project, TARGET, *QUICK)
    assert "repose: error: results/quick: jobs is 'running'; allowed: none" in done.stderr
    assert not (folder / "config.json").exists()

    done = snakemake(project, TARGET, *QUICK)
    assert done.returncode == 0, done.stderr
    assert (folder / "config.json").exists()


def test_where_snakemakes_records_are_lost_those_of_the_results_tell_what_to_make_again(project):
    words = (TARGET, *QUICK)
    assert snakemake(project, *words).returncode == 0
    shutil.rmtree(project / ".snakemake")
    told = "warning: results/quick/design/samples.csv and 1 more results were made with other settings"
    assert told not in snakemake(project, "-n", *words).stderr
    assert told not in snakemake(project, "-n", *words, "--config", "funnel={seeds: 3}").stderr
    changed = (*words, "--config", "design={seed: 5}")
    assert told in snakemake(project, "-n", *changed).stderr
    assert snakemake(project, *changed, "--forceall").returncode == 0
    assert told not in snakemake(project, "-n", *changed).stderr


POURS = {"pour": 12, "validation_pour": 9, "trajectory": 1, "turn": 2}


def test_an_edited_engine_pours_again(finished, monkeypatch):
    project, words = finished
    assert planned(project, *words, "--", "calibration") == {}
    monkeypatch.setattr(sources, "engine_hash", lambda: "edited")
    monkeypatch.setattr(cache, "source_hash", lambda: "edited")
    jobs = planned(project, *words, "--", "calibration")
    assert {rule: jobs[rule] for rule in POURS} == POURS


def test_a_changed_target_pours_no_published_solution_again(finished):
    project, words = finished
    config = json.loads((project / "results/quick/config.json").read_text())
    config["targets"][0]["value"] += 1
    (project / "target.json").write_text(json.dumps({"targets": config["targets"]}))
    jobs = planned(project, *words[:2], "target.json", *words[2:], "--", "calibration")
    assert "pour" not in jobs
    assert (jobs["validation_pour"], jobs["trajectory"], jobs["turn"]) == (3, 1, 2), "our own solutions"


def test_another_label_runs_nothing(finished):
    project, words = finished
    assert planned(project, *words, "label=other", "--", "calibration") == {}


@pytest.mark.parametrize(
    ("lost", "rule"),
    [
        ("network/network.json", "network"),
        ("heaps/003.pours.json", "pour"),
        ("heaps/003.json", "measure_runs"),
        ("validation/heaps/102.npz", "validation_pour"),
    ],
)
def test_a_file_that_a_killed_job_left_out_is_made_again(finished, lost, rule):
    project, words = finished
    path = project / "results/quick" / lost
    content = path.read_bytes()
    path.unlink()
    try:
        assert planned(project, *words)[rule] == 1
    finally:
        path.write_bytes(content)
