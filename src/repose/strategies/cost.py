"""Number of pours of a strategy."""

from collections.abc import Mapping
from typing import Any

from repose.config.contradictions import strategy_contradictions
from repose.core.parameter_space import ParameterSpace
from repose.doe.box_behnken import box_behnken
from repose.doe.central_composite import central_composite

OTHERS = ("response_surface", "sequential")  # besides the published strategy

Pours = tuple[tuple[str, int, int], ...]


def misfit(config: Mapping[str, Any]) -> str | None:
    """Why a configuration cannot use its strategy; None if it can."""
    faults = (f"{key}; allowed: {allowed}" for key, allowed in strategy_contradictions(config))
    return next((f"not with this configuration: {fault}" for fault in faults), None)


def pours(config: Mapping[str, Any]) -> Pours | None:
    """Pours of a configuration's strategy as (purpose, parameter sets, seeds).

    None for the published strategy, whose pours `repose.config.cost` counts.
    """
    if config["strategy"] == "sequential":
        section = config["sequential"]
        return (("at most", section["most_pours"] // section["seeds"], section["seeds"]),)
    return response_surface(config) if config["strategy"] == "response_surface" else None


def response_surface(config: Mapping[str, Any]) -> Pours:
    """The steps of a response surface as (purpose, parameter sets, seeds), at most.

    The screening may keep fewer parameters than `response_surface.most_factors`.
    """
    section = config["response_surface"]
    factors = min(section["most_factors"], ParameterSpace.of(config["parameters"]).dimensions)
    if section["surface"] == "box_behnken":
        runs = len(box_behnken(factors, section["centres"])[0])
    else:
        runs = len(central_composite(factors, section["surface"], section["centres"])[0])
    steps = (
        ("screening", section["screening_runs"] + section["centres"]),
        ("ascent", section["steps"] + 1),
        ("surface", runs),
        ("check", section["checks"]),
    )
    return tuple((name, sets, section["seeds"]) for name, sets in steps)
