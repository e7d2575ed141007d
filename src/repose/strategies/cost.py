"""Number of pours of a strategy, and whether a configuration can take it."""

from collections.abc import Mapping
from typing import Any

from repose.core.parameter_space import ParameterSpace
from repose.core.section import Contradictions
from repose.strategies.base import Pours, Strategy, names, strategy


def others() -> tuple[str, ...]:
    """Return the strategies that have a section of their own; the rest take the article's steps."""
    return tuple(name for name in names() if strategy(name).settings is not None)


def contradictions(config: Mapping[str, Any]) -> Contradictions:
    """Yield dotted keys with which a configuration's strategy cannot run, and what is allowed."""
    own, section, free = _read(config)
    found = own.contradictions(section, free, len(config["targets"]))
    return ((f"{own.name}.{key}", allowed) for key, allowed in found)


def misfit(config: Mapping[str, Any]) -> str | None:
    """Say why a configuration cannot use its strategy; None if it can."""
    off = contradictions(config)
    return next((f"not with this configuration: {key}; expected {allowed}" for key, allowed in off), None)


def pours(config: Mapping[str, Any]) -> Pours | None:
    """Count the pours of a configuration's strategy (purpose, parameter sets, seeds); None for the article's method."""
    own, section, free = _read(config)
    return own.pours(section, free)


def _read(config: Mapping[str, Any]) -> tuple[Strategy, Any, int]:
    """Return a configuration's strategy with its section, and the number of free parameters."""
    own, section = strategy(config["strategy"]), config["parameters"]
    settings = None if own.settings is None else own.settings.model_validate(config[own.name])
    return own, settings, ParameterSpace.of(section, names=tuple(section)).dimensions
