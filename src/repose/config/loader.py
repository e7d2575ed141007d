"""Read configuration files, merge them, and write the resolved configuration.

Each file overrides the files before it. A study writes the resolved configuration into
its folder of results.
"""

import copy
import functools
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from repose.bench.parameters import LAW_PARAMETERS, PARAMETERS
from repose.common import ledger, places
from repose.common.files import StrPath, write_text
from repose.common.keys import Config, Origin, get_value

# A crop is a kind of grain with its measured sizes and density. Keys of the section
# `berry`, the section of the grain, that define a crop.
CROP_KEYS = ("sizes", "density_kg_m3", "stl")
COMMAND_LINE = "command line (--config)"
# Name of the source of values that another workflow passes to this one.
WORKFLOW_SOURCE = "configuration"
RESOLVED_FILE = "config.json"  # in the folder of results
# A number with an exponent. Some readers of YAML read 1e-3 as a string.
EXPONENT_PATTERN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
# Sections that replace those of earlier files and are not merged with them. For
# example, a fixed parameter must not keep the prior of an earlier file.
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
    """A file of a configuration, or the command line.

    Attributes
    ----------
    path : str
        Path of the file, or `COMMAND_LINE`.
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


def _make_caching_reader() -> ReadFunction:
    """Make a function that reads each configuration file only once, by `read_file`."""
    # The type of a cached function does not say which arguments it has.
    reader: Any = functools.cache(read_file)
    return reader


def merge_with_defaults(
    files: Sequence[StrPath], overrides: Config | None = None
) -> MergedConfig:
    """Merge configuration files over the defaults, and find the file of each key.

    Values are not checked, and `auto` is not replaced. If the files together have every
    key, they are merged without the defaults, so that messages name only them.

    Parameters
    ----------
    files : sequence of path
        The files. Each overrides the ones before it.
    overrides : mapping, optional
        Nested values that override all files. Strings among them are parsed as YAML.

    Returns
    -------
    MergedConfig
        The merged values, and the file of each key.

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    # The files may be merged twice, alone and over the defaults, but read each only
    # once.
    read = _make_caching_reader()
    paths = [places.find_file(path) for path in files]
    if paths:
        merged_users_files = _merge_files(paths, overrides, read)
        if not _lacks_keys(merged_users_files.config):
            return merged_users_files

    # Some keys are missing, so use the defaults below the user's files.
    return _merge_files(list_files_with_defaults(paths, read), overrides, read)


