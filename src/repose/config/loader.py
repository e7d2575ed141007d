"""The files of a configuration, each over the one before it, and the resolved file that a study writes."""

import copy
import functools
import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from repose.config.keys import Origin
from repose.core import ledger, places
from repose.core.files import write_text
from repose.core.parameters import FURTHER, PARAMETERS

CROP = ("sizes", "density_kg_m3", "stl")  # keys of `berry` that define a crop
COMMAND_LINE = "command line (--config)"
Read = Callable[[str | os.PathLike], dict[str, Any]]
RESOLVED = "config.json"  # in the folder of results
# Replaced, not merged: a fixed parameter has no prior of another file.
WHOLE = {f"parameters.{name}" for name in (*PARAMETERS, *FURTHER)}


def read(path: str | os.PathLike) -> dict[str, Any]:
    """As `repose.config.reading.read`; a job, which reads no YAML, does not load it."""
    from repose.config import reading

    return reading.read(path)


def read_layers(
    files: Sequence[str | os.PathLike], overrides: Mapping[str, Any] | None = None
) -> tuple[dict[str, Any], Origin]:
    """The configuration of files over the defaults, and the file of each key; `overrides`, texts as YAML, lie over all.

    Values are not checked, and `auto` stays; a complete file needs no default.
    """
    from repose.config.faults import lacks_keys  # imported here and below: help and jobs load none of it

    paths = [places.find(path) for path in files]
    read_once: Any = functools.cache(read)
    if paths:
        config, source = _over_each_other(paths, overrides, read_once)
        if not lacks_keys(config):
            return config, source
    return _over_each_other(layers(paths, read_once), overrides, read_once)


def layers(files: Sequence[str | os.PathLike], read: Read = read) -> list[str | os.PathLike]:
    """The defaults, then the given files of a configuration, each to be read over the one before it.

    The built-in crop is a default only if no other file defines a crop, so that no crop takes numbers of another one.
    """
    own = (places.root() / places.DEFAULT_CONFIG).resolve()
    defaults = places.configs()
    others = [path for path in defaults if path.resolve() != own]
    return [*(others if any(_is_a_crop(read(path)) for path in (*others, *files)) else defaults), *files]


def own_crop_under(*files: str | os.PathLike) -> Path | None:
    """The file of the built-in crop if a configuration uses it in a folder that has no configuration.

    None also if one of the files lies beside it, and so is made for it.
    """
    own = places.root() / places.DEFAULT_CONFIG
    if places.configs()[-1] != own:
        return None
    paths = [places.find(path) for path in files]
    if any(path != own and path.parent == own.parent for path in paths):
        return None
    if is_resolved(*paths):
        return None
    from repose.config.faults import lacks_keys

    if paths and own not in paths and not lacks_keys(_over_each_other(paths)[0]):
        return None
    return own if own in (*paths, *layers(paths)) else None


def _is_a_crop(config):
    """Whether a file defines a grain by a key that no default has: sizes, density or scan."""
    grain = config.get("berry")
    return isinstance(grain, dict) and any(grain.get(key) is not None for key in CROP)


def _over_each_other(
    files: Sequence[str | os.PathLike], overrides: Mapping[str, Any] | None = None, read: Read = read
) -> tuple[dict[str, Any], Origin]:
    """The files' configurations, each over the one before it, under the overrides; and the file of each key."""
    config: dict[str, Any] = {}
    origin: dict[str, str] = {}
    for path in files:
        _merge(config, read(path), origin, str(path))
    _merge(config, _values(overrides or {}), origin, COMMAND_LINE)
    return _with_files_resolved(config), Origin(
        origin, str(files[-1]) if files else "", str(places.find(places.METHOD_CONFIG))
    )


def _with_files_resolved(config):
    """The configuration, with built-in files for the named files that the working folder lacks."""
    from repose.config.models import named_files

    for name in named_files():
        section, _, key = name.rpartition(".")
        found = config.get(section) if section else config
        path = found.get(key) if isinstance(found, dict) else None
        if isinstance(path, str):
            found[key] = str(places.find(path))
    return config


def write_resolved(config: Mapping[str, Any], path: str | os.PathLike) -> None:
    """Write a configuration as JSON; an equal file stays untouched."""
    path = Path(path)
    text = json.dumps(config, indent=1) + "\n"
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        write_text(path, text)


def is_resolved(*files: str | os.PathLike) -> bool:
    """Whether this is a single file that `write_resolved` wrote, unchanged since."""
    return len(files) == 1 and Path(files[0]).name == RESOLVED and ledger.is_own_file(files[0])


def _values(value):
    """Overrides with their text read as YAML: the command line gives 2 and [1, 2] as text."""
    from repose.config.reading import parse

    if isinstance(value, dict):
        return {key: _values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_values(item) for item in value]
    return parse(value, COMMAND_LINE) if isinstance(value, str) and value.strip() else value


def _merge(config, more, origin, source, prefix=""):
    """Put `more` over config by sections, and note in origin each key's file; sections in WHOLE are replaced."""
    for key, value in more.items():
        name = f"{prefix}{key}"
        origin[name] = source
        if name not in WHOLE and isinstance(value, dict) and isinstance(config.get(key), dict):
            _merge(config[key], value, origin, source, f"{name}.")
        else:
            config[key] = copy.deepcopy(value)
            if isinstance(value, dict):
                _merge(config[key], value, origin, source, f"{name}.")
