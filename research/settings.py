"""Read the settings of the studies in this folder: `config.yaml`, and files that override it."""

from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from repose.common.errors import InputError, YamlError, raise_together
from repose.common.reading import read_yaml

HERE = Path(__file__).parent
# The file of the user, in the working folder.
USER_FILE = Path("research.yaml")
SECTIONS = (
    "pool",
    "compare_search",
    "compare_whole",
    "shape_study",
    "second_responses",
    "joint_targets",
)
# Sections whose keys are names of variants. The section of the last file replaces the
# others. The study checks each variant with the schema of the section that it changes.
VARIANTS = tuple(
    f"shape_study.{key}" for key in ("particles", "fillings", "sensitivities")
)
# Sections whose keys may have any name.
FREE_NAMES = (
    *VARIANTS,
    "second_responses.minutes",
    "second_responses.smallest_discrepancy",
)
# Words for the types of values, for messages.
TYPES = {
    int: "an integer",
    float: "a number",
    str: "text",
    list: "a list",
    dict: "a section",
}


def read_settings(config: Mapping[str, Any]) -> dict[str, Any]:
    """Read the settings of the studies in this folder.

    A small run uses the smaller values of quick.yaml. A file research.yaml in the working
    folder overrides all other values.

    Parameters
    ----------
    config : mapping
        The configuration of the study, of which only `small_run` is read.

    Returns
    -------
    dict
        The sections besides those of the study's configuration.

    Raises
    ------
    InputError
        With all keys that are unknown, and all values that have another type than the
        default.
    """
    defaults = read_yaml(HERE / "config.yaml")
    override_files = []
    if config["small_run"]:
        override_files.append(HERE / "quick.yaml")
    if USER_FILE.is_file():
        override_files.append(USER_FILE)

    # Compare each file with the defaults, and report all faults at once.
    overrides = {str(path): read_yaml(path) for path in override_files}
    faults: list[InputError] = []
    for path, values in overrides.items():
        faults += _find_faults(values, defaults, path)
    raise_together(faults)

    settings = defaults
    for values in overrides.values():
        _override(settings, values)
    return settings


def _override(
    settings: dict[str, Any], values: Mapping[str, Any], prefix: str = ""
) -> None:
    """Override settings by other values, section by section.

    Parameters
    ----------
    settings : dict
        The settings, or one of their sections. It is changed in place.
    values : mapping
        The new values. Their sections may be incomplete, except those of `VARIANTS`.
    prefix : str, optional
        Dotted key of the section, with a trailing dot; empty for all settings.
    """
    for key, value in values.items():
        dotted_key = f"{prefix}{key}"
        if isinstance(value, dict) and dotted_key not in VARIANTS:
            _override(settings[key], value, f"{dotted_key}.")
        else:
            settings[key] = value


def _find_faults(
    values: Mapping[str, Any],
    defaults: Mapping[str, Any],
    source: str,
    prefix: str = "",
) -> Iterator[InputError]:
    """Find unknown keys, and values of another type than the default.

    Parameters
    ----------
    values : mapping
        The values of a file, or of one of its sections.
    defaults : mapping
        The default values of the same keys.
    source : str
        The file, for messages.
    prefix : str, optional
        Dotted key of the section, with a trailing dot; empty for the whole file.

    Yields
    ------
    InputError
        A fault.
    """
    section = prefix.removesuffix(".")
    for key, value in values.items():
        dotted_key = f"{prefix}{key}"
        if key not in defaults and section not in FREE_NAMES:
            yield YamlError(
                source,
                key=dotted_key,
                value=value,
                allowed=f"a known key; {_suggest_key(str(key), defaults)}",
            )
            continue

        # Where names are free, every value has the type of the first default.
        first_default = next(iter(defaults.values()))
        default = defaults.get(key, first_default)
        # A number of minutes may have decimals, even if the default has none.
        if "minutes" in dotted_key and type(default) is int:
            default = float(default)

        if not _has_type_of(default, value):
            yield YamlError(
                source,
                key=dotted_key,
                value=value,
                allowed=f"{TYPES[type(default)]}, such as {default}",
            )
        elif isinstance(value, dict) and section not in VARIANTS:
            yield from _find_faults(value, default, source, f"{dotted_key}.")


def _suggest_key(key: str, known: Iterable[str]) -> str:
    """Suggest the most similar known key, or list all known keys if none is similar."""
    known_keys = list(known)
    similar = get_close_matches(key, known_keys, 1)
    if similar:
        return f"did you mean {similar[0]}?"
    return f"keys here: {', '.join(known_keys)}"


def _has_type_of(default: Any, value: Any) -> bool:
    """Tell whether a value has the type of a default, which may be a list.

    An integer is also accepted as a number. An empty default is a list of texts.
    """
    if isinstance(default, list) and isinstance(value, list):
        if not default:
            return all(isinstance(item, str) for item in value)
        return all(_has_type_of(default[0], item) for item in value)
    is_integer_for_number = type(value) is int and type(default) is float
    return type(value) is type(default) or is_integer_for_number
