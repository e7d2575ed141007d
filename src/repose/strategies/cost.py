"""Number of pours of a strategy, and whether a configuration can take it."""

from collections.abc import Mapping
from typing import Any

from repose.strategies.base import names, strategy

Pours = tuple[tuple[str, int, int], ...]


def others() -> tuple[str, ...]:
    """Return the strategies that have a section of their own; the rest take the article's steps."""
    return tuple(name for name in names() if strategy(name).settings is not None)


def misfit(config: Mapping[str, Any]) -> str | None:
    """Say why a configuration cannot use its strategy; None if it can."""
    off = strategy(config["strategy"]).contradictions(config)
    return next((f"not with this configuration: {key}; expected {allowed}" for key, allowed in off), None)


def pours(config: Mapping[str, Any]) -> Pours | None:
    """Count the pours of a configuration's strategy (purpose, parameter sets, seeds); None for the article's method."""
    return strategy(config["strategy"]).pours(config)
