"""Studies whose runs another program makes, from the design to the report."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
import yaml

PROGRAM = """
import json, random, sys
given = json.load(open("parameters.json"))
random.seed(given["seed"])
friction = given["parameters"]["friction"]
rolling = given["parameters"]["rolling"]
if friction > 0.76:
    sys.exit("unstable")
angle = (18 + 18 * friction + 40 * rolling) * random.gauss(1, 0.003)
time = (3 + 2 * friction - 2 * rolling) * random.gauss(1, 0.003)
json.dump({"angle_deg": angle, "time_s": time}, open("responses.json", "w"))
"""
# The formula at friction 0.5 and rolling 0.1, without its noise.
TRUTH = {"friction": 0.5, "rolling": 0.1}
STUDY = {
    "simulator": {
        "name": "toy 1.0",
        "command": ["python", "toy.py"],
        "files": ["toy.py"],
        "output": "responses.json",
        "time_limit_s": 60,
    },
    "label": "toy",
    "seed": 1,
    "strategy": "published",
    "surrogate": "network",
    "seeds": 1,
    "parameters": {"friction": [0.2, 0.8], "rolling": [0.01, 0.2]},
    "targets": {
        "angle_deg": {"value": 31.0, "sd": 0.6, "repetitions": 10, "unit": "deg"},
        "time_s": {"value": 3.8, "sd": 0.1, "repetitions": 10, "unit": "s"},
    },
    "design": {"samples": 14},
    "network": {"hidden": 3, "starts": 3, "epochs": 200},
    "miga": {"rounds": 30, "solutions": 20},
    "validation": {"solutions": 1, "seeds": 1, "representative_seeds": 2},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return written(tmp_path_factory.mktemp("external"), STUDY)


def written(folder, study):
    (folder / "toy.py").write_text(PROGRAM)
    (folder / "toy.yaml").write_text(yaml.safe_dump(study))
    return folder


def call_of(*arguments):
    """The command of a call, and its environment."""
    command = [sys.executable, "-m", "repose", *arguments, "--configfile", "toy.yaml"]
    source = Path(__file__).parents[2] / "src"
    return command, {**os.environ, "PYTHONPATH": str(source)}


def repose(folder, *arguments, status=0):
    command, environment = call_of(*arguments)
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, env=environment
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_a_check_reads_and_a_trial_runs_once(folder):
    text = repose(folder, "check", "--try")
    assert "toy 1.0: python toy.py; the program is " in text
    assert "angle_deg 3" in text
    assert sorted(os.listdir(folder)) == ["toy.py", "toy.yaml"]


@pytest.mark.slow
def test_a_dry_run_shows_the_command_of_each_run(folder):
    text = repose(folder, "run", "-n", "-p", "--cores", "1")
    assert "toy 1.0, sample 14, run 1: python toy.py" in text
    assert "repose stage simulate" in text
    for rule in ("berry", "shape", "warm_up", "pour", "drum", "published_sets"):
        assert f"rule {rule}:" not in text
    assert not (folder / "results").exists()


@pytest.mark.slow
@pytest.mark.essential
def test_the_article_s_method_from_design_to_card(folder):
    repose(folder, "run", "--cores", "2")
    results = folder / "results"
    dataset = pd.read_csv(results / "dataset.csv").set_index("sample")
    failed = dataset[dataset["friction"] > 0.76]
    assert len(failed)
    assert set(failed["status"]) == {"exit_status"}
    assert failed["reason"].str.contains("unstable").all()
    assert failed["angle_deg"].isna().all()
    assert (dataset.drop(failed.index)["status"] == "ok").all()

    card = json.loads((results / "card.json").read_text())
    assert card["simulator"] == "toy 1.0"
    for name, value in TRUTH.items():
        assert card["parameters"][name]["value"] == pytest.approx(value, rel=0.15)
    table4 = pd.read_csv(results / "validation" / "table4.csv")
    assert table4["angle_simulated_deg"].notna().all()
    page = (results / "report.html").read_text()
    assert "The runs were made by another program" in page
    assert "Simulation by toy 1.0" in page

    # Nothing is left to do, and a forced rule makes no finished run again.
    assert "Nothing to be done" in repose(folder, "run", "--cores", "2")
    made = results / "runs" / "001" / "1" / "responses.json"
    before = made.stat().st_mtime_ns
    until = ["--until", "dataset"]
    repose(folder, "run", "--cores", "2", "--forcerun", "simulate", *until)
    assert made.stat().st_mtime_ns == before

    # An edited output is named, also by a dry run; its run alone is made again.
    text = made.read_text()
    made.write_text(text.replace(".", "9.", 1))
    until = ["--cores", "1", *until]
    refusal = repose(folder, "run", "-n", status=2)
    assert "results/runs/001/1/responses.json: content is 'something else'" in refusal
    assert "results/runs/001/1.json, and give the same command again" in refusal
    other = results / "runs" / "002" / "1" / "responses.json"
    others_before = other.stat().st_mtime_ns
    made.unlink()
    (results / "runs" / "001" / "1.json").unlink()
    repose(folder, "run", *until)
    assert made.read_text() == text
    assert other.stat().st_mtime_ns == others_before


@pytest.mark.slow
def test_other_strategies_ask_for_runs_until_they_have_an_answer(tmp_path):
    changes = {
        "strategy": "sequential",
        "seeds": 2,
        "sequential": {"start_samples": 6, "batch": 2, "most_runs": 16},
    }
    folder = written(tmp_path, STUDY | changes)
    repose(folder, "run", "--cores", "2")
    check = pd.read_csv(folder / "results" / "sequential" / "check.csv")
    assert check["deviation_percent"].abs().max() < 3
    card = json.loads((folder / "results" / "card.json").read_text())
    assert card["simulator"] == "toy 1.0"


@pytest.mark.slow
def test_faults_end_before_any_run(tmp_path):
    simulator = STUDY["simulator"] | {"command": "python toy.py"}
    folder = written(tmp_path, STUDY | {"simulator": simulator})
    text = repose(folder, "run", "-n", status=2)
    assert "simulator.command is 'python toy.py'; expected a list of strings" in text
    assert not (folder / "results").exists()


@pytest.mark.slow
def test_a_kill_loses_no_finished_run(tmp_path):
    # No run of these fails.
    ranges = STUDY["parameters"] | {"friction": [0.2, 0.7]}
    folder = written(tmp_path, STUDY | {"parameters": ranges})
    runs = folder / "results" / "runs"
    until = ["run", "--cores", "1", "--until", "dataset"]
    command, environment = call_of(*until)
    with open(folder / "killed.log", "wb") as log:
        # Its own session, so that the workflow and its jobs are killed together.
        workflow = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    deadline = time.monotonic() + 600
    while len(list(runs.glob("*/1.json"))) < 3 and time.monotonic() < deadline:
        assert workflow.poll() is None, (folder / "killed.log").read_text()
        time.sleep(0.02)
    os.killpg(workflow.pid, signal.SIGKILL)
    workflow.wait()
    made = {path: path.stat().st_mtime_ns for path in runs.glob("*/1/responses.json")}
    assert 3 <= len(made) < 14

    repose(folder, *until)
    for path, time_ns in made.items():
        assert path.stat().st_mtime_ns == time_ns, path
    dataset = pd.read_csv(folder / "results" / "dataset.csv")
    assert len(dataset) == 14
