"""Reading of saved pours: NAME.pours.json holds the status of each pour, NAME.npz the final positions."""

import re
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from repose.core.errors import InputError
from repose.core.files import read_json, read_npz

POURS = ".pours.json"  # behind the stem of a job's files
KINDS = ("position", "quaternion", "in_pile")
WHAT = f"NAME{POURS} as the verb pour writes it"


def read_pours(path: str | PathLike) -> dict[str, Any]:
    """Read the JSON file of a job's pours; each of its ``pours`` has a seed and a status."""
    job = read_json(path, what=WHAT)
    pours = job.get("pours")
    if not str(path).endswith(POURS) or not isinstance(pours, list) or not pours:
        raise InputError(path, "pours", pours, WHAT)
    for pour in pours:
        if not isinstance(pour, dict) or not isinstance(pour.get("status"), str) or "seed" not in pour:
            raise InputError(path, "pours", pour, "records with a seed and a status")
    return job


def saved_positions(path: str | PathLike) -> dict[str, np.ndarray]:
    """All arrays of a job's .npz file, with the keys NAME_SEED."""
    return read_npz(path, what="the .npz file that the verb pour wrote")


def pour_arrays(
    arrays: dict[str, np.ndarray], seed: object, source: object, kinds: Iterable[str] = KINDS
) -> dict[str, np.ndarray]:
    """Arrays of one pour by name, such as ``position``, from arrays with the keys NAME_SEED."""
    ending = f"_{seed}"
    selected = {key.removesuffix(ending): values for key, values in arrays.items() if key.endswith(ending)}
    for kind in kinds:
        if kind not in selected:
            raise InputError(source, f"{kind}{ending}", None, "an array in the .npz file beside it")
    return selected


def first_pour(path: str | PathLike) -> dict[str, np.ndarray]:
    """The arrays of the first seed in a job's .npz file, by name, such as ``position``."""
    arrays = saved_positions(path)
    seeds = [match.group(1) for key in arrays if (match := re.fullmatch(r"position_(.+)", key))]
    if not seeds:
        raise InputError(path, "arrays", sorted(arrays), "position_SEED, quaternion_SEED, in_pile_SEED")
    return pour_arrays(arrays, seeds[0], path)


def positions_file(pours_json: str | PathLike) -> Path:
    """The .npz file that belongs to a NAME.pours.json."""
    path = Path(pours_json)
    return path.with_name(path.name.removesuffix(POURS) + ".npz")
