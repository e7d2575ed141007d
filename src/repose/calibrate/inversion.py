"""Search for parameter sets whose predicted responses match the measured ones.

The method is that of section 3.3 of the paper, with its Table 3. The multi-island
genetic algorithm (`repose.calibrate.search`) searches on the surrogate.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate import expected_loss
from repose.calibrate.answer import ENDS_NOT_SIMULATED
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.scales import to_coordinates
from repose.calibrate.search.objective import (
    HISTORY_COLUMNS,
    Objective,
    Preference,
    SearchResult,
    search_points,
)
from repose.calibrate.search.settings import MIN_LOSS, MigaSettings
from repose.calibrate.surrogates import Surrogate
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.numbers import format_decimals, format_significant

# Smallest number of solutions, so that the validation always has points to choose from.
MIN_ROWS = 10


class Inversion(NamedTuple):
    """Result of `invert`.

    Attributes
    ----------
    solutions : pandas.DataFrame
        The representative, then the others by objective: `solution`, parameters,
        predicted responses, `objective` (Eq. 11), `violation`, `feasible`,
        `representative`; with priors `prior_distance_sd`, with a support `warning`.
    intervals : pandas.DataFrame
        Table 3 of the paper.
    history : pandas.DataFrame
        A row for each round of the search.
    summary : dict
        Counts, the representative, its distances from ranges and targets, a message.
    """

    solutions: pd.DataFrame
    intervals: pd.DataFrame
    history: pd.DataFrame
    summary: dict[str, Any]


def invert(
    model: Surrogate,
    space: ParameterSpace,
    targets: Targets,
    settings: MigaSettings,
    support: Support | None = None,
) -> Inversion:
    """Search for parameter sets whose predicted responses meet the targets.

    Among equally good sets, those nearest to the means of the priors come first.

    Parameters
    ----------
    model : Surrogate
        The surrogate.
    space : ParameterSpace
        The ranges that are searched.
    targets : Targets
        The targets of the study.
    settings : MigaSettings
        The section `miga`.
    support : Support, optional
        Region of the samples; sets beyond it get a warning.

    Returns
    -------
    Inversion
        The best distinct feasible solutions. If there are fewer than `MIN_ROWS`, the
        nearest infeasible ones follow. If no feasible solution is near samples, the
        solutions are the sets with the lowest objective in the region of the samples.

    Raises
    ------
    InputError
        If the aim of a target lies outside its range.
    """
    _require_aims_in_ranges(targets)
    # Search for points whose predictions meet the targets.
    predict = restrict_to_free_parameters(model, space)
    preference = Preference.from_priors(space)
    result = _search_parameters(predict, space, targets, settings, preference, support)

    # Put the representative first, whether it is feasible or not.
    points = result.points
    if settings.answer == MIN_LOSS and model.can_predict_errors:
        if result.is_restricted_to_samples:
            # Choose among the points found, since a minimum elsewhere is extrapolated.
            points = _put_best_by_loss_first(points, model, space, targets, preference)
        else:
            # Minimise the loss over the whole ranges of the parameters.
            best = expected_loss.minimise_expected_loss(model, space, targets)
            points = _put_first(best, points, space, settings.distance)
    responses = predict(points)
    objectives, violations = result.objective(responses)
    rows = slice(_count_rows(violations, settings.solutions))
    points = points[rows]

    # Tabulate the solutions. Points have coordinates from -1 to 1, the unit cube from 0
    # to 1.
    table = pd.DataFrame(space.values((points + 1) / 2), columns=list(space.names))
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table[list(targets.predicted)] = responses[rows]
    table["objective"] = objectives[rows]
    table["violation"] = violations[rows]
    table["feasible"] = table["violation"] == 0
    table["representative"] = table["solution"] == 1
    if preference is not None:
        table["prior_distance_sd"] = preference.distance(points)
    if support is not None:
        table["warning"] = support.make_warnings(
            table[list(space.names)].to_numpy(float)
        )

    # Without a feasible solution, Table 3 describes the nearest ones.
    feasible_rows = table[table["feasible"]]
    counts = {
        "n_feasible_met": result.n_feasible,
        "n_solutions": len(feasible_rows),
        "evaluations": result.evaluations,
    }
    return Inversion(
        solutions=table,
        intervals=make_interval_table(
            feasible_rows if len(feasible_rows) else table, space
        ),
        history=pd.DataFrame(result.history, columns=list(HISTORY_COLUMNS)),
        summary=_make_summary(table, space, targets, settings, counts)
        | _find_missing_simulation(table, space, support, result.nearest_to_ranges),
    )


class _SearchResult(NamedTuple):
    """Result of one or two searches."""

    points: np.ndarray  # (n, d) in [-1, 1], the best distinct points, best first
    objective: Objective  # that they minimise
    history: list[tuple]  # a row with the columns `HISTORY_COLUMNS` for each round
    n_feasible: int  # number of feasible points that the search met
    evaluations: int  # number of points that were evaluated
    nearest_to_ranges: np.ndarray  # (d,), the best point of the first search
    # Whether the search was restricted to the region of the samples. This is the second
    # search, after a first one without a feasible point near samples.
    is_restricted_to_samples: bool


def _search_parameters(
    predict: Callable[[np.ndarray], np.ndarray],
    space: ParameterSpace,
    targets: Targets,
    settings: MigaSettings,
    preference: Preference | None,
    support: Support | None,
) -> _SearchResult:
    """Search for parameter sets that meet the targets, or else come near to them.

    A set is feasible if its predicted responses lie inside the ranges of the targets.
    The first search looks for feasible sets in the whole ranges of the parameters. Far
    from the samples a surrogate extrapolates, so a set may seem feasible there even if
    none is. Therefore the result of the first search is used only if it has a feasible
    set near samples. Otherwise a second search looks for the sets nearest to the
    targets, and stays in the region of the samples. If the constraints exclude this
    whole region, a third search does the same in the whole ranges.

    Parameters
    ----------
    predict : callable
        Function of points (n, d) in [-1, 1] that returns responses (n, k).
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    settings : MigaSettings
        The section `miga`.
    preference : Preference or None
        A cost that increases with the distance from the means of the priors; None
        without priors.
    support : Support or None
        Region of the samples.

    Returns
    -------
    _SearchResult
        The evaluations of all searches are counted.
    """
    largest_preference = preference.largest if preference else 0.0
    objective = Objective(targets, largest_preference)

    def search(minimised: Objective, searched_region: Support | None) -> SearchResult:
        """Search a region of samples; None means the whole ranges of the parameters."""
        return search_points(
            predict,
            minimised,
            space.dimensions,
            settings,
            preference,
            compute_violation=_make_violation_function(space, searched_region),
        )

    region = None
    found = search(objective, region)
    evaluations = _count_evaluations(found)
    # The archive has the points in the order of their quality. Even without a feasible
    # point, it has the nearest ones, as long as the constraints allow any point.
    nearest_to_ranges = found.archive.points[0]
    _, violations = objective(predict(found.archive.points))
    feasible = found.archive.points[violations == 0]
    if not _is_near_samples(feasible, space, support).any():
        # An objective without the ranges as a constraint leads to the sets nearest to
        # the targets, instead of those nearest to the ranges.
        objective = Objective(targets, constrained=False)
        region = support
        found = search(objective, region)
        evaluations += _count_evaluations(found)
        # The constraints exclude the whole region of the samples.
        if len(found.archive.points) == 0:
            region = None
            found = search(objective, region)
            evaluations += _count_evaluations(found)
    return _SearchResult(
        points=found.archive.points,
        objective=objective,
        history=found.history,
        n_feasible=found.n_feasible,
        evaluations=evaluations,
        nearest_to_ranges=nearest_to_ranges,
        is_restricted_to_samples=region is not None,
    )


def _is_near_samples(
    points: np.ndarray, space: ParameterSpace, support: Support | None
) -> np.ndarray:
    """Mark the points (n, d) in [-1, 1] that are near samples; all without a support.

    Far from its samples, a surrogate states errors that are several times too small. A
    prediction there proves nothing, even if its stated error is small.
    """
    if support is None or not len(points):
        return np.ones(len(points), bool)
    return ~support.is_sparse(space.values((points + 1) / 2))


def _count_evaluations(found: SearchResult) -> int:
    """Return the number of points that a search evaluated."""
    return int(found.history[-1][HISTORY_COLUMNS.index("evaluations")])


def _make_violation_function(
    space: ParameterSpace, support: Support | None = None
) -> Callable[[np.ndarray], np.ndarray] | None:
    """Make a function that measures by how much points violate the constraints.

    Parameters
    ----------
    space : ParameterSpace
        The parameters, with their constraints.
    support : Support, optional
        Region of the samples. A point outside it violates a further constraint.

    Returns
    -------
    callable or None
        It maps points (n, d) in [-1, 1] to violations (n,), which are 0 where all
        constraints are obeyed. None if there are neither constraints nor a support.
    """
    if support is None and not space.constraints:
        return None

    def compute_violation(points: np.ndarray) -> np.ndarray:
        unit = (points + 1) / 2
        violation = space.violation(unit)
        if support is not None:
            violation += support.excess(space.values(unit))
        return violation

    return compute_violation


def _require_aims_in_ranges(targets: Targets) -> None:
    """Raise InputError for a target whose aim lies outside its range."""
    for target in targets:
        if not target.low <= target.aim <= target.high:
            raise InputError(
                source="targets",
                key=target.name,
                value=target.aim,
                allowed=f"inside its range {[target.low, target.high]}",
            )


def _count_rows(violations: np.ndarray, maximum: int) -> int:
    """Count the points that become solutions.

    The solutions are the feasible points and the representative, but at least
    `MIN_ROWS` and at most `maximum`. Without any feasible point there are `maximum`
    solutions.

    Parameters
    ----------
    violations : numpy.ndarray, (n,)
        Violations of the points, the representative first and then the best first.
    maximum : int
        Largest number of solutions.
    """
    n_feasible = int(np.count_nonzero(violations == 0))
    if n_feasible == 0:
        return maximum
    # An infeasible representative is a further solution. True counts as 1.
    is_first_infeasible = bool(violations[0] > 0)
    return max(MIN_ROWS, min(n_feasible + is_first_infeasible, maximum))


def restrict_to_free_parameters(
    surrogate: Surrogate, space: ParameterSpace
) -> Callable[[np.ndarray], np.ndarray]:
    """Make a function that predicts the responses from the free parameters alone.

    The fixed parameters keep their values. If possible, the result uses the surrogate's
    own fast function, because a search calls it very often.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate.
    space : ParameterSpace
        The parameters of the study.

    Returns
    -------
    callable
        Function of points (n, d) that returns the predicted responses (n, k). The
        coordinates of a point go from -1 to 1, the ends of the range of each free
        parameter, evenly along its scale.
    """
    if space.scale and dict(surrogate.scale) != space.scale:
        # The fast function of this surrogate does not spread the points along the
        # scales of the space. So convert points to the unit cube, which goes from 0 to
        # 1, and then to values of the parameters.
        return lambda points: surrogate.predict(space.values((points + 1) / 2))
    low = space.add_fixed_values(space.low)[0]
    high = space.add_fixed_values(space.high)[0]
    predict_from_all = surrogate.response_function(low, high)
    # Without fixed parameters, the function has the right inputs.
    if space.dimensions == len(space.names):
        return predict_from_all
    columns = [space.names.index(name) for name in space.free]

    def predict_from_free(points: np.ndarray) -> np.ndarray:
        # The range of a fixed parameter is a single value, so its coordinate has no
        # effect and can be 0.
        all_coordinates = np.zeros((len(points), len(space.names)))
        all_coordinates[:, columns] = points
        return predict_from_all(all_coordinates)

    return predict_from_free


def make_interval_table(solutions: pd.DataFrame, space: ParameterSpace) -> pd.DataFrame:
    """Tabulate the interval of each parameter among solutions, and its dispersion.

    This is Table 3 of the paper.

    Parameters
    ----------
    solutions : pandas.DataFrame
        A row for each parameter set.
    space : ParameterSpace
        The parameters of the study.

    Returns
    -------
    pandas.DataFrame
        A row for each parameter: `variable`, `low`, `high`, and `dispersion_percent`.
        The dispersion is the width of the interval in percent of the width of the
        range. Both are differences of values or, on a logarithmic scale, of their
        logarithms.
    """
    names = list(space.names)
    low = solutions[names].min().to_numpy(float)
    high = solutions[names].max().to_numpy(float)
    range_low, range_high = space.coordinate_bounds
    free_widths = pd.Series(range_high - range_low, index=list(space.free))
    # A fixed parameter has an interval of width 0, so its dispersion is 0 for any width
    # of the range. Use 1 to avoid a division by 0.
    range_widths = free_widths.reindex(names, fill_value=1.0).to_numpy()
    ends = to_coordinates(np.array([low, high]), names, space.scale)
    dispersion_percent = 100 * (ends[1] - ends[0]) / range_widths
    table = pd.DataFrame({"variable": names, "low": low, "high": high})
    return table.assign(dispersion_percent=dispersion_percent)


def describe_result(
    responses: np.ndarray, targets: Targets, n_feasible: int, distance: float
) -> str:
    """Describe the result of the search in a sentence.

    The sentence compares the prediction for the answer, the representative solution,
    with the ranges and the aims of the targets.

    Parameters
    ----------
    responses : numpy.ndarray, (k,)
        Predicted responses of the answer.
    targets : Targets
        The targets of the study.
    n_feasible : int
        Number of feasible solutions.
    distance : float
        Smallest distance between two feasible solutions, in normalised parameters.

    Returns
    -------
    str
        The sentence, with a full stop.
    """

    def format_numbers(numbers: Iterable[float]) -> str:
        """Write one number for each target, with its unit."""
        return targets.format_with_units(
            [format_decimals(number) for number in numbers]
        )

    ranges = targets.format_with_units(
        [
            f"{format_significant(target.low)}-{format_significant(target.high)}"
            for target in targets
        ]
    )
    aims = targets.format_with_units(
        [format_significant(target.aim) for target in targets]
    )
    predicted = format_numbers(responses)
    deviations = format_numbers(abs(responses - targets.aim))
    if n_feasible:
        return (
            f"{n_feasible} distinct feasible solutions inside {ranges}, at least "
            f"{distance:g} apart in normalised parameters; the prediction for the "
            f"answer is {predicted}, which is {deviations} from the target {aims}."
        )
    outside = format_numbers(_measure_distances(responses, targets.low, targets.high))
    return (
        "All later stages use the nearest solutions: the prediction for the answer is "
        f"{predicted}, which is {outside} outside the ranges {ranges}, and "
        f"{deviations} from the target {aims}."
    )


def _make_summary(
    table: pd.DataFrame,
    space: ParameterSpace,
    targets: Targets,
    settings: MigaSettings,
    counts: dict[str, int],
) -> dict[str, Any]:
    """Make the content of summary.json.

    Parameters
    ----------
    table : pandas.DataFrame
        The solutions. The first row must be the representative solution, which is the
        answer.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    settings : MigaSettings
        The section `miga`.
    counts : mapping
        Entries of the summary that count points; `n_solutions` must be among them.

    Returns
    -------
    dict
        Numbers, texts and dicts that JSON can hold.
    """
    answer = table.iloc[0]
    responses = answer[list(targets.predicted)].to_numpy(float)
    distances_from_ranges = _measure_distances(responses, targets.low, targets.high)
    # Measure the distances from the aims with ranges of width 0.
    distances_from_aims = _measure_distances(responses, targets.aim, targets.aim)
    representative = {}
    for name in (*space.names, *targets.predicted, "objective"):
        representative[name] = float(answer[name])
    message = describe_result(
        responses, targets, counts["n_solutions"], settings.distance
    )
    if "warning" in table and answer["warning"]:
        message += f" Beyond the samples: {answer['warning']}."
    return {
        "feasible": counts["n_solutions"] > 0,
        **counts,
        "distance": settings.distance,
        "representative": representative,
        "box_distance": dict(zip(targets.names, distances_from_ranges, strict=True)),
        "target_distance": dict(zip(targets.names, distances_from_aims, strict=True)),
        "message": message,
    }


def _find_missing_simulation(
    table: pd.DataFrame,
    space: ParameterSpace,
    support: Support | None,
    nearest_to_ranges: np.ndarray,
) -> dict[str, Any]:
    """Return the entry `stop` of the summary if the nearest set is at an end without samples.

    The response may be steep at an end of a parameter's range. Without samples there,
    the targets are not known to be out of reach.

    Parameters
    ----------
    table : pandas.DataFrame
        The solutions, the representative one first.
    space : ParameterSpace
        The parameters of the study.
    support : Support or None
        Region that the samples cover.
    nearest_to_ranges : numpy.ndarray, (d,)
        The point in [-1, 1] whose prediction is nearest to the ranges of the targets,
        whether samples are near it or not.

    Returns
    -------
    dict
        The entry `stop`. The dict is empty if a solution is feasible, if samples are
        near all these ends, or if there is no support.
    """
    if support is None or table["feasible"].any():
        return {}
    representative = table[list(space.names)].to_numpy(float)[:1]
    anywhere = space.values((nearest_to_ranges[None] + 1) / 2)
    lacks_samples = support.is_at_end_without_samples(
        np.vstack([representative, anywhere])
    )
    return {"stop": ENDS_NOT_SIMULATED} if lacks_samples.any() else {}


def _put_best_by_loss_first(
    points: np.ndarray,
    model: Surrogate,
    space: ParameterSpace,
    targets: Targets,
    preference: Preference | None,
) -> np.ndarray:
    """Put the point with the smallest expected loss before the other points (n, d)."""
    values = space.values((points + 1) / 2)
    loss = expected_loss.compute_expected_loss(model, values, targets)
    if preference is not None:
        loss += preference(points)
    best = int(np.argmin(loss))
    return np.vstack([points[best], np.delete(points, best, axis=0)])


def _put_first(
    best: Mapping[str, float],
    points: np.ndarray,
    space: ParameterSpace,
    distance: float,
) -> np.ndarray:
    """Put a parameter set before the points (n, d), and drop points too near to it.

    The first point always stays. It is the set of least objective, which is poured as
    one of the checks (`repose.stages.validate.select_for_validation`).
    """
    values = np.array([[best[name] for name in space.names]])
    point = 2 * space.unit(values) - 1
    is_kept = np.linalg.norm(points - point, axis=1) >= distance
    is_kept[0] = True
    return np.vstack([point, points[is_kept]])


def _measure_distances(
    responses: np.ndarray, low: np.ndarray, high: np.ndarray
) -> list[float]:
    """Measure how far each response (k,) lies outside the range from low to high.

    The distance of a response inside its range is 0.
    """
    distance = np.maximum(np.maximum(low - responses, responses - high), 0.0)
    return [float(value) for value in distance]
