"""What runs again, and what does not: two workflows in one folder, an edited engine, lost files, changed targets."""

import json
import shutil

import pandas as pd
import pytest
from plans import planned, snakemake
from shared import target

from repose.common import source_code
from repose.common.errors import BAD_INPUT
from repose.common.lock import lock_folder
from repose.common.places import PACKAGE

pytestmark = pytest.mark.slow

TARGET = "results/quick/design/samples.csv"
QUICK = ("--cores", "1", "--configfile", "config/quick.yaml")
POURS = {"pour": 12, "validation_pour": 3, "trajectory": 1, "drum_run": 2}
# The stages of the method in their order, and one rule that follows each.
STAGES = {
    "design": ("design", "pour"),
    "pour": ("pour", "measure_runs"),
    "dataset": ("dataset", "network"),
    "network": ("network", "miga"),
    "miga": ("miga", "validation_pour"),
    "validate": ("validate", "card"),
    "drum": ("drum", "draw_drum"),
}


@pytest.mark.essential
def test_a_second_workflow_stops_with_one_message_before_it_writes(project):
    folder = project / "results" / "quick"
    with lock_folder(folder):
        done = snakemake(
            project,
            TARGET,
            *QUICK,
            "--config",
            "simulation={gravity_m_s2: 1.62}",
            status=2,
        )
    faults = [line for line in done.stderr.splitlines() if "error" in line]
    assert len(faults) == 1
    assert faults[0].startswith("repose: error: results/quick: workflow is 'process ")
    assert faults[0].endswith(
        "; expected one at a time; wait until the other workflow has ended"
    )
    assert {path.name for path in folder.iterdir()} == {".lock"}
    snakemake(project, TARGET, *QUICK, status=0)
    assert (folder / "config.json").exists()


def test_a_run_tells_the_processor_time_of_all_its_processes_and_keeps_that_of_earlier_runs(
    project,
):
    done = [snakemake(project, TARGET, *QUICK, "--forceall") for _ in range(2)]
    calls = pd.read_csv(project / "results/quick/benchmarks/calls.csv")
    expected = [call.used_s for call in done]
    assert calls["cpu_s"].tolist()[-2:] == pytest.approx(expected, rel=0.03, abs=0.1)
    expected = [call.took_s for call in done]
    assert calls["wall_s"].tolist()[-2:] == pytest.approx(expected, rel=0.1, abs=1.5)
    sums = [f"{calls[column].sum() / 60:.1f} min" for column in ("wall_s", "cpu_s")]
    line = f"; all {len(calls)} runs: {sums[0]} by the clock, {sums[1]} of processor time ("
    assert line in done[-1].stderr.splitlines()[-1]


@pytest.mark.essential
def test_a_call_that_pours_says_once_what_its_piles_cannot_be(project):
    line = "reach: WARNING: Target out of reach: "
    options = (*QUICK, "--config", "measure={response: whole}")
    design = snakemake(project, TARGET, *options, status=0)
    assert "reach: " not in design.stderr
    arguments = ("results/quick/heaps/001.pours.json", *options)
    assert "reach: " not in snakemake(project, "-n", *arguments).stderr
    done = snakemake(project, *arguments, status=0)
    messages = [text for text in done.stderr.splitlines() if text.startswith("reach: ")]
    assert len(messages) == 1
    assert messages[0].startswith(line)
    drum = {
        "targets": [target("drum_slip_deg", 44, 2, 40, 48, 5)],
        "posterior": {"shape_study": None},
    }
    (project / "mine.json").write_text(json.dumps(drum))
    arguments = ("results/quick/drum_runs/001.pours.json", *QUICK, "mine.json")
    done = snakemake(project, *arguments, "--forceall", status=0)
    assert "reach: " not in done.stderr


@pytest.mark.essential
def test_a_damaged_result_stops_the_workflow(project):
    arguments = (TARGET, *QUICK)
    snakemake(project, *arguments, status=0)
    path = project / TARGET
    good = path.read_text()
    path.write_text(good.replace("1", "2", 1))
    for more in ((), ("-n",)):
        done = snakemake(project, *arguments, *more, status=2)
        assert (
            f"repose: error: {TARGET}: content is 'something else'; expected "
            in done.stderr
        )
    path.unlink()
    snakemake(project, *arguments, status=0)
    assert path.read_text() == good


@pytest.mark.essential
def test_somebodys_file_stops_the_workflow(project):
    path = project / "results/quick/network/network.json"
    path.parent.mkdir(parents=True)
    path.write_text("mine")
    done = snakemake(project, "network", *QUICK, status=2)
    result = "repose: error: results/quick/network/network.json: file is 'there already'; expected a file that repose"
    assert result in done.stderr
    assert path.read_text() == "mine"
    path.unlink()


@pytest.mark.essential
@pytest.mark.parametrize("stage", STAGES)
def test_each_stage_can_be_forced_to_run_again(finished, stage):
    project, arguments = finished
    counts = planned(project, *arguments, "--forcerun", stage)
    forced, next_rule = STAGES[stage]
    assert counts[forced] == {"pour": 12}.get(stage, 1)
    assert counts[next_rule] >= 1
    order = list(STAGES)
    before = [name for name in order[: order.index(stage)] if stage != "drum"]
    assert not set(before) & set(counts)


