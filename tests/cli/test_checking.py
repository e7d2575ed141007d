"""What `repose check` says of a time step, of numbers that it computed, and while the engine is compiled."""

import sys
import time
from types import SimpleNamespace

import pytest

from repose.cli import checking
from repose.config import computed, cost
from repose.dem.time_steps import Limit


@pytest.mark.parametrize(
    ("step_s", "hint"),
    [
        (4.0e-6, "; with 3.2e-05 a run takes 0.12 of the time"),  # 0.9 of 4.09e-5 is 3.681e-5
        (3.0e-5, ""),
    ],
)
def test_a_time_step_far_below_the_longest_is_reported_with_the_saved_time(step_s, hint):
    limit = Limit(4.09e-5, "as a pile has it")
    assert checking.about_step(step_s, limit).endswith(f"at most 4.09e-05, as a pile has it{hint}")


@pytest.mark.parametrize("longest_s", [1.0e-3, 3.3e-5, 9.99e-7, 2.0e-6 / 0.8])
def test_the_advised_step_has_two_digits_and_is_allowed(longest_s):
    step = computed.advised_step_s(longest_s)
    assert step == float(f"{step:.2g}")
    assert 0.7 * longest_s < step <= computed.STEP_SHARE * longest_s * (1 + 1e-12)


def test_the_cost_is_that_of_the_least_disturbed_pour(monkeypatch):
    """Three pours; another program slowed two of them. None ends before its pile is timed."""
    took = iter([90.0, 50.0, 70.0])

    def pour(self, small, until_rest):
        assert not until_rest
        time.sleep(0.02)
        return SimpleNamespace(us_per_step=next(took))

    monkeypatch.setattr("repose.apparatus.funnel.FunnelTest.pour", pour)
    monkeypatch.setattr(time, "process_time", time.perf_counter)  # all of the time is its own
    grains = cost.FEWEST_TIMED
    ranges: dict = dict.fromkeys(("e_gg", "e_gp"), (0.1, 0.5))
    ranges |= dict.fromkeys(("mus_gg", "mur_gg", "mus_gp", "mur_gp"), (0.1, 0.3))
    config = {
        "simulation": {"time_step_s": 1e-5, "gravity_m_s2": 9.81, "tension": "release", "rest_energy_j": 1e-9},
        "funnel": {"berries": grains},
        "parameters": ranges,
    }
    assert cost.measured_berry_step_s(config, {}, None) == pytest.approx(50e-6 / grains, rel=0.05)


def test_a_terminal_shows_the_seconds_of_the_compilation(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(checking, "TICK_S", 0.01)
    with checking.elapsed_seconds_shown("compiling"):
        time.sleep(0.1)
    assert "\rcompiling; 0 s" in capsys.readouterr().err


def test_a_log_gets_one_line(capsys):
    with checking.elapsed_seconds_shown("compiling"):
        pass
    assert capsys.readouterr().err == "compiling\n"
