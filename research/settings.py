"""Settings of the studies here: `config.yaml` beside this file, and the files that lie over it."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from repose.common.errors import InputError, YamlError, raise_together
from repose.common.reading import read_yaml

HERE = Path(__file__).parent
OWN = Path("research.yaml")  # of the working folder
SECTIONS = (
    "pool",
    "compare_search",
    "compare_whole",
    "shape_study",
    "second_responses",
    "joint_targets",
)
# Sections of variants: the last file's replaces the others; the study checks each with the schema of what it changes.
VARIANTS = tuple(
    f"shape_study.{key}" for key in ("particles", "fillings", "sensitivities")
)
FREE_NAMES = (
    *VARIANTS,
    "second_responses.minutes",
    "second_responses.smallest_discrepancy",
)
TYPES = {
    int: "an integer",
    float: "a number",
    str: "text",
    list: "a list",
    dict: "a section",
}


def of(config: Mapping[str, Any]) -> dict[str, Any]:
    """Read the sections beside those of a study's configuration; those of quick.yaml if it is a small run.

    An InputError names all keys that are unknown and all values that have another type than the default.
    """
    settings = read_yaml(HERE / "config.yaml")
    known = read_yaml(HERE / "config.yaml")
    files = [
        *([HERE / "quick.yaml"] if config["small_run"] else []),
        *([OWN] if OWN.is_file() else []),
    ]
    contents = [(str(path), read_yaml(path)) for path in files]
    raise_together(
        fault for path, more in contents for fault in _faults(more, known, path)
    )
    for _, more in contents:
        _lay_over(settings, more)
    return settings


def _lay_over(settings, more, prefix=""):
    """Put `more` over the settings, key by key."""
    for key, value in more.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and name not in VARIANTS:
            _lay_over(settings[key], value, f"{name}.")
        else:
            settings[key] = value


def _faults(
    given: Any, known: Any, source: str, prefix: str = ""
) -> Iterator[InputError]:
    """Unknown keys, and values of another type than the default's."""
    for key, value in given.items():
        name = f"{prefix}{key}"
        if key not in known and prefix[:-1] not in FREE_NAMES:
            near = get_close_matches(str(key), known, 1)
            hint = (
                f"did you mean {near[0]}?" if near else f"keys here: {', '.join(known)}"
            )
            yield YamlError(source, name, value, f"a known key; {hint}")
            continue
        like = known.get(key, next(iter(known.values())))
        like = float(like) if "minutes" in name and type(like) is int else like
        if not _alike(value, like):
            yield YamlError(source, name, value, f"{TYPES[type(like)]}, such as {like}")
        elif isinstance(value, dict) and prefix[:-1] not in VARIANTS:
            yield from _faults(value, like, source, f"{name}.")


def _alike(value, like):
    """Whether a value has the type of a default; an integer is a number, too."""
    if isinstance(like, list) and isinstance(value, list):
        return all(
            _alike(item, like[0]) if like else isinstance(item, str) for item in value
        )
    return type(value) is type(like) or (type(value) is int and type(like) is float)
