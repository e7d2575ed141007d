"""The end of a calibration in words."""

import json
import re
import textwrap
from pathlib import Path
from types import SimpleNamespace

import pytest
from refusals import input_error
from shared import studied

from repose import strategies
from repose.chain import answer
from repose.core.parameters import PARAMETERS

ROOT = Path(__file__).parents[2]
TARGET = {
    "response": "aor_deg",
    "apparatus": "funnel",
    "value": 32.0,
    "sd": 2.0,
    "repetitions": 10,
    "range": [31.0, 34.0],
}


def study(folder, simulated, feasible=True):
    """Configuration of a study whose search and check are written to folder."""
    summary = {
        "feasible": feasible,
        "message": "The search: nothing met.",
        "representative": dict.fromkeys(PARAMETERS, 0.25),
    }
    (folder / "miga").mkdir()
    (folder / "miga" / "summary.json").write_text(json.dumps(summary))
    (folder / "validation").mkdir()
    (folder / "validation" / "representative.csv").write_text(
        "response,simulated,simulated_se,n_seeds,status,within_1_percent,within_2_percent\n"
        f"aor_deg,{simulated},0.25,16,ok,{'0.25,0.75' if simulated else ','}\n"
    )
    return {"label": "wheat", "results_dir": str(folder), "targets": [TARGET]}


def read(config):
    names = ("miga/summary.json", "validation/representative.csv", "miga/feasible.csv")
    return answer.read(studied(config), *(f"{config['results_dir']}/{name}" for name in names))


@pytest.mark.parametrize(
    ("simulated", "met", "margin"), [(33.5, True, 0.5), (31.25, True, 0.25), (30.0, False, -1.0), (36.0, False, -2.0)]
)
def test_the_margin_is_the_way_to_the_nearer_end_of_the_range(simulated, met, margin, tmp_path):
    found = read(study(tmp_path, simulated))
    assert found.met is met
    assert found.checks[0].margin == margin
    assert ("NOT met" in str(found)) is not met
    lines = str(found).splitlines()
    off = 100 * (simulated - 32.0) / 32.0
    said = f"wheat: targets {'met' if met else 'NOT met'}"
    numbers = f"Angle of repose {simulated:g} +- 0.25 deg (measured 32, {off:+.1f} %)."
    side = "below" if simulated < 31.0 else "above"
    missed = f" The simulated angle of repose lies {-margin:g} deg {side} its range."
    assert lines[:2] == [f"{said}. {numbers}{'' if met else missed}", "The calibrated parameters:"]
    assert found.reason == "The simulated mean lies inside the range." if met else missed[1:]
    assert lines[-1].startswith("Tables: " if met else "What helps: `repose run refined`")
    assert str(found).count(said) == 1
    assert all(name in str(found) for name in PARAMETERS)
    assert found.within == {1.0: 0.25, 2.0: 0.75}
    off = simulated - 32.0
    near = f"aor_deg {100 * off / 32:+.1f} +- 0.8 % ({abs(off) / 2:.2f} standard deviations of a repetition)"
    assert f"Simulated less measured: {near}." in str(found)
    assert "by these runs alone: within 1 %: 0.25, within 2 %: 0.75" in str(found)


def test_a_prediction_outside_the_targets_is_no_answer_even_where_the_simulation_is_inside(tmp_path):
    found = read(study(tmp_path, 32.5, feasible=False))
    assert not found.met
    lines = str(found).splitlines()
    assert lines[0].startswith("wheat: targets NOT met. Angle of repose 32.5 +- 0.25 deg")
    assert lines[0].endswith(
        " No parameter set is predicted inside the range; the simulated mean lies inside the range."
    )
    assert lines[1:3] == ["The search: nothing met.", "The nearest parameters:"]
    assert lines[-1].startswith("What helps: wider parameters or targets; ")
    assert found.out_of_reach


def test_failed_runs_have_no_number(tmp_path):
    found = read(study(tmp_path, ""))
    assert not found.met
    assert found.checks[0].margin is None
    assert "no number" in str(found)
    assert found.verdict.endswith(
        "Angle of repose without a number (measured 32). The angle of repose has no number, as its runs ended ok."
    )
    assert found.within == {1.0: None, 2.0: None}
    assert "the distance of the means from their targets is unknown" in str(found)


