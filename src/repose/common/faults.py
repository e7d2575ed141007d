"""Find faulty keys of a configuration, and describe the values that a key allows.

Pydantic validates a configuration and reports errors. This module turns each of them
into a fault: an `InputError` that names the file, the key and the allowed values.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from repose.common.errors import MAX_REPORTED, InputError, YamlError
from repose.common.keys import Origin, find_file_to_edit, find_source_file, follow_path
from repose.common.section import AUTO, CONTRADICTION

Model = type[BaseModel]
# Types of pydantic's errors about a key that does not exist.
UNKNOWN_KEY_TYPES = ("extra_forbidden", "invalid_key")
TYPE_NAMES = {
    "integer": "an integer",
    "number": "a number",
    "string": "text",
    "boolean": "true or false",
    "array": "a list",
    "null": "null",
    "object": "a section",
}
# If a target has no range, its range is computed from these numbers.
RANGE_SOURCES = ("value", "sd", "repetitions")


class CheckResult(NamedTuple):
    """The faults of a configuration, and the keys that have them.

    Attributes
    ----------
    faults : list of InputError
        The faults, for the user.
    keys : set of str
        The dotted keys with a fault. A misspelt key is listed twice: as the user wrote
        it, and as the key that is missing because of it.
    """

    faults: list[InputError]
    keys: set[str]


class _Error(NamedTuple):
    """An error that pydantic found in a configuration.

    Attributes
    ----------
    type : str
        Pydantic's name for the kind of error, such as ``missing``.
    path : list of str
        The keys that lead to the faulty value. For a key that does not exist, they lead
        to the section around it.
    unknown : object
        The key that does not exist; None for any other error.
    context : mapping
        Further details from pydantic.
    """

    type: str
    path: list[str]
    unknown: Any
    context: Mapping[str, Any]


def find_faults(config: Any, source: str | Origin, model: Model) -> CheckResult:
    """Find the faults of single keys, and contradictions between keys of one section.

    If a key is misspelt, the correct key is missing. Only the misspelt key is reported.

    Parameters
    ----------
    config : object
        The configuration as plain values.
    source : str or Origin
        The file of the configuration, or the file of each key.
    model : type of pydantic.BaseModel
        The model of a configuration.

    Returns
    -------
    CheckResult
        The faults and their keys; both are empty for a valid configuration.
    """
    errors = _find_errors(config, model)
    faults = list(_make_faults(errors, config, source, model))
    missing = {".".join(error.path) for error in errors if error.type == "missing"}
    return CheckResult(faults, missing | {fault.key for fault in faults})


def convert_whole_numbers(config: Any, model: Model) -> Any:
    """Replace numbers such as 3.0 by integers wherever a key must be an integer.

    R, MATLAB and many JSON writers store whole numbers as 3.0.

    Parameters
    ----------
    config : object
        The configuration as plain values. It is not changed.
    model : type of pydantic.BaseModel
        The model of a configuration.

    Returns
    -------
    object
        The configuration itself, or a copy with such numbers replaced.
    """
    # The models are strict: they report an error for 3.0 wherever they require an
    # integer. The errors therefore lead to all such numbers.
    converted = config
    for error in _find_errors(config, model):
        value = follow_path(config, error.path)
        if not isinstance(value, float) or not value.is_integer():
            continue
        # A key that allows several types has a schema for each of them.
        key_schema = find_schema(error.path, model)
        type_schemas = (key_schema, *key_schema.get("anyOf", ()))
        allowed_types = [type_schema.get("type") for type_schema in type_schemas]
        if "integer" in allowed_types:
            converted = _replace_value(converted, error.path, int(value))
    return converted


def _replace_value(config: Any, path: Sequence[str], value: Any) -> Any:
    """Return a copy of a configuration in which one key has another value.

    Parameters
    ----------
    config : object
        The configuration, or a part of it. It is not changed.
    path : sequence of str
        The steps that lead to the key: names of keys, and positions in lists as digits.
        All of them must exist. An empty path means the part as a whole.
    value : object
        The new value.

    Returns
    -------
    object
        The copy.
    """
    # At the end of the path, the new value takes the place of the old one.
    if not path:
        return value

    # Copy this level, and replace the part to which the first step leads.
    step, *inner_path = path
    if isinstance(config, Mapping):
        return {**config, step: _replace_value(config[step], inner_path, value)}
    entries = list(config)
    position = int(step)
    entries[position] = _replace_value(entries[position], inner_path, value)
    return entries


def lacks_keys(config: Mapping[str, Any], model: Model) -> bool:
    """Tell whether any section of a configuration lacks a key.

    Parameters
    ----------
    config : mapping
        The configuration as plain values. Invalid values are ignored.
    model : type of pydantic.BaseModel
        The model of a configuration.

    Returns
    -------
    bool
        True if a section of the configuration lacks one of its keys. A section that is
        not a mapping is an invalid value and lacks none.
    """
    for detail in _list_validation_errors(config, model):
        section = follow_path(config, detail["loc"][:-1])
        if detail["type"] == "missing" and isinstance(section, Mapping):
            return True
    return False


def _list_validation_errors(config: Any, model: Model) -> list[ErrorDetails]:
    """List the errors that pydantic finds in a configuration; none if it is valid."""
    try:
        model.model_validate(config)
    except ValidationError as error:
        return error.errors(include_url=False, include_input=False)
    return []


def is_valid_value(key: str, value: Any, model: Model) -> bool:
    """Tell whether a value is allowed for a key at the top of a configuration."""
    return all(error.path != [key] for error in _find_errors({key: value}, model))


def describe_allowed_values(key: str, model: Model) -> str:
    """Describe the allowed values of a dotted key."""
    return describe_schema(find_schema(key.split("."), model))


@cache
def make_schema(model: Model) -> dict[str, Any]:
    """Return the JSON schema of a model."""
    return model.model_json_schema()


def find_schema(path: Sequence[str], model: Model) -> dict[str, Any]:
    """Find the schema of a key by the names that lead to it, and follow references."""
    whole_schema = make_schema(model)
    key_schema = whole_schema
    for step in path:
        key_schema = _find_inner_schema(key_schema, step, whole_schema)
    return key_schema


def describe_schema(schema: Mapping[str, Any]) -> str:
    """Describe in words which values a JSON schema allows.

    Parameters
    ----------
    schema : mapping
        The schema of a key, without references.

    Returns
    -------
    str
        A phrase such as ``a number from 0 to 1``, which follows "expected" in a
        message.
    """
    # A key with `section.Allowed` in its type has its own description.
    if "allowed" in schema:
        return schema["allowed"]

    # The key may have one value, a few values, several alternatives or inner keys.
    if "const" in schema:
        return str(schema["const"])
    if "enum" in schema:
        return " or ".join(map(str, schema["enum"]))
    if "anyOf" in schema:
        alternatives = [describe_schema(inner) for inner in schema["anyOf"]]
        others = " or ".join(text for text in alternatives if text != AUTO)
        return f"{AUTO}, or {others}" if AUTO in alternatives else others
    if "properties" in schema:
        return f"a section with the keys {', '.join(schema['properties'])}"

    return _describe_type(schema)


def _describe_type(schema: Mapping[str, Any]) -> str:
    """Describe in words the type of a single value, and its bounds.

    Parameters
    ----------
    schema : mapping
        The schema of the value. The models give a number both bounds or none, and never
        exclude the upper one.

    Returns
    -------
    str
        A phrase such as ``an integer from 1 to 100``.
    """
    name = TYPE_NAMES[schema["type"]]
    if "exclusiveMinimum" in schema:
        low = _format_bound(schema["exclusiveMinimum"])
        high = _format_bound(schema["maximum"])
        return f"{name} above {low} and up to {high}"
    if "minimum" in schema:
        low = _format_bound(schema["minimum"])
        high = _format_bound(schema["maximum"])
        return f"{name} from {low} to {high}"
    if "maxLength" in schema:
        return f"{name} of 1 to {schema['maxLength']} characters"
    return name


def _format_bound(number: float) -> str:
    """Format a bound for a message: an integer in full, other numbers to six digits."""
    return str(number) if isinstance(number, int) else f"{number:g}"


def _find_inner_schema(
    outer: Mapping[str, Any], step: int | str, whole_schema: Mapping[str, Any]
) -> Any:
    """Find the schema of one key inside an outer schema.

    Parameters
    ----------
    outer : mapping
        The schema of a section, or of a list of sections.
    step : int or str
        A key of the section, or the position of an entry in the list. The position may
        be an integer or a string of digits.
    whole_schema : mapping
        The schema of the whole configuration. References in the other schemas point to
        its definitions.

    Returns
    -------
    mapping or None
        The schema, without a reference. None if there is no such key.
    """
    # Only the schema of a list has "items". Sections are always references, so a list
    # of numbers or texts has no reference.
    entry_schema = outer.get("items", {})
    is_list_of_sections = "$ref" in entry_schema
    inner: Any = None
    if is_list_of_sections:
        if str(step).isdigit():
            inner = entry_schema
    elif isinstance(step, str):
        # Some sections allow any name, and have one schema for all names. In other
        # sections, `additionalProperties` is False or missing.
        inner = outer.get("properties", {}).get(step)
        if not inner:
            inner = outer.get("additionalProperties") or None

    # Follow references such as #/$defs/NAME to the schema that they stand for.
    while inner and "$ref" in inner:
        name = inner["$ref"].rsplit("/", 1)[1]
        inner = whole_schema["$defs"][name]
    return inner


def _find_errors(config: Any, model: Model) -> list[_Error]:
    """Validate a configuration and list its errors, unknown keys first.

    Parameters
    ----------
    config : object
        The configuration as plain values.
    model : type of pydantic.BaseModel
        The model of a configuration.

    Returns
    -------
    list of _Error
        An error inside a value is listed as an error of the whole value. The list is
        empty for a valid configuration.
    """
    details = _list_validation_errors(config, model)
    errors = [_locate_error(detail, make_schema(model)) for detail in details]
    # Pydantic also reports a list as too short if its entries are invalid. Leave out
    # this error, because the errors of the entries are reported.
    keys_with_inner_errors = {error.path[0] for error in errors if len(error.path) > 1}
    reported = [
        error
        for error in errors
        if error.type != "too_short" or keys_with_inner_errors.isdisjoint(error.path)
    ]
    return sorted(
        reported, key=lambda error: (error.type not in UNKNOWN_KEY_TYPES, error.path)
    )


def _locate_error(detail: ErrorDetails, whole_schema: Mapping[str, Any]) -> _Error:
    """Find the key of the configuration to which an error of pydantic belongs.

    Parameters
    ----------
    detail : ErrorDetails
        The error. Its location begins with the path of the key. After it, pydantic may
        add further steps: an unknown key, the name of a type, or a position inside the
        value.
    whole_schema : mapping
        The schema of the whole configuration.

    Returns
    -------
    _Error
        The error with the path of its key.
    """
    # Follow the location as long as it names keys of the schema.
    path: list[str] = []
    key_schema = whole_schema
    location = detail["loc"]
    for step in location:
        inner = _find_inner_schema(key_schema, step, whole_schema)
        if inner is None:
            break
        key_schema = inner
        path.append(str(step))

    # The rest of the location is an unknown key, or something inside the value. An
    # error inside the value counts as an error of the whole value, which gets the type
    # "value", because pydantic's type does not describe it.
    rest = location[len(path) :]
    is_unknown_key = detail["type"] in UNKNOWN_KEY_TYPES and len(rest) == 1
    is_inside_the_value = bool(rest) and not is_unknown_key
    return _Error(
        type="value" if is_inside_the_value else detail["type"],
        path=path,
        unknown=rest[0] if is_unknown_key else None,
        context=detail.get("ctx", {}),
    )


def _make_faults(
    errors: list[_Error], config: Any, source: str | Origin, model: Model
) -> Iterator[InputError]:
    """Turn the errors of a configuration into faults that name the file of each key.

    Parameters
    ----------
    errors : list of _Error
        The result of `_find_errors`, with the unknown keys first. A misspelt key causes
        two errors: an unknown key and a missing one. Only the unknown one is reported,
        and it must be known before the missing one is reached.
    config : object
        The configuration.
    source : str or Origin
        The file of the configuration, or the file of each key.
    model : type of pydantic.BaseModel
        The model of a configuration.

    Yields
    ------
    InputError
        The faults in the order of the errors.
    """
    # These keys are missing only because of another fault, so they are not reported.
    # The loop adds the keys that the user has misspelt.
    explained_keys = _find_ranges_without_numbers(errors)
    n_unknown_keys = 0
    for error in errors:
        key = ".".join(error.path)
        if error.type in UNKNOWN_KEY_TYPES:
            section = find_schema(error.path, model)
            known_keys = sorted(section["properties"])
            # Guessing takes time, so guess only for faults that are reported one by
            # one.
            guess = None
            if n_unknown_keys < MAX_REPORTED:
                guess = _guess_key(str(error.unknown), known_keys)
            n_unknown_keys += 1
            # The key that was meant is missing because it is misspelt.
            if guess is not None:
                explained_keys.add(".".join([*error.path, guess]))
            yield _make_unknown_key_fault(
                error, config, source=source, known=known_keys, guess=guess
            )
        elif error.type == "missing":
            if key not in explained_keys:
                yield _make_missing_key_fault(error, source=source, model=model)
        elif error.type == CONTRADICTION:
            yield from _make_contradiction_faults(error, config, source=source)
        else:
            yield _make_invalid_value_fault(error, config, source=source, model=model)


def _guess_key(unknown: str, known: Sequence[str]) -> str | None:
    """Guess which of the known keys the user meant; None if no key is similar."""
    from difflib import get_close_matches  # slow to import, and few files have faults

    matches = get_close_matches(unknown, known, 1)
    return matches[0] if matches else None


def _make_missing_key_fault(
    error: _Error, source: str | Origin, model: Model
) -> InputError:
    """Make the fault for a key that the user's file lacks."""
    key = ".".join(error.path)
    allowed_values = describe_schema(find_schema(error.path, model))
    return YamlError(
        find_file_to_edit(source, key),
        key=key,
        value=None,
        allowed=f"{allowed_values}; the key is missing",
    )


