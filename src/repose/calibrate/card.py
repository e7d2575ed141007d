"""The general part of a material card: parameters with their intervals, and the verdict.

`repose.stages.card` adds the grain and the bench tests.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from repose.calibrate.answer import Result
from repose.calibrate.parameter_space import ParameterSpace
from repose.common import provenance

if TYPE_CHECKING:
    import pandas as pd

# Descriptions of the intervals, as values of the card's key `interval`.
POSTERIOR_INTERVAL: Final = "central 95 % of the posterior"
SOLUTION_RANGE: Final = "range of the parameter sets found"
# Share of the width of a range. An answer that is nearer to an end than this counts as
# lying at the bound.
BOUND_TOLERANCE = 1e-3
# Keys of the card's entry `made_by`, with the keys of the record of provenance.
PROVENANCE_KEYS = {
    "version": "repose",
    "commit": "commit",
    "configuration": "settings",
    "engine": "engine",
    "seed": "seed",
}

IntervalEnds = tuple[float | None, float | None]
PosteriorTables: TypeAlias = "tuple[pd.DataFrame, pd.DataFrame]"


def assemble_card(
    about: Mapping[str, Any],
    tests: Mapping[str, Mapping[str, Any]],
    answer: Result,
    space: ParameterSpace,
    solutions: "pd.DataFrame",
    posterior: "PosteriorTables | None" = None,
    labels: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Assemble a card from its parts.

    Parameters
    ----------
    about : mapping
        Entries of the card about the simulator or the grain.
    tests : mapping
        Definition and bench test of each response, by name.
    answer : Result
        Parameters and verdict.
    space : ParameterSpace
        The parameters of the study.
    solutions : pandas.DataFrame
        All parameter sets that were found.
    posterior : pair of pandas.DataFrame, optional
        Intervals of the parameters, and draws. Without a posterior, intervals and
        correlations are those of the solutions.
    labels : mapping, optional
        Meaning of each parameter, by default its name.

    Returns
    -------
    dict
        The content of card.json.
    """
    parameter_sets = solutions
    if posterior is not None:
        _, parameter_sets = posterior
    # Correlate the parameters along their scales, so on a logarithmic scale correlate
    # the logarithms. A parameter that is the same in all sets has no correlation. The
    # card has 0 for it.
    coordinates = parameter_sets[list(space.free)]
    for name in space.scale:
        logarithms = space.coordinates(name, coordinates[name])
        coordinates = coordinates.assign(**{name: logarithms})
    correlations = coordinates.corr().fillna(0.0).round(4)

    # Describe each parameter with its interval.
    intervals = find_intervals(space, solutions, posterior)
    parameters = {}
    for name in space.names:
        value = answer.parameters[name]
        low, high = intervals[name]
        parameters[name] = {
            "meaning": (labels or {}).get(name, name),
            "value": value,
            **widen_to_value(space, name, value, low, high),
            "given": _describe_origin(name, space),
        }
        if name in space.scale:
            parameters[name]["scale"] = space.scale[name]

    # Put the parts together; 1 is the version of the card.
    card: dict[str, Any] = {"card": 1, "material": answer.label, **about}
    card |= {
        "parameters": parameters,
        "interval": SOLUTION_RANGE if posterior is None else POSTERIOR_INTERVAL,
        "correlations": correlations.to_dict("index"),
        "tests": [
            check.make_card_entry() | dict(tests[check.response])
            for check in answer.checks
        ],
        "met": answer.verdict.met,
        "verdict": answer.verdict.value,
        "probability_inside": answer.probability,
        "out_of_reach": answer.out_of_reach,
        "reason": answer.reason,
    }
    if answer.near_bounds:
        card["near_bounds"] = list(answer.near_bounds)
    if answer.small_run:
        card["small_run"] = True
    card["within"] = {
        f"{percent:g} %": probability for percent, probability in answer.within.items()
    }
    card["made_by"] = _describe_maker()
    return card


def find_intervals(
    space: ParameterSpace,
    solutions: "pd.DataFrame",
    posterior: "PosteriorTables | None",
) -> dict[str, IntervalEnds]:
    """Find the ends of the interval of each parameter.

    They are the ends of the credible interval. Without a posterior, they are the
    smallest and the largest value among the solutions.

    Parameters
    ----------
    space : ParameterSpace
    solutions : pandas.DataFrame
        All parameter sets that were found.
    posterior : pair of pandas.DataFrame or None
        Intervals of the parameters, and draws.

    Returns
    -------
    dict
        Lower and upper end by name of the parameter; (None, None) for a fixed
        parameter.
    """
    if posterior is None:
        free_values = solutions[list(space.free)]
        low = free_values.min()
        high = free_values.max()
    else:
        interval_table, _ = posterior
        table = interval_table.set_index("parameter")
        low = table["credible_low"]
        high = table["credible_high"]
    intervals: dict[str, IntervalEnds] = {}
    for name in space.names:
        if name in space.free:
            intervals[name] = (float(low[name]), float(high[name]))
        else:
            intervals[name] = (None, None)
    return intervals


def widen_to_value(
    space: ParameterSpace,
    name: str,
    value: float,
    low: float | None,
    high: float | None,
) -> dict[str, Any]:
    """Describe the interval of a parameter, widened so that it contains the answer.

    The interval of draws or solutions need not contain the answer. If the answer lies at
    a bound of the searched range, the interval stays as it is.

    Parameters
    ----------
    space : ParameterSpace
    name : str
        Name of the parameter.
    value : float
        Value of the parameter in the answer.
    low, high : float or None
        Ends of the interval; None for a fixed parameter.

    Returns
    -------
    dict
        ``low`` and ``high``, None for a fixed parameter; ``at_bound``, "lower" or
        "upper", if the value lies at this bound; ``widened`` if the interval did not
        contain the value.
    """
    if name not in space.free or low is None or high is None:
        return {"low": None, "high": None}
    # Compare the value with both bounds along the scale of the parameter.
    k = space.free.index(name)
    lowest = float(space.coordinate_ends[0][k])
    highest = float(space.coordinate_ends[1][k])
    coordinate = float(space.coordinates(name, np.array(value)))
    for side, bound in (("lower", lowest), ("upper", highest)):
        if abs(coordinate - bound) <= BOUND_TOLERANCE * (highest - lowest):
            return {"low": low, "high": high, "at_bound": side}
    interval: dict[str, Any] = {"low": min(low, value), "high": max(high, value)}
    if not low <= value <= high:
        interval["widened"] = True
    return interval


def add_remark(text: str, interval: Mapping[str, Any]) -> str:
    """Append a remark to a text if `widen_to_value` found a bound or widened."""
    if "at_bound" in interval:
        return f"{text}; at the {interval['at_bound']} bound of the range"
    if "widened" in interval:
        return f"{text}; interval widened to hold the answer"
    return text


def _describe_origin(name: str, space: ParameterSpace) -> str:
    """Return whether a parameter was calibrated or fixed."""
    if name in space.prior:
        return "calibrated from a prior"
    return "calibrated" if name in space.free else "fixed"


def _describe_maker() -> dict[str, Any]:
    """Name the version, configuration, engine and seed that made the card."""
    record = provenance.get_current_record() or provenance.describe_machine()
    made_by = {name: record.get(key) for name, key in PROVENANCE_KEYS.items()}
    settings = made_by["configuration"]
    if isinstance(settings, Mapping):
        made_by["configuration"] = provenance.hash_content(settings)
    return made_by
