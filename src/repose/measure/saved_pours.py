"""Saved pours to measured piles: a change of the measurement needs no new pour."""

import json
import re
from pathlib import Path

import numpy as np

from repose.core.errors import InputError, NoFlankError
from repose.core.files import write_json
from repose.core.runs import STATUSES, summarise_runs
from repose.measure import pile
from repose.measure.angles import RECORDED, RESPONSES
from repose.measure.silhouette import silhouette

POURS = ".pours.json"  # behind the stem of a job's files
KINDS = ("position", "quaternion", "in_pile")


def measure_job(config, pours_json, particle, berry, out_dir=None):
    """Measure the piles of one job and write OUT/NAME.json in one move; returns its content.

    config: whole configuration; pours_json: NAME.pours.json of `heap.pour_job`, with NAME.npz beside it;
    particle: `shape.Particle`; berry: what `repose berry` wrote; out_dir: by default where the pours are. Raises
    InputError naming the file that is missing or of something else.
    """
    path = Path(pours_json)
    job = read_pours(path)
    name = path.name.removesuffix(POURS)
    settings = pile.MeasureSettings.of(config["measure"], berry)
    pours = job.pop("pours")
    with saved_positions(path.with_name(f"{name}.npz")) as arrays:
        runs = [
            measure_pour(record, pour_arrays(arrays, record["seed"], path), particle, settings)
            for record in pours
        ]
    result = job | {"summary": summarise_runs(runs, RECORDED), "runs": runs}
    out = path.parent if out_dir is None else Path(out_dir)
    write_json(out / f"{name}.json", result)
    return result


def measure_pour(record, arrays, particle, settings):
    """The record of a pour with every response; None where there is no pile to measure.

    record: of `heap.pour_once`; arrays: position, quaternion, in_pile and, where the berries differ in size,
    scale; settings: `pile.MeasureSettings`. A pile without the response gets the status no_flank and keeps
    what could be measured.
    """
    judged = {key: record[key] for key in ("seed", "status", "reason")}
    responses = dict.fromkeys(RESPONSES)
    if record["status"] == "ok":
        try:
            measured = pile.measure_pile(
                arrays["position"],
                arrays["quaternion"],
                particle,
                settings,
                members=arrays["in_pile"],
                scales=arrays.get("scale"),
            )
            responses = measured.record()
            if responses["aor_deg"] is None:
                judged |= {"status": "no_flank", "reason": measured.reasons[settings.response]}
        except NoFlankError as error:
            judged |= {"status": "no_flank", "reason": error.reason}
    return judged | responses | {key: value for key, value in record.items() if key not in judged}


def read_pours(path):
    """The JSON of a job's pours, or InputError."""
    try:
        job = json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise InputError(path, "pours", str(error), f"NAME{POURS} as the verb pour writes it") from error
    pours = job.get("pours") if isinstance(job, dict) else None
    if not str(path).endswith(POURS) or not isinstance(pours, list) or not pours:
        raise InputError(path, "pours", pours, f"NAME{POURS} as the verb pour writes it")
    for one in pours:
        if not isinstance(one, dict) or one.get("status") not in STATUSES or "seed" not in one:
            raise InputError(path, "pours", one, f"records with a seed and a status of {', '.join(STATUSES)}")
    return job


def saved_positions(path):
    """The open .npz of a job, or InputError."""
    try:
        return np.load(path)
    except (OSError, ValueError) as error:
        raise InputError(path, "positions", str(error), "the .npz file that the verb pour wrote") from error


def pour_arrays(arrays, seed, source):
    """position (N, 3) m, quaternion (N, 4), in_pile (N,) and, if saved, scale (N,) of one seed, or InputError."""
    for kind in KINDS:
        if f"{kind}_{seed}" not in arrays:
            raise InputError(source, f"{kind}_{seed}", None, "an array in the .npz file beside it")
    return {kind: arrays[f"{kind}_{seed}"] for kind in (*KINDS, "scale") if f"{kind}_{seed}" in arrays}


def first_pour(path):
    """The arrays of the first seed in a job's .npz, or InputError."""
    with saved_positions(path) as arrays:
        seeds = [match.group(1) for key in arrays if (match := re.fullmatch(r"position_(.+)", key))]
        if not seeds:
            raise InputError(path, "arrays", sorted(arrays), "position_SEED, quaternion_SEED, in_pile_SEED")
        return pour_arrays(arrays, seeds[0], path)


def side_view(arrays, particle, settings, azimuth_deg=0.0):
    """Silhouette (H, W) uint8 of a pour's pile, or of all its berries where the settings keep loose ones; its
    lower border is the plate."""
    kept = arrays["in_pile"] if settings.largest_pile_only else np.ones(len(arrays["position"]), bool)
    sizes = {"scales": arrays["scale"][kept]} if "scale" in arrays else {}
    bodies = arrays["position"][kept], arrays["quaternion"][kept], particle
    return silhouette(*bodies, azimuth_deg, settings.mm_per_pixel, **sizes)