def test_a_small_run_says_so_first(tmp_path):
    first = str(read(study(tmp_path, 32.0) | {"small_run": True})).splitlines()[0]
    assert first == (
        "wheat: a small run, its numbers are no calibration: targets met. "
        "Angle of repose 32 +- 0.25 deg (measured 32, +0.0 %)."
    )


def of_two(feasible=True, out_of_reach=False, angle=32.0, height=66.0, status="ok"):
    checks = (
        answer.Check("aor_deg", "deg", angle, None, 9, status, 32.0, 2.0, 31.0, 34.0, predicted=32.5),
        answer.Check("my_mm", "mm", height, 0.5, 9, status, 66.0, 2.0, 64.0, 68.0),
    )
    return answer.Result("two", {}, feasible, "", checks, "", {}, out_of_reach=out_of_reach)


@pytest.mark.parametrize(
    ("given", "met", "reason"),
    [
        ({}, True, "The simulated means lie inside both ranges."),
        ({"height": 70.0}, False, "The simulated my_mm lies 2 mm above its range."),
        (
            {"angle": 30.0, "height": 63.0},
            False,
            "The simulated angle of repose lies 1 deg below its range and "
            "the simulated my_mm lies 1 mm below its range.",
        ),
        (
            {"angle": 30.0, "feasible": False, "out_of_reach": True},
            False,
            "No parameter set is predicted inside both ranges; "
            "the simulated angle of repose lies 1 deg below its range.",
        ),
        (
            {"feasible": False},
            False,
            "The answer is not predicted inside both ranges; the simulated means lie inside both ranges.",
        ),
        (
            {"angle": None, "height": None, "status": answer.NOT_AGAIN},
            None,
            "The answer is predicted inside both ranges; the answer was not simulated again.",
        ),
    ],
)
def test_the_reason_says_which_response_misses_by_how_much(given, met, reason):
    found = of_two(**given)
    assert found.met is met
    assert found.reason == reason
    assert found.verdict.endswith(reason) is not bool(met)


def test_an_answer_that_was_not_simulated_has_its_prediction_in_the_first_line():
    found = of_two(angle=None, height=None, status=answer.NOT_AGAIN)
    assert found.verdict.startswith(
        "two: targets not checked yet. Angle of repose predicted 32.5 deg (measured 32, +1.6 %), "
        "my_mm without a number (measured 66). "
    )


@pytest.mark.parametrize(
    ("summary", "out_of_reach"),
    [
        ({"feasible": True}, False),
        ({"feasible": False}, True),
        ({"feasible": False, "stop": "budget"}, False),
        ({"feasible": False, "stop": "out_of_reach"}, True),
        ({"feasible": True, "stop": "out_of_reach"}, False),
    ],
)
def test_out_of_reach_is_a_miss_that_was_predicted(summary, out_of_reach):
    assert answer.out_of_reach(summary) is out_of_reach


HANDLER = re.search(r"^onsuccess:\n((?: {4}.*\n)+)", (ROOT / "workflow/Snakefile").read_text(), re.MULTILINE)


@pytest.mark.parametrize("strategy", strategies.names())
@pytest.mark.parametrize("simulated", [32.0, 30.0])
@pytest.mark.parametrize("feasible", [True, False])
def test_a_finished_run_of_each_strategy_prints_the_verdict_first_and_ends_well(
    strategy, simulated, feasible, tmp_path, capsys
):
    """The handler of the workflow; a SystemExit in it would be the status of the run."""
    names = {"summary": "miga/summary.json", "representative": "validation/representative.csv"}
    files = {name: tmp_path / path for name, path in names.items()}
    made = SimpleNamespace(rule="conclude", feasible="solutions.csv", table4="t4.csv", **files)
    known = {"answers": answer, "ANSWERS": {strategy: made}, "RESULTS": str(tmp_path)}
    known |= {"STUDY": studied(study(tmp_path, simulated, feasible))}
    known |= {"CALL": SimpleNamespace(made=lambda path, results: (path, results) == ("t4.csv", str(tmp_path)))}
    exec(textwrap.dedent(HANDLER[1]), known)
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(
        f"wheat: targets {'met' if feasible and simulated == 32.0 else 'NOT met'}. Angle of repose "
    )


def test_a_study_that_has_not_run_is_reported(tmp_path):
    input_error(r"summary\.json", read, {"label": "wheat", "results_dir": str(tmp_path), "targets": [TARGET]})
