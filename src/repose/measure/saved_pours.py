"""Reading of saved pours: NAME.pours.json holds the status of each pour, NAME.npz the final positions."""

import math
import re
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from repose.common.errors import InputError, require
from repose.common.files import read_json, read_npz

POURS = ".pours.json"  # behind the stem of a job's files
KINDS = ("position", "quaternion", "in_pile")
COLUMNS = {"position": 3, "quaternion": 4}
ONE_A_GRAIN = ("in_pile", "scale")
Arrays = Mapping[str, np.ndarray]  # of a pour, by name
WHAT = f"NAME{POURS} as the verb pour writes it"


def read_pours(path: str | PathLike) -> dict[str, Any]:
    """Read the JSON file of a job's pours; each of its ``pours`` has a seed, a status, a reason and numbers."""
    job = read_json(path, what=WHAT)
    pours = job.get("pours")
    if not str(path).endswith(POURS) or not isinstance(pours, list) or not pours:
        raise InputError(path, "pours", pours, WHAT)
    for pour in pours:
        if (
            not isinstance(pour, dict)
            or not isinstance(pour.get("status"), str)
            or "seed" not in pour
        ):
            raise InputError(path, "pours", pour, "records with a seed and a status")
        require(
            isinstance(pour.setdefault("reason", ""), str),
            path,
            "reason",
            pour["reason"],
            "text",
        )
        for key in pour.keys() - {"status", "reason"}:
            if pour[key] is not None and not (
                isinstance(pour[key], int | float) and math.isfinite(pour[key])
            ):
                raise InputError(path, key, pour[key], "a finite number, or null")
    seeds = [pour["seed"] for pour in pours]
    require(len(set(seeds)) == len(seeds), path, "seed", seeds, "each seed once")
    return job


def saved_positions(path: str | PathLike) -> dict[str, np.ndarray]:
    """All arrays of a job's .npz file, with the keys NAME_SEED."""
    return read_npz(path, what="the .npz file that the verb pour wrote")


def pour_arrays(
    arrays: Arrays, seed: object, source: object, kinds: Iterable[str] = KINDS
) -> dict[str, np.ndarray]:
    """Arrays of one pour by name, from those with the keys NAME_SEED; InputError if one of `kinds` is unusable."""
    ending = f"_{seed}"
    selected = {
        key.removesuffix(ending): values
        for key, values in arrays.items()
        if key.endswith(ending)
    }
    for kind in kinds:
        require(
            kind in selected,
            source,
            f"{kind}{ending}",
            None,
            "an array in the .npz file beside it",
        )
    if "position" in kinds:
        _check_grains(selected, source, ending)
    return selected


def _check_grains(arrays: Arrays, source: object, ending: str) -> None:
    """Raise InputError for arrays of different numbers of grains, or with impossible values."""
    grains = arrays["position"].shape[-2:-1]
    for kind in filter(arrays.__contains__, (*COLUMNS, *ONE_A_GRAIN)):
        values, name = arrays[kind], f"{kind}{ending}"
        shape = (*grains, COLUMNS[kind]) if kind in COLUMNS else grains
        found = f"{values.dtype} {values.shape}"
        good = (
            values.dtype.kind in "bfiu"
            and values.shape[-len(shape) :] == shape
            and grains
        )
        require(
            good,
            source,
            name,
            found,
            f"numbers {shape}, of as many grains as the other arrays",
        )
        require(np.isfinite(values).all(), source, name, "not finite", "finite numbers")
        require(
            kind != "quaternion" or values.any(axis=-1).all(),
            source,
            name,
            "zero",
            "a rotation of each grain",
        )
        if kind == "scale" and not (values > 0).all():
            raise InputError(
                source,
                name,
                float(values.min()),
                "sizes above 0, in sizes of the mean grain",
            )


def first_pour(path: str | PathLike) -> dict[str, np.ndarray]:
    """Read the arrays of the first seed in a job's .npz file, by name, such as ``position``."""
    arrays = saved_positions(path)
    seeds = [
        match.group(1)
        for key in arrays
        if (match := re.fullmatch(r"position_(.+)", key))
    ]
    require(
        seeds,
        path,
        "arrays",
        sorted(arrays),
        "position_SEED, quaternion_SEED, in_pile_SEED",
    )
    return pour_arrays(arrays, seeds[0], path)


def positions_file(pours_json: str | PathLike) -> Path:
    """Name the .npz file that belongs to a NAME.pours.json."""
    path = Path(pours_json)
    return path.with_name(path.name.removesuffix(POURS) + ".npz")
