"""Progress: a bar at a terminal, a line a minute in a log, silence on request."""

import io
import re

import pytest

from repose.dem.io import progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_log_gets_a_line_a_minute_and_a_terminal_a_bar_with_the_time_left(
    monkeypatch, capsys
):
    now = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    with progress.show_progress(0.0, 10.0, 1e-3, label="seed 7") as report:
        for k in range(1, 131):
            now[0] = float(k)
            report(0.02 * k)
    lines = capsys.readouterr().err.splitlines()
    expected = (("1.200", "07:20"), ("2.400", "06:20"))
    expected = [
        f"seed 7 {made}/10.000 s, 0.02 s/s, 20 steps/s, {left} left"
        for made, left in expected
    ]
    assert lines == expected
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "xterm")
    with progress.show_progress(1.0, 3.0, 1e-3) as report:
        report(2.0)
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", screen.getvalue())
    assert re.search(r"2\.000/3\.000 s, .* s/s, \d+ steps/s, \d\d:\d\d left", text)
    assert "━" in text


def test_a_time_is_told_as_by_a_clock():
    assert [progress.format_duration(s) for s in (0.4, 59.6, 3723)] == [
        "00:00",
        "01:00",
        "1:02:03",
    ]


@pytest.mark.parametrize("choice", [None, False])
def test_short_runs_in_a_log_and_silent_ones_write_nothing(choice, capsys):
    with progress.show_progress(0.0, 1.0, 1e-3, choice) as report:
        report(0.5)
    assert capsys.readouterr().err == ""
