"""Save a simulation in one file, from which it goes on with the same bits."""

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
from ..kernels import state as st
from ..materials import Contact, Material
from ..shapes import Clump, Shape
from ..sources import source_hash
from ..walls import Motion
from ..world import World
from .whole import write_whole

FORMAT = 1
DESCRIPTION = "about"  # name of the array that holds the description
INTACT = "a whole file that Simulation.save wrote"
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
# Arrays of these lists that have an entry for each body and do not grow.
ARRAYS_OF_BODIES = ("limit", "deepest")

AnyWorld = TypeVar("AnyWorld", bound=World)


def save(simulation: World, path: str | os.PathLike) -> None:
    """Write a simulation to a .npz file, in one move.

    The file holds plain arrays. One of them holds a description of the arguments, as
    bytes of JSON.
    """
    description = json.dumps(_describe(simulation)).encode()
    arrays: dict[str, Any] = {DESCRIPTION: np.frombuffer(description, np.uint8)}
    arrays.update(_named_arrays(simulation))
    write_whole(path, lambda handle: np.savez_compressed(handle, **arrays))


def load(simulation_class: type[AnyWorld], path: str | os.PathLike) -> AnyWorld:
    """Read a simulation as it was saved.

    Raises
    ------
    InputError
        Naming the file if it is missing, damaged, of another format, or written by
        other sources of the engine.
    """
    path = Path(path)
    description, arrays = _read(path)
    version = description.get("format")
    if version != FORMAT:
        raise InputError(path, "format", version, f"{FORMAT}, what this version reads")
    sources = description.get("engine")
    if sources != source_hash():
        raise InputError(
            path,
            "engine sources",
            sources,
            f"{source_hash()!r}: only the sources that wrote a checkpoint "
            "go on with the same bits",
        )
    try:
        simulation = simulation_class(**_arguments(description))
        _restore(simulation, arrays)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(path, "content", str(error), INTACT) from None
    return simulation


def _read(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Read description and arrays of a file."""
    if not path.is_file():
        raise InputError(
            path, "file", None, "an existing checkpoint, written by Simulation.save"
        )
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


def _named_arrays(simulation: World) -> Iterator[tuple[str, np.ndarray]]:
    """Yield every array of a simulation with its name.

    An attribute is an array, or a named tuple with arrays, such as the list of pairs;
    these have names such as "pairs.first".
    """
    for name, value in vars(simulation).items():
        if isinstance(value, np.ndarray):
            yield name, value
        for field in getattr(value, "_fields", ()):
            array = getattr(value, field)
            if isinstance(array, np.ndarray):
                yield f"{name}.{field}", array


def _restore(simulation: World, saved: Mapping[str, np.ndarray]) -> None:
    """Give a new simulation the arrays of a saved one.

    Raises
    ------
    KeyError
        If the names of the arrays differ.
    ValueError
        If an array has another type or shape than in the new simulation.
    """
    arrays = dict(_named_arrays(simulation))
    if set(arrays) != set(saved):
        raise KeyError(f"arrays {sorted(set(arrays) ^ set(saved))}")
    for name, values in saved.items():
        array = arrays[name]
        if array.dtype == values.dtype and array.shape == values.shape:
            array[...] = values
        elif _may_replace(name, array, values):
            _replace_array(simulation, name, values)
        else:
            raise ValueError(f"array {name} is {values.dtype}{values.shape}")


def _may_replace(name: str, array: np.ndarray, values: np.ndarray) -> bool:
    """Return whether values may replace an array: it grows, and they are as wide."""
    has_type = array.dtype == values.dtype
    return has_type and _may_grow(name) and array.shape[1:] == values.shape[1:]


def _may_grow(name: str) -> bool:
    """Return whether an array belongs to the lists of contacts that grow."""
    group, _, field = name.partition(".")
    return group in GROWING_LISTS and field not in ARRAYS_OF_BODIES


def _replace_array(simulation: World, name: str, values: np.ndarray) -> None:
    """Replace an array of a list, named "group.name", by a longer or shorter one."""
    group, _, field = name.partition(".")
    lists = getattr(simulation, group)
    setattr(simulation, group, lists._replace(**{field: _aligned(values)}))


def _aligned(values: np.ndarray) -> np.ndarray:
    """Copy an array so that it begins at a cache line, as the kernels need it."""
    if values.dtype != np.float64:
        return values.copy()
    copy = st.zeros(*values.shape)
    copy[...] = values
    return copy


def _describe(simulation: World) -> dict[str, Any]:
    """Describe the arguments of a simulation, in types of JSON."""
    physics = simulation.physics
    arguments = {name: _plain(getattr(simulation, name)) for name in KEPT_ARGUMENTS}
    arguments |= {
        "time_step_s": physics.dt,
        "gravity_m_s2": _plain(physics.gravity),
        "contact_law": simulation.contact_law.name,
        "rolling_law": simulation.rolling_law.name,
        "exit_height_m": physics.exit_height,
        "curved_walls_above_m": physics.curved_walls_above,
        "floor_height_m": physics.floor_height,
    }
    return {
        "format": FORMAT,
        "engine": source_hash(),
        "shapes": _plain(simulation.shapes),
        "materials": _plain(simulation.materials),
        "contacts": [
            [*pair, _plain(contact)]
            for pair, contact in simulation.contact_pairs.items()
        ],
        "walls": {
            name: [type(wall).__name__, _plain(wall)]
            for name, wall in simulation.wall_set.surfaces.items()
        },
        "arguments": arguments,
    }


def _arguments(description: Mapping[str, Any]) -> dict[str, Any]:
    """Make the arguments of a simulation from its description, see `_describe`."""
    shapes = {name: _shape(fields) for name, fields in description["shapes"].items()}
    materials = {
        name: Material(**fields) for name, fields in description["materials"].items()
    }
    contacts = {(a, b): Contact(**fields) for a, b, fields in description["contacts"]}
    walls = {
        name: _wall(class_name, fields)
        for name, (class_name, fields) in description["walls"].items()
    }
    return {
        "shapes": shapes,
        "materials": materials,
        "contacts": contacts,
        "walls": walls,
        **description["arguments"],
    }


def _wall(class_name: str, fields: Mapping[str, Any]) -> Any:
    """Make the wall of a class that has these fields."""
    values = _tuples(fields)
    values["motion"] = Motion(**values["motion"])
    return getattr(wall_types, class_name)(**values)


def _shape(fields: Mapping[str, Any]) -> Clump | Shape:
    """Make the shape that has these fields."""
    return Clump(**fields) if "spheres_m" in fields else Shape(**fields)


def _plain(value: Any) -> Any:
    """Convert a value to types of JSON; an object becomes a mapping of its fields."""
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
        return {name: _plain(getattr(value, name)) for name in names}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    return value


def _tuples(value: Any) -> Any:
    """Convert the lists in a value of JSON to tuples."""
    if isinstance(value, dict):
        return {name: _tuples(item) for name, item in value.items()}
    if isinstance(value, list):
        return tuple(_tuples(item) for item in value)
    return value
