"""The response surface around the best point of the path, and its optimum.

If constraints forbid a run of the design, a D-optimal run takes its place. The optimum
and all other parameter sets obey the constraints.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.designs.model import Model
from repose.calibrate.designs.optimum import Optimum, find_optimum
from repose.calibrate.designs.region import Region
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.answer import select_separated
from repose.calibrate.strategies.response_surface import ResponseSurfaceSettings
from repose.calibrate.strategies.response_surface.steps import (
    CODED_PREFIX,
    add_new_run_column,
    compute_scale,
    list_factors,
    make_region,
    make_samples,
    move_forbidden_runs,
    select_good_samples,
)
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets

# Probability of the intervals of predictions.
CONFIDENCE = 0.95
# Number of points of the cube among which parameter sets inside the ranges are
# searched.
N_POINTS = 2048


class Alternatives(NamedTuple):
    """Further parameter sets that are predicted inside all ranges, the best first."""

    sets: np.ndarray  # (n, p)
    mean: np.ndarray  # (n, k), predicted responses


def rank_path_points(
    table: pd.DataFrame, dataset: pd.DataFrame, targets: Targets
) -> pd.DataFrame:
    """Select the usable points of the path of ascent, and mark the best one.

    Returns
    -------
    pandas.DataFrame
        The points with two further columns: `error_percent`, the weighted root mean
        square of the relative deviations from the targets, and `best`.
    """
    points = select_good_samples(table, dataset)
    deviation = points[list(targets.names)].to_numpy(float) / targets.aim - 1
    square = (targets.weight * deviation**2).sum(axis=1) / targets.weight.sum()
    points["error_percent"] = 100 * np.sqrt(square)
    points["best"] = points.index == points["error_percent"].idxmin()
    return points


def make_surface_samples(
    points: pd.DataFrame, space: ParameterSpace, settings: ResponseSurfaceSettings
) -> pd.DataFrame:
    """Make the samples of the surface around the best point of the path of ascent.

    A factor is a parameter that the surface varies. Its outermost levels lie
    `settings.reach` times its range away from the centre. The centre is moved if a
    factor would otherwise leave its range.

    Parameters
    ----------
    points : pandas.DataFrame
        The path, from `rank_path_points`.
    space : ParameterSpace
        The parameters of the study.
    settings : ResponseSurfaceSettings
        The section `response_surface`.

    Returns
    -------
    pandas.DataFrame
        See `make_samples`.

    Raises
    ------
    InputError
        If allowed runs do not determine a quadratic model.
    """
    factors = list_factors(points)
    reach = settings.reach
    # The design in coded units, in which 0 is the centre of each factor.
    coded_design, outermost_level = settings.make_surface_design(len(factors))

    # Move the centre inwards just enough for the outermost levels to stay in the unit
    # cube.
    best = points.loc[points["best"], list(space.names)].to_numpy(float)
    best_unit = space.unit(best)  # (1, d)
    columns = [space.free.index(name) for name in factors]
    centre = np.clip(best_unit[:, columns], reach, 1 - reach)

    def convert_to_unit(coded: np.ndarray) -> np.ndarray:
        """Convert coded points of the factors to points of the unit cube.

        The other parameters stay at the best point.
        """
        unit_points = np.repeat(best_unit, len(coded), axis=0)
        # The outermost coded level is at the distance `reach` from the centre.
        unit_points[:, columns] = centre + reach / outermost_level * coded
        return unit_points

    # Replace the runs that violate constraints.
    region = make_region(space, convert_to_unit, len(factors))
    runs = move_forbidden_runs(coded_design, region, "quadratic", space)
    table = make_samples(
        "surface", space, convert_to_unit(runs.coded), factors, runs.coded
    )
    return add_new_run_column(table, runs.is_new, space)


def make_surface_region(table: pd.DataFrame, space: ParameterSpace) -> Region | None:
    """Make the region of the surface's cube that the constraints allow.

    `table` has the samples of the surface. The result is None if there are no
    constraints.
    """
    return make_region(space, _make_conversion(table, space), len(list_factors(table)))


def find_best_point(
    models: list[Model], targets: Targets, region: Region | None = None
) -> Optimum:
    """Find the optimum of the quadratic models inside the cube of the design.

    There is one model for each target. `region` is the allowed part of the cube.
    """
    return find_optimum(
        models,
        targets.aim,
        scale=compute_scale(targets),
        low=targets.low,
        high=targets.high,
        region=region,
    )


def convert_to_unit_cube(
    table: pd.DataFrame, points: np.ndarray, space: ParameterSpace
) -> np.ndarray:
    """Convert points from coded units to the unit cube of the ranges.

    Parameters
    ----------
    table : pandas.DataFrame
        The samples of the surface.
    points : numpy.ndarray, (n, factors) or (factors,)
        Points in coded units.
    space : ParameterSpace
        The parameters of the study.

    Returns
    -------
    numpy.ndarray, (n, d)
        The same points in the unit cube.
    """
    return _make_conversion(table, space)(points)


def _make_conversion(
    table: pd.DataFrame, space: ParameterSpace
) -> Callable[[np.ndarray], np.ndarray]:
    """Make the function that converts coded points of a surface to the unit cube.

    A factor is a parameter that the surface varies. Its levels are its values in coded
    units. At least two levels must differ.

    Parameters
    ----------
    table : pandas.DataFrame
        The samples of the surface.
    space : ParameterSpace
        The parameters of the study.

    Returns
    -------
    callable
        Function of points (n, factors) or (factors,) in coded units that returns points
        (n, d) of the unit cube.
    """
    samples = space.unit(table[list(space.names)].to_numpy(float))
    # The coordinate of a factor in the unit cube is linear in its coded level. The line
    # passes through a sample at the lowest level and one at the highest level.
    columns = []
    low_levels = []
    low_coordinates = []
    slopes = []
    for name in list_factors(table):
        column = space.free.index(name)
        levels = table[CODED_PREFIX + name].to_numpy(float)
        lowest = levels.argmin()
        highest = levels.argmax()
        rise = samples[highest, column] - samples[lowest, column]
        columns.append(column)
        low_levels.append(levels[lowest])
        low_coordinates.append(samples[lowest, column])
        slopes.append(rise / (levels[highest] - levels[lowest]))

    def convert_to_unit(points: np.ndarray) -> np.ndarray:
        offsets = np.atleast_2d(points) - np.array(low_levels)
        # Parameters other than the factors are the same in all samples.
        unit_points = np.repeat(samples[:1], len(offsets), axis=0)
        unit_points[:, columns] = np.array(low_coordinates) + np.array(slopes) * offsets
        return unit_points

    return convert_to_unit


def find_alternatives(
    models: list[Model], table: pd.DataFrame, study: Study
) -> Alternatives:
    """Find parameter sets inside the design that are predicted inside all ranges.

    Parameters
    ----------
    models : list of Model
        A quadratic model for each response.
    table : pandas.DataFrame
        The samples of the surface.
    study : Study
        The study.

    Returns
    -------
    Alternatives
        The parameter sets that are nearest to the aims come first.
    """
    from scipy.stats import qmc

    space = study.parameters
    targets = study.targets
    settings = study.settings

    # Predict the responses at points that are spread over the cube of the factors, in
    # coded units from -1 to 1. Drop the points that violate constraints.
    sequence = qmc.Sobol(len(models[0].factors), rng=settings.design.seed)
    coded = 2 * sequence.random(N_POINTS) - 1
    region = make_surface_region(table, space)
    if region is not None:
        coded = coded[region.is_allowed(coded)]
    predicted = np.column_stack([model.predict(coded) for model in models])
    is_inside = np.all((predicted >= targets.low) & (predicted <= targets.high), axis=1)

    # Sort the points inside all ranges by their distance from the aims.
    deviation = (predicted - targets.aim) / compute_scale(targets)
    nearest_first = np.argsort((deviation**2).sum(axis=1), kind="stable")
    inside_rows = nearest_first[is_inside[nearest_first]]

    # Choose points that are far enough from each other, in the unit cube. The number of
    # solutions and their distance are settings of the search (`miga`).
    unit_points = convert_to_unit_cube(table, coded[inside_rows], space)
    separated = select_separated(unit_points, settings.miga)
    return Alternatives(
        space.values(unit_points[separated]), predicted[inside_rows][separated]
    )


def make_check_samples(
    table: pd.DataFrame, best: Optimum, space: ParameterSpace, count: int
) -> pd.DataFrame:
    """Make the samples of the check, which repeat the optimum `count` times.

    `table` has the samples of the surface.
    """
    unit_points = np.repeat(
        convert_to_unit_cube(table, best.coded, space), count, axis=0
    )
    coded = np.repeat(best.coded[None], count, axis=0)
    return make_samples("check", space, unit_points, list_factors(table), coded)


def make_notes(
    models: list[Model], best: Optimum, check: pd.DataFrame, study: Study
) -> dict[str, Any]:
    """Describe the optimum, as notes of the proposal.

    Parameters
    ----------
    models : list of Model
        A quadratic model for each response.
    best : Optimum
        The optimum of the models.
    check : pandas.DataFrame
        The samples of the check.
    study : Study
        The study.

    Returns
    -------
    dict
        The table `predictions`; `optimum`, a mapping; and `why`, a sentence.
    """
    parameters = check.loc[0, list(study.parameters.names)].astype(float).to_dict()
    coded = dict(zip(models[0].factors, best.coded.tolist(), strict=True))
    verb = "meet" if best.met else "do not meet"
    return {
        "predictions": predict_at_optimum(models, best, study.targets, len(check)),
        "optimum": {
            "parameters": parameters,
            "coded": coded,
            "met": best.met,
            "desirability": best.desirability,
        },
        "why": f"the surfaces {verb} the targets: {parameters}",
    }


def predict_at_optimum(
    models: list[Model], best: Optimum, targets: Targets, n_runs: int
) -> pd.DataFrame:
    """Predict the responses at the optimum.

    Parameters
    ----------
    models : list of Model
        A quadratic model for each response.
    best : Optimum
        The optimum of the models.
    targets : Targets
        The targets of the study.
    n_runs : int
        Number of runs of the check, which simulates the optimum again.

    Returns
    -------
    pandas.DataFrame
        `response`, `target`, `predicted`, `standard_error`, and the ends of two 95 %
        intervals. The true mean lies between `mean_low` and `mean_high`, and the mean
        of the runs of the check between `low` and `high`, if the model is right.
    """
    point = best.coded[None]
    table = pd.DataFrame({"response": targets.names, "target": targets.aim})
    table["predicted"] = [float(model.predict(point)[0]) for model in models]
    table["standard_error"] = [
        float(model.standard_error(point)[0]) for model in models
    ]
    t_quantile = np.array([_compute_t_quantile(model) for model in models])
    # The mean of the runs also scatters about the true mean.
    variance_of_mean = [model.variance / n_runs for model in models]
    error_of_runs = np.sqrt(table["standard_error"] ** 2 + variance_of_mean)
    table["mean_low"] = table["predicted"] - t_quantile * table["standard_error"]
    table["mean_high"] = table["predicted"] + t_quantile * table["standard_error"]
    table["low"] = table["predicted"] - t_quantile * error_of_runs
    table["high"] = table["predicted"] + t_quantile * error_of_runs
    return table


def _compute_t_quantile(model: Model) -> float:
    """Return the quantile of the t distribution for an interval of a model.

    It is NaN for a model without degrees of freedom.
    """
    from scipy import stats

    if not model.df:
        return np.nan
    return float(stats.t.ppf((1 + CONFIDENCE) / 2, model.df))


def add_check(predicted: pd.DataFrame, dataset: pd.DataFrame) -> pd.DataFrame:
    """Compare the predictions at the optimum with the simulations of the check.

    Parameters
    ----------
    predicted : pandas.DataFrame
        Result of `predict_at_optimum`.
    dataset : pandas.DataFrame
        The samples of the check with their responses.

    Returns
    -------
    pandas.DataFrame
        A copy of `predicted` with further columns: `simulated`, the mean of the good
        samples, which is NaN if there are none; `simulated_error`, its standard error,
        which is NaN if there are fewer than two; `deviation_percent` from the target;
        and `as_predicted`, whether the mean lies between `low` and `high`.
    """
    table = predicted.copy()
    good = dataset[dataset["status"] == "ok"]
    values = good[list(table["response"])].to_numpy(float)
    n_good = len(good)
    table["simulated"] = np.nan
    table["simulated_error"] = np.nan
    if n_good > 0:
        table["simulated"] = values.mean(axis=0)
    if n_good > 1:
        table["simulated_error"] = values.std(axis=0, ddof=1) / np.sqrt(n_good)
    table["deviation_percent"] = 100 * (table["simulated"] / table["target"] - 1)
    table["as_predicted"] = table["simulated"].between(table["low"], table["high"])
    return table
