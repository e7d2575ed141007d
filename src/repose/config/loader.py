"""Read configuration files, merge them, and write the resolved configuration.

Each file overrides the files before it. A study writes the resolved configuration into
its folder of results.
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
from repose.common.files import StrPath, write_text
from repose.common.keys import Config, Origin, get_value

# Keys of `berry` that define a crop.
CROP_KEYS = ("sizes", "density_kg_m3", "stl")
COMMAND_LINE = "command line (--config)"
# Name for the source of values that another workflow passes to this one.
WORKFLOW_SOURCE = "configuration"
RESOLVED_FILE = "config.json"  # in the folder of results
# A number with an exponent. Some readers of YAML read 1e-3 as text.
EXPONENT_PATTERN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
# Sections that replace those of earlier files and are not merged with them. For example,
# a fixed parameter must not keep the prior of an earlier file.
REPLACED_SECTIONS = {f"parameters.{name}" for name in (*PARAMETERS, *LAW_PARAMETERS)}
# Stands for a value that a file lacks. No file can contain this value.
MISSING = ...

ReadFunction = Callable[[StrPath], dict[str, Any]]


class MergedConfig(NamedTuple):
    """A configuration that was merged from several files.

    Attributes
    ----------
    config : dict
        The merged values.
    origin : Origin
        The file of each of its keys.
    """

    config: dict[str, Any]
    origin: Origin


class ConfigFile(NamedTuple):
    """A file of a configuration.

    Attributes
    ----------
    path : str
        Path of the file.
    content : mapping
        The values of the file, before they are merged with those of other files.
    """

    path: str
    content: Config


def read_file(path: StrPath) -> dict[str, Any]:
    """Read a configuration file, as `repose.common.reading.read_yaml` does.

    That module is imported only here, because the jobs of the workflow read no YAML.
    """
    from repose.common import reading

    return reading.read_yaml(path)


def merge_with_defaults(
    files: Sequence[StrPath], overrides: Config | None = None
) -> MergedConfig:
    """Merge configuration files over the defaults, and find the file of each key.

    Values are not checked, and `auto` is not replaced. If the files have all keys, the
    defaults are not used.

    Parameters
    ----------
    files : sequence of path
        Each overrides the ones before it.
    overrides : mapping, optional
        Nested values that override all files. Texts among them are parsed as YAML.

    Returns
    -------
    MergedConfig

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    # The files may be merged twice: alone, and over the defaults. Read each file once.
    paths = [places.find_file(path) for path in files]
    read_once: Any = functools.cache(read_file)
    if paths:
        merged = _merge_files(paths, overrides, read_once)
        is_complete = not _lacks_keys(merged.config)
        if is_complete:
            return merged
    return _merge_files(
        list_files_with_defaults(paths, read_once), overrides, read_once
    )


def merge_without_defaults(
    files: Sequence[StrPath], overrides: Config | None = None
) -> MergedConfig:
    """Merge configuration files, without the defaults.

    Parameters
    ----------
    files : sequence of path
        Each overrides the ones before it.
    overrides : mapping, optional
        Nested values that override all files. Texts among them are parsed as YAML.
    """
    return _merge_files([places.find_file(path) for path in files], overrides)


def is_external(config: Config) -> bool:
    """Tell whether a configuration names a program that the workflow calls."""
    return isinstance(config.get("simulator"), Mapping)


def locate_workflow_values(
    workflow_config: Config,
    files: Sequence[StrPath] = (),
    default_source: str = COMMAND_LINE,
) -> MergedConfig:
    """Find the file of each value in Snakemake's `config`, without adding defaults.

    Parameters
    ----------
    workflow_config : mapping
        Snakemake's `config`. Texts from its command line are parsed as YAML.
    files : sequence of path
        The files that Snakemake has merged; each overrides those before it. If there are
        none, Snakemake has read the default configuration of the working folder.
    default_source : str
        Name of the source of values that are in no file.

    Returns
    -------
    MergedConfig
    """
    config_files = []
    for path in files or places.list_default_configs()[-1:]:
        config_files.append(ConfigFile(str(path), read_file(places.find_file(path))))
    values, files_by_key = _locate_values(workflow_config, config_files, default_source)
    return MergedConfig(
        values, Origin(files_by_key, default_file=config_files[-1].path)
    )


