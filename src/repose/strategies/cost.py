"""Number of pours of a strategy, and whether a configuration can take it."""

from collections.abc import Mapping
from typing import Any

from repose.strategies.base import names, strategy

Pours = tuple[tuple[str, int, int], ...]


def others() -> tuple[str, ...]:
    """Strategies that have a section of their own; the rest take the article's steps."""
    return tuple(name for name in names() if strategy(name).settings is not None)


def misfit(config: Mapping[str, Any]) -> str | None:
    """Why a configuration cannot use its strategy; None if it can."""
    contradictions = strategy(config["strategy"]).contradictions(config)
    faults = (f"{key}; allowed: {allowed}" for key, allowed in contradictions)
    return next((f"not with this configuration: {fault}" for fault in faults), None)


def pours(config: Mapping[str, Any]) -> Pours | None:
    """Pours of a configuration's strategy as (purpose, parameter sets, seeds); None for the article's method."""
    return strategy(config["strategy"]).pours(config)
