"""Jobs: one parameter set in any bench test with all its seeds, poured, saved, and measured.

A job's files are NAME.pours.json (how each run ended), NAME.npz (arrays of each run, ARRAY_SEED),
NAME_trajectory_SEED.npz (frames, if requested) and, measured, NAME.json. The wall time of each run is
in timings/NAME.json alone, so that all other files of equal runs are equal.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from repose.bench.bench_test import BenchTest, Run, Scene, bench_of
from repose.bench.parameters import named
from repose.calibrate.runs import summarise_runs
from repose.calibrate.seeds import UNNAMED
from repose.common.errors import require
from repose.common.files import write_json, write_npz
from repose.common.ledger import check_replaceable
from repose.measure.saved_pours import (
    POURS,
    positions_file,
    pour_arrays,
    read_pours,
    saved_positions,
)
from repose.stages.kept_runs import KeptRuns, read_measurement, write_measurement

Progress = Callable[[int], AbstractContextManager[Callable[[float], object] | None]]


def run_once(test: BenchTest[Any], scene: Scene) -> tuple[dict[str, Any], Run]:
    """Run and measure once, without files; return the measured run, and the run."""
    run = test.run(scene)
    return test.result(run.record, run.arrays, scene), run


def about_job(test: BenchTest[Any], scene: Scene, name: object) -> dict[str, Any]:
    """Describe a job, as each of its files does."""
    of_test = {} if test.name == UNNAMED else {"apparatus": test.name}
    return of_test | {
        "sample": int(str(name)) if str(name).isdigit() else name,
        "parameters": {p: float(scene.parameters[p]) for p in named(scene.parameters)},
        "time_step_s": scene.simulation.time_step_s,
    }


def pour_job(
    test: BenchTest[Any],
    scene: Scene,
    name: str,
    seeds: Iterable[int],
    out_dir: str | PathLike,
    interval_s: float | None = None,
    progress: Progress | None = None,
    keeps_runs: bool = False,
) -> Path:
    """Run one parameter set with all its seeds, write the files of the job, NAME.pours.json last, and return its path.

    With `interval_s` also frames are written, this simulated time apart. `progress`, called with each seed, gives a
    context manager that is called with the simulated time. With `keeps_runs` each run is also kept (`kept_runs`), and
    taken from there where it is the same; so a further seed runs that seed only, and a job that was killed goes on.
    """
    out = Path(out_dir)
    seeds = list(seeds)
    films = [
        f"{name}_trajectory_{seed}.npz" for seed in seeds if interval_s is not None
    ]
    for file in (f"{name}.npz", f"{name}{POURS}", *films):
        check_replaceable(out / file)  # not after minutes of pouring
    records: list[dict[str, Any]] = []
    saved: dict[str, np.ndarray] = {}
    took_s: dict[str, float] = {}
    about = about_job(test, scene, name)
    kept = KeptRuns(out, name, about) if keeps_runs else None
    for seed in seeds:
        run = kept.read(seed) if kept and interval_s is None else None
        if run is None:
            began = time.perf_counter()
            with progress(seed) if progress else nullcontext() as report:
                run = test.run(scene.with_seed(seed), interval_s, report)
            took_s[str(seed)] = round(time.perf_counter() - began, 3)
            if kept:
                kept.write(run)
        records.append(run.record)
        saved |= {f"{key}_{seed}": values for key, values in run.arrays.items()}
        if run.frames is not None:
            write_npz(out / f"{name}_trajectory_{seed}.npz", run.frames)
    if took_s:
        write_timings(out, name, took_s)
    write_npz(out / f"{name}.npz", saved)
    path = out / f"{name}{POURS}"
    write_json(path, about | {"pours": records})
    return path


def write_timings(folder: Path, name: str, took_s: Mapping[str, float]) -> None:
    """Write the wall time [s] of each run of a job, by its seed."""
    write_json(folder / "timings" / f"{name}.json", {"wall_s": dict(took_s)})


def measure_job(
    scene: Scene,
    pours_json: str | PathLike,
    out_dir: str | PathLike | None = None,
    keeps_runs: bool = False,
) -> dict[str, Any]:
    """Measure the runs of a saved job, write NAME.json, by default beside the pours, and return its content.

    With `keeps_runs` a kept measurement is taken where it is the same.
    """
    path = Path(pours_json)
    result = read_measurement(path) if keeps_runs else None
    if result is None:
        result = measured(scene, path)
        if keeps_runs:
            write_measurement(path, result)
    out = path.parent if out_dir is None else Path(out_dir)
    write_json(out / f"{path.name.removesuffix(POURS)}.json", result)
    return result


def measured(scene: Scene, path: Path) -> dict[str, Any]:
    """Measure a saved job: its description, its measured runs, and their summary."""
    job = read_pours(path)
    test = bench_of(job, path)
    pours = job.pop("pours")
    for pour in pours:
        require(
            pour["status"] in test.statuses,
            path,
            "status",
            pour["status"],
            ", ".join(test.statuses),
        )
    arrays = saved_positions(positions_file(path))
    runs = []
    for pour in pours:
        needed = (
            test.required_arrays if pour["status"] == "ok" else ()
        )  # the arrays of a spoiled run may hold anything
        runs.append(
            test.result(pour, pour_arrays(arrays, pour["seed"], path, needed), scene)
        )
    columns = test.recorded.beginning_with(
        tuple(one.name for one in test.target_responses(scene.settings.config))
    )
    return job | {"summary": summarise_runs(runs, columns), "runs": runs}
