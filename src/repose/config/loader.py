"""The files of a configuration, which override one another, and the resolved file.

A study writes the resolved configuration into its folder of results.
"""

import copy
import functools
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from repose.bench.parameters import LAW_PARAMETERS, PARAMETERS
from repose.common import ledger, places
from repose.common.files import Path_, write_text
from repose.common.keys import Config, Origin

# Keys of `berry` that define a crop.
CROP = ("sizes", "density_kg_m3", "stl")
COMMAND_LINE = "command line (--config)"
# Source of the values that another workflow gives to this one.
WORKFLOW = "configuration"
RESOLVED = "config.json"  # in the folder of results
# A number with an exponent: some YAML readers take 1e-3 for text.
EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
# Sections that replace those of another file: a parameter that is fixed must not keep
# the prior of the file before.
REPLACED = {f"parameters.{name}" for name in (*PARAMETERS, *LAW_PARAMETERS)}
# Stands for a value that is missing in a file; no file can hold it.
MISSING = ...

Read = Callable[[Path_], dict[str, Any]]


class Layered(NamedTuple):
    """A configuration of several files, and the file of each of its keys."""

    config: dict[str, Any]
    origin: Origin


class Layer(NamedTuple):
    """A file and its values."""

    path: str
    content: Config


def read(path: Path_) -> dict[str, Any]:
    """Read a configuration file, as `repose.common.reading.read` does.

    That module is imported here, as the jobs of the workflow read no YAML.
    """
    from repose.common import reading

    return reading.read(path)


