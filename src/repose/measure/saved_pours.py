"""Read and check saved pours: their records and the final positions of their grains.

NAME.pours.json holds the status of each pour of a job, NAME.npz the final positions.
"""

import math
import re
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from repose.common.errors import InputError
from repose.common.files import read_json, read_npz

POURS_ENDING = ".pours.json"  # ending of the file, after the job's name
REQUIRED_ARRAYS = ("position", "quaternion", "in_pile")
N_COLUMNS = {"position": 3, "quaternion": 4}
NUMBERS_PER_GRAIN = ("in_pile", "scale")
# NumPy's letters for booleans, floats, and integers of two kinds
NUMERIC_KINDS = "bfiu"
EXPECTED_FILE = f"NAME{POURS_ENDING} as the subcommand pour writes it"

Arrays = Mapping[str, np.ndarray]  # of a pour, by name


def read_pours(path: str | PathLike) -> dict[str, Any]:
    """Read the JSON file of a job's pours.

    Parameters
    ----------
    path : path
        NAME.pours.json.

    Returns
    -------
    dict
        The content of the file. Its key ``pours`` has a list of pours, each with a
        seed, a status, a reason (which may be empty) and numbers.

    Raises
    ------
    InputError
        If the file is not such a file, or has an impossible pour.
    """
    job = read_json(path, what=EXPECTED_FILE)
    # Other files of the program have no list of pours, or have another name.
    pours = job.get("pours")
    is_pours_file = str(path).endswith(POURS_ENDING)
    if not is_pours_file or not isinstance(pours, list) or not pours:
        raise InputError(path, key="pours", value=pours, allowed=EXPECTED_FILE)
    for pour in pours:
        _check_pour(pour, path)
        # A record may lack a reason.
        pour.setdefault("reason", "")
    seeds = [pour["seed"] for pour in pours]
    if len(set(seeds)) < len(seeds):
        raise InputError(path, key="seed", value=seeds, allowed="each seed once")
    return job


def _check_pour(pour: Any, path: str | PathLike) -> None:
    """Raise InputError for an impossible record of a pour.

    Parameters
    ----------
    pour : object
        The record, as it was read. It should be a mapping, and may lack a reason.
    path : path
        The file, for messages.
    """
    is_record = isinstance(pour, dict) and "seed" in pour
    if not is_record or not isinstance(pour.get("status"), str):
        raise InputError(
            path, key="pours", value=pour, allowed="records with a seed and a status"
        )
    reason = pour.get("reason", "")
    if not isinstance(reason, str):
        raise InputError(path, key="reason", value=reason, allowed="text")
    # All other values are numbers. The seed is one, too.
    for key in pour.keys() - {"status", "reason"}:
        value = pour[key]
        is_number = isinstance(value, int | float) and math.isfinite(value)
        if value is not None and not is_number:
            raise InputError(
                path, key=key, value=value, allowed="a finite number, or null"
            )


def read_positions(path: str | PathLike) -> dict[str, np.ndarray]:
    """Read all arrays of a job's .npz file, with the keys NAME_SEED."""
    return read_npz(path, what="the .npz file that the subcommand pour wrote")


def select_pour(
    arrays: Arrays,
    seed: object,
    source: object,
    required_arrays: Iterable[str] = REQUIRED_ARRAYS,
) -> dict[str, np.ndarray]:
    """Select the arrays of one pour from those of its job, and check them.

    Parameters
    ----------
    arrays : mapping
        Arrays of a job, with the keys NAME_SEED.
    seed : int or str
        The pour's seed.
    source : object
        The file, for messages.
    required_arrays : iterable of str
        Names of the arrays that are needed.

    Returns
    -------
    dict
        All arrays of the pour, by their names without the seed.

    Raises
    ------
    InputError
        If a needed array is missing, or the grains are impossible.
    """
    # The names of the pour's arrays end with its seed.
    ending = f"_{seed}"
    selected = {}
    for key, values in arrays.items():
        if key.endswith(ending):
            selected[key.removesuffix(ending)] = values
    for name in required_arrays:
        if name not in selected:
            raise InputError(
                source,
                key=f"{name}{ending}",
                value=None,
                allowed="an array in the .npz file beside it",
            )
    if "position" in required_arrays:
        _check_grains(selected, source, ending)
    return selected


def _check_grains(arrays: Arrays, source: object, ending: str) -> None:
    """Raise InputError for arrays of different numbers of grains, or impossible values.

    Parameters
    ----------
    arrays : mapping
        Arrays of a pour by name. Positions may be those of one time (N, 3) or of
        several (T, N, 3).
    source : object
        The file, for messages.
    ending : str
        The text after the name of an array in the file, for messages.
    """
    # Slice the number of grains from the shape, as a tuple (N,). It is empty if the
    # array has too few dimensions.
    grain_shape = arrays["position"].shape[-2:-1]
    for name in (*N_COLUMNS, *NUMBERS_PER_GRAIN):
        if name not in arrays:
            continue
        values = arrays[name]
        key = f"{name}{ending}"
        shape = (*grain_shape, N_COLUMNS[name]) if name in N_COLUMNS else grain_shape
        is_numeric = values.dtype.kind in NUMERIC_KINDS
        # Compare only the last axes, because the first one may be that of times.
        has_shape = grain_shape and values.shape[-len(shape) :] == shape
        if not is_numeric or not has_shape:
            raise InputError(
                source,
                key=key,
                value=f"{values.dtype} {values.shape}",
                allowed=f"numbers {shape}, of as many grains as the other arrays",
            )
        _check_values(name, values, source, key)


def _check_values(name: str, values: np.ndarray, source: object, key: str) -> None:
    """Raise InputError for an array of grains with an impossible value.

    Parameters
    ----------
    name : str
        Name of the array, such as ``quaternion``.
    values : ndarray
        The array.
    source : object
        The file, for messages.
    key : str
        Name of the array in the file, for messages.
    """
    if not np.isfinite(values).all():
        raise InputError(source, key=key, value="not finite", allowed="finite numbers")
    # A quaternion of zeros is not a rotation.
    if name == "quaternion" and not values.any(axis=-1).all():
        raise InputError(
            source, key=key, value="zero", allowed="a rotation of each grain"
        )
    if name == "scale" and not (values > 0).all():
        raise InputError(
            source,
            key=key,
            value=float(values.min()),
            allowed="sizes above 0, in sizes of the mean grain",
        )


def read_first_pour(path: str | PathLike) -> dict[str, np.ndarray]:
    """Read the arrays of the first pour in a job's .npz file.

    Their names, such as ``position``, are those of the file without the seed. Raises
    InputError if the file has no pour.
    """
    arrays = read_positions(path)
    return select_pour(arrays, _find_first_seed(arrays, path), path)


def read_first_seed(path: str | PathLike) -> str:
    """Read the seed of the pour that `read_first_pour` reads."""
    return _find_first_seed(read_positions(path), path)


def _find_first_seed(arrays: Mapping[str, np.ndarray], path: str | PathLike) -> str:
    """Find the seed of the first pour among the arrays of a job's .npz file."""
    for key in arrays:
        match = re.fullmatch(r"position_(.+)", key)
        if match:
            return match.group(1)
    raise InputError(
        path,
        key="arrays",
        value=sorted(arrays),
        allowed="position_SEED, quaternion_SEED, in_pile_SEED",
    )


def positions_file(pours_json: str | PathLike) -> Path:
    """Return the path of the .npz file beside a NAME.pours.json."""
    path = Path(pours_json)
    return path.with_name(path.name.removesuffix(POURS_ENDING) + ".npz")