def _make_invalid_value_fault(
    error: _Error, config: Any, source: str | Origin, model: Model
) -> InputError:
    """Make the fault for a value that its key does not allow."""
    key = ".".join(error.path)
    # An error without a key concerns the whole configuration, which may be a list.
    allowed_values = "keys with values"
    if key:
        allowed_values = describe_schema(find_schema(error.path, model))
    value = follow_path(config, error.path)
    return YamlError(
        find_source_file(source, key), key=key, value=value, allowed=allowed_values
    )


def _find_ranges_without_numbers(errors: list[_Error]) -> set[str]:
    """Find the ranges of targets that are missing because another number is wrong.

    If the user gives no range, it is computed from the other numbers of its target. If
    one of these numbers is wrong, only this number is reported.

    Returns
    -------
    set of str
        Dotted keys such as ``targets.0.range``.
    """
    keys = set()
    for error in errors:
        is_number = error.path[-1:] and error.path[-1] in RANGE_SOURCES
        if is_number and error.path[0] == "targets":
            keys.add(".".join([*error.path[:-1], "range"]))
    return keys


def _make_unknown_key_fault(
    error: _Error,
    config: Any,
    source: str | Origin,
    known: Sequence[str],
    guess: str | None,
) -> InputError:
    """Make the fault for a key that does not exist.

    Parameters
    ----------
    error : _Error
        The error at the key.
    config : object
        The configuration.
    source : str or Origin
        The file that the fault names.
    known : sequence of str
        The keys that its section may have.
    guess : str or None
        The key of `known` that the user probably meant; None if no key is similar.

    Returns
    -------
    InputError
        The fault, which suggests the guess or lists the known keys.
    """
    unknown_name = str(error.unknown)
    key = ".".join([*error.path, unknown_name])
    hint = f"keys here: {', '.join(known)}"
    if guess is not None:
        hint = f"did you mean {guess}?"

    # In a YAML file, a key may also be null or a number such as 1.5. Pydantic reports
    # all keys as Python's text for them, so find the value by this text.
    section = follow_path(config, error.path)
    values = {str(name): value for name, value in section.items()}
    value = values[unknown_name]
    return YamlError(
        find_source_file(source, key),
        key=key,
        value=value,
        allowed=f"a known key; {hint}",
    )


def _make_contradiction_faults(
    error: _Error, config: Any, source: str | Origin
) -> Iterator[InputError]:
    """Make the faults for values that are valid alone but contradict each other.

    The validator of the section has put pairs of a key and its allowed values into the
    context of the error (`repose.common.section.refuse`). The key "" stands for the
    whole section.
    """
    for name, words in error.context["found"]:
        path = [*error.path, name] if name else error.path
        key = ".".join(path)
        yield YamlError(
            find_file_to_edit(source, key),
            key=key,
            value=follow_path(config, path),
            allowed=words,
        )