def merge_without_defaults(
    files: Sequence[StrPath], overrides: Config | None = None
) -> MergedConfig:
    """Merge configuration files, without the defaults.

    Parameters
    ----------
    files : sequence of path
        Each overrides the ones before it.
    overrides : mapping, optional
        Nested values that override all files. Strings among them are parsed as YAML.

    Returns
    -------
    MergedConfig
        The merged values, and the file of each key.
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
        Snakemake's `config`. Strings from its command line are parsed as YAML.
    files : sequence of path
        The files that Snakemake has merged; each overrides those before it. If there
        are none, Snakemake has read the default configuration of the working folder.
    default_source : str
        Name of the source of values that are in no file.

    Returns
    -------
    MergedConfig
        The values, and the file of each key.
    """
    # The last default file is the configuration of the working folder.
    paths = files or places.list_default_configs()[-1:]
    config_files = [
        ConfigFile(str(path), read_file(places.find_file(path))) for path in paths
    ]
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
    function finds out which file has which key, so that error messages can name the
    file. The defaults normally contain a built-in crop, which is a kind of grain with
    its sizes and density. If the user's values define another crop, the built-in one
    is left out, because the numbers of two crops must never be mixed.

    Parameters
    ----------
    workflow_config : mapping
        Snakemake's `config`. Strings from its command line are parsed as YAML.
    files : sequence of path
        The files that Snakemake has merged; each overrides those before it. If there
        are none, Snakemake has read the default configuration of the working folder, or
        another workflow passes its values.
    default_source : str
        Name of the source of values that are in no file.

    Returns
    -------
    MergedConfig
        All values, and the file of each key.
    """
    read = _make_caching_reader()
    user_files = [places.find_file(path) for path in files]
    default_files = _choose_default_files(workflow_config, user_files, read)

    # Find the file that each value comes from. Without files of the user, Snakemake has
    # read the configuration of the working folder, which is the last default file. Add
    # it to the searched files, even if the values are not merged over it. A second copy
    # in the list does no harm.
    working_folder_config = places.list_default_configs()[-1]
    config_files = _read_config_files(
        [*default_files, working_folder_config, *user_files], read
    )
    values, files_by_key = _locate_values(workflow_config, config_files, default_source)

    # Merge the values over the defaults. A complete configuration needs none. The
    # values come last, because they override the defaults.
    files_to_merge = default_files if _lacks_keys(workflow_config) else []
    merged = _merge_files(files_to_merge, read=read)
    _merge_into(merged.config, values)

    # An error message asks the user to add a missing key to the default file of the
    # origin, and never to edit the file of the method. Take the last of the user's
    # files.
    origin = Origin(
        {**merged.origin.files_by_key, **files_by_key},
        default_file=str(user_files[-1]) if user_files else default_source,
        method_file=merged.origin.method_file,
    )
    return MergedConfig(_replace_missing_paths(merged.config), origin)


def _choose_default_files(
    workflow_config: Config, user_files: Sequence[StrPath], read: ReadFunction
) -> list[StrPath]:
    """Choose the default files that lie below the values in Snakemake's `config`.

    The file of the built-in crop is among them only if nothing else defines a crop.

    Parameters
    ----------
    workflow_config : mapping
        Snakemake's `config`.
    user_files : sequence of path
        The files that Snakemake has merged; none if it has read the default
        configuration, or if another workflow passes its values.
    read : callable
        Function that reads a file.

    Returns
    -------
    list of path
        The default files; each overrides those before it.
    """
    # Without files, the values are those of a whole study. If they define a crop, only
    # the keys of the method may be missing.
    if not user_files and _defines_crop(workflow_config):
        return [places.find_file(places.METHOD_CONFIG)]
    contents = [read(path) for path in user_files]
    return list_files_with_defaults(
        (), read=read, other_configs=[*contents, workflow_config]
    )


def _read_config_files(
    paths: Iterable[StrPath], read: ReadFunction
) -> list[ConfigFile]:
    """Read configuration files, and keep each content together with its path."""
    return [ConfigFile(str(path), read(path)) for path in paths]


def _locate_values(
    value: Any,
    config_files: Sequence[ConfigFile],
    default_source: str,
    dotted_key: str = "",
) -> tuple[Any, dict[str, str]]:
    """Find the files from which the values of Snakemake's `config` come.

    Snakemake has merged its files, and so has lost which file has which value.

    Parameters
    ----------
    value : object
        Snakemake's `config`, a section of it, or a single value. A section is searched
        key by key.
    config_files : sequence of ConfigFile
        The files; each overrides those before it.
    default_source : str
        Name of the source of values that are in no file.
    dotted_key : str
        The key of the value. It is empty for the whole `config`.

    Returns
    -------
    value : object
        The value as the file has it, with its type. Snakemake's value may be a string
        such as "1e-5" instead of a number.
    files_by_key : dict of str to str
        The source of the dotted key, and of each key below it.
    """
    if not isinstance(value, Mapping):
        value_in_file, source = _locate_single_value(
            value, dotted_key, config_files=config_files, default_source=default_source
        )
        return value_in_file, {dotted_key: source}

    # A section belongs to the last file that has it, even if its keys belong to other
    # files.
    section_file = _find_last_file_with_section(dotted_key, config_files)
    files_by_key = {dotted_key: section_file or default_source}
    section = {}
    # Treat each key of the section in the same way, by a call of this function.
    for name, item in value.items():
        section[name], files_of_item = _locate_values(
            item,
            config_files,
            default_source,
            dotted_key=f"{dotted_key}.{name}" if dotted_key else name,
        )
        files_by_key |= files_of_item
    return section, files_by_key


def _locate_single_value(
    value: Any, dotted_key: str, config_files: Sequence[ConfigFile], default_source: str
) -> tuple[Any, str]:
    """Find the file from which a value in Snakemake's `config` comes.

    It is the last file that has an equal value under this key. Values are equal as in
    Python, so 1 equals 1.0 and True.

    Parameters
    ----------
    value : object
        The value, which is not a section.
    dotted_key, config_files, default_source
        As in `_locate_values`.

    Returns
    -------
    value : object
        The value as the file has it. If no file has an equal value, it is Snakemake's
        value, parsed as YAML if it may be a number that was given as a string.
    source : str
        The file, or `default_source` if no file has an equal value.
    """
    # Snakemake gives some values as strings: each value of a command line, and numbers
    # such as 1e-5 in a file.
    parsed_value = value
    if default_source == COMMAND_LINE or EXPONENT_PATTERN.match(str(value)):
        parsed_value = _parse_strings(value)

    # Search the last file first. None may be a value in a file, so use another default
    # for a missing key.
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
    """Tell whether any section of a configuration lacks a key that it must have."""
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

    Each file overrides those before it. A crop is a kind of grain with its sizes and
    density; one crop is built in. Its file is among the defaults only if no other file
    defines a crop, because the numbers of two crops must never be mixed.

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
        The default files, then the user's files.
    """
    # The configuration of the working folder may be the built-in one, so compare the
    # paths to which links lead.
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
    """Return the file of the built-in crop if a study uses it, but nobody chose it.

    A crop is a kind of grain with its sizes and density. A user who has no
    configuration in the working folder may calibrate the built-in crop by mistake. The
    caller can then tell the user.

    Parameters
    ----------
    *files : path
        The files of the user.

    Returns
    -------
    Path or None
        The file of the built-in crop. None if the study does not use this crop, or if
        the user has clearly chosen it.
    """
    built_in_crop = places.find_program_folder() / places.DEFAULT_CONFIG
    paths = [places.find_file(path) for path in files]

    # The last default file is the configuration of the working folder. Only if there is
    # none, it is the built-in crop.
    working_folder_config = places.list_default_configs()[-1]
    if working_folder_config != built_in_crop:
        return None

    # A file that a study has written names its own crop.
    if is_resolved(*paths):
        return None

    # A file in the folder of the built-in crop is a variant of this crop, so the user
    # has chosen it.
    for path in paths:
        if path != built_in_crop and path.parent == built_in_crop.parent:
            return None

    # The study uses the built-in crop if the user's files include it.
    if built_in_crop in paths:
        return built_in_crop

    # It also does if the user's files lack keys and are merged over the built-in crop.
    lacks_keys = not paths or _lacks_keys(_merge_files(paths).config)
    if lacks_keys and built_in_crop in list_files_with_defaults(paths):
        return built_in_crop
    return None