def merge_workflow_values(
    workflow_config: Config,
    files: Sequence[StrPath] = (),
    default_source: str = COMMAND_LINE,
) -> MergedConfig:
    """Merge the values in Snakemake's `config` over the defaults.

    Snakemake has already merged its configuration files and its command line. This
    function finds out which file has which key, so that messages about faults can name
    the file. If the user's values define a crop, no number of the built-in crop is used.

    Parameters
    ----------
    workflow_config : mapping
        Snakemake's `config`. Texts from its command line are parsed as YAML.
    files : sequence of path
        The files that Snakemake has merged; each overrides those before it.
    default_source : str
        Name of the source of values that are in no file.

    Returns
    -------
    MergedConfig
    """
    read_once: Any = functools.cache(read_file)
    user_files = [places.find_file(path) for path in files]
    method_file = places.find_file(places.METHOD_CONFIG)

    # Choose the default files. If the values define a crop, only the method is needed.
    default_files: list[StrPath] = [method_file]
    if user_files or not _defines_crop(workflow_config):
        contents = [*map(read_once, user_files), workflow_config]
        default_files = list_files_with_defaults((), read_once, contents)

    # A complete configuration needs no defaults.
    needed_files = default_files if _lacks_keys(workflow_config) else []
    defaults = _merge_files(needed_files, read=read_once)

    # Find the file that each value comes from. Without files of the user, Snakemake has
    # read the last default file.
    config_files = []
    last_default_file = places.list_default_configs()[-1]
    for path in (*default_files, last_default_file, *user_files):
        config_files.append(ConfigFile(str(path), read_once(path)))
    values, files_by_key = _locate_values(workflow_config, config_files, default_source)

    # Merge the values over the defaults. The files are known, so `_merge` need not note
    # them. Messages about a missing key name the user's last file.
    config = _merge(defaults.config, values, files_by_key={}, source="")
    return MergedConfig(
        _resolve_named_files(config),
        Origin(
            {**defaults.origin.files_by_key, **files_by_key},
            default_file=str(user_files[-1]) if user_files else default_source,
            method_file=str(method_file),
        ),
    )


def _locate_values(
    workflow_config: Config, config_files: Sequence[ConfigFile], default_source: str
) -> tuple[dict[str, Any], dict[str, str]]:
    """Find the files from which the values of Snakemake's `config` come.

    Parameters
    ----------
    workflow_config : mapping
        Snakemake's `config`.
    config_files : sequence of ConfigFile
        The files; each overrides those before it.
    default_source : str
        Name of the source of values that are in no file.

    Returns
    -------
    values : dict
        The values as the files have them. Snakemake may have converted some to text.
    files_by_key : dict of str to str
        The source of each dotted key.
    """
    files_by_key: dict[str, str] = {}
    values = _find_in_files(
        workflow_config,
        dotted_key="",
        config_files=config_files,
        files_by_key=files_by_key,
        default_source=default_source,
    )
    return values, files_by_key


def _find_in_files(
    value: Any,
    dotted_key: str,
    config_files: Sequence[ConfigFile],
    files_by_key: dict[str, str],
    default_source: str,
) -> Any:
    """Find the file from which a value of Snakemake comes, and add it to `files_by_key`.

    Parameters
    ----------
    value : object
        A single value, or a section, which is searched key by key.
    dotted_key : str
        The key of the value. It is empty for the whole configuration.
    config_files : sequence of ConfigFile
        The files; each overrides those before it.
    files_by_key : dict
        The source of each dotted key. This function adds to it.
    default_source : str
        Name of the source of values that are in no file.

    Returns
    -------
    object
        The value in the file. Snakemake may have converted it to text.
    """
    if not isinstance(value, Mapping):
        value_in_file, source = _find_single_value(
            value, dotted_key, config_files=config_files, default_source=default_source
        )
        files_by_key[dotted_key] = source
        return value_in_file

    # Search each key of a section.
    section = {}
    for name, item in value.items():
        section[name] = _find_in_files(
            item,
            f"{dotted_key}.{name}" if dotted_key else name,
            config_files=config_files,
            files_by_key=files_by_key,
            default_source=default_source,
        )

    # The section itself belongs to the last file that has it.
    section_file = _find_last_file_with_section(dotted_key, config_files)
    files_by_key[dotted_key] = section_file or default_source
    return section


