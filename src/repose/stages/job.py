"""Simulate, save and measure a job: all runs of one parameter set in a bench test.

The files of a job are NAME.pours.json (how each run ended), NAME.npz (arrays of each
run, named ARRAY_SEED), NAME_trajectory_SEED.npz (frames, if requested) and, once it is
measured, NAME.json. The wall time of each run is only in timings/NAME.json, so that
equal runs leave equal files otherwise.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from repose.bench.bench_test import BenchTest, Run, Scene, bench_of
from repose.bench.parameters import parameters_among
from repose.calibrate.runs import summarise_runs
from repose.calibrate.seeds import UNNAMED
from repose.common.errors import InputError
from repose.common.files import write_json, write_npz
from repose.common.ledger import check_replaceable
from repose.measure.saved_pours import (
    POURS_ENDING,
    positions_file,
    read_positions,
    read_pours,
    select_pour,
)
from repose.stages.kept_runs import KeptRuns, read_measurement, write_measurement

# A function that takes the seed of a run. It returns a context manager whose value is
# None or a function that takes the simulated time [s].
Progress = Callable[[int], AbstractContextManager[Callable[[float], object] | None]]


def run_once(test: BenchTest[Any], scene: Scene) -> tuple[dict[str, Any], Run]:
    """Run a bench test once and measure the run, without writing files.

    Parameters
    ----------
    test : BenchTest
        The bench test.
    scene : Scene
        The scene, whose seed is that of the run.

    Returns
    -------
    dict
        The measured run.
    Run
        The run itself.
    """
    run = test.run(scene)
    return test.result(run.record, run.arrays, scene), run


def describe_job(test: BenchTest[Any], scene: Scene, name: object) -> dict[str, Any]:
    """Describe a job: its sample, parameters, time step and bench test.

    Each JSON file of the job begins with this description.

    Parameters
    ----------
    test : BenchTest
        The bench test.
    scene : Scene
        The scene, which has the parameters and the time step.
    name : object
        Name of the job. If it consists of digits, it is the number of a sample.

    Returns
    -------
    dict
        ``sample``, ``parameters``, ``time_step_s`` and ``apparatus``, the name of the
        bench test. The funnel is the default bench test, so its name is left out.
    """
    description: dict[str, Any] = {}
    # `UNNAMED` is the name of the funnel.
    if test.name != UNNAMED:
        description["apparatus"] = test.name
    description["sample"] = int(str(name)) if str(name).isdigit() else name
    description["parameters"] = {
        parameter: float(scene.parameters[parameter])
        for parameter in parameters_among(scene.parameters)
    }
    description["time_step_s"] = scene.simulation.time_step_s
    return description


def run_job(
    test: BenchTest[Any],
    scene: Scene,
    name: str,
    seeds: Iterable[int],
    out_dir: str | PathLike,
    interval_s: float | None = None,
    progress: Progress | None = None,
    keep_runs: bool = False,
) -> Path:
    """Run one parameter set with all its seeds, and write the files of the job.

    Parameters
    ----------
    test : BenchTest
        The bench test.
    scene : Scene
        The scene of the runs.
    name : str
        Name of the job.
    seeds : iterable of int
        Seeds of the runs.
    out_dir : path
        Folder for the files of the job.
    interval_s : float, optional
        Simulated time between the frames that are written; by default none are.
    progress : callable, optional
        Function that shows the progress of each run; see `Progress`.
    keep_runs : bool, optional
        Whether to keep each run (`kept_runs`), and to read kept runs instead of making
        them again. A job with one more seed then makes only the run of this seed, and a
        job that was killed continues.

    Returns
    -------
    Path
        NAME.pours.json, which is written last.
    """
    out = Path(out_dir)
    seeds = list(seeds)
    # Before minutes of simulation, make sure that no file of another program is
    # replaced.
    names = [f"{name}.npz", f"{name}{POURS_ENDING}"]
    if interval_s is not None:
        names += [_name_trajectory_file(name, seed) for seed in seeds]
    for file in names:
        check_replaceable(out / file)

    records: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    wall_s: dict[str, float] = {}
    description = describe_job(test, scene, name)
    kept_runs = KeptRuns(out, name, description) if keep_runs else None
    for seed in seeds:
        run = None
        # Kept runs have no frames. If frames are requested, make the run again.
        if kept_runs is not None and interval_s is None:
            run = kept_runs.read(seed)
        if run is None:
            start = time.perf_counter()
            with progress(seed) if progress else nullcontext() as report:
                run = test.run(scene.with_seed(seed), interval_s, report)
            wall_s[str(seed)] = round(time.perf_counter() - start, 3)
            if kept_runs is not None:
                kept_runs.write(run)
        records.append(run.record)
        for key, values in run.arrays.items():
            arrays[f"{key}_{seed}"] = values
        if run.frames is not None:
            write_npz(out / _name_trajectory_file(name, seed), run.frames)

    if wall_s:
        write_timings(out, name, wall_s)
    write_npz(out / f"{name}.npz", arrays)
    path = out / f"{name}{POURS_ENDING}"
    write_json(path, description | {"pours": records})
    return path


def _name_trajectory_file(name: str, seed: int) -> str:
    """Name the file of the frames of a run."""
    return f"{name}_trajectory_{seed}.npz"


def write_timings(folder: Path, name: str, wall_s: Mapping[str, float]) -> None:
    """Write the wall time [s] of each run of a job, by its seed."""
    write_json(folder / "timings" / f"{name}.json", {"wall_s": dict(wall_s)})


def measure_job(
    scene: Scene,
    pours_json: str | PathLike,
    out_dir: str | PathLike | None = None,
    keep_runs: bool = False,
) -> dict[str, Any]:
    """Measure the runs of a saved job, and write the result as NAME.json.

    Parameters
    ----------
    scene : Scene
        The scene of the runs.
    pours_json : path
        NAME.pours.json of the saved job, where NAME is the name of the job.
    out_dir : path, optional
        Folder for NAME.json. The default is the folder of the job.
    keep_runs : bool, optional
        Whether to keep the result in the folder `runs`, and to read it from there as
        long as it is valid, instead of measuring again (`kept_runs`).

    Returns
    -------
    dict
        The content of NAME.json.
    """
    path = Path(pours_json)
    result = read_measurement(path) if keep_runs else None
    if result is None:
        result = measure_runs(scene, path)
        if keep_runs:
            write_measurement(path, result)
    out = path.parent if out_dir is None else Path(out_dir)
    write_json(out / f"{path.name.removesuffix(POURS_ENDING)}.json", result)
    return result


def measure_runs(scene: Scene, path: Path) -> dict[str, Any]:
    """Measure all runs of a saved job, without writing files.

    A job is all runs of one parameter set in a bench test, each with another seed.

    Parameters
    ----------
    scene : Scene
        The grains, walls and settings of the study. The settings define the responses.
    path : Path
        NAME.pours.json of the job. NAME.npz is in the same folder.

    Returns
    -------
    dict
        The description of the job, its measured runs, and their ``summary``.

    Raises
    ------
    InputError
        If a run has a status that is not one of its bench test's, or if an array is
        missing.
    """
    job = read_pours(path)
    test = bench_of(job, path)
    # Take the records of the runs out of the job. Below, the measured runs replace
    # them, and the rest of the job is its description.
    records = job.pop("pours")
    for record in records:
        status = record["status"]
        if status not in test.statuses:
            raise InputError(
                path, key="status", value=status, allowed=", ".join(test.statuses)
            )

    arrays_of_job = read_positions(positions_file(path))
    measured_runs = []
    for record in records:
        # The arrays of a failed run may be incomplete, so none of them is required.
        required_arrays = test.required_arrays if record["status"] == "ok" else ()
        arrays = select_pour(
            arrays_of_job, record["seed"], source=path, required_arrays=required_arrays
        )
        measured_runs.append(test.result(record, arrays, scene))

    # The columns of the summary begin with the responses of the targets. The other
    # responses that the bench test always records follow.
    targets = test.target_responses(scene.settings.config)
    recorded = test.recorded.put_targets_first(tuple(target.name for target in targets))
    summary = summarise_runs(measured_runs, recorded)
    return job | {"summary": summary, "runs": measured_runs}
