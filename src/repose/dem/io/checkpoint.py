"""Save a simulation in a file, and load it so that it continues bit by bit the same."""

import dataclasses
import json
import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .. import walls as wall_types
from ..errors import InputError
from ..kernels import state
from ..materials import Contact, Material
from ..shapes import Clump, Shape
from ..sources import source_hash
from ..walls import Motion
from ..world import World
from .whole import write_whole

FORMAT = 1
DESCRIPTION = "about"  # name of the array that holds the description
INTACT = "a whole file that Simulation.save wrote"  # for messages
# Arguments of a simulation that it keeps as attributes of the same names.
KEPT_ARGUMENTS = (
    "capacity",
    "lower",
    "upper",
    "tension",
    "friction_limit",
    "largest_scale",
    "threads",
)
GROWING_LISTS = ("pairs", "flat", "curved", "meshed", "clumps")
# Arrays in these lists that have an entry for each body and therefore do not grow
ARRAYS_OF_BODIES = ("limit", "deepest")

AnyWorld = TypeVar("AnyWorld", bound=World)


def save(simulation: World, path: str | os.PathLike) -> None:
    """Write a simulation to a .npz file, which is either complete or absent.

    The file contains plain arrays. One of them holds a description of the arguments, as
    JSON in bytes.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    path : path
        The file.
    """
    description = json.dumps(_describe(simulation)).encode()
    arrays: dict[str, Any] = {DESCRIPTION: np.frombuffer(description, np.uint8)}
    arrays.update(_list_arrays(simulation))
    write_whole(path, lambda handle: np.savez_compressed(handle, **arrays))


def load(simulation_class: type[AnyWorld], path: str | os.PathLike) -> AnyWorld:
    """Read a simulation as it was saved.

    Parameters
    ----------
    simulation_class : type
        Class of the simulation, such as `Simulation`.
    path : path
        The file.

    Returns
    -------
    Simulation
        A new object of this class, in the state of the saved one.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another format, or written by another
        version of the engine. The message names the file.
    """
    path = Path(path)
    description, arrays = _read_file(path)
    version = description.get("format")
    if version != FORMAT:
        raise InputError(path, "format", version, f"{FORMAT}, what this version reads")
    sources = description.get("engine")
    if sources != source_hash():
        raise InputError(
            path,
            "engine sources",
            sources,
            f"{source_hash()!r}: a checkpoint continues identically only with "
            "the sources that wrote it",
        )
    # Make a new simulation from the arguments, and give it the state of the saved one.
    try:
        simulation = simulation_class(**_make_arguments(description))
        _restore_arrays(simulation, arrays)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(path, "content", str(error), INTACT) from None
    return simulation