MEASURED = {"measure_runs", "measure_validation_runs"}
# A module of each room: rules of the calibration that an edit of it plans, and rules that
# it does not plan.
EDITED = {
    "dem/simulation.py": (set(POURS), set()),
    "bench/funnel.py": (set(POURS) | MEASURED, set()),
    "grain/particle.py": (set(POURS) | {"shape"}, set()),
    "measure/angles.py": (MEASURED | {"drum", "dataset"}, {"pour"}),
    "calibrate/targets.py": ({"dataset", "network", "miga", "validate"}, {"pour"}),
    "calibrate/variance.py": ({"network"}, {"pour", "design"}),
    "calibrate/surrogates/two_layer.py": ({"network", "miga"}, {"pour", "dataset"}),
    "calibrate/search/miga.py": ({"miga", "solutions"}, {"pour", "network"}),
    "calibrate/expected_loss.py": ({"miga"}, {"pour", "network"}),
    "calibrate/uncertainty/posterior.py": ({"posterior_tables"}, {"miga", "dataset"}),
    "stages/card_study.py": ({"card"}, {"miga", "dataset"}),
    "report/renderer/render.py": ({"page", "draw_figure05"}, {"dataset", "card"}),
    "report/page/report.css": ({"page"}, {"dataset", "card"}),
    "stages/drum_quantities.csv": ({"drum"}, {"pour"}),
    "export/lammps.py": (set(), set()),
    "config/pipeline.py": (set(), set()),
    "common/files.py": (set(), set()),
    "cli/run.py": (set(), set()),
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the package, on which the rules then stand."""
    copy = tmp_path / "repose"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__", "data"))
    monkeypatch.setattr(source_code, "PACKAGE", copy)
    for function in vars(source_code).values():
        if hasattr(function, "cache_clear"):
            function.cache_clear()  # each fork fills its own
    return copy


@pytest.mark.essential
@pytest.mark.parametrize("name", EDITED)
def test_an_edit_plans_the_stages_that_use_the_module(finished, package, name):
    project, arguments = finished
    planned_rules, other_rules = EDITED[name]
    statement = b"\nEDITED = 1\n" if name.endswith(".py") else b"\n"
    (package / name).write_bytes((package / name).read_bytes() + statement)
    jobs = planned(project, *arguments)
    assert planned_rules <= set(jobs)
    assert not other_rules & set(jobs)
    if not planned_rules:
        assert jobs == {}
    if "pour" in planned_rules:
        assert {rule: jobs[rule] for rule in POURS} == POURS


def test_an_edit_of_comments_or_format_plans_nothing(finished, package):
    project, arguments = finished
    for path in package.rglob("*.py"):
        path.write_bytes(path.read_bytes() + b"\n\n# a comment\n")
    assert planned(project, *arguments) == {}


def test_a_changed_target_pours_the_new_solutions_alone_and_another_label_nothing(
    finished,
):
    project, arguments = finished
    config = json.loads((project / "results/quick/config.json").read_text())
    config["targets"][0]["value"] += 1
    (project / "target.json").write_text(json.dumps({"targets": config["targets"]}))
    jobs = planned(
        project,
        *arguments[:2],
        "target.json",
        *arguments[2:],
        "--",
        "calibration",
        "films",
    )
    assert "pour" not in jobs
    assert jobs["validation_pour"] == 3
    assert jobs["trajectory"] == 1
    assert jobs["drum_run"] == 2
    assert planned(project, *arguments, "label=other", "--", "calibration") == {}


@pytest.mark.parametrize(
    ("lost", "rule"),
    [
        ("network/network.json", "network"),
        ("heaps/003.pours.json", "pour"),
        ("heaps/003.json", "measure_runs"),
        ("validation/heaps/003.npz", "validation_pour"),
    ],
)
def test_a_file_that_a_killed_job_left_out_is_made_again(finished, lost, rule):
    project, arguments = finished
    path = project / "results/quick" / lost
    content = path.read_bytes()
    path.unlink()
    jobs = planned(project, *arguments)
    path.write_bytes(content)
    assert jobs[rule] == 1


def test_a_job_that_refuses_its_input_ends_the_workflow_as_the_verb_ends(finished):
    """Last in this file: the results of the finished study are empty, and the job's own are removed."""
    project, arguments = finished
    made = "results/quick/validation/solutions.csv"
    # `onerror` ends the workflow with the status that the job ended with.
    done = snakemake(
        project,
        "--cores",
        "1",
        *arguments,
        "--forcerun",
        "solutions",
        "--",
        made,
        status=BAD_INPUT,
    )
    # Snakemake prints the log of the job, and the workflow says how to go on.
    lines = [line.strip() for line in done.stderr.splitlines()]
    message = "repose: error: results/quick/miga/feasible.csv: rows is 0"
    assert any(line.startswith(message) for line in lines)
    *_, advice, times = lines
    assert "correct what the message above names" in advice
    assert times.startswith("time: ")
