"""Read and check saved pours: their records and the final positions of their grains.

A job simulates several pours of one parameter set, each with its own seed.
NAME.pours.json contains the status of each pour of a job, and NAME.npz the final
positions.
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
# Arrays with a vector for each grain, and the number of its components
VECTOR_SIZES = {"position": 3, "quaternion": 4}
SCALAR_ARRAYS = ("in_pile", "scale")  # arrays with a single number for each grain
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
        If the file is not such a file, or contains an invalid record.
    """
    job = read_json(path, what=EXPECTED_FILE)
    # Check the name, too, because the path of the .npz file is derived from it.
    name = Path(path).name
    if not name.endswith(POURS_ENDING):
        raise InputError(path, key="file name", value=name, allowed=EXPECTED_FILE)
    pours = job.get("pours")
    if not isinstance(pours, list) or not pours:
        raise InputError(path, key="pours", value=pours, allowed=EXPECTED_FILE)
    for pour in pours:
        _check_pour(pour, path)
        pour.setdefault("reason", "")  # a valid record may lack it
    seeds = [pour["seed"] for pour in pours]
    if len(set(seeds)) < len(seeds):
        raise InputError(path, key="seed", value=seeds, allowed="each seed once")
    return job


def _check_pour(pour: Any, path: str | PathLike) -> None:
    """Raise InputError for an invalid record of a pour.

    A valid record is a mapping with a ``seed``, a ``status`` (text) and optionally a
    ``reason`` (text). All further values are finite numbers or None.

    Parameters
    ----------
    pour : object
        The record, as it was read from the file.
    path : path
        The file, for messages.
    """
    has_seed = isinstance(pour, dict) and "seed" in pour
    if not has_seed or not isinstance(pour.get("status"), str):
        raise InputError(
            path, key="pours", value=pour, allowed="records with a seed and a status"
        )
    reason = pour.get("reason", "")
    if not isinstance(reason, str):
        raise InputError(path, key="reason", value=reason, allowed="text")
    # All other values, including the seed, must be numbers. A bool counts as a number.
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
        Arrays of a job. A key consists of the array's name and the seed of the pour,
        such as ``position_3``.
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
        If a needed array is missing, or if an array has a wrong shape or invalid
        values.
    """
    # The key of each of the pour's arrays ends with its seed.
    suffix = f"_{seed}"
    selected = {}
    for key, values in arrays.items():
        if key.endswith(suffix):
            selected[key.removesuffix(suffix)] = values
    for name in required_arrays:
        if name not in selected:
            raise InputError(
                source,
                key=f"{name}{suffix}",
                value=None,
                allowed="an array of this name in the .npz file",
            )
    # Without positions, the number of grains is unknown, so nothing can be checked.
    if "position" in required_arrays:
        _check_grains(selected, source, suffix)
    return selected


def _check_grains(arrays: Arrays, source: object, suffix: str) -> None:
    """Raise InputError for an array with a wrong shape or invalid values.

    All arrays must have the same number of grains as the positions.

    Parameters
    ----------
    arrays : mapping
        Arrays of a pour by name. Positions may be given for one time (N, 3) or for
        several times (T, N, 3).
    source : object
        The file, for messages.
    suffix : str
        The text that follows the name of an array in its key, such as ``_3``. It is
        needed only for messages.
    """
    # The slice is a tuple (N,) with the number of grains. It is empty if the array has
    # too few dimensions, and then an error is raised below.
    grain_shape = arrays["position"].shape[-2:-1]
    for name in (*VECTOR_SIZES, *SCALAR_ARRAYS):
        if name not in arrays:
            continue
        values = arrays[name]
        key = f"{name}{suffix}"
        shape = grain_shape
        if name in VECTOR_SIZES:
            shape = (*grain_shape, VECTOR_SIZES[name])
        is_numeric = values.dtype.kind in NUMERIC_KINDS
        # Compare only the last axes, because the first one may be that of times.
        last_axes = values.shape[-len(shape) :]
        has_shape = len(grain_shape) > 0 and last_axes == shape
        if not is_numeric or not has_shape:
            raise InputError(
                source,
                key=key,
                value=f"{values.dtype} {values.shape}",
                allowed=f"numbers {shape}, for as many grains as in the other arrays",
            )
        _check_values(name, values, source, key)


def _check_values(name: str, values: np.ndarray, source: object, key: str) -> None:
    """Raise InputError for an array of grains with an invalid value.

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
