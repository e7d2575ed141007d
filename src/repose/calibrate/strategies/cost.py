"""Number of pours of a strategy, and whether a configuration can take it."""

from typing import Any

from repose.calibrate.strategies.base import Pours, Strategy, names, strategy
from repose.common.section import Contradictions


def others() -> tuple[str, ...]:
    """Return the strategies that have a section of their own; the rest take the article's steps."""
    return tuple(name for name in names() if strategy(name).settings is not None)


def contradictions(settings: Any, name: str | None = None) -> Contradictions:
    """Yield dotted keys with which a strategy, by default a configuration's own, cannot run, and what is allowed."""
    own, section, free = _read(settings, name)
    found = own.contradictions(section, free, len(settings.targets))
    return ((f"{own.name}.{key}", allowed) for key, allowed in found)


def misfit(settings: Any, name: str) -> str | None:
    """Say why a configuration cannot use a strategy; None if it can."""
    off = contradictions(settings, name)
    return next(
        (
            f"not with this configuration: {key}; expected {allowed}"
            for key, allowed in off
        ),
        None,
    )


def pours(settings: Any, name: str | None = None) -> Pours | None:
    """Count the pours of a strategy (purpose, parameter sets, seeds); None for the article's method."""
    own, section, free = _read(settings, name)
    return own.pours(section, free)


def _read(settings: Any, name: str | None) -> tuple[Strategy, Any, int]:
    """Return a strategy with its section, and the number of free parameters."""
    own = strategy(name or settings.strategy)
    given = [one for one in dict(settings.parameters).values() if one is not None]
    section = None if own.settings is None else getattr(settings, own.name)
    return own, section, sum("fixed" not in one for one in given)
