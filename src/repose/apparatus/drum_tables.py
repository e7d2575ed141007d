"""Measurements of a drum that has turned: the surface of its bed, the motion in the slip, and tables of all runs.

Nothing here turns a drum but `run_job`: a changed definition measures the states that were kept.
"""

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.apparatus import drum
from repose.apparatus.job import about_job, write_timings
from repose.core.errors import InputError
from repose.core.files import read_json, read_npz, write_json, write_npz, write_table
from repose.measure import bed

if TYPE_CHECKING:
    import pandas as pd

    from repose.particle.particle import Particle

STATES = ("start", "report", "before", "after")
# Quantities averaged over seeds, and their names in the table.
SUMMARY = {
    "report_turned_deg": "turned at the report",
    "report_surface_deg": "surface at the report",
    "report_bed_deg": "centre of mass at the report",
    "before_time_s": "first slip, time since the rotation began",
    "before_turned_deg": "first slip, turned",
    "before_surface_deg": "surface before the slip",
    "before_bed_deg": "centre of mass before the slip",
    "after_surface_deg": "surface after the slip",
    "after_bed_deg": "centre of mass after the slip",
    "surface_drop_deg": "fall of the surface",
    "bed_drop_deg": "fall of the centre of mass",
    "slip_duration_s": "from the slip's beginning to rest",
    "moved_share": "share of berries that moved by more than their diameter",
    "surface_moved_mm": "motion of the uppermost layer against the drum",
    "wall_moved_mm": "motion of the lowest layer against the drum",
}
RECORD = ["seed", "time_s", "turned_deg", "surface_deg", "bed_deg", "energy_j"]
PROFILE = ["seed", "depth_mm", "moved_mm", "moved_sd_mm", "berries"]
WHAT = "a JSON file of `repose stage drum`, its .npz beside it"


def surface_of(
    position: np.ndarray,
    quaternion: np.ndarray,
    scale: np.ndarray,
    config: Mapping[str, Any],
    particle: "Particle",
    section: str = drum.NAME,
) -> bed.Surface:
    """The surface of a bed of N berries as a section of the configuration defines it; ValueError if it has none."""
    return bed.measure_surface(
        position,
        quaternion,
        particle,
        drum.Drum.of(config[section]).radius_m,
        config["measure"]["mm_per_pixel"],
        config[section]["fit_share"],
        scale,
    )


def surface_angles(
    position: np.ndarray,
    quaternion: np.ndarray,
    scale: np.ndarray,
    config: Mapping[str, Any],
    particle: "Particle",
    section: str = drum.NAME,
) -> np.ndarray:
    """Angle of the surface in each of T frames [degrees]; NaN where the bed has no surface."""
    angles = np.full(len(position), math.nan)
    for k, (centres, turns) in enumerate(zip(position, quaternion, strict=True)):
        try:
            angles[k] = surface_of(centres, turns, scale, config, particle, section).angle_deg
        except ValueError:
            continue
    return angles


def no_surface(config: Mapping[str, Any]) -> str:
    """The reason why a bed has no surface."""
    scale = config["measure"]["mm_per_pixel"]
    return f"the bed has no surface that {scale:g} mm a pixel (measure.mm_per_pixel) resolve"


def measured_run(
    record: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
    config: Mapping[str, Any],
    particle: "Particle",
) -> tuple[dict[str, Any], np.ndarray]:
    """A run of the drum, measured, and the motion by depth (bins, 4) in its slip, lengths in mm.

    The measured run is the record with the angles of the surface and, of a slip, the numbers of `_of_slip`. Where
    the surface before or after a slip cannot be measured, the status is ``no_surface`` and there are no numbers.
    Without a slip the motion by depth is empty.
    """
    measured, profile = dict(record), np.zeros((0, 4))
    if record["status"] not in ("ok", "no_slip"):
        return measured, profile
    states = STATES if record["status"] == "ok" else STATES[:2]
    angles = surface_angles(
        np.array([arrays[f"position_{state}"] for state in states]),
        np.array([arrays[f"quaternion_{state}"] for state in states]),
        arrays["scale"],
        config,
        particle,
    )
    for state, angle in zip(states, angles, strict=True):
        measured[f"{state}_surface_deg"] = float(angle) if math.isfinite(angle) else None
    if record["status"] == "no_slip":
        return measured, profile
    if not np.isfinite(angles[2:]).all():
        judged = {"seed": record["seed"], "status": "no_surface", "reason": no_surface(config)}
        return judged | {"rotation_from_s": record["rotation_from_s"]}, profile
    numbers, profile = _of_slip(record, arrays, config, particle)
    return measured | {"surface_drop_deg": float(angles[2] - angles[3])} | numbers, profile


