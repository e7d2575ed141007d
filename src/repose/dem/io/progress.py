"""How far a run is: a bar at a terminal, a line a minute in a log."""

import sys
import time
from collections import deque
from typing import Any

WINDOW_S = 10.0  # wall time over which the speed is taken
LINE_EVERY_S = 60.0
BAR_EVERY_S = 0.1


def display(begin_s: float, end_s: float, time_step_s: float, progress: Any = None, label: str = "") -> Any:
    """A context manager that shows how far a run is, to be called with the simulated time [s] now and then.

    progress None: a bar where stderr is a terminal, else a line a minute. False: silence. Or a function of the
    simulated time. label: words before the numbers.
    """
    if progress is False:
        return _Display(begin_s, end_s, time_step_s, label)
    if callable(progress):
        return _Caller(progress)
    if progress is not None:
        raise ValueError(
            f"progress is {progress!r}; allowed: None, False, or a function of the simulated time"
        )
    shown = _Bar if sys.stderr.isatty() else _Lines
    return shown(begin_s, end_s, time_step_s, label)


class _Caller:
    """Passes the time on."""

    def __init__(self, function):
        self.function = function

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        return None

    def __call__(self, time_s):
        self.function(time_s)


class _Display:
    """Keeps the speed; shows nothing."""

    def __init__(self, begin_s, end_s, time_step_s, label):
        self.begin_s, self.end_s, self.time_step_s, self.label = begin_s, end_s, time_step_s, label
        self._marks = deque([(time.perf_counter(), begin_s)])

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        return None

    def __call__(self, time_s):
        now = time.perf_counter()
        self._marks.append((now, time_s))
        while len(self._marks) > 2 and now - self._marks[0][0] > WINDOW_S:
            self._marks.popleft()
        self.show(time_s, now)

    def show(self, time_s, now):
        """Show a simulated time at a wall time."""

    def words(self, time_s):
        """Simulated time, speed and time left in words."""
        (wall, begin), (now, end) = self._marks[0], self._marks[-1]
        speed = (end - begin) / max(now - wall, 1e-9)
        left = clock((self.end_s - time_s) / speed) if speed > 0.0 else "--:--"
        steps = speed / self.time_step_s
        return f"{time_s:.3f}/{self.end_s:.3f} s, {speed:.3g} s/s, {steps:.0f} steps/s, {left} left"


class _Lines(_Display):
    """A line a minute on stderr, none in a run that is shorter."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self._next = time.perf_counter() + LINE_EVERY_S

    def show(self, time_s, now):
        """Write a line where the last one is a minute old."""
        if now >= self._next:
            self._next = now + LINE_EVERY_S
            print(" ".join([self.label, self.words(time_s)]).strip(), file=sys.stderr, flush=True)


class _Bar(_Display):
    """A bar on the terminal."""

    def __enter__(self):
        # a quarter of a second of imports that no quiet run should pay for
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[words]}")
        self._rich = Progress(*columns, console=Console(stderr=True), auto_refresh=False)
        self._rich.start()
        self._next = 0.0
        self._task = self._rich.add_task(self.label, total=self.end_s - self.begin_s, words="")
        return self

    def __exit__(self, *_error):
        self._rich.stop()

    def show(self, time_s, now):
        """Draw the bar anew, ten times a second at most."""
        if now < self._next and time_s < self.end_s:
            return
        self._next = now + BAR_EVERY_S
        done = time_s - self.begin_s
        self._rich.update(self._task, completed=done, words=self.words(time_s), refresh=True)


def clock(seconds: float) -> str:
    """Seconds as 1:02:03, or 02:03 below an hour."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes:02d}:{seconds:02d}"
