"""The schema of a configuration, and its faults in words.

`schema.yaml` beside this file has the keys and their ranges; each bench test has those of its own section.
"""

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from repose.apparatus import bench, names
from repose.config.computed import AUTO, COMPUTED
from repose.config.reading import Origin, get, origin_of, owner_of
from repose.core.errors import InputError, YamlError

SCHEMA_PATH = Path(__file__).with_name("schema.yaml")
SHARED = ("time_step_s", "gravity_m_s2", "tension", "rest_energy_j")
FRICTION_LIMIT = (
    "no longer a key: the tension decides (keep: the elastic part of the force, release: all of it), since other pairs "
    "break Coulomb's law; delete this line"
)
RESEARCH = (
    "now of the checkout's folder research/, in a file research.yaml beside the study's; delete this section"
)
# Keys of earlier configurations, and their present places.
MOVED = {
    "heap": f"now the section funnel; its keys {', '.join(SHARED)} are in the section simulation",
    "target": "now the list targets: one entry for each response, with value, sd, repetitions and range",
    **{f"funnel.{key}": f"now simulation.{key}, for every bench test" for key in SHARED},
    "funnel.friction_limit": FRICTION_LIMIT,
    "simulation.friction_limit": FRICTION_LIMIT,
    **dict.fromkeys(("pool", "compare_search", "compare_whole"), RESEARCH),
    **dict.fromkeys(("shape_study", "second_responses", "joint_targets"), RESEARCH),
}


def validator() -> Any:
    """The schema's validator; numbers are finite, and 8.0 is no integer."""
    return _validator(names())


@cache
def _validator(apparatus):
    """The validator for these bench tests, whose sections are part of the schema."""
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
    for key in (one.key for one in COMPUTED):
        section, name = key.split(".")
        keys = schema["properties"][section]["properties"]
        keys[name] = {
            "anyOf": [{"const": AUTO}, keys[name]],
            "description": f"{AUTO}, or {allowed_by(keys[name])}",
        }
    return jsonschema.validators.extend(base, {"increasing": _not_increasing}, type_checker=types)(schema)


def lacks_keys(config: Mapping[str, Any]) -> bool:
    """Whether a configuration lacks any key; it may hold values that are not allowed."""
    return any(error.validator == "required" for error in validator().iter_errors(config))


def _not_increasing(validator, wanted, given, _):
    """Faults of a list of numbers that do not rise, for the schema's keyword `increasing`."""
    from jsonschema import ValidationError

    numbers = validator.is_type(given, "array") and all(validator.is_type(one, "number") for one in given)
    if wanted and numbers and not all(low < high for low, high in pairwise(given)):
        yield ValidationError(f"{given!r} does not rise")


def input_errors(errors: Iterable[Any], config: Any, source: str | Origin) -> Iterator[InputError]:
    """Faults found by the schema as InputErrors; one inside a list of plain values names the whole list.

    A mistyped key is also a missing key: only the mistyping is reported.
    """
    meant = set()
    for error in sorted(errors, key=lambda one: (one.validator != "additionalProperties", _place(one))):
        path = []
        value = config
        for step in error.absolute_path:
            value = value[step]
            if not isinstance(step, int) or isinstance(value, dict):
                path.append(str(step))
        section = ".".join(path)
        if error.validator == "additionalProperties":
            known = sorted(error.schema["properties"])
            for extra in (key for key in error.instance if key not in known):
                key = f"{section}.{extra}" if section else str(extra)
                near = difflib.get_close_matches(str(extra), known, 1)
                meant |= {".".join([*path, *near])}
                hint = f"did you mean {near[0]}?" if near else f"keys here: {', '.join(known)}"
                allowed = MOVED.get(key, f"no such key; {hint}")
                yield YamlError(origin_of(source, key), key, error.instance[extra], allowed)
        elif error.validator == "required":
            # the schema has a fault for each missing key, without its name; `raise_together` leaves out the duplicates
            for missing in error.validator_value:
                key = ".".join([*path, missing])
                if missing not in error.instance and key not in meant:
                    allowed = f"{allowed_by(subschema([*path, missing]))}; the key is missing"
                    yield YamlError(owner_of(source, key), key, None, allowed)
        else:
            allowed = allowed_by(subschema(path)) if path else "keys with values"
            yield YamlError(origin_of(source, section), section, get(config, section), allowed)


def missing_keys(errors: Iterable[Any]) -> set[str]:
    """Dotted keys that a configuration must have and has not, among faults found by the schema."""
    return {
        ".".join([*map(str, error.absolute_path), key])
        for error in errors
        if error.validator == "required"
        for key in error.validator_value
        if key not in error.instance
    }


def subschema(path: Sequence[str]) -> dict[str, Any]:
    """The schema of a key, given by its parts, with references followed."""
    schema = root = validator().schema
    for step in path:
        if step.isdigit():
            schema = schema["items"]
        else:  # free names share a schema
            schema = schema.get("properties", {}).get(step) or schema["additionalProperties"]
        while "$ref" in schema:
            schema = root["$defs"][schema["$ref"].rsplit("/", 1)[1]]
    return schema


def allowed_by(schema: Mapping[str, Any]) -> str:
    """The allowed values of a schema, in words."""
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


def _place(error):
    """Place of a fault, to sort by."""
    return list(map(str, error.absolute_path))


def _plain(number):
    """A bound as a reader would write it."""
    return str(number) if isinstance(number, int) else f"{number:g}"
