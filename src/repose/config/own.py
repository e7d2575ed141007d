"""The short configuration of a study with a simulator of the user's own, checked and completed."""

import difflib
import math
import os
from collections.abc import Mapping
from typing import Any

from repose.config.reading import get, read
from repose.core import places
from repose.core.errors import InputError, raise_together
from repose.core.parameter_space import ParameterSpace
from repose.core.responses import Response
from repose.core.section import AUTO
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
BENCH = "own"  # bench test of the responses
SEEDS = 2  # runs of each sample
SURROGATE = "gaussian_process"
METHOD = ("design", "network", "miga", "response_surface", "refine")
TARGET = ("value", "sd", "repetitions", "range", "unit", "definition", "noise_sd")
RANGE_PERCENT = 2.0  # of the value, to each side, where no range is given


def is_own(path: str | os.PathLike) -> bool:
    """Whether a configuration is for a simulator of the user's own: it names the simulator."""
    return "simulator" in read(path)


class OwnMaking:
    """The making of a study with a simulator of the user's own: parameters and targets of any names.

    `config` has the sections that strategies read, in the form of a whole configuration. InputError for a bad key;
    `source` names the file in it.

    Keys of `content`: `simulator`, `label`, `seed`, `parameters` (as in `ParameterSpace.of`, with any names) and
    `targets`: for each response `value`, `sd` and `repetitions`, optional `range`, `unit`, `definition` and `noise_sd`.
    Optional: `strategy`, the sections `sequential` and `posterior`, whose missing keys have defaults, and for the other
    strategies `seeds`, `surrogate` and the sections of `METHOD`, whose missing keys are those of config/method.yaml.
    """

    def __init__(self, content: Mapping[str, Any], source: object = "study") -> None:
        self.content = dict(content)
        _check_keys(content, source)
        sections = [_mapping(content[key], source, key) for key in ("parameters", "targets")]
        for name in (*sections[0], *sections[1]):
            if not isinstance(name, str) or name in RESERVED or name != name.strip() or not name:
                raise InputError(source, "column", name, f"text, and none of {', '.join(RESERVED)}")
        both = sorted(set(sections[0]) & set(sections[1]))
        if both:
            raise InputError(source, "targets", both[0], "a name that is no parameter's")
        self.space = ParameterSpace.of(sections[0], f"{source}, parameters", tuple(sections[0]))
        if not self.space.free:
            raise InputError(source, "parameters", "all fixed", "at least one range or prior")
        self.targets = Targets([_target(name, one, source) for name, one in sections[1].items()])
        if not len(self.targets):
            raise InputError(source, "targets", {}, "at least one response")
        self.config = self._completed(content, source)

    def _completed(self, content, source):
        """The configuration with every section that a strategy reads."""
        from repose import strategies

        _text(content["simulator"], source, "simulator")
        _text(content["label"], source, "label")
        seed = _number(content["seed"], source, "seed", 0, 2**31 - 1, whole=True)
        chosen = strategies.strategy(content.get("strategy", "sequential"), source)
        sequential = _section(content, "sequential", SEQUENTIAL, source)
        if sequential["start_samples"] * sequential["seeds"] > sequential["most_runs"]:
            allowed = "at least sequential.start_samples times sequential.seeds"
            raise InputError(source, "sequential.most_runs", sequential["most_runs"], allowed)
        seeds = _number(content.get("seeds", SEEDS), source, "seeds", 1, 1000, whole=True)
        config = {
            **{key: content[key] for key in NEEDED},
            **_of_the_method(content, seed, source),
            "strategy": chosen.name,
            "definitions": _given(content, "definition"),
            "noise_sd": _given(content, "noise_sd"),
            # the strategy counts pours, which are runs here
            "sequential": {**sequential, "most_pours": sequential["most_runs"]},
            "posterior": {**_section(content, "posterior", POSTERIOR, source), "seed": seed},
            BENCH: {"seeds": seeds},
        }
        if chosen.name != "sequential":  # its own rule is for pours, whose noise nobody gives
            for key, allowed in chosen.contradictions(config):
                raise InputError(source, key, get(config, key), allowed)
        return config

    def check_inputs(self) -> None:
        """Refuse: such a study has no grain."""
        raise InputError("study", "grain", None, "a study of our own simulator; this one has the user's")


def _check_keys(content, source):
    """Refuse keys that are unknown, with the nearest one, and keys that are missing: all at once."""
    known = (*NEEDED, "strategy", "sequential", "posterior", "seeds", "surrogate", *METHOD)
    faults = []
    for key in content:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, 1)
            hint = f"did you mean {near[0]}?" if near else f"keys here: {', '.join(known)}"
            faults.append(InputError(source, key, content[key], f"no such key; {hint}"))
    faults += [
        InputError(source, key, None, "needed; the key is missing") for key in NEEDED if key not in content
    ]
    raise_together(faults)


def _of_the_method(content, seed, source):
    """The sections of the article's method that other strategies read, over those of config/method.yaml."""
    from repose.config import computed, faults

    method = read(places.find(places.METHOD_CONFIG))
    config = {key: {**method[key], **_mapping(content.get(key, {}), source, key)} for key in METHOD}
    config["surrogate"] = content.get("surrogate", SURROGATE)
    found = faults.check(config, str(source)).faults  # other sections are missing
    raise_together([fault for fault in found if fault.key.partition(".")[0] in config])
    for key in ("design", "network", "miga"):
        config[key]["seed"] = seed
    if config["network"].get("split", AUTO) == AUTO:
        config["network"]["split"] = computed.split(config)
    return config


def _given(content, key):
    """A key of the targets that have it."""
    return {name: one[key] for name, one in content["targets"].items() if key in one}


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
        Response(name, unit, name, name, BENCH, -math.inf), value, sd, repetitions, low, high, value
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
