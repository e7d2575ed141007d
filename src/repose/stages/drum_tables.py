"""Run the drum, and make the tables of all its runs.

The states of the runs are kept, so they can be measured again after a definition
changes.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose.bench.bench_test import Scene
from repose.bench.drum import STATES, DrumTest
from repose.common.errors import InputError
from repose.common.files import read_json, read_npz, write_json, write_npz, write_table
from repose.stages.job import describe_job, write_timings

if TYPE_CHECKING:
    import pandas as pd

    from repose.grain.particle import Particle

# Quantities that are averaged over the runs, with their keys in a run.
QUANTITIES_FILE = Path(__file__).with_name("drum_quantities.csv")
RECORD_COLUMNS = ["time_s", "turned_deg", "surface_deg", "bed_deg", "energy_j"]
PROFILE_COLUMNS = ["depth_mm", "moved_mm", "moved_sd_mm", "berries"]
SUMMARY_COLUMNS = [
    "quantity",
    "key",
    "mean",
    "standard_error",
    "lowest",
    "highest",
    "runs",
]
EXPECTED_FILES = "a JSON file of `repose stage drum`, with its .npz next to it"


class MeasuredRun(NamedTuple):
    """A measured run of the drum."""

    record: Mapping[str, Any]
    # The columns of `RECORD_COLUMNS` over time, and `profile`, the motion by depth
    # (bins, 4).
    arrays: Mapping[str, np.ndarray]


def run_job(
    scene: Scene, seeds: Iterable[int], out_dir: str | PathLike
) -> list[dict[str, Any]]:
    """Run the drum once with each seed, and save and measure each run.

    Each run has two files: OUT/drum_SEED.npz has all frames, and OUT/drum_SEED.json is
    written after it. A JSON file therefore marks a complete run.

    Parameters
    ----------
    scene : Scene
        Drum, grain and parameters. The seed of the scene is replaced.
    seeds : iterable of int
        Seeds of the runs.
    out_dir : path
        The folder for these files, called OUT above.

    Returns
    -------
    list of dict
        The content of each JSON file, in which the measured run replaces its raw
        record.
    """
    out = Path(out_dir)
    test = DrumTest()
    results = []
    for seed in seeds:
        name = f"drum_{seed}"
        start_s = time.perf_counter()
        # An interval of 0 keeps every frame that the drum records.
        run = test.run(scene.with_seed(seed), interval_s=0.0)
        elapsed_s = round(time.perf_counter() - start_s, 3)

        # The JSON file has the raw record. The measurement is returned but not saved,
        # because it depends on definitions that may change.
        job = describe_job(test, scene, seed)
        description = {key: job[key] for key in ("parameters", "time_step_s")}
        write_timings(out, name, {str(seed): elapsed_s})
        # Write the JSON file last: it marks a complete run.
        write_npz(out / f"{name}.npz", run.frames or {})
        write_json(out / f"{name}.json", description | {"run": run.record})

        measured = test.result(run.record, run.arrays, scene)
        results.append(description | {"run": measured})
    return results


def write_tables(
    json_paths: Sequence[str | PathLike],
    config: Mapping[str, Any],
    particle: "Particle",
    out_dir: str | PathLike,
) -> "dict[str, pd.DataFrame]":
    """Measure saved runs of the drum, and write their tables.

    The tables are runs.csv, summary.csv, record.csv and profile.csv. The file
    median.npz is a copy of the frames of the run that `choose_median_run` chooses.

    Parameters
    ----------
    json_paths : sequence of path
        The JSON files that `run_job` has written. The frames of a run are in the file
        next to it with the same name and the suffix .npz.
    config : mapping
        The whole configuration.
    particle : Particle
        The shape of the grains.
    out_dir : path
        Folder for the tables and median.npz.

    Returns
    -------
    dict of pandas.DataFrame
        Result of `make_tables`.

    Raises
    ------
    InputError
        If a file is missing or was not written by `run_job`, or if a seed is repeated.
    """
    # A scene usually has contact parameters and the material of the grain. Only a
    # simulation uses them, so they may be empty for a measurement.
    scene = Scene.of(config, parameters={}, grain={}, particle=particle)
    runs: list[MeasuredRun] = []
    path_of_seed: dict[int, Path] = {}
    for path in map(Path, json_paths):
        record = read_json(path, {"run": dict}, EXPECTED_FILES)["run"]
        seed = record.get("seed")
        if seed in path_of_seed:
            raise InputError(path, key="run.seed", value=seed, allowed="each seed once")
        runs.append(_measure_run(record, path, scene))
        path_of_seed[seed] = path

    out = Path(out_dir)
    tables_by_name = make_tables(runs)
    for name, table in tables_by_name.items():
        write_table(out / f"{name}.csv", table)
    median_seed = choose_median_run(tables_by_name["runs"])
    median_npz = path_of_seed[median_seed].with_suffix(".npz")
    write_npz(out / "median.npz", read_npz(median_npz, (), EXPECTED_FILES))
    return tables_by_name


def choose_median_run(runs: "pd.DataFrame") -> int:
    """Choose the run whose drum had turned by the median angle before its first slip.

    Parameters
    ----------
    runs : pandas.DataFrame
        A row for each run: `seed`, `status`, and for runs that slipped
        `before_turned_deg`.

    Returns
    -------
    int
        The seed of this run. If the number of slips is even, the lower of the middle
        two is chosen. If no run slipped, the first run is chosen.
    """
    slipped = runs[runs["status"] == "ok"]
    if slipped.empty:
        return int(runs["seed"].iloc[0])
    sorted_runs = slipped.sort_values("before_turned_deg", kind="stable")
    return int(sorted_runs["seed"].iloc[(len(sorted_runs) - 1) // 2])


def _measure_run(record: Mapping[str, Any], path: Path, scene: Scene) -> MeasuredRun:
    """Measure a run from the frames in the file next to its JSON file.

    Parameters
    ----------
    record : mapping
        The record of the run.
    path : Path
        Its JSON file.
    scene : Scene
        The drum and the grains.
    """
    test = DrumTest()
    frames = read_npz(
        path.with_suffix(".npz"), _list_required_arrays(record), EXPECTED_FILES
    )
    measured, profile = test.measure_with_profile(record, frames, scene)
    angles = test.surface_angles(
        frames["position"], frames["quaternion"], frames["scale"], scene
    )
    return MeasuredRun(measured, frames | {"profile": profile, "surface_deg": angles})


def _list_required_arrays(run: Mapping[str, Any]) -> tuple[str, ...]:
    """List the arrays that the file of a run must have.

    A run that slipped has the states before and after the slip. A run without a slip
    has only those before it.
    """
    names = [key for key in RECORD_COLUMNS if key != "surface_deg"]
    names += ["position", "quaternion", "scale"]
    states_of_status = {"ok": STATES, "no_slip": STATES[:2]}
    for state in states_of_status.get(run.get("status", ""), ()):
        names += [f"position_{state}", f"quaternion_{state}"]
    return tuple(names)


def make_tables(runs: Sequence[MeasuredRun]) -> "dict[str, pd.DataFrame]":
    """Arrange measured runs of the drum in tables.

    Parameters
    ----------
    runs : sequence of MeasuredRun
        The runs, all with different seeds.

    Returns
    -------
    dict of pandas.DataFrame
        Four tables. ``runs`` has a row for each run. ``summary`` is the result of
        `average_quantities`. ``record`` has a row for each time of each run.
        ``profile`` has a row for each depth in each run, with lengths in mm.
    """
    import pandas as pd

    records = {}
    profiles = {}
    for run in runs:
        seed = run.record["seed"]
        columns = {key: run.arrays[key] for key in RECORD_COLUMNS}
        records[seed] = pd.DataFrame(columns)
        profiles[seed] = pd.DataFrame(run.arrays["profile"], columns=PROFILE_COLUMNS)
    run_table = pd.DataFrame([run.record for run in runs])
    return {
        "runs": run_table,
        "summary": average_quantities(run_table),
        "record": _join_tables(records),
        "profile": _join_tables(profiles),
    }


def _join_tables(tables_by_seed: "Mapping[Any, pd.DataFrame]") -> "pd.DataFrame":
    """Join the tables of all runs, with the column `seed`."""
    import pandas as pd

    joined = pd.concat(tables_by_seed, names=["seed"])
    return joined.reset_index("seed").reset_index(drop=True)


def average_quantities(runs: "pd.DataFrame") -> "pd.DataFrame":
    """Average each quantity of the file `QUANTITIES_FILE` over the runs that have it.

    Parameters
    ----------
    runs : pandas.DataFrame
        A row for each measured run.

    Returns
    -------
    pandas.DataFrame
        A row for each quantity, with the columns `SUMMARY_COLUMNS`. Cells are NaN if no
        run has the quantity. The standard error is NaN if only one run has it.
    """
    import pandas as pd

    quantities = pd.read_csv(QUANTITIES_FILE)
    rows = []
    for key, quantity in zip(quantities["key"], quantities["quantity"], strict=True):
        values = np.zeros(0)
        if key in runs:
            values = runs[key].dropna().to_numpy(float)
        rows.append({"quantity": quantity, "key": key, **_average(values)})
    return pd.DataFrame(rows, columns=SUMMARY_COLUMNS)


def _average(values: np.ndarray) -> dict[str, float]:
    """Average the values (n,) of a quantity, one for each run that has it.

    Returns
    -------
    dict
        Mean, standard error, lowest and highest value, and the number of runs, by
        column of the summary. Columns that cannot be computed from so few runs are left
        out.
    """
    n_runs = len(values)
    averages: dict[str, float] = {"runs": n_runs}
    if n_runs > 0:
        averages |= {
            "mean": values.mean(),
            "lowest": values.min(),
            "highest": values.max(),
        }
    if n_runs > 1:
        averages["standard_error"] = values.std(ddof=1) / np.sqrt(n_runs)
    return averages
