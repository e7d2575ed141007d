"""Jobs of the drum, and the tables of all its runs: a changed definition measures the states that were kept."""

import time
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.bench.bench_test import Scene
from repose.bench.drum import STATES, DrumTest
from repose.common.errors import InputError
from repose.common.files import read_json, read_npz, write_json, write_npz, write_table
from repose.stages.job import about_job, write_timings

if TYPE_CHECKING:
    import pandas as pd

    from repose.grain.particle import Particle

SUMMARY = Path(__file__).with_name(
    "drum_quantities.csv"
)  # quantities averaged over seeds, by their keys in a run
RECORD = ["time_s", "turned_deg", "surface_deg", "bed_deg", "energy_j"]
PROFILE = ["depth_mm", "moved_mm", "moved_sd_mm", "berries"]
WHAT = "a JSON file of `repose stage drum`, its .npz beside it"


def run_job(
    scene: Scene, seeds: Iterable[int], out_dir: str | PathLike
) -> list[dict[str, Any]]:
    """Turn the drum with each seed; write OUT/drum_SEED.npz with every frame, and then OUT/drum_SEED.json.

    A run whose JSON file is there is complete. Returns the contents of the JSON files, with their runs measured.
    """
    out, results = Path(out_dir), []
    test = DrumTest()
    for seed in seeds:
        began = time.perf_counter()
        run = test.run(scene.with_seed(seed), interval_s=0.0)
        write_timings(
            out, f"drum_{seed}", {str(seed): round(time.perf_counter() - began, 3)}
        )
        write_npz(out / f"drum_{seed}.npz", run.frames or {})
        about = about_job(test, scene, seed)
        result = {key: about[key] for key in ("parameters", "time_step_s")}
        write_json(out / f"drum_{seed}.json", result | {"run": run.record})
        results.append(result | {"run": test.result(run.record, run.arrays, scene)})
    return results


def run(
    json_paths: Sequence[str | PathLike],
    config: Mapping[str, Any],
    particle: "Particle",
    out_dir: str | PathLike,
) -> "dict[str, pd.DataFrame]":
    """Measure runs; write runs.csv, summary.csv, record.csv and profile.csv into out_dir; return these tables.

    InputError if a file is missing or none of `run_job`, or a seed is there twice.
    """
    test, scene = DrumTest(), Scene.of(config, {}, {}, particle)
    by_seed: dict[int, tuple[dict, dict]] = {}
    for path in map(Path, json_paths):
        record = read_json(path, {"run": dict}, WHAT)["run"]
        if record.get("seed") in by_seed:
            raise InputError(path, "run.seed", record["seed"], "each seed once")
        frames = read_npz(path.with_suffix(".npz"), _needed(record), WHAT)
        measured, profile = test.measured_run(record, frames, scene)
        angles = test.surface_angles(
            frames["position"], frames["quaternion"], frames["scale"], scene
        )
        by_seed[record["seed"]] = (
            measured,
            frames | {"profile": profile, "surface_deg": angles},
        )
    made = tables(list(by_seed.values()))
    for name, content in made.items():
        write_table(Path(out_dir) / f"{name}.csv", content)
    return made


def _needed(run: Mapping[str, Any]) -> tuple[str, ...]:
    """Name the arrays that the file of a run must have."""
    states = {"ok": STATES, "no_slip": STATES[:2]}.get(run.get("status", ""), ())
    of_states = (
        f"{kind}_{state}" for state in states for kind in ("position", "quaternion")
    )
    kept = (key for key in RECORD if key != "surface_deg")
    return (*kept, "position", "quaternion", "scale", *of_states)


def tables(
    runs: Sequence[tuple[Mapping[str, Any], Mapping[str, np.ndarray]]],
) -> "dict[str, pd.DataFrame]":
    """Make the tables of measured runs, given as (record, arrays with the columns of the record and ``profile``).

    runs: one row per run. summary: quantity, key, mean, standard_error (none of one run), lowest, highest, runs.
    record: the record of all runs over time. profile: motion by depth of all runs, lengths in mm.
    """
    import pandas as pd

    def of_all(frames: Iterable["pd.DataFrame"]) -> "pd.DataFrame":
        by_seed = {
            run["seed"]: frame for (run, _), frame in zip(runs, frames, strict=True)
        }
        return (
            pd.concat(by_seed, names=["seed"])
            .reset_index("seed")
            .reset_index(drop=True)
        )

    table = pd.DataFrame([run for run, _ in runs])
    return {
        "runs": table,
        "summary": summarise(table),
        "record": of_all(
            pd.DataFrame({key: arrays[key] for key in RECORD}) for _, arrays in runs
        ),
        "profile": of_all(
            pd.DataFrame(arrays["profile"], columns=PROFILE) for _, arrays in runs
        ),
    }


def summarise(runs: "pd.DataFrame") -> "pd.DataFrame":
    """Compute mean and standard error of every quantity of `SUMMARY` over the runs that have it."""
    import pandas as pd

    rows = []
    for key, quantity in pd.read_csv(SUMMARY).itertuples(index=False):
        values = runs[key].dropna().to_numpy(float) if key in runs else np.zeros(0)
        n, known = len(values), values if len(values) else np.full(1, np.nan)
        error = values.std(ddof=1) / np.sqrt(n) if n > 1 else np.nan
        rows.append((quantity, key, known.mean(), error, known.min(), known.max(), n))
    return pd.DataFrame(
        rows,
        columns=[
            "quantity",
            "key",
            "mean",
            "standard_error",
            "lowest",
            "highest",
            "runs",
        ],
    )
