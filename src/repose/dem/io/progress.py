"""Show the progress of a run: a bar in a terminal, a line per minute in a log."""

import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, NamedTuple

WINDOW_S = 10.0  # wall time over which the speed is measured
LINE_EVERY_S = 60.0  # wall time between two lines
BAR_EVERY_S = 0.1  # wall time between two updates of the bar


class Mark(NamedTuple):
    """The simulated time at a wall time."""

    wall_s: float
    time_s: float


@contextmanager
def show_progress(
    begin_s: float,
    end_s: float,
    time_step_s: float,
    progress: Any = None,
    label: str = "",
) -> Iterator[Callable[[float], Any]]:
    """Show the progress of a run, as long as the context lasts.

    Parameters
    ----------
    begin_s, end_s : float
        Simulated time at the start and at the end [s].
    time_step_s : float
        Time step [s].
    progress : callable, False or None
        None shows a bar if stderr is a terminal; otherwise a line per minute. False
        shows nothing. A function is called with the simulated time instead.
    label : str
        Label that is shown before the numbers.

    Yields
    ------
    callable
        A function of the simulated time [s], to be called after each chunk of steps.

    Raises
    ------
    ValueError
        If `progress` is anything else.
    """
    if progress is False:
        yield lambda _time_s: None
    elif callable(progress):
        yield progress
    elif progress is not None:
        raise ValueError(
            f"progress is {progress!r}; "
            "expected None, False, or a function of the simulated time"
        )
    else:
        with _report_on_stderr(begin_s, end_s, time_step_s, label) as report:
            yield report


@contextmanager
def _report_on_stderr(
    begin_s: float, end_s: float, time_step_s: float, label: str
) -> Iterator[Callable[[float], None]]:
    """Show the progress on stderr, as a bar or as lines.

    Parameters
    ----------
    begin_s, end_s, time_step_s, label
        See `show_progress`.

    Yields
    ------
    callable
        A function of the simulated time [s].
    """
    is_terminal = sys.stderr.isatty()
    start = Mark(time.perf_counter(), begin_s)
    with _choose_display(is_terminal, label, begin_s, end_s) as show:
        yield _Reporter(show, start, end_s, time_step_s, has_bar=is_terminal)


class _Reporter:
    """Shows the progress at intervals, when it is called with the simulated time.

    Parameters
    ----------
    show : callable
        Function that shows the simulated time and a description of the speed.
    start : Mark
        Simulated and wall time at which the run began.
    end_s, time_step_s : float
        Simulated time at the end, and the time step [s].
    has_bar : bool
        Whether `show` draws a bar. It is drawn at once, again after `BAR_EVERY_S`, and
        at the end. The first line comes after `LINE_EVERY_S`.
    """

    def __init__(
        self,
        show: Callable[[float, str], None],
        start: Mark,
        end_s: float,
        time_step_s: float,
        has_bar: bool,
    ) -> None:
        self._show = show
        self._end_s = end_s
        self._time_step_s = time_step_s
        self._has_bar = has_bar
        self._interval_s = BAR_EVERY_S if has_bar else LINE_EVERY_S
        self._next_report_s = 0.0 if has_bar else start.wall_s + LINE_EVERY_S
        self._marks = deque([start])  # of the last `WINDOW_S`

    def __call__(self, time_s: float) -> None:
        """Show the simulated time and the speed, if a report is due.

        Parameters
        ----------
        time_s : float
            Simulated time [s].
        """
        now = time.perf_counter()
        # The speed is measured between the first and the last mark, a pair of wall time
        # and simulated time. Marks older than the window are dropped, but two remain.
        self._marks.append(Mark(now, time_s))
        while len(self._marks) > 2 and now - self._marks[0].wall_s > WINDOW_S:
            self._marks.popleft()

        # A bar is also drawn at the end, even if no report is due, so that it is full.
        is_last_bar = self._has_bar and time_s >= self._end_s
        # A report is due at `_next_report_s`. `_show` draws the bar or prints a line.
        if now >= self._next_report_s or is_last_bar:
            self._next_report_s = now + self._interval_s
            text = _describe_speed(
                self._marks[0], self._marks[-1], self._end_s, self._time_step_s
            )
            self._show(time_s, text)


def _choose_display(
    is_terminal: bool, label: str, begin_s: float, end_s: float
) -> AbstractContextManager[Callable[[float, str], None]]:
    """Choose whether a bar or lines show the simulated time and the speed."""
    if is_terminal:
        return _draw_bar(label, begin_s, end_s)

    def write_line(_time_s: float, text: str) -> None:
        print(f"{label} {text}".strip(), file=sys.stderr, flush=True)

    return nullcontext(write_line)


def _describe_speed(first: Mark, last: Mark, end_s: float, time_step_s: float) -> str:
    """Describe the simulated time, the speed and the wall time left.

    Parameters
    ----------
    first, last : Mark
        The marks between which the speed is measured.
    end_s : float
        Simulated time at the end [s].
    time_step_s : float
        Time step [s].
    """
    wall_s = max(last.wall_s - first.wall_s, 1e-9)
    speed = (last.time_s - first.time_s) / wall_s
    time_left = (
        format_duration((end_s - last.time_s) / speed) if speed > 0.0 else "--:--"
    )
    return (
        f"{last.time_s:.3f}/{end_s:.3f} s, {speed:.3g} s/s, "
        f"{speed / time_step_s:.0f} steps/s, {time_left} left"
    )


@contextmanager
def _draw_bar(
    label: str, begin_s: float, end_s: float
) -> Iterator[Callable[[float, str], None]]:
    """Draw a bar on the terminal, as long as the context lasts.

    Parameters
    ----------
    label : str
        Label that is shown before the bar.
    begin_s, end_s : float
        Simulated time at which the bar is empty and full [s].

    Yields
    ------
    callable
        A function of the simulated time [s] and of the text after the bar. It draws the
        bar and the text.
    """
    # Imported here because it takes a quarter of a second and only a bar needs it.
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[words]}"),
        console=Console(stderr=True),
        auto_refresh=False,
    )
    with progress:
        task = progress.add_task(label, total=end_s - begin_s, words="")

        def update(time_s: float, text: str) -> None:
            progress.update(task, completed=time_s - begin_s, words=text, refresh=True)

        yield update


def format_duration(seconds: float) -> str:
    """Format a duration as 1:02:03, or as 02:03 below an hour."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours}:{minutes:02d}:{seconds:02d}"
    return f"{minutes:02d}:{seconds:02d}"
