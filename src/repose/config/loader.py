"""The files of a configuration, each over the one before it, and the resolved file that a study writes."""

import copy
import functools
import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from repose.bench.parameters import FURTHER, PARAMETERS
from repose.common import ledger, places
from repose.common.files import Path_, write_text
from repose.common.keys import Config, Origin

CROP = ("sizes", "density_kg_m3", "stl")  # keys of `berry` that define a crop
COMMAND_LINE = "command line (--config)"
WORKFLOW = "configuration"  # that a workflow around this one gives
Contents = Sequence[tuple[str, Config]]  # of files
Layered = tuple[
    dict[str, Any], Origin
]  # a configuration, and the file of each of its keys
Read = Callable[[Path_], dict[str, Any]]
EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
RESOLVED = "config.json"  # in the folder of results
# Replaced, not merged: a fixed parameter has no prior of another file.
WHOLE = {f"parameters.{name}" for name in (*PARAMETERS, *FURTHER)}


def read(path: Path_) -> dict[str, Any]:
    """Call `repose.common.reading.read`; a job, which reads no YAML, does not load it."""
    from repose.common import reading

    return reading.read(path)


def read_layers(files: Sequence[Path_], overrides: Config | None = None) -> Layered:
    """Read files over the defaults, and note the file of each key; `overrides`, texts as YAML, lie over all.

    Values are not checked, and `auto` stays; a complete file needs no default.
    """
    paths = [places.find(path) for path in files]
    read_once: Any = functools.cache(read)
    if paths:
        config, source = _over_each_other(paths, overrides, read_once)
        if not _lacks_keys(config):
            return config, source
    return _over_each_other(layers(paths, read_once), overrides, read_once)


def over_defaults(
    given: Config, files: Sequence[Path_] = (), otherwise: str = COMMAND_LINE
) -> Layered:
    """Lay what snakemake calls `config` over the defaults that it needs; a crop inherits nothing of another one.

    Its texts are read as YAML. A message names the last of the `files` that has a value, or else `otherwise`.
    """
    read_once: Any = functools.cache(read)
    files = [places.find(path) for path in files]
    method, study = places.find(places.METHOD_CONFIG), places.configs()[-1]
    below: list[Path_] = [method]
    if files or not _is_a_crop(given):
        below = layers((), read_once, *map(read_once, files), given)
    config, source = _over_each_other(
        below if _lacks_keys(given) else (), read=read_once
    )
    contents = [(str(path), read_once(path)) for path in (*below, study, *files)]
    own: dict[str, str] = {}
    _merge(config, _as_in_files(given, "", contents, own, otherwise), {}, "")
    default = str(files[-1]) if files else otherwise
    return _with_files_resolved(config), Origin(
        {**source.origin, **own}, default, str(method)
    )


def _as_in_files(
    value: Any, name: str, files: Contents, origin: dict[str, str], otherwise: str
) -> Any:
    """Return the values that snakemake gives as the files have them; note the last file of each key in `origin`."""
    if isinstance(value, Mapping):
        prefix = f"{name}." if name else ""
        inside = {
            key: _as_in_files(one, f"{prefix}{key}", files, origin, otherwise)
            for key, one in value.items()
        }
        having = [
            path for path, content in files if isinstance(_at(content, name), dict)
        ]
        origin[name] = having[-1] if having else otherwise
        return inside
    # what a YAML of another version takes for a text, and all texts of the command line
    meant = (
        _values(value)
        if otherwise == COMMAND_LINE or EXPONENT.match(str(value))
        else value
    )
    for path, content in reversed(files):
        if (theirs := _at(content, name)) in (value, meant):
            origin[name] = path
            return theirs
    origin[name] = otherwise
    return meant


def _at(content: Any, name: str) -> Any:
    """Return the value of a dotted key in a file; `...`, which no file has, where it is missing."""
    for step in name.split(".") if name else ():
        content = content.get(step, ...) if isinstance(content, dict) else ...
    return content


def _lacks_keys(config: Config) -> bool:
    """Return whether a section of a configuration lacks a key."""
    # Imported here, as help and jobs load none of it.
    from repose.common.faults import lacks_keys
    from repose.config.models import settings_type

    return lacks_keys(config, settings_type())


