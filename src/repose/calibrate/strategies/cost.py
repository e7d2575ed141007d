"""The number of runs of a strategy, and whether a configuration fits it."""

from repose.calibrate.strategies.base import Pours, names, strategy
from repose.common.section import Contradictions, Section


def list_strategies_with_section() -> tuple[str, ...]:
    """Return the names of the strategies that have a section of the configuration.

    The workflow runs the others by the steps of the article.
    """
    return tuple(name for name in names() if strategy(name).settings is not None)


def find_contradictions(
    name: str, section: Section | None, free: int, responses: int
) -> Contradictions:
    """Yield the keys with which a strategy cannot run.

    Parameters
    ----------
    name : str
        Name of the strategy.
    section : Section or None
        The strategy's section, which is valid on its own.
    free, responses : int
        Numbers of free parameters and of targets.

    Yields
    ------
    (str, str)
        Dotted key, and what is allowed.
    """
    for key, allowed in strategy(name).contradictions(section, free, responses):
        yield f"{name}.{key}", allowed


def describe_obstacle(
    name: str, section: Section | None, free: int, responses: int
) -> str | None:
    """Describe why a strategy cannot run; None if it can.

    The arguments are those of `find_contradictions`. If there are several reasons, the
    first one is described.
    """
    for key, allowed in find_contradictions(name, section, free, responses):
        return f"not with this configuration: {key}; expected {allowed}"
    return None


def count_max_runs(name: str, section: Section | None, free: int) -> Pours | None:
    """Count the runs that a strategy makes at most; None for the article's method.

    Returns
    -------
    tuple of (str, int, int) or None
        A purpose, its number of parameter sets, and the runs of each.
    """
    return strategy(name).pours(section, free)