def _defines_crop(config: Config) -> bool:
    """Tell whether a configuration defines a crop: by sizes, a density or a scan.

    A crop is a kind of grain. The section of the grain has the name `berry`.
    """
    grain_section = config.get("berry")
    if not isinstance(grain_section, dict):
        return False
    if grain_section.get("sizes") or grain_section.get("stl"):
        return True
    has_crop_key = any(grain_section.get(key) is not None for key in CROP_KEYS)
    if not has_crop_key:
        return False

    # A density that is a string comes from the command line. It changes one number of a
    # crop, but does not define another crop.
    return not isinstance(grain_section.get("density_kg_m3"), str)


def _merge_files(
    files: Sequence[StrPath],
    overrides: Config | None = None,
    read: ReadFunction = read_file,
) -> MergedConfig:
    """Merge the values of files and the overrides, and find the file of each key.

    The path of a named file that is not in the working folder is replaced by the path
    of the file of this name in the installed program.

    Parameters
    ----------
    files : sequence of path
        Each overrides the ones before it.
    overrides : mapping, optional
        Nested values that override all files. Strings among them are parsed as YAML.
    read : callable, optional
        Function that reads a file.

    Returns
    -------
    MergedConfig
        The merged values, and the file of each key.
    """
    layers = _read_config_files(files, read)
    layers.append(ConfigFile(COMMAND_LINE, _parse_strings(overrides or {})))
    config: dict[str, Any] = {}
    files_by_key: dict[str, str] = {}
    for layer in layers:
        _merge_into(config, layer.content)
        files_by_key |= dict.fromkeys(_list_dotted_keys(layer.content), layer.path)

    # An error message asks the user to add a missing key to the default file of the
    # origin, which is the last one here, and never to edit the file of the method.
    origin = Origin(
        files_by_key,
        default_file=str(files[-1]) if files else "",
        method_file=str(places.find_file(places.METHOD_CONFIG)),
    )
    return MergedConfig(_replace_missing_paths(config), origin)