def layers(files: Sequence[Path_], read: Read = read, *more: Config) -> list[Path_]:
    """List the defaults, then the given files of a configuration, each to be read over the one before it.

    The built-in crop is a default only if no other file, and none of `more`, defines a crop: no crop takes numbers of
    another one.
    """
    own = (places.root() / places.DEFAULT_CONFIG).resolve()
    defaults = places.configs()
    others = [path for path in defaults if path.resolve() != own]
    contents = (*map(read, (*others, *files)), *more)
    return [*(others if any(map(_is_a_crop, contents)) else defaults), *files]


def own_crop_under(*files: Path_) -> Path | None:
    """Return the file of the built-in crop if a configuration uses it in a folder that has no configuration.

    None also if one of the files is in the same folder, and so is made for it.
    """
    own, paths = (
        places.root() / places.DEFAULT_CONFIG,
        [places.find(path) for path in files],
    )
    beside = any(path != own and path.parent == own.parent for path in paths)
    if places.configs()[-1] != own or beside or is_resolved(*paths):
        return None
    if paths and own not in paths and not _lacks_keys(_over_each_other(paths)[0]):
        return None
    return own if own in (*paths, *layers(paths)) else None


def _is_a_crop(config: Config) -> bool:
    """Return whether a file defines a grain by a key that no default has: sizes, density or scan.

    A density that is a text comes from the command line, which changes one of the crop's numbers.
    """
    grain = config.get("berry")
    if not isinstance(grain, dict) or all(grain.get(key) is None for key in CROP):
        return False
    return any(grain.get(key) for key in ("sizes", "stl")) or not isinstance(
        grain[CROP[1]], str
    )


def _over_each_other(
    files: Sequence[Path_], overrides: Config | None = None, read: Read = read
) -> Layered:
    """Lay the configurations of files and the overrides over each other; note the file of each key."""
    config: dict[str, Any] = {}
    origin: dict[str, str] = {}
    for path in files:
        _merge(config, read(path), origin, str(path))
    _merge(config, _values(overrides or {}), origin, COMMAND_LINE)
    default = str(files[-1]) if files else ""
    return _with_files_resolved(config), Origin(
        origin, default, str(places.find(places.METHOD_CONFIG))
    )


def _with_files_resolved(config: dict[str, Any]) -> dict[str, Any]:
    """Put built-in files in place of the named files that the working folder lacks."""
    from repose.config.models import named_files

    for name in named_files():
        section, _, key = name.rpartition(".")
        found = config.get(section) if section else config
        if isinstance(found, dict) and isinstance(found.get(key), str):
            found[key] = str(places.find(found[key]))
    return config


def write_resolved(config: Config, path: Path_) -> None:
    """Write a configuration as JSON; an equal file stays untouched."""
    path = Path(path)
    text = json.dumps(config, indent=1) + "\n"
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        write_text(path, text)


def is_resolved(*files: Path_) -> bool:
    """Return whether this is a single file that `write_resolved` wrote, unchanged since."""
    return (
        len(files) == 1
        and Path(files[0]).name == RESOLVED
        and ledger.is_own_file(files[0])
    )


def _values(value: Any) -> Any:
    """Read the text in overrides as YAML: the command line gives 2 and [1, 2] as text."""
    from repose.common.reading import parse

    if isinstance(value, dict):
        return {key: _values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_values(item) for item in value]
    return (
        parse(value, COMMAND_LINE)
        if isinstance(value, str) and value.strip()
        else value
    )


def _merge(
    below: dict[str, Any],
    more: Config,
    origin: dict[str, str],
    source: str,
    prefix: str = "",
) -> None:
    """Put `more` over below by sections, and note in origin each key's file; sections in WHOLE are replaced."""
    for key, value in more.items():
        name = f"{prefix}{key}"
        origin[name] = source
        if (
            name not in WHOLE
            and isinstance(value, dict)
            and isinstance(below.get(key), dict)
        ):
            _merge(below[key], value, origin, source, f"{name}.")
        else:
            below[key] = copy.deepcopy(value)
            if isinstance(value, dict):
                _merge(below[key], value, origin, source, f"{name}.")
