"""Parameter sets whose predicted responses match the measured responses: section 3.3 of the paper, Table 3.

The search is the multi-island genetic algorithm (`repose.calibrate.search`) on the surrogate.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate import expected_loss
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.objective import HISTORY, Objective, Preference, search
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.surrogates import Surrogate
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.common.errors import InputError

LEAST_LOSS = "least_expected_loss"  # of `miga.answer`
FEWEST_ROWS = (
    10  # of the solutions, so that validation always has points to choose from
)


class Inversion(NamedTuple):
    """Result of `invert`; in its solutions the representative comes first, then the others by objective."""

    # parameters, predicted responses, objective (Eq. 11), violation, feasible, representative; with a support warning,
    # with priors prior_distance_sd
    solutions: pd.DataFrame
    intervals: pd.DataFrame  # Table 3
    history: pd.DataFrame  # a row for each round of the search
    summary: dict[
        str, Any
    ]  # counts, the representative, its distances from ranges and targets, a message


def invert(
    model: Surrogate,
    space: ParameterSpace,
    targets: Targets,
    settings: MigaSettings,
    support: Support | None = None,
) -> Inversion:
    """Search the free parameters for predicted responses that meet the targets.

    The result has the best distinct feasible solutions, filled up with the nearest others to at least 10; without any
    feasible one it has the sets of least objective. Of equally good sets, those near the means of the priors come
    first.
    """
    for target in targets:
        if not target.low <= target.aim <= target.high:
            raise InputError(
                "targets",
                target.name,
                target.aim,
                f"inside its range {[target.low, target.high]}",
            )
    respond, preference = on_free_parameters(model, space), Preference.of(space)
    objective = Objective(targets, preference.largest if preference else 0.0)
    archive, history, feasible_met = search(
        respond, objective, space.dimensions, settings, preference
    )
    evaluations = history[-1][HISTORY.index("evaluations")]
    if (
        not feasible_met
    ):  # then the nearest to the targets, not to the edge of empty ranges
        objective = Objective(targets, constrained=False)
        archive, history, _ = search(
            respond, objective, space.dimensions, settings, preference
        )
        evaluations += history[-1][HISTORY.index("evaluations")]

    points = archive.points
    if settings.answer == LEAST_LOSS and model.knows_its_errors:
        points = _behind(
            expected_loss.least(model, space, targets), points, space, settings.distance
        )
    Y = respond(points)
    F, V = objective(Y)
    met, most = np.count_nonzero(V == 0), settings.solutions
    # the representative stands first, feasible or not
    rows = slice(0, max(FEWEST_ROWS, min(met + (V[0] > 0), most)) if met else most)
    points, Y, F, V = points[rows], Y[rows], F[rows], V[rows]
    n_feasible = int(np.count_nonzero(V == 0))
    table = pd.DataFrame(space.values((points + 1) / 2), columns=list(space.names))
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table[list(targets.predicted)] = Y
    table["objective"], table["violation"], table["feasible"] = F, V, V == 0
    table["representative"] = table["solution"] == 1
    if preference is not None:
        table["prior_distance_sd"] = preference.distance(points)
    if support is not None:
        table["warning"] = support.warnings(table[list(space.names)].to_numpy(float))
    history = pd.DataFrame(history, columns=list(HISTORY))
    shown = table[table["feasible"]] if n_feasible else table
    counts = {
        "n_feasible_met": feasible_met,
        "n_solutions": n_feasible,
        "evaluations": int(evaluations),
    }
    return Inversion(
        table,
        intervals(shown, space),
        history,
        _summary(table, space, targets, settings, counts),
    )


def on_free_parameters(
    surrogate: Surrogate, space: ParameterSpace
) -> Callable[[np.ndarray], np.ndarray]:
    """Make the surrogate a function of the free parameters: points (n, d) in [-1, 1] to responses (n, k)."""
    respond = surrogate.response_function(
        space.complete(space.low)[0], space.complete(space.high)[0]
    )
    if space.dimensions == len(space.names):
        return respond
    columns = [space.names.index(name) for name in space.free]

    def respond_to_free(points: np.ndarray) -> np.ndarray:
        every = np.zeros(
            (len(points), len(space.names))
        )  # both ends of a fixed parameter are its value
        every[:, columns] = points
        return respond(every)

    return respond_to_free


def intervals(solutions: pd.DataFrame, space: ParameterSpace) -> pd.DataFrame:
    """Make Table 3: interval and dispersion (its width over the range's) of each parameter."""
    names = list(space.names)
    low, high = (
        solutions[names].min().to_numpy(float),
        solutions[names].max().to_numpy(float),
    )
    width = (
        pd.Series(space.high - space.low, list(space.free))
        .reindex(names, fill_value=1.0)
        .to_numpy()
    )
    table = pd.DataFrame({"variable": names, "low": low, "high": high})
    return table.assign(dispersion_percent=100 * (high - low) / width)


def message(
    responses: np.ndarray, targets: Targets, n_feasible: int, distance: float
) -> str:
    """Write the result of the search as text, from the responses (k,) of the representative."""

    def in_words(values: Iterable[float]) -> str:
        return targets.in_words([f"{value:.2f}" for value in values])

    ranges = targets.in_words([f"{target.low:g}-{target.high:g}" for target in targets])
    best = f"the answer is predicted {in_words(responses)}"
    aims = targets.in_words([f"{target.aim:g}" for target in targets])
    off = f"{in_words(abs(responses - targets.aim))} from the target {aims}"
    if n_feasible:
        apart = f"at least {distance:g} apart in normalised parameters"
        return f"{n_feasible} distinct feasible solutions inside {ranges}, {apart}; {best}, {off}."
    beyond = in_words(_outside(responses, targets.low, targets.high))
    return f"All later stages use the nearest solutions: {best}, {beyond} outside the ranges {ranges}, {off}."


def _summary(
    table: pd.DataFrame,
    space: ParameterSpace,
    targets: Targets,
    settings: MigaSettings,
    counts: dict[str, int],
) -> dict[str, Any]:
    """Make the content of summary.json."""
    best = table.iloc[0]
    responses = best[list(targets.predicted)].to_numpy(float)
    box, off = (
        _outside(responses, targets.low, targets.high),
        _outside(responses, targets.aim, targets.aim),
    )
    summary: dict[str, Any] = {
        "feasible": counts["n_solutions"] > 0,
        **counts,
        "distance": settings.distance,
        "representative": {
            name: float(best[name])
            for name in (*space.names, *targets.predicted, "objective")
        },
        "box_distance": dict(zip(targets.names, box, strict=True)),
        "target_distance": dict(zip(targets.names, off, strict=True)),
        "message": message(
            responses, targets, counts["n_solutions"], settings.distance
        ),
    }
    if "warning" in table and best["warning"]:
        summary["message"] += f" Beyond the samples: {best['warning']}."
    return summary


def _behind(
    first: Mapping[str, float],
    points: np.ndarray,
    space: ParameterSpace,
    distance: float,
) -> np.ndarray:
    """Put the set `first` before the points (n, d) that are not too near to it; the best point always stays."""
    place = 2 * space.unit(np.array([[first[name] for name in space.names]])) - 1
    far = np.linalg.norm(points - place, axis=1) >= distance
    far[0] = True
    return np.vstack([place, points[far]])


def _outside(responses: np.ndarray, low: np.ndarray, high: np.ndarray) -> list[float]:
    """Measure how far each response (k,) is from the range low to high; 0 inside."""
    return [
        float(value)
        for value in np.maximum(np.maximum(low - responses, responses - high), 0.0)
    ]