def _replace_missing_paths(config: dict[str, Any]) -> dict[str, Any]:
    """Replace paths of missing files by paths of files that come with the program.

    The installed program has, for example, tables in its folder `resources`.
    `places.find_file` looks for a file in the working folder first. The configuration
    is changed in place.

    Parameters
    ----------
    config : dict
        The configuration. It need not be valid, so values of wrong types are left as
        they are.

    Returns
    -------
    dict
        The same object.
    """
    from repose.config.models import list_file_keys

    for dotted_key in list_file_keys():
        section_name, _, key = dotted_key.rpartition(".")
        section = config.get(section_name) if section_name else config
        if isinstance(section, dict) and isinstance(section.get(key), str):
            section[key] = str(places.find_file(section[key]))
    return config


def write_resolved(config: Config, path: StrPath) -> None:
    """Write a configuration as JSON, unless the file already has this content."""
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


def _parse_strings(value: Any) -> Any:
    """Parse each string in a value as YAML.

    A command line gives numbers and lists as strings, such as "2" and "[1, 2]".

    Parameters
    ----------
    value : object
        A single value, or nested mappings and lists.

    Returns
    -------
    object
        A copy with the strings parsed. An empty string stays empty, and a tuple becomes
        a list.
    """
    from repose.common.reading import parse_yaml

    if isinstance(value, dict):
        return {key: _parse_strings(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_parse_strings(item) for item in value]
    if isinstance(value, str) and value.strip():
        return parse_yaml(value, COMMAND_LINE)
    return value


def _merge_into(config: dict[str, Any], values: Config, prefix: str = "") -> None:
    """Merge values into a configuration, section by section.

    Parameters
    ----------
    config : dict
        The configuration, which is changed. Keys that `values` does not have are kept,
        except in the sections of `REPLACED_SECTIONS`.
    values : mapping
        The new values. Their sections may be incomplete.
    prefix : str
        Dotted key of the section to which the values belong, with a trailing dot; empty
        for the whole configuration.
    """
    for key, value in values.items():
        dotted_key = f"{prefix}{key}"
        section = config.get(key)
        is_merged = isinstance(value, dict) and dotted_key not in REPLACED_SECTIONS
        if is_merged and isinstance(section, dict):
            _merge_into(section, value, prefix=f"{dotted_key}.")
        else:
            config[key] = copy.deepcopy(value)


def _list_dotted_keys(values: Config, prefix: str = "") -> Iterator[str]:
    """Yield the dotted key of each section, and of each value, of a configuration."""
    for key, value in values.items():
        dotted_key = f"{prefix}{key}"
        yield dotted_key
        if isinstance(value, dict):
            yield from _list_dotted_keys(value, prefix=f"{dotted_key}.")