def read_layers(files: Sequence[Path_], overrides: Config | None = None) -> Layered:
    """Read configuration files over the defaults, and note the file of each key.

    Values are not checked, and `auto` stays. A complete file needs no default.

    Parameters
    ----------
    files : sequence of path
        Each overrides the ones before it.
    overrides : mapping, optional
        Nested values over all files; their texts are read as YAML.

    Returns
    -------
    Layered

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    paths = [places.find(path) for path in files]
    read_once: Any = functools.cache(read)
    if paths:
        layered = _merge_files(paths, overrides, read_once)
        if not _lacks_keys(layered.config):
            return layered
    return _merge_files(layers(paths, read_once), overrides, read_once)


def over_defaults(
    given: Config, files: Sequence[Path_] = (), otherwise: str = COMMAND_LINE
) -> Layered:
    """Lay the values that snakemake calls `config` over the defaults.

    Snakemake has merged the values of its configuration files and command line. Which
    file holds which key is found again here, for the messages about faults. A crop of
    the user takes no number from the built-in crop.

    Parameters
    ----------
    given : mapping
        The values of snakemake; the texts of its command line are read as YAML.
    files : sequence of path
        Its configuration files.
    otherwise : str
        Source of the values that no file has.

    Returns
    -------
    Layered
    """
    read_once: Any = functools.cache(read)
    files = [places.find(path) for path in files]
    method = places.find(places.METHOD_CONFIG)
    study = places.configs()[-1]

    # Choose the defaults.
    default_files: list[Path_] = [method]
    if files or not _is_a_crop(given):
        contents = [*map(read_once, files), given]
        default_files = layers((), read_once, contents)
    needed_files = default_files if _lacks_keys(given) else []
    defaults = _merge_files(needed_files, read=read_once)

    # Find the file of each value, the last first.
    sources = []
    for path in (*default_files, study, *files):
        sources.append(Layer(str(path), read_once(path)))
    origin: dict[str, str] = {}
    values = _values_of_files(
        given, "", sources=sources, origin=origin, otherwise=otherwise
    )

    config = _merge(defaults.config, values, origin={}, source="")
    return Layered(
        _resolve_named_files(config),
        Origin(
            {**defaults.origin.origin, **origin},
            default=str(files[-1]) if files else otherwise,
            shared=str(method),
        ),
    )


def _values_of_files(
    value: Any,
    key: str,
    sources: Sequence[Layer],
    origin: dict[str, str],
    otherwise: str,
) -> Any:
    """Return the values of snakemake as the files have them.

    The source of each dotted key is noted in `origin`: the last of the files that has
    it, or `otherwise`.
    """
    if isinstance(value, Mapping):
        section = {}
        for name, item in value.items():
            dotted = f"{key}.{name}" if key else name
            section[name] = _values_of_files(
                item, dotted, sources=sources, origin=origin, otherwise=otherwise
            )
        origin[key] = otherwise
        for source in sources:
            if isinstance(_value_at(source.content, key), dict):
                origin[key] = source.path
        return section

    # All values of the command line are texts, and so are some numbers of files.
    parsed = value
    if otherwise == COMMAND_LINE or EXPONENT.match(str(value)):
        parsed = _parse_texts(value)
    for source in reversed(sources):
        value_of_file = _value_at(source.content, key)
        if value_of_file in (value, parsed):
            origin[key] = source.path
            return value_of_file
    origin[key] = otherwise
    return parsed


def _value_at(content: Any, key: str) -> Any:
    """Return the value of a dotted key in a file, or `MISSING`."""
    if not key:
        return content
    for step in key.split("."):
        if not isinstance(content, dict):
            return MISSING
        content = content.get(step, MISSING)
    return content


def _lacks_keys(config: Config) -> bool:
    """Return whether a section of a configuration lacks a key."""
    # Imported here, as help and jobs load none of it.
    from repose.common.faults import lacks_keys
    from repose.config.models import settings_type

    return lacks_keys(config, settings_type())


def layers(
    files: Sequence[Path_], read: Read = read, further: Iterable[Config] = ()
) -> list[Path_]:
    """List the defaults and the files of a configuration; each overrides those before.

    The built-in crop is a default only if nothing else defines a crop, so that no crop
    takes numbers of another one.

    Parameters
    ----------
    files : sequence of path
        The user's files.
    read : callable, optional
        Reads a file.
    further : iterable of mapping
        Further values that may define a crop.

    Returns
    -------
    list of path
    """
    built_in_crop = (places.root() / places.DEFAULT_CONFIG).resolve()
    defaults = places.configs()
    others = [path for path in defaults if path.resolve() != built_in_crop]
    contents = [read(path) for path in (*others, *files)]
    if any(_is_a_crop(content) for content in (*contents, *further)):
        return [*others, *files]
    return [*defaults, *files]


def find_substitute_crop(*files: Path_) -> Path | None:
    """Return the file of the built-in crop if it stands in for a missing configuration.

    It does where a configuration uses it in a folder that has no configuration. The
    result is None if one of the files lies beside the built-in crop, and so is made for
    it.
    """
    built_in_crop = places.root() / places.DEFAULT_CONFIG
    paths = [places.find(path) for path in files]
    for path in paths:
        if path != built_in_crop and path.parent == built_in_crop.parent:
            return None
    if places.configs()[-1] != built_in_crop or is_resolved(*paths):
        return None
    if built_in_crop in paths:
        return built_in_crop
    if paths and not _lacks_keys(_merge_files(paths).config):
        return None
    if built_in_crop in layers(paths):
        return built_in_crop
    return None


def _is_a_crop(config: Config) -> bool:
    """Return whether a file defines a crop: it has sizes, a density or a scan.

    A density that is a text comes from the command line, which changes one number of
    the crop.
    """
    grain = config.get("berry")
    if not isinstance(grain, dict):
        return False
    if grain.get("sizes") or grain.get("stl"):
        return True
    if all(grain.get(key) is None for key in CROP):
        return False
    return not isinstance(grain.get("density_kg_m3"), str)


def _merge_files(
    files: Sequence[Path_], overrides: Config | None = None, read: Read = read
) -> Layered:
    """Merge the values of files and the overrides; note the file of each key."""
    config: dict[str, Any] = {}
    origin: dict[str, str] = {}
    for path in files:
        _merge(config, read(path), origin=origin, source=str(path))
    _merge(config, _parse_texts(overrides or {}), origin=origin, source=COMMAND_LINE)
    default = str(files[-1]) if files else ""
    shared = str(places.find(places.METHOD_CONFIG))
    return Layered(_resolve_named_files(config), Origin(origin, default, shared))


def _resolve_named_files(config: dict[str, Any]) -> dict[str, Any]:
    """Replace the named files that the working folder lacks by the program's own.

    The configuration is changed in place, and returned.
    """
    from repose.config.models import named_files

    for dotted in named_files():
        section_name, _, key = dotted.rpartition(".")
        section = config.get(section_name) if section_name else config
        if isinstance(section, dict) and isinstance(section.get(key), str):
            section[key] = str(places.find(section[key]))
    return config


def write_resolved(config: Config, path: Path_) -> None:
    """Write a configuration as JSON; an equal file stays untouched."""
    path = Path(path)
    text = json.dumps(config, indent=1) + "\n"
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        write_text(path, text)


def is_resolved(*files: Path_) -> bool:
    """Return whether this is a single file of `write_resolved`, unchanged since."""
    if len(files) != 1:
        return False
    path = files[0]
    return Path(path).name == RESOLVED and ledger.is_own_file(path)


def _parse_texts(value: Any) -> Any:
    """Read the texts in a value as YAML: the command line gives 2 and [1, 2] as text."""
    from repose.common.reading import parse

    if isinstance(value, dict):
        return {key: _parse_texts(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_parse_texts(item) for item in value]
    if isinstance(value, str) and value.strip():
        return parse(value, COMMAND_LINE)
    return value


def _merge(
    config: dict[str, Any],
    values: Config,
    origin: dict[str, str],
    source: str,
    prefix: str = "",
) -> dict[str, Any]:
    """Put values over a configuration, section by section, in place; return it.

    The source of each dotted key is noted in `origin`. Sections in `REPLACED` are not
    merged with those of the configuration.
    """
    for key, value in values.items():
        dotted = f"{prefix}{key}"
        origin[dotted] = source
        if not isinstance(value, dict):
            config[key] = copy.deepcopy(value)
            continue
        is_merged = dotted not in REPLACED and isinstance(config.get(key), dict)
        if not is_merged:
            config[key] = copy.deepcopy(value)
        # After a copy this only notes the source of the inner keys.
        _merge(config[key], value, origin=origin, source=source, prefix=f"{dotted}.")
    return config
