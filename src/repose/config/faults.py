"""Faults of a configuration as messages: the file, the key, the value and the allowed values."""

import difflib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from repose.common.errors import InputError, YamlError
from repose.common.section import AUTO, CONTRADICTION, Section
from repose.config.keys import Origin, at, origin_of, owner_of
from repose.config.models import settings_type

UNKNOWN = ("extra_forbidden", "invalid_key")  # types of pydantic's errors
WORDS = {
    "integer": "an integer",
    "number": "a number",
    "string": "text",
    "boolean": "true or false",
    "array": "a list",
    "null": "null",
}


class Checked(NamedTuple):
    """The faults that the models find in a configuration."""

    faults: list[InputError]
    keys: set[str]  # dotted keys with a fault; a mistyped key counts as missing, too


class _Error(NamedTuple):
    """An error of a model at a key, or at its section if the key is unknown."""

    type: str
    path: list[str]
    unknown: Any  # key that does not exist, in the section at `path`
    context: Mapping[str, Any]


def check(
    config: Any,
    source: str | Origin = "configuration",
    model: type[Section] | None = None,
) -> Checked:
    """Find the faults of single keys and of keys of one section; `source` names the file in them.

    A mistyped key is also a missing key: only the mistyping is reported.
    """
    errors = _errors(config, model or settings_type())
    faults = list(_faults(errors, config, source, model or settings_type()))
    missing = {".".join(error.path) for error in errors if error.type == "missing"}
    return Checked(faults, missing | {fault.key for fault in faults})


def lacks_keys(config: Mapping[str, Any]) -> bool:
    """Return whether a configuration lacks any key; it may hold values that are not allowed."""
    missing = (
        error.path[:-1]
        for error in _errors(config, settings_type())
        if error.type == "missing"
    )
    return any(isinstance(at(config, place), Mapping) for place in missing)


def is_valid(key: str, value: Any) -> bool:
    """Return whether a key outside sections may have a value."""
    return all(error.path != [key] for error in _errors({key: value}, settings_type()))


def allowed(key: str) -> str:
    """Describe the allowed values of a dotted key."""
    return allowed_by(subschema(key.split(".")))


@cache
def _schema(model: type[Section]) -> dict[str, Any]:
    """Return the JSON schema of a model."""
    return model.model_json_schema()


def schema() -> dict[str, Any]:
    """Return the JSON schema of a configuration."""
    return _schema(settings_type())


def subschema(
    path: Sequence[str], model: type[Section] | None = None
) -> dict[str, Any]:
    """Return the schema of a key, given by its parts, with references followed."""
    whole = _schema(model or settings_type())
    node = whole
    for step in path:
        node = _inside(node, step, whole)
    return node


def allowed_by(schema: Mapping[str, Any]) -> str:
    """Describe the allowed values of a schema."""
    if "description" in schema and "properties" not in schema:
        return schema["description"]
    if "const" in schema:
        return str(schema["const"])
    if "enum" in schema:
        return " or ".join(map(str, schema["enum"]))
    if "anyOf" in schema:
        kinds = [allowed_by(kind) for kind in schema["anyOf"]]
        numbers = " or ".join(kind for kind in kinds if kind != AUTO)
        return f"{AUTO}, or {numbers}" if AUTO in kinds else numbers
    if "properties" in schema:
        return f"a section with the keys {', '.join(schema['properties'])}"
    text = WORDS[schema["type"]]
    if "exclusiveMinimum" in schema:
        return f"{text} above {schema['exclusiveMinimum']:g} and up to {schema['maximum']:g}"
    if "minimum" in schema:
        return f"{text} from {_plain(schema['minimum'])} to {_plain(schema['maximum'])}"
    return (
        f"{text} of 1 to {schema['maxLength']} characters"
        if "maxLength" in schema
        else text
    )


