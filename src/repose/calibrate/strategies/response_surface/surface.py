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

# Probability of the intervals.
CONFIDENCE = 0.95
# Points of the cube that are searched for parameter sets inside the ranges.
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
    points: pd.DataFrame, space: ParameterSpace, section: ResponseSurfaceSettings
) -> pd.DataFrame:
    """Design the samples of the surface around the best point of the path.

    The outermost levels of each factor lie `reach` of its range away from the centre. The
    centre is moved if a factor would leave its range.

    Parameters
    ----------
    points : pandas.DataFrame
        The path, from `rank_path_points`.
    space : ParameterSpace
    section : ResponseSurfaceSettings

    Raises
    ------
    InputError
        If allowed runs do not determine a quadratic model.
    """
    factors = list_factors(points)
    reach = section.reach
    coded, outermost_level = section.coded(len(factors))

    # Move the centre inwards so far that the outermost levels stay in the unit cube.
    best = points.loc[points["best"], list(space.names)].to_numpy(float)
    best_unit = space.unit(best)  # (1, d)
    columns = [space.free.index(name) for name in factors]
    centre = np.clip(best_unit[:, columns], reach, 1 - reach)

    # Vary the factors around the centre, and keep the other parameters at the best point.
    def convert_to_unit(coded: np.ndarray) -> np.ndarray:
        """Convert coded points of the factors to points of the unit cube."""
        unit = np.repeat(best_unit, len(coded), axis=0)
        unit[:, columns] = centre + reach / outermost_level * coded
        return unit

    region = make_region(space, convert_to_unit, len(factors))
    runs = move_forbidden_runs(coded, region, "quadratic", space)
    table = make_samples(
        "surface", space, convert_to_unit(runs.coded), factors, runs.coded
    )
    return add_new_run_column(table, runs.is_new, space)


def make_surface_region(table: pd.DataFrame, space: ParameterSpace) -> Region | None:
    """Make the allowed region of the surface's cube; None without constraints.

    `table` has the samples of the surface.
    """
    return make_region(space, _make_conversion(table, space), len(list_factors(table)))


def find_best_point(
    models: list[Model], targets: Targets, region: Region | None = None
) -> Optimum:
    """Find the optimum of the quadratic models inside the cube of the design.

    There is one model for each target. `region` is what is allowed of the cube.
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
        In coded units.
    space : ParameterSpace

    Returns
    -------
    numpy.ndarray, (n, d)
    """
    return _make_conversion(table, space)(points)


def _make_conversion(
    table: pd.DataFrame, space: ParameterSpace
) -> Callable[[np.ndarray], np.ndarray]:
    """Make the function that converts coded points of a surface to the unit cube."""
    sample_unit = space.unit(table[list(space.names)].to_numpy(float))
    # The position in the range is linear in the coded level. For each factor, the line
    # passes through a sample at the lowest level and one at the highest level.
    columns = []
    starts = []
    slopes = []
    for name in list_factors(table):
        column = space.free.index(name)
        coded = table[CODED_PREFIX + name].to_numpy(float)
        lowest = coded.argmin()
        highest = coded.argmax()
        rise = sample_unit[highest, column] - sample_unit[lowest, column]
        columns.append(column)
        starts.append((coded[lowest], sample_unit[lowest, column]))
        slopes.append(rise / (coded[highest] - coded[lowest]))
    start_coded, start_unit = np.transpose(starts)

    def convert_to_unit(points: np.ndarray) -> np.ndarray:
        points = np.atleast_2d(points)
        # Parameters other than the factors are the same in all samples.
        unit = np.repeat(sample_unit[:1], len(points), axis=0)
        unit[:, columns] = start_unit + np.array(slopes) * (points - start_coded)
        return unit

    return convert_to_unit


def find_alternatives(
    models: list[Model], table: pd.DataFrame, study: Study
) -> Alternatives:
    """Find parameter sets inside the design that are predicted to meet all ranges.

    Parameters
    ----------
    models : list of Model
        A quadratic model for each response.
    table : pandas.DataFrame
        The samples of the surface.
    study : Study

    Returns
    -------
    Alternatives
        The parameter sets that are nearest to the aims come first.
    """
    from scipy.stats import qmc

    space = study.parameters
    targets = study.targets
    settings = study.settings

    # Predict the responses at points all over the cube.
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
    rows = nearest_first[is_inside[nearest_first]]

    # Keep only points that are far enough from each other.
    unit = convert_to_unit_cube(table, coded[rows], space)
    kept = select_separated(unit, settings.miga)
    return Alternatives(space.values(unit[kept]), predicted[rows][kept])


def make_check_samples(
    table: pd.DataFrame, best: Optimum, space: ParameterSpace, count: int
) -> pd.DataFrame:
    """Make the samples of the check, which repeat the optimum `count` times.

    `table` has the samples of the surface.
    """
    unit = np.repeat(convert_to_unit_cube(table, best.coded, space), count, axis=0)
    coded = np.repeat(best.coded[None], count, axis=0)
    return make_samples("check", space, unit, list_factors(table), coded)


def make_notes(
    models: list[Model], best: Optimum, check: pd.DataFrame, study: Study
) -> dict[str, Any]:
    """Describe the optimum, as notes of the proposal.

    Parameters
    ----------
    models : list of Model
        A quadratic model for each response.
    best : Optimum
    check : pandas.DataFrame
        The samples of the check.
    study : Study

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
    models: list[Model], best: Optimum, targets: Targets, runs: int
) -> pd.DataFrame:
    """Predict the responses at the optimum.

    Parameters
    ----------
    models : list of Model
        A quadratic model for each response.
    best : Optimum
    targets : Targets
    runs : int
        Number of runs of the check.

    Returns
    -------
    pandas.DataFrame
        `response`, `target`, `predicted`, `standard_error`, and the ends of two 95 %
        intervals. If the model is right, the true mean lies between `mean_low` and
        `mean_high`, and the mean of the `runs` between `low` and `high`.
    """
    point = best.coded[None]
    table = pd.DataFrame({"response": targets.names, "target": targets.aim})
    table["predicted"] = [float(model.predict(point)[0]) for model in models]
    table["standard_error"] = [
        float(model.standard_error(point)[0]) for model in models
    ]
    t = np.array([_compute_t_quantile(model) for model in models])
    # The mean of the runs also scatters about the true mean.
    variance_of_mean = [model.variance / runs for model in models]
    error_of_runs = np.sqrt(table["standard_error"] ** 2 + variance_of_mean)
    table["mean_low"] = table["predicted"] - t * table["standard_error"]
    table["mean_high"] = table["predicted"] + t * table["standard_error"]
    table["low"] = table["predicted"] - t * error_of_runs
    table["high"] = table["predicted"] + t * error_of_runs
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
        A copy of `predicted` with the further columns `simulated`, the mean of the good
        samples, `simulated_error`, `deviation_percent`, and `as_predicted`, whether the
        mean lies between `low` and `high`. The mean is NaN without a good sample, its
        standard error with fewer than two.
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
