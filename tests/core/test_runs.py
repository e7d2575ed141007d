"""Runs of one parameter set: status, mean, standard error."""

import math
import subprocess
import sys

import pytest
from refusals import value_error
from shared import one_run

from repose.core.runs import Recorded, error_of, summarise_runs

RECORDED = Recorded(("aor_deg", "height_mm", "discharge_s"), ("discharge_s",), ("aor_deg", "berries"))


def test_mean_and_standard_error_by_hand():
    summary = summarise_runs([one_run(1, aor=20.0), one_run(2, aor=22.0), one_run(3, aor=27.0)], RECORDED)
    assert (summary["status"], summary["reason"], summary["n_seeds"]) == ("ok", "", 3)
    assert summary["aor_deg"] == pytest.approx(23.0)
    assert summary["aor_se_deg"] == pytest.approx(math.sqrt((9 + 1 + 16) / 2 / 3))
    assert summary["height_se_mm"] == 0.0
    assert summary["discharge_s"] == pytest.approx(17.0)
    single = summarise_runs([one_run(1)], RECORDED)
    assert (single["status"], single["aor_deg"], single["aor_se_deg"]) == ("ok", 22.0, None)


@pytest.mark.parametrize(
    ("statuses", "expected"),
    [
        (["ok", "jammed"], "ok"),
        (["ok", "jammed", "no_flank", "no_flank"], "no_flank"),
        (["jammed", "no_flank"], "jammed"),
        (["unstable"], "unstable"),
        (["ok", "ok", "jammed", "jammed"], "ok"),
    ],
)
def test_status_is_ok_from_half_on_and_else_the_commonest(statuses, expected):
    summary = summarise_runs([one_run(k, status) for k, status in enumerate(statuses)], RECORDED)
    assert summary["status"] == expected
    assert (summary["aor_deg"] is None) is (expected != "ok")


def test_no_runs_are_refused_and_targets_stand_in_front_with_their_errors():
    value_error("at least one run", summarise_runs, [], RECORDED)
    ours = RECORDED.beginning_with(("discharge_s", "base_radius_mm"))
    assert ours.summary == (
        *("status", "reason", "n_seeds", "discharge_s", "discharge_se_s", "base_radius_mm", "base_radius_se_mm"),
        *("aor_deg", "aor_se_deg", "height_mm", "height_se_mm"),
    )
    assert ours.single == ("discharge_s", "base_radius_mm", "aor_deg", "berries")
    same = Recorded(RECORDED.means, RECORDED.without_error, ("aor_deg", "height_mm", "berries"))
    assert RECORDED.beginning_with(("aor_deg", "height_mm")) == same
    assert error_of("packing_percent") == "packing_se_percent"


def test_a_heap_job_does_not_pay_for_pandas():
    code = "import sys; from repose.core.runs import summarise_runs; sys.exit('pandas' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env={"PYTHONPATH": ":".join(sys.path)}).returncode == 0