def _find_single_value(
    value: Any, dotted_key: str, config_files: Sequence[ConfigFile], default_source: str
) -> tuple[Any, str]:
    """Find the last file that has a value of Snakemake.

    Parameters
    ----------
    value : object
        The value, which is no section.
    dotted_key, config_files, default_source
        As in `_find_in_files`.

    Returns
    -------
    value : object
        The value as the file has it.
    source : str
        The file, or `default_source` if no file has an equal value.
    """
    # A command line contains only texts, and Snakemake reads numbers such as 1e-5 as text.
    parsed_value = value
    if default_source == COMMAND_LINE or EXPONENT_PATTERN.match(str(value)):
        parsed_value = _parse_texts(value)

    # Search the last file first. None may be a value in a file, so use another default for
    # a missing key.
    for config_file in reversed(config_files):
        value_in_file = get_value(config_file.content, dotted_key, MISSING)
        if value_in_file in (value, parsed_value):
            return value_in_file, config_file.path
    return parsed_value, default_source


def _find_last_file_with_section(
    dotted_key: str, config_files: Sequence[ConfigFile]
) -> str | None:
    """Return the path of the last file that has a section; None if no file has it."""
    for config_file in reversed(config_files):
        if isinstance(get_value(config_file.content, dotted_key), dict):
            return config_file.path
    return None


def _lacks_keys(config: Config) -> bool:
    """Tell whether a section of a configuration lacks a key."""
    # Import these modules only here: the help and the jobs do not need them.
    from repose.common.faults import lacks_keys
    from repose.config.models import make_settings_type

    return lacks_keys(config, make_settings_type())


def list_files_with_defaults(
    files: Sequence[StrPath],
    read: ReadFunction = read_file,
    other_configs: Iterable[Config] = (),
) -> list[StrPath]:
    """List the default files and the user's files of a configuration.

    Each file overrides those before it. The built-in crop is among the defaults only if
    no other file defines a crop, so that numbers of two crops are never mixed.

    Parameters
    ----------
    files : sequence of path
        The user's files.
    read : callable, optional
        Function that reads a file.
    other_configs : iterable of mapping
        Values from other sources, which may also define a crop.

    Returns
    -------
    list of path
    """
    built_in_crop = (places.find_program_folder() / places.DEFAULT_CONFIG).resolve()
    defaults = places.list_default_configs()
    defaults_without_crop = [
        path for path in defaults if path.resolve() != built_in_crop
    ]
    contents = [read(path) for path in (*defaults_without_crop, *files)]
    if any(_defines_crop(content) for content in (*contents, *other_configs)):
        return [*defaults_without_crop, *files]
    return [*defaults, *files]


def find_substitute_crop(*files: StrPath) -> Path | None:
    """Find the built-in crop if it replaces a missing configuration.

    This is the case if the working folder has no configuration, and the user's files
    need the built-in crop.

    Parameters
    ----------
    *files : path
        The files of the user.

    Returns
    -------
    Path or None
        The file of the built-in crop; None if it replaces no missing configuration.
    """
    built_in_crop = places.find_program_folder() / places.DEFAULT_CONFIG
    paths = [places.find_file(path) for path in files]

    # A file beside that of the built-in crop is a variant of this crop.
    for path in paths:
        if path != built_in_crop and path.parent == built_in_crop.parent:
            return None

    # Nothing is missing if the folder has a configuration or the file is complete.
    if places.list_default_configs()[-1] != built_in_crop or is_resolved(*paths):
        return None

    # The files include the built-in crop, or are merged over it because they define no crop.
    if built_in_crop in paths:
        return built_in_crop
    is_complete = paths and not _lacks_keys(_merge_files(paths).config)
    if not is_complete and built_in_crop in list_files_with_defaults(paths):
        return built_in_crop
    return None


def _defines_crop(config: Config) -> bool:
    """Tell whether a configuration defines a crop: by sizes, a density or a scan."""
    grain = config.get("berry")
    if not isinstance(grain, dict):
        return False
    if grain.get("sizes") or grain.get("stl"):
        return True
    if all(grain.get(key) is None for key in CROP_KEYS):
        return False

    # A density that is a text comes from the command line. It changes one number of a crop
    # but does not define another crop.
    return not isinstance(grain.get("density_kg_m3"), str)


