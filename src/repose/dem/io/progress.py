"""How far a run is: a bar at a terminal, a line a minute in a log."""

import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any

WINDOW_S = 10.0  # wall time over which the speed is taken
LINE_EVERY_S = 60.0
BAR_EVERY_S = 0.1


@contextmanager
def display(
    begin_s: float,
    end_s: float,
    time_step_s: float,
    progress: Any = None,
    label: str = "",
) -> Iterator[Callable[[float], Any]]:
    """Show a progress bar; yield a callback that takes the simulated time [s].

    progress None: a bar where stderr is a terminal, else a line a minute. False: silence. Or a function of the
    simulated time. label: words before the numbers.
    """
    if progress is False or callable(progress):
        yield (lambda time_s: None) if progress is False else progress
        return
    if progress is not None:
        raise ValueError(
            f"progress is {progress!r}; expected None, False, or a function of the simulated time"
        )
    marks = deque([(time.perf_counter(), begin_s)])
    terminal = sys.stderr.isatty()
    # a line comes after a minute, a bar at once and at the end
    due = 0.0 if terminal else time.perf_counter() + LINE_EVERY_S

    def report(time_s: float) -> None:
        nonlocal due
        now = time.perf_counter()
        marks.append((now, time_s))
        while len(marks) > 2 and now - marks[0][0] > WINDOW_S:
            marks.popleft()
        if now >= due or (terminal and time_s >= end_s):
            due = now + (BAR_EVERY_S if terminal else LINE_EVERY_S)
            show(time_s, _words(marks, end_s, time_step_s))

    with (
        _bar(label, begin_s, end_s)
        if terminal
        else nullcontext(partial(_line, label)) as show
    ):
        yield report


def _words(marks: deque[tuple[float, float]], end_s: float, time_step_s: float) -> str:
    """Tell simulated time, speed and time left."""
    (wall, begin), (now, time_s) = marks[0], marks[-1]
    speed = (time_s - begin) / max(now - wall, 1e-9)
    left = clock((end_s - time_s) / speed) if speed > 0.0 else "--:--"
    return f"{time_s:.3f}/{end_s:.3f} s, {speed:.3g} s/s, {speed / time_step_s:.0f} steps/s, {left} left"


def _line(label: str, _time_s: float, words: str) -> None:
    """Write a line on stderr."""
    print(" ".join([label, words]).strip(), file=sys.stderr, flush=True)


@contextmanager
def _bar(
    label: str, begin_s: float, end_s: float
) -> Iterator[Callable[[float, str], None]]:
    """Draw a bar on the terminal."""
    # a quarter of a second of imports that no quiet run should pay for
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[words]}"),
    )
    with Progress(*columns, console=Console(stderr=True), auto_refresh=False) as drawn:
        task = drawn.add_task(label, total=end_s - begin_s, words="")
        yield lambda time_s, words: drawn.update(
            task, completed=time_s - begin_s, words=words, refresh=True
        )


def clock(seconds: float) -> str:
    """Seconds as 1:02:03, or 02:03 below an hour."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return (
        f"{hours}:{minutes:02d}:{seconds:02d}"
        if hours
        else f"{minutes:02d}:{seconds:02d}"
    )
