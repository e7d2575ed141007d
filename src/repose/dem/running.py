"""Runs of any length: in chunks that Ctrl-C can end, with progress, records and checkpoints on the way."""

import time
from typing import Any

from .checks import not_negative, positive
from .io.progress import display

CHUNK_S = 0.2  # wall time between two looks at the clock
FIRST_CHUNK = 20  # steps


def run(
    simulation: Any,
    seconds: float,
    progress: Any,
    record: Any,
    record_every_s: float | None,
    checkpoint: Any,
    every_s: float,
) -> None:
    """Advance a simulation with progress, records and checkpoints.

    Parameters
    ----------
    simulation : Simulation
        That is advanced.
    seconds, progress, record, record_every_s, checkpoint, every_s : object
        See `Simulation.run`.

    Raises
    ------
    ValueError
        If one of them is not allowed.
    """
    begin_s, dt = simulation.time_s, simulation.time_step_s
    end = simulation.steps + round(not_negative("seconds", seconds) / dt)
    records = _functions(record)
    between = _steps_between(record_every_s, dt) if records else 0
    positive("every_s", every_s)
    chunk, saved = FIRST_CHUNK, time.monotonic()
    with display(begin_s, end * dt, dt, progress) as report:
        try:
            if records and simulation.steps == 0:
                _keep(records, simulation)
            while simulation.steps < end:
                made = min(end - simulation.steps, chunk)
                if records:
                    made = min(made, between - simulation.steps % between)
                chunk = _next_chunk(made, _timed(simulation.run_steps, made))
                if records and simulation.steps % between == 0:
                    _keep(records, simulation)
                report(simulation.time_s)
                if checkpoint is not None and time.monotonic() - saved >= every_s:
                    simulation.save(checkpoint)
                    saved = time.monotonic()
        except KeyboardInterrupt:
            if checkpoint is not None:
                simulation.save(checkpoint)
            raise
    if checkpoint is not None:
        simulation.save(checkpoint)


def _functions(record):
    """The functions to call with the simulation."""
    functions = [] if record is None else list(record) if isinstance(record, list | tuple) else [record]
    if not all(callable(function) for function in functions):
        raise ValueError(f"record is {record!r}; allowed: a function of the simulation, or a list of them")
    return functions


def _steps_between(record_every_s, dt):
    """Steps between two records."""
    if record_every_s is None:
        raise ValueError("record_every_s is None; allowed: above 0 where there is something to record")
    return max(1, round(positive("record_every_s", record_every_s) / dt))


def _keep(records, simulation):
    """Call every function with the simulation."""
    for function in records:
        function(simulation)


def _timed(function, argument):
    """Wall time that a call takes [s]."""
    began = time.perf_counter()
    function(argument)
    return time.perf_counter() - began


def _next_chunk(made, took_s):
    """Steps that take about CHUNK_S, where `made` steps took `took_s`; the time to compile counts, too."""
    wanted = made * CHUNK_S / max(took_s, 1e-6)
    return max(1, round(min(max(wanted, 0.1 * made), 10.0 * made)))
