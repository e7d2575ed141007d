"""The short configuration of a study with a simulator of the user's own."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from repose.config.reading import read
from repose.core.errors import InputError, raise_together
from repose.core.parameter_space import ParameterSpace
from repose.core.responses import Response
from repose.core.targets import Target, Targets

RESERVED = ("sample", "run", "status")  # columns of the table that are neither parameter nor response
NEEDED = ("simulator", "label", "seed", "parameters", "targets")
# Each number with its default, smallest and largest value; an integer default asks for an integer.
SEQUENTIAL = {
    "start_samples": (16, 2, 10_000),
    "seeds": (2, 1, 1000),
    "batch": (8, 1, 1000),
    "tolerance_percent": (1.0, 0.01, 50.0),
    "probability": (0.7, 0.05, 0.99),
    "most_runs": (120, 4, 1_000_000),
}
POSTERIOR = {
    "discrepancy_percent": (2.0, 0.0, 50.0),
    "discrepancy_correlation": (0.0, 0.0, 0.99),
    "walkers": (128, 32, 10_000),
    "steps": (400, 100, 1_000_000),
}
TARGET = ("value", "sd", "repetitions", "range", "unit", "definition", "noise_sd")
RANGE_PERCENT = 2.0  # of the value, to each side, where no range is given


@dataclass(frozen=True)
class OwnStudy:
    """A study with a simulator of the user's own."""

    simulator: str
    label: str  # of the material
    seed: int
    space: ParameterSpace
    targets: Targets
    definitions: Mapping[str, str]  # of responses, where given
    noise_sd: Mapping[str, float]  # standard deviation of a single run of the simulator, where given
    sequential: Mapping[str, Any]  # as the section of a whole configuration
    posterior: Mapping[str, Any]  # as the section of a whole configuration


def is_own(path: str | os.PathLike) -> bool:
    """Whether a configuration is for a simulator of the user's own: it names the simulator."""
    return "simulator" in read(path)


def read_study(path: str | os.PathLike) -> OwnStudy:
    """Read the configuration, a YAML or JSON file; raises InputError as `study_of`."""
    return study_of(read(path), path)


def study_of(content: Mapping[str, Any], source: object = "study") -> OwnStudy:
    """The study of a configuration; `source` names it in an InputError.

    Keys: ``simulator``, ``label``, ``seed``, ``parameters`` (as in `ParameterSpace.of`, with any names) and
    ``targets``: for each response ``value``, ``sd`` and ``repetitions``, optional ``range``, ``unit``, ``definition``
    and ``noise_sd``. The sections ``sequential`` and ``posterior`` are optional; their missing keys have defaults.
    """
    known = (*NEEDED, "sequential", "posterior")
    faults = [
        InputError(source, key, content[key], f"no such key; keys here: {', '.join(known)}")
        for key in content
        if key not in known
    ]
    faults += [
        InputError(source, key, None, "needed; the key is missing") for key in NEEDED if key not in content
    ]
    raise_together(faults)
    sections = [_mapping(content[key], source, key) for key in ("parameters", "targets")]
    for name in (*sections[0], *sections[1]):
        if not isinstance(name, str) or name in RESERVED or name != name.strip() or not name:
            raise InputError(source, "column", name, f"text, and none of {', '.join(RESERVED)}")
    both = sorted(set(sections[0]) & set(sections[1]))
    if both:
        raise InputError(source, "targets", both[0], "a name that is no parameter's")
    space = ParameterSpace.of(sections[0], f"{source}, parameters", tuple(sections[0]))
    if not space.free:
        raise InputError(source, "parameters", "all fixed", "at least one range or prior")
    targets = [_target(name, one, source) for name, one in sections[1].items()]
    if not targets:
        raise InputError(source, "targets", {}, "at least one response")
    study = OwnStudy(
        simulator=_text(content["simulator"], source, "simulator"),
        label=_text(content["label"], source, "label"),
        seed=_number(content["seed"], source, "seed", 0, 2**31 - 1, whole=True),
        space=space,
        targets=Targets(targets),
        definitions={name: one["definition"] for name, one in sections[1].items() if "definition" in one},
        noise_sd={name: one["noise_sd"] for name, one in sections[1].items() if "noise_sd" in one},
        sequential=_section(content, "sequential", SEQUENTIAL, source),
        posterior=_section(content, "posterior", POSTERIOR, source),
    )
    section = study.sequential
    if section["start_samples"] * section["seeds"] > section["most_runs"]:
        allowed = "at least sequential.start_samples times sequential.seeds"
        raise InputError(source, "sequential.most_runs", section["most_runs"], allowed)
    # the strategy counts pours, which are runs here
    return _with(study, sequential={**section, "most_pours": section["most_runs"]})


def _with(study, **changes):
    """A study with some attributes changed."""
    return OwnStudy(**{**study.__dict__, **changes})


def _target(name, given, source):
    """A target; without a range it gets its value and 2 % to each side."""
    key, given = f"targets.{name}", _mapping(given, source, f"targets.{name}")
    for one in given:
        if one not in TARGET:
            raise InputError(
                source, f"{key}.{one}", given[one], f"no such key; keys here: {', '.join(TARGET)}"
            )
    largest = 1e12
    value = _number(given.get("value"), source, f"{key}.value", -largest, largest)
    if value == 0.0:
        raise InputError(source, f"{key}.value", value, "not 0: tolerances are in percent of it")
    sd = _number(given.get("sd"), source, f"{key}.sd", 0.0, largest)
    repetitions = _number(given.get("repetitions"), source, f"{key}.repetitions", 1, 10_000, whole=True)
    half = RANGE_PERCENT / 100 * abs(value)
    ends = given.get("range", [value - half, value + half])
    if not isinstance(ends, list) or len(ends) != 2:
        raise InputError(source, f"{key}.range", ends, "a pair [low, high]")
    low, high = (_number(end, source, f"{key}.range", -largest, largest) for end in ends)
    if not low <= value <= high or low == high:
        raise InputError(source, f"{key}.range", ends, f"a pair [low, high] about the value, {value:g}")
    for text in ("unit", "definition"):
        if text in given:
            _text(given[text], source, f"{key}.{text}")
    if "noise_sd" in given:
        _number(given["noise_sd"], source, f"{key}.noise_sd", 1e-9 * abs(value), largest)
    unit = given.get("unit", "")
    return Target(
        Response(name, unit, name, name, "own", -math.inf), value, sd, repetitions, low, high, value
    )


def _section(content, name, keys, source):
    """A section whose keys have defaults."""
    given = _mapping(content.get(name, {}), source, name)
    for key in given:
        if key not in keys:
            raise InputError(
                source, f"{name}.{key}", given[key], f"no such key; keys here: {', '.join(keys)}"
            )
    return {
        key: _number(given.get(key, default), source, f"{name}.{key}", low, high, isinstance(default, int))
        for key, (default, low, high) in keys.items()
    }


def _mapping(value, source, key):
    """A mapping, or InputError."""
    if not isinstance(value, Mapping):
        raise InputError(source, key, value, "a section of keys with values")
    return value


def _text(value, source, key):
    """A text of one line, or InputError."""
    if not isinstance(value, str) or not value.strip() or "\n" in value:
        raise InputError(source, key, value, "text of one line")
    return value


def _number(value, source, key, low, high, whole=False):
    """A number between two others, or InputError."""
    kinds = (int,) if whole else (int, float)
    if type(value) not in kinds or not low <= value <= high:
        kind = "an integer" if whole else "a number"
        raise InputError(source, key, value, f"{kind} from {low:g} to {high:g}")
    return value