def _plain(number: float) -> str:
    """Write a bound as a reader would."""
    return str(number) if isinstance(number, int) else f"{number:g}"


def _inside(found: Mapping[str, Any], step: int | str, whole: Mapping[str, Any]) -> Any:
    """Return the schema of a key, of an entry of a list of sections, or of a section with free names; else None."""
    entries = found.get("items", {})
    if "$ref" in entries:
        inner = entries if str(step).isdigit() else None
    elif not isinstance(step, str):
        inner = None
    else:
        inner = (
            found.get("properties", {}).get(step)
            or found.get("additionalProperties")
            or None
        )
    while inner and "$ref" in inner:
        inner = whole["$defs"][inner["$ref"].rsplit("/", 1)[1]]
    return inner


def _errors(config: Any, model: type[Section]) -> list[_Error]:
    """Find the errors of a model, unknown keys first; an error inside a value counts as one of the whole value."""
    try:
        model.model_validate(config)
    except ValidationError as error:
        errors = [
            _error(fault, _schema(model))
            for fault in error.errors(include_url=False, include_input=False)
        ]
        inside = {fault.path[0] for fault in errors if len(fault.path) > 1}
        # a list is also too short where all its entries have faults
        errors = [
            fault
            for fault in errors
            if fault.type != "too_short" or inside.isdisjoint(fault.path)
        ]
        return sorted(errors, key=lambda error: (error.type not in UNKNOWN, error.path))
    return []


def _error(error: ErrorDetails, whole: Mapping[str, Any]) -> _Error:
    """Place an error of pydantic at its key; pydantic's path may go on with a type of the value."""
    path: list[str] = []
    found, place = whole, error["loc"]
    for step in place:
        inner = _inside(found, step, whole)
        if inner is None:
            break
        found = inner
        path.append(str(step))
    rest = place[len(path) :]
    unknown = error["type"] in UNKNOWN and len(rest) == 1
    of_the_value = bool(rest) and not unknown
    return _Error(
        "value" if of_the_value else error["type"],
        path,
        rest[0] if unknown else None,
        error.get("ctx", {}),
    )


def _faults(
    errors: list[_Error], config: Any, source: str | Origin, model: type[Section]
) -> Iterator[InputError]:
    """Yield the errors as faults; a missing range is none where a number from which it follows is wrong."""
    numbers = [
        error.path
        for error in errors
        if error.path[-1:] in (["value"], ["sd"], ["repetitions"])
    ]
    meant = {
        ".".join([*path[:-1], "range"]) for path in numbers if path[:1] == ["targets"]
    }
    for error in errors:
        key = ".".join(error.path)
        if error.type in UNKNOWN:
            known = sorted(subschema(error.path, model)["properties"])
            near = difflib.get_close_matches(str(error.unknown), known, 1)
            meant |= {".".join([*error.path, *near])}
            hint = (
                f"did you mean {near[0]}?" if near else f"keys here: {', '.join(known)}"
            )
            extra = f"{key}.{error.unknown}" if key else str(error.unknown)
            # a key such as null or 1.5 is no text in the file, and is one in the error
            value = {
                str(name): value for name, value in at(config, error.path).items()
            }[str(error.unknown)]
            yield YamlError(
                origin_of(source, extra), extra, value, f"a known key; {hint}"
            )
        elif error.type == "missing":
            if key not in meant:
                words = (
                    f"{allowed_by(subschema(error.path, model))}; the key is missing"
                )
                yield YamlError(owner_of(source, key), key, None, words)
        elif error.type == CONTRADICTION:
            for name, words in error.context["found"]:
                path = [*error.path, *filter(None, [name])]
                dotted = ".".join(path)
                yield YamlError(
                    owner_of(source, dotted), dotted, at(config, path), words
                )
        else:
            words = (
                allowed_by(subschema(error.path, model)) if key else "keys with values"
            )
            yield YamlError(origin_of(source, key), key, at(config, error.path), words)