def _of_slip(record, arrays, config, particle):
    """Motion of the berries in the slip; None where no berry lies under the part of the surface that is fitted."""
    centres = arrays["position_before"], arrays["position_after"]
    before = surface_of(centres[0], arrays["quaternion_before"], arrays["scale"], config, particle)
    turned_rad = math.radians(record["after_turned_deg"] - record["before_turned_deg"])
    depth, moved = bed.slip_displacement(*centres, turned_rad, before)
    bin_m = 1e-3 * config[drum.NAME]["depth_bin_mm"]
    profile = bed.depth_profile(depth, moved, bin_m) * (1e3, 1e3, 1e3, 1.0)
    numbers = {
        "moved_share": bed.moved_share(moved, particle),
        "surface_moved_mm": float(profile[0, 1]) if len(profile) else None,
        "wall_moved_mm": float(profile[-1, 1]) if len(profile) else None,
    }
    return numbers, profile


def run_job(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    seeds: Iterable[int],
    particle: "Particle",
    berry: Mapping[str, Any],
    out_dir: str | PathLike,
) -> list[dict[str, Any]]:
    """Turn the drum with each seed; write OUT/drum_SEED.npz with every frame, and then OUT/drum_SEED.json.

    A run whose JSON file is there is complete. Returns the contents of the JSON files, with their runs measured.
    """
    out, results = Path(out_dir), []
    for seed in seeds:
        began = time.perf_counter()
        run = drum.run(config, parameters, seed, particle, berry, interval_s=0.0)
        write_timings(out, f"drum_{seed}", {str(seed): round(time.perf_counter() - began, 3)})
        write_npz(out / f"drum_{seed}.npz", run.frames or {})
        about = about_job(drum.BENCH, config, seed, parameters)
        result = {key: about[key] for key in ("parameters", "time_step_s")}
        write_json(out / f"drum_{seed}.json", result | {"run": run.record})
        results.append(result | {"run": drum.measure(run.record, run.arrays, config, particle, berry)})
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
    by_seed: dict[int, tuple[dict, dict]] = {}
    for path in map(Path, json_paths):
        record = read_json(path, {"run": dict}, WHAT)["run"]
        if record.get("seed") in by_seed:
            raise InputError(path, "run.seed", record["seed"], "each seed once")
        frames = read_npz(path.with_suffix(".npz"), _needed(record), WHAT)
        measured, profile = measured_run(record, frames, config, particle)
        angles = surface_angles(frames["position"], frames["quaternion"], frames["scale"], config, particle)
        by_seed[record["seed"]] = measured, frames | {"profile": profile, "surface_deg": angles}
    made = tables(list(by_seed.values()))
    for name, content in made.items():
        write_table(Path(out_dir) / f"{name}.csv", content)
    return made


def _needed(run):
    """Arrays that the file of a run must have."""
    states = {"ok": STATES, "no_slip": STATES[:2]}.get(run.get("status"), ())
    of_states = (f"{kind}_{state}" for state in states for kind in ("position", "quaternion"))
    kept = (key for key in RECORD[1:] if key != "surface_deg")
    return (*kept, "position", "quaternion", "scale", *of_states)


def tables(runs: Sequence[tuple[Mapping[str, Any], Mapping[str, np.ndarray]]]) -> "dict[str, pd.DataFrame]":
    """The tables of measured runs, given as (record, arrays with the columns of the record and ``profile``).

    runs: one row per run. summary: quantity, key, mean, standard_error (none of one run), lowest, highest, runs.
    record: the record of all runs over time. profile: motion by depth of all runs, lengths in mm.
    """
    import pandas as pd

    records = [pd.DataFrame({key: arrays[key] for key in RECORD[1:]}) for _, arrays in runs]
    profiles = [pd.DataFrame(arrays["profile"], columns=PROFILE[1:]) for _, arrays in runs]
    seeds = [run["seed"] for run, _ in runs]
    table = pd.DataFrame([run for run, _ in runs])
    return {
        "runs": table,
        "summary": summarise(table),
        "record": pd.concat(
            [record.assign(seed=seed)[RECORD] for record, seed in zip(records, seeds, strict=True)],
            ignore_index=True,
        ),
        "profile": pd.concat(
            [profile.assign(seed=seed)[PROFILE] for profile, seed in zip(profiles, seeds, strict=True)],
            ignore_index=True,
        ),
    }


def summarise(runs: "pd.DataFrame") -> "pd.DataFrame":
    """Mean and standard error of every quantity of SUMMARY over the runs that have it."""
    import pandas as pd

    rows = []
    for key, quantity in SUMMARY.items():
        values = runs[key].dropna().to_numpy(float) if key in runs else np.zeros(0)
        n = len(values)
        rows.append(
            {
                "quantity": quantity,
                "key": key,
                "mean": values.mean() if n else np.nan,
                "standard_error": values.std(ddof=1) / np.sqrt(n) if n > 1 else np.nan,
                "lowest": values.min() if n else np.nan,
                "highest": values.max() if n else np.nan,
                "runs": n,
            }
        )
    return pd.DataFrame(rows)
