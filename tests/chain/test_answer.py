"""The end of a calibration in words."""

import json

import pytest

from repose.chain import answer
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS

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
        "message": "No feasible solution: nothing met.",
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
    """The answer in the folder of results."""
    names = ("miga/summary.json", "validation/representative.csv", "miga/feasible.csv")
    return answer.read(config, *(f"{config['results_dir']}/{name}" for name in names))


@pytest.mark.parametrize(
    ("simulated", "met", "margin"),
    [(33.5, True, 0.5), (31.25, True, 0.25), (30.0, False, -1.0), (36.0, False, -2.0)],
)
def test_the_margin_is_the_way_to_the_nearer_end_of_the_range(simulated, met, margin, tmp_path):
    found = read(study(tmp_path, simulated))
    assert found.met is met
    assert found.checks[0].margin == margin
    assert ("NOT met" in str(found)) is not met
    assert ("which do NOT meet the targets:" in str(found)) is not met
    result = (
        "Targets met" if met else "Targets NOT met: predictions meet them, the simulation misses aor_deg by"
    )
    assert str(found).splitlines()[-1].startswith(result)
    assert met or f"aor_deg by {-margin:g} deg. What helps: `repose run refined`" in found.verdict
    assert all(name in str(found) for name in PARAMETERS)
    assert found.within == {1.0: 0.25, 2.0: 0.75}
    off = simulated - 32.0
    near = f"aor_deg {100 * off / 32:+.1f} +- 0.8 % ({abs(off) / 2:.2f} standard deviations of a repetition)"
    assert f"Simulated less measured: {near}." in str(found)
    assert "by these runs alone: within 1 %: 0.25, within 2 %: 0.75" in str(found)


def test_a_prediction_outside_the_targets_is_no_answer_even_where_the_simulation_is_inside(tmp_path):
    found = read(study(tmp_path, 32.5, feasible=False))
    assert not found.met
    assert "No feasible solution" in str(found)
    assert "nearest parameters" in str(found)
    assert found.verdict.startswith("Targets NOT met: no parameters are predicted to meet them.")


def test_failed_runs_have_no_number(tmp_path):
    found = read(study(tmp_path, ""))
    assert not found.met
    assert found.checks[0].margin is None
    assert "no number" in str(found)
    assert "misses aor_deg, which has no number." in found.verdict
    assert found.within == {1.0: None, 2.0: None}
    assert "the distance of the means from their targets is unknown" in str(found)


def test_a_study_that_has_not_run_is_reported(tmp_path):
    with pytest.raises(InputError, match=r"summary\.json"):
        read({"label": "wheat", "results_dir": str(tmp_path), "targets": [TARGET]})
