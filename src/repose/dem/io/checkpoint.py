"""A simulation in one file, to go on from with the same bits."""

import dataclasses
import json
import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import walls as wall_types
from ..cache import source_hash
from ..errors import InputError
from ..kernels import state as st
from ..materials import Contact, Material
from ..shapes import Clump, Shape
from ..walls import Motion
from .whole import write_whole

if TYPE_CHECKING:
    from ..simulation import Simulation

FORMAT = 1
ABOUT = "about"  # the array that holds the description
WHOLE = "a whole file that Simulation.save wrote"
OF_SIMULATION = (
    "capacity",
    "lower",
    "upper",
    "tension",
    "friction_limit",
    "largest_scale",
    "threads",
)  # its arguments
OF_BODIES = (
    "limit",
    "deepest",
)  # arrays of wall contacts that have a place for each body and do not grow


def save(simulation: "Simulation", path: str | os.PathLike) -> None:
    """Write a simulation to a .npz of plain arrays, in one move; the descriptive part is JSON in bytes."""
    about = json.dumps(_description(simulation)).encode()
    arrays: dict[str, Any] = {
        ABOUT: np.frombuffer(about, np.uint8),
        **dict(_arrays(simulation)),
    }
    write_whole(path, lambda handle: np.savez_compressed(handle, **arrays))


def load(kind: type, path: str | os.PathLike) -> Any:
    """Read the simulation of a file, as it was saved; kind: its class.

    InputError names the file where it is missing, damaged, of another format, or of other engine sources.
    """
    path = Path(path)
    about, arrays = _read(path)
    if about.get("format") != FORMAT:
        raise InputError(
            path, "format", about.get("format"), f"{FORMAT}, what this version reads"
        )
    if about.get("engine") != source_hash():
        allowed = f"{source_hash()!r}: only the sources that wrote a checkpoint go on with the same bits"
        raise InputError(path, "engine sources", about.get("engine"), allowed)
    try:
        simulation = kind(**_arguments(about))
        _restore(simulation, arrays)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(path, "content", str(error), WHOLE) from None
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
        about = json.loads(arrays.pop(ABOUT).tobytes())
    except (
        OSError,
        EOFError,
        KeyError,
        ValueError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise InputError(path, "checkpoint", str(error), WHOLE) from None
    return about, arrays


def _arrays(simulation: "Simulation") -> Iterator[tuple[str, np.ndarray]]:
    """Yield every array of a simulation, single or in a named tuple, with its name."""
    for name, value in vars(simulation).items():
        if isinstance(value, np.ndarray):
            yield name, value
        for field in getattr(value, "_fields", ()):
            if isinstance(getattr(value, field), np.ndarray):
                yield f"{name}.{field}", getattr(value, field)


def _restore(simulation: "Simulation", arrays: Mapping[str, np.ndarray]) -> None:
    """Give a new simulation the arrays of another."""
    made = dict(_arrays(simulation))
    if set(made) != set(arrays):
        raise KeyError(f"arrays {sorted(set(made) ^ set(arrays))}")
    for name, values in arrays.items():
        array = made[name]
        if array.dtype == values.dtype and array.shape == values.shape:
            array[...] = values
        elif (
            array.dtype == values.dtype
            and _may_grow(name)
            and array.shape[1:] == values.shape[1:]
        ):
            group, _, field = name.partition(".")
            setattr(
                simulation,
                group,
                getattr(simulation, group)._replace(**{field: _aligned(values)}),
            )
        else:
            raise ValueError(f"array {name} is {values.dtype}{values.shape}")


def _may_grow(name: str) -> bool:
    """Tell whether an array belongs to the lists of contacts, which grow."""
    group, _, field = name.partition(".")
    return (
        group in ("pairs", "flat", "curved", "meshed", "clumps")
        and field not in OF_BODIES
    )


def _aligned(values: np.ndarray) -> np.ndarray:
    """Copy an array so that it begins at a cache line, as the kernels need it."""
    if values.dtype != np.float64:
        return values.copy()
    copy = st.zeros(*values.shape)
    copy[...] = values
    return copy


def _description(simulation: "Simulation") -> dict[str, Any]:
    """Describe the arguments of a simulation, for JSON."""
    physics, walls = simulation.physics, simulation.wall_set.surfaces
    arguments = {name: _plain(getattr(simulation, name)) for name in OF_SIMULATION}
    return {
        "format": FORMAT,
        "engine": source_hash(),
        "shapes": {name: _plain(shape) for name, shape in simulation.shapes.items()},
        "materials": {
            name: _plain(material) for name, material in simulation.materials.items()
        },
        "contacts": [
            [*pair, _plain(contact)]
            for pair, contact in simulation.contact_pairs.items()
        ],
        "walls": {
            name: [type(wall).__name__, _plain(wall)] for name, wall in walls.items()
        },
        "arguments": arguments
        | {
            "time_step_s": physics.dt,
            "gravity_m_s2": _plain(physics.gravity),
            "contact_law": simulation.contact_law.name,
            "rolling_law": simulation.rolling_law.name,
            "exit_height_m": physics.exit_height,
            "curved_walls_above_m": physics.curved_walls_above,
            "floor_height_m": physics.floor_height,
        },
    }


def _arguments(about: Mapping[str, Any]) -> dict[str, Any]:
    """Make the arguments of the described simulation."""
    walls = {}
    for name, (kind, fields) in about["walls"].items():
        motion = Motion(**_tuples(fields["motion"]))
        walls[name] = getattr(wall_types, kind)(**{**_tuples(fields), "motion": motion})
    return {
        "shapes": {name: _shape(fields) for name, fields in about["shapes"].items()},
        "materials": {
            name: Material(**fields) for name, fields in about["materials"].items()
        },
        "contacts": {(a, b): Contact(**fields) for a, b, fields in about["contacts"]},
        "walls": walls,
        **about["arguments"],
    }


def _shape(fields: Mapping[str, Any]) -> Clump | Shape:
    """Make the shape that has these fields."""
    return Clump(**fields) if "spheres_m" in fields else Shape(**fields)


def _plain(value: Any) -> Any:
    """Convert a value to the types of JSON; an object becomes a mapping of its fields."""
    if dataclasses.is_dataclass(value):
        return {
            field.name: _plain(getattr(value, field.name))
            for field in dataclasses.fields(value)
        }
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return (
        {name: _plain(item) for name, item in value.items()}
        if isinstance(value, Mapping)
        else value
    )


def _tuples(value: Any) -> Any:
    """Convert a value of JSON: tuples in place of lists."""
    if isinstance(value, dict):
        return {name: _tuples(item) for name, item in value.items()}
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
