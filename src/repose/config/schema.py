"""The schema of a configuration, and its faults in words.

`schema.yaml` beside this file says which keys there are and their ranges; each bench test says it of its own section.
"""

import difflib
import math
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from repose.apparatus import bench, names
from repose.config.reading import Origin, get, origin_of
from repose.core.errors import InputError

SCHEMA_PATH = Path(__file__).with_name("schema.yaml")
SHARED = ("time_step_s", "gravity_m_s2", "tension", "friction_limit", "rest_energy_j")
# Keys of earlier configurations, and where they went.
MOVED = {
    "heap": f"now the section funnel; its keys {', '.join(SHARED)} are in the section simulation",
    "target": "now the list targets: one entry for each response, with value, sd, repetitions and range",
    **{f"funnel.{key}": f"now simulation.{key}, for every bench test" for key in SHARED},
}


def validator() -> Any:
    """The schema's validator; numbers are finite, and 8.0 is no integer."""
    return _validator(names())


@cache
def _validator(apparatus):
    """The same for these bench tests, whose sections are part of the schema."""
    import jsonschema

    base = jsonschema.Draft202012Validator
    types = base.TYPE_CHECKER.redefine_many(
        {
            "number": lambda _, value: type(value) in (int, float) and math.isfinite(value),
            "integer": lambda _, value: type(value) is int,
        }
    )
    schema = yaml.safe_load(SCHEMA_PATH.read_text(encoding="utf-8"))
    schema["properties"] |= {name: bench(name).section_schema() for name in apparatus}
    return jsonschema.validators.extend(base, {"increasing": _not_increasing}, type_checker=types)(schema)


def _not_increasing(validator, wanted, given, _):
    """Faults of a list of numbers that do not rise, for the schema's keyword `increasing`."""
    from jsonschema import ValidationError

    numbers = validator.is_type(given, "array") and all(validator.is_type(one, "number") for one in given)
    if wanted and numbers and not all(low < high for low, high in pairwise(given)):
        yield ValidationError(f"{given!r} does not rise")


def input_error(error: Any, config: Any, source: str | Origin) -> InputError:
    """A fault found by the schema as an InputError; a fault inside a list of plain values names the whole list.

    Parameters
    ----------
    error : jsonschema.ValidationError
    config : mapping
    source : str or Origin
        Name of the file, for the message.

    Returns
    -------
    InputError
    """
    path = []
    value = config
    for step in error.absolute_path:
        value = value[step]
        if not isinstance(step, int) or isinstance(value, dict):
            path.append(str(step))
    section = ".".join(path)
    if error.validator == "additionalProperties":
        known = sorted(error.schema["properties"])
        extra = next(key for key in error.instance if key not in known)
        key = f"{section}.{extra}" if section else str(extra)
        if key in MOVED:
            return InputError(origin_of(source, key), key, error.instance[extra], MOVED[key])
        near = difflib.get_close_matches(str(extra), known, 1)
        hint = f"did you mean {near[0]}?" if near else f"keys here: {', '.join(known)}"
        return InputError(origin_of(source, key), key, error.instance[extra], f"no such key; {hint}")
    if error.validator == "required":
        missing = next(key for key in error.validator_value if key not in error.instance)
        path.append(missing)
        key = ".".join(path)
        return InputError(
            origin_of(source, section), key, None, f"{allowed_by(subschema(path))}; the key is missing"
        )
    return InputError(origin_of(source, section), section, get(config, section), allowed_by(subschema(path)))


def subschema(path: Sequence[str]) -> dict[str, Any]:
    """The schema of a key, references followed.

    Parameters
    ----------
    path : sequence of str
        Parts of the key.

    Returns
    -------
    dict
    """
    schema = root = validator().schema
    for step in path:
        schema = schema["items"] if step.isdigit() else schema["properties"][step]
        while "$ref" in schema:
            schema = root["$defs"][schema["$ref"].rsplit("/", 1)[1]]
    return schema


def allowed_by(schema: Mapping[str, Any]) -> str:
    """In words, what a schema takes.

    Parameters
    ----------
    schema : mapping

    Returns
    -------
    str
    """
    if "description" in schema:
        return schema["description"]
    if "enum" in schema:
        return " or ".join(map(str, schema["enum"]))
    types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    words = {"integer": "an integer", "number": "a number", "string": "text", "boolean": "true or false"}
    words |= {
        "array": "a list",
        "null": "null",
        "object": "a section with the keys " + ", ".join(schema.get("properties", ())),
    }
    text = words[types[0]]
    if "exclusiveMinimum" in schema:
        text += f" above {schema['exclusiveMinimum']:g} and up to {schema['maximum']:g}"
    elif "minimum" in schema:
        text += f" from {_plain(schema['minimum'])} to {_plain(schema['maximum'])}"
    elif "maxLength" in schema:
        text += f" of 1 to {schema['maxLength']} characters"
    return " or ".join([text, *(words[kind] for kind in types[1:])])


def _plain(number):
    """A bound as a reader would write it."""
    return str(number) if isinstance(number, int) else f"{number:g}"