def _read_file(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Read a file of a simulation.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    description : dict
        Format, sources of the engine, and arguments (`_describe`).
    arrays : dict of str to ndarray
        The arrays of the simulation by name.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    if not path.is_file():
        raise InputError(
            path, "file", None, "an existing checkpoint, written by Simulation.save"
        )
    # A damaged archive may raise any of these errors: of the system, of zip, zlib or
    # JSON, for a missing description, or for one that is not an array (AttributeError).
    try:
        with np.load(path, allow_pickle=False) as store:
            arrays = {name: store[name] for name in store.files}
        description = json.loads(arrays.pop(DESCRIPTION).tobytes())
    except (
        OSError,
        EOFError,
        KeyError,
        ValueError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise InputError(path, "checkpoint", str(error), INTACT) from None
    return description, arrays


def _list_arrays(simulation: World) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the name and the value of every array of a simulation.

    An array is an attribute of the simulation, or a field of an attribute that is a
    named tuple. The name of a field has the form "pairs.first".
    """
    for name, value in vars(simulation).items():
        if isinstance(value, np.ndarray):
            yield name, value
        for field in getattr(value, "_fields", ()):
            array = getattr(value, field)
            if isinstance(array, np.ndarray):
                yield f"{name}.{field}", array


def _restore_arrays(simulation: World, saved_arrays: Mapping[str, np.ndarray]) -> None:
    """Copy the arrays of a saved simulation into a new one.

    `load` turns the errors raised here into an InputError, which names the file.

    Parameters
    ----------
    simulation : Simulation
        A simulation with the same arguments as the saved one. Its arrays are
        overwritten.
    saved_arrays : mapping
        The saved arrays by name.

    Raises
    ------
    KeyError
        If the names of the arrays differ.
    ValueError
        If an array has another type or shape than in the new simulation.
    """
    new_arrays = dict(_list_arrays(simulation))
    if set(new_arrays) != set(saved_arrays):
        raise KeyError(f"arrays {sorted(set(new_arrays) ^ set(saved_arrays))}")
    for name, saved in saved_arrays.items():
        new = new_arrays[name]
        if new.dtype == saved.dtype and new.shape == saved.shape:
            new[...] = saved
        elif _may_replace(name, new, saved):
            # Lists of contacts grow during a simulation, so the saved array may be
            # longer than the new one. Only arrays of such lists may be replaced.
            _replace_array(simulation, name, saved)
        else:
            raise ValueError(f"array {name} is {saved.dtype}{saved.shape}")


def _may_replace(name: str, new: np.ndarray, saved: np.ndarray) -> bool:
    """Return whether a saved array may replace a new array of another length.

    It may if it belongs to a list that grows and if only the lengths differ.
    """
    has_type = new.dtype == saved.dtype
    return has_type and _may_grow(name) and new.shape[1:] == saved.shape[1:]


def _may_grow(name: str) -> bool:
    """Return whether an array belongs to the lists of contacts that grow."""
    group, _, field = name.partition(".")
    return group in GROWING_LISTS and field not in ARRAYS_OF_BODIES


def _replace_array(simulation: World, name: str, values: np.ndarray) -> None:
    """Replace an array of a simulation by one of another length.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    name : str
        Name of the array: the name of a list and of one of its fields, with a point
        between them.
    values : ndarray
        The new values, which are copied.
    """
    group, _, field = name.partition(".")
    lists = getattr(simulation, group)
    setattr(simulation, group, lists._replace(**{field: _copy_aligned(values)}))


def _copy_aligned(values: np.ndarray) -> np.ndarray:
    """Copy an array. A copy of floats starts at a cache line, as the kernels need."""
    if values.dtype != np.float64:
        return values.copy()
    copy = state.aligned_zeros(*values.shape)
    copy[...] = values
    return copy


def _describe(simulation: World) -> dict[str, Any]:
    """Describe the arguments of a simulation by JSON types."""
    physics = simulation.physics
    arguments = {name: _convert(getattr(simulation, name)) for name in KEPT_ARGUMENTS}
    arguments |= {
        "time_step_s": physics.dt,
        "gravity_m_s2": _convert(physics.gravity),
        "contact_law": simulation.contact_law.name,
        "rolling_law": simulation.rolling_law.name,
        "exit_height_m": physics.exit_height,
        "curved_walls_above_m": physics.curved_walls_above,
        "floor_height_m": physics.floor_height,
    }
    return {
        "format": FORMAT,
        "engine": source_hash(),
        "shapes": _convert(simulation.shapes),
        "materials": _convert(simulation.materials),
        "contacts": [
            [*pair, _convert(contact)]
            for pair, contact in simulation.contact_pairs.items()
        ],
        "walls": {
            name: [type(wall).__name__, _convert(wall)]
            for name, wall in simulation.wall_set.surfaces.items()
        },
        "arguments": arguments,
    }


def _make_arguments(description: Mapping[str, Any]) -> dict[str, Any]:
    """Make the arguments of a simulation from its description (see `_describe`)."""
    shapes = {
        name: _make_shape(fields) for name, fields in description["shapes"].items()
    }
    materials = {
        name: Material(**fields) for name, fields in description["materials"].items()
    }
    contacts = {(a, b): Contact(**fields) for a, b, fields in description["contacts"]}
    walls = {
        name: _make_wall(class_name, fields)
        for name, (class_name, fields) in description["walls"].items()
    }
    return {
        "shapes": shapes,
        "materials": materials,
        "contacts": contacts,
        "walls": walls,
        **description["arguments"],
    }


def _make_wall(class_name: str, fields: Mapping[str, Any]) -> Any:
    """Make a wall from the name of its class and its fields."""
    values = _convert_lists(fields)
    values["motion"] = Motion(**values["motion"])
    return getattr(wall_types, class_name)(**values)


def _make_shape(fields: Mapping[str, Any]) -> Clump | Shape:
    """Make a shape from its fields."""
    return Clump(**fields) if "spheres_m" in fields else Shape(**fields)


def _convert(value: Any) -> Any:
    """Convert a value to JSON types.

    Parameters
    ----------
    value : object
        A dataclass, which becomes a mapping of its fields; an array or a sequence,
        which becomes a list; a mapping, whose values are converted; or a number or a
        string, which is returned unchanged.
    """
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
        return {name: _convert(getattr(value, name)) for name in names}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_convert(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _convert(item) for name, item in value.items()}
    return value


def _convert_lists(value: Any) -> Any:
    """Convert the lists in a JSON value to tuples."""
    if isinstance(value, dict):
        return {name: _convert_lists(item) for name, item in value.items()}
    if isinstance(value, list):
        return tuple(_convert_lists(item) for item in value)
    return value
