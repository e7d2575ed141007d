"""Runs of the drum to tables: every run, means with standard errors over seeds, the record, the slipping layer."""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from repose.core.errors import InputError

# What is averaged over seeds, and its name in the table.
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


def run(json_paths, out_dir):
    """Write runs.csv, summary.csv, record.csv and profile.csv into out_dir; return the tables by name.

    json_paths: of `drum.run_job`, each with its .npz beside it. summary.csv: quantity, key, mean, standard_error (none
    of one run), lowest, highest, runs. Raises InputError for a file that is missing or none of these, or a seed twice.
    """
    runs, records, profiles = [], [], []
    for path in map(Path, json_paths):
        one, arrays = _read(path)
        if any(one["seed"] == other["seed"] for other in runs):
            raise InputError(path, "run.seed", one["seed"], "each seed once")
        runs.append(one)
        record = pd.DataFrame({key: arrays[key] for key in RECORD[1:]})
        records.append(record.assign(seed=one["seed"])[RECORD])
        profile = pd.DataFrame(arrays["profile"], columns=PROFILE[1:])
        profiles.append(profile.assign(seed=one["seed"])[PROFILE])
    table = pd.DataFrame(runs)
    tables = {
        "runs": table,
        "summary": summarise(table),
        "record": pd.concat(records, ignore_index=True),
        "profile": pd.concat(profiles, ignore_index=True),
    }
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    for name, content in tables.items():
        content.to_csv(out / f"{name}.csv", index=False)
    return tables


def summarise(runs):
    """Mean and standard error of every quantity of SUMMARY over the runs that have it."""
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


def _read(path):
    """A run's mapping and its arrays, or InputError."""
    try:
        run = json.loads(path.read_text())["run"]
        with np.load(path.with_suffix(".npz")) as file:
            arrays = {key: file[key] for key in (*RECORD[1:], "profile")}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            path, "run of the drum", str(error), "a JSON file of `repose drum`, its .npz beside it"
        ) from None
    return run, arrays
