"""The general part of a material card: parameters with their intervals, and the verdict.

`repose.stages.card` adds the grain and the bench tests.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from repose.calibrate.answer import Result
from repose.calibrate.determination import judge_determination
from repose.calibrate.parameter_space import ParameterSpace
from repose.common import provenance

if TYPE_CHECKING:
    import pandas as pd

# Descriptions of the intervals, as values of the card's key `interval`.
POSTERIOR_INTERVAL: Final = "central 95 % of the posterior"
# Version of the format of the card.
CARD_VERSION = 1
SOLUTION_RANGE: Final = "range of the parameter sets found"
# An answer counts as lying at a bound if it is nearer to it than this fraction of the
# width of the range.
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
    comparisons: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Assemble a material card from its parts.

    Parameters
    ----------
    about : mapping
        Entries of the card about the simulator or the grain.
    tests : mapping
        For each response by name, the entries of the card that define the response and
        its bench test.
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
    comparisons : mapping, optional
        Entries of the card with which the answer is compared: ``samples_inside`` and
        ``published``.

    Returns
    -------
    dict
        The content of card.json.
    """
    parameter_sets = solutions
    if posterior is not None:
        _, parameter_sets = posterior
    intervals = find_intervals(space, solutions, posterior)
    determinations = _judge_determinations(posterior)
    card: dict[str, Any] = {"card": CARD_VERSION, "material": answer.label, **about}
    card |= {
        "parameters": {
            name: _describe_parameter(
                name, answer.parameters[name], intervals[name], space, labels or {}
            )
            | determinations.get(name, {})
            for name in space.names
        },
        "interval": SOLUTION_RANGE if posterior is None else POSTERIOR_INTERVAL,
        "correlations": _correlate_parameters(parameter_sets, space),
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
    card |= comparisons or {}
    card["within"] = {
        f"{percent:g} %": probability for percent, probability in answer.within.items()
    }
    card["made_by"] = _describe_maker()
    return card


def _describe_parameter(
    name: str,
    value: float,
    interval: IntervalEnds,
    space: ParameterSpace,
    labels: Mapping[str, str],
) -> dict[str, Any]:
    """Make the entry of the card for a parameter.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : float
        Its value in the answer.
    interval : pair
        Ends of its interval, which need not contain the answer.
    space : ParameterSpace
        The parameters of the study.
    labels : mapping
        Meanings of parameters by name. A parameter without one has its name as meaning.
    """
    low, high = interval
    entry = {
        "meaning": labels.get(name, name),
        "value": value,
        **make_interval_entry(space, name, value, low, high),
        "given": _describe_origin(name, space),
    }
    if name in space.scale:
        entry["scale"] = space.scale[name]
    return entry


def _judge_determinations(
    posterior: "PosteriorTables | None",
) -> dict[str, dict[str, str]]:
    """Make the entry of each free parameter that says how well it is determined.

    The entries are missing without a posterior, or if its table lacks a column.
    """
    if posterior is None:
        return {}
    table, _ = posterior
    if not {"width_ratio", "information_bits"} <= set(table.columns):
        return {}
    entries = {}
    for row in table.to_dict("records"):
        determination = judge_determination(row["width_ratio"], row["information_bits"])
        entries[str(row["parameter"])] = {"determination": determination.value}
    return entries


def _correlate_parameters(
    parameter_sets: "pd.DataFrame", space: ParameterSpace
) -> dict[str, dict[str, float]]:
    """Compute the correlations between the free parameters.

    A parameter with a logarithmic scale is replaced by its logarithm.

    Parameters
    ----------
    parameter_sets : pandas.DataFrame
        A column for each parameter.
    space : ParameterSpace
        The parameters of the study.

    Returns
    -------
    dict
        For each parameter, its correlation with each parameter by name. It is 0 for a
        parameter that does not vary.
    """
    coordinates = parameter_sets[list(space.free)]
    for name in space.scale:
        coordinates_of_parameter = space.coordinates(name, coordinates[name])
        coordinates = coordinates.assign(**{name: coordinates_of_parameter})
    correlations = coordinates.corr().fillna(0.0).round(4)
    # pandas states no type for the keys, so state it here.
    correlations_by_name: dict[str, dict[str, float]] = correlations.to_dict("index")
    return correlations_by_name


def find_intervals(
    space: ParameterSpace,
    solutions: "pd.DataFrame",
    posterior: "PosteriorTables | None",
) -> dict[str, IntervalEnds]:
    """Find the interval of each parameter.

    It is the credible interval of the posterior. Without a posterior, it reaches from
    the smallest to the largest value among the solutions.

    Parameters
    ----------
    space : ParameterSpace
        The parameters of the study.
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


def make_interval_entry(
    space: ParameterSpace,
    name: str,
    value: float,
    low: float | None,
    high: float | None,
) -> dict[str, Any]:
    """Make the entry of a parameter's interval, widened to contain the answer.

    If the answer lies at a bound of the searched range, `at_bound` says so, and a
    widened interval ends at this bound.

    Parameters
    ----------
    space : ParameterSpace
        The parameters of the study.
    name : str
        Name of the parameter.
    value : float
        Value of the parameter in the answer.
    low, high : float or None
        Ends of the interval; None for a fixed parameter.

    Returns
    -------
    dict
        ``low`` and ``high`` are always there, and None for a fixed parameter. If the
        value lies at a bound, ``at_bound`` is "lower" or "upper". If the interval did
        not contain the value, ``widened`` is True.
    """
    if name not in space.free or low is None or high is None:
        return {"low": None, "high": None}
    # Compare the value with both bounds of the range. On a logarithmic scale, compare
    # their logarithms.
    k = space.free.index(name)
    lower_bounds, upper_bounds = space.coordinate_bounds
    lower = float(lower_bounds[k])
    upper = float(upper_bounds[k])
    coordinate = float(space.coordinates(name, np.array(value)))
    ends_of_range = {"lower": float(space.low[k]), "upper": float(space.high[k])}
    remarks: dict[str, Any] = {}
    values_to_contain = [value]
    for side, bound in (("lower", lower), ("upper", upper)):
        if abs(coordinate - bound) <= BOUND_TOLERANCE * (upper - lower):
            remarks["at_bound"] = side
            values_to_contain.append(ends_of_range[side])
            break
    if low <= value <= high:
        return {"low": low, "high": high, **remarks}
    return {
        "low": min(low, *values_to_contain),
        "high": max(high, *values_to_contain),
        **remarks,
        "widened": True,
    }


def add_remark(text: str, interval: Mapping[str, Any]) -> str:
    """Append a remark to a text if the interval was widened, or the answer lies at a bound."""
    if "at_bound" in interval:
        text += f"; at the {interval['at_bound']} bound of the range"
    if "widened" in interval:
        text += "; interval widened to contain the answer"
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