def _merge_files(
    files: Sequence[StrPath],
    overrides: Config | None = None,
    read: ReadFunction = read_file,
) -> MergedConfig:
    """Merge the values of files and the overrides, and find the file of each key.

    Parameters
    ----------
    files : sequence of path
        Each overrides the ones before it.
    overrides : mapping, optional
        Nested values that override all files. Texts among them are parsed as YAML.
    read : callable, optional
        Function that reads a file.
    """
    config: dict[str, Any] = {}
    files_by_key: dict[str, str] = {}
    for path in files:
        _merge(config, read(path), files_by_key=files_by_key, source=str(path))
    _merge(
        config,
        _parse_texts(overrides or {}),
        files_by_key=files_by_key,
        source=COMMAND_LINE,
    )

    # Messages ask the user to add a missing key to the last file, and never to edit the
    # file of the method.
    last_file = str(files[-1]) if files else ""
    method = str(places.find_file(places.METHOD_CONFIG))
    return MergedConfig(
        _resolve_named_files(config), Origin(files_by_key, last_file, method)
    )


def _resolve_named_files(config: dict[str, Any]) -> dict[str, Any]:
    """Replace paths that do not exist in the working folder by files of the program.

    Parameters
    ----------
    config : dict
        The configuration, which need not be valid. It is changed in place.

    Returns
    -------
    dict
        The same configuration.
    """
    from repose.config.models import list_file_keys

    for dotted_key in list_file_keys():
        section_name, _, key = dotted_key.rpartition(".")
        section = config.get(section_name) if section_name else config
        if isinstance(section, dict) and isinstance(section.get(key), str):
            section[key] = str(places.find_file(section[key]))
    return config


def write_resolved(config: Config, path: StrPath) -> None:
    """Write a configuration as JSON, unless the file has this content already."""
    path = Path(path)
    text = json.dumps(config, indent=1) + "\n"
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        write_text(path, text)


def is_resolved(*files: StrPath) -> bool:
    """Tell whether the files are one unchanged file of `write_resolved`."""
    if len(files) != 1:
        return False
    path = files[0]
    return Path(path).name == RESOLVED_FILE and ledger.is_own_file(path)


def _parse_texts(value: Any) -> Any:
    """Parse each text in a value as YAML.

    A command line gives numbers and lists as text, such as "2" and "[1, 2]".

    Parameters
    ----------
    value : object
        A single value, or nested mappings and lists.

    Returns
    -------
    object
        A copy with the texts parsed. An empty text stays empty.
    """
    from repose.common.reading import parse_yaml

    if isinstance(value, dict):
        return {key: _parse_texts(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_parse_texts(item) for item in value]
    if isinstance(value, str) and value.strip():
        return parse_yaml(value, COMMAND_LINE)
    return value


def _merge(
    config: dict[str, Any],
    values: Config,
    files_by_key: dict[str, str],
    source: str,
    prefix: str = "",
) -> dict[str, Any]:
    """Merge values into a configuration in place, section by section, and return it.

    Parameters
    ----------
    config : dict
        The configuration, which is changed in place. Keys that `values` does not have are
        kept, except in the sections of `REPLACED_SECTIONS`.
    values : mapping
        The new values. Their sections may be incomplete.
    files_by_key : dict
        The source of each dotted key. This function adds to it.
    source : str
        The file that the values come from.
    prefix : str
        Dotted key of the section to which the values belong, with a trailing dot; empty
        for the whole configuration.

    Returns
    -------
    dict
        The same `config`.
    """
    for key, value in values.items():
        dotted_key = f"{prefix}{key}"
        files_by_key[dotted_key] = source
        if not isinstance(value, dict):
            config[key] = copy.deepcopy(value)
            continue

        # The value is a section. Replace the old one, unless both are to be merged.
        is_merged = dotted_key not in REPLACED_SECTIONS and isinstance(
            config.get(key), dict
        )
        if not is_merged:
            config[key] = copy.deepcopy(value)
        # If the section was just copied, this call only adds the source of its keys.
        _merge(
            config[key],
            value,
            files_by_key=files_by_key,
            source=source,
            prefix=f"{dotted_key}.",
        )
    return config
