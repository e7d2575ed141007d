"""Second and third step: a second-order design about the best point of the path, its models and their optimum."""

from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.designs.model import Model
from repose.calibrate.designs.optimum import Optimum, optimum
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.answer import separated
from repose.calibrate.strategies.response_surface import ResponseSurfaceSettings
from repose.calibrate.strategies.response_surface.steps import (
    CODED,
    factors_of,
    samples,
    scale_of,
    usable,
)
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets

LEVEL = 0.95  # of the intervals
POINTS = 2048  # of the cube, searched for parameter sets inside the ranges


def walked(
    table: pd.DataFrame, dataset: pd.DataFrame, targets: Targets
) -> pd.DataFrame:
    """Select the usable points of the path of ascent; add `error_percent` and `best`.

    `error_percent` is the weighted root mean square of the relative misses.
    """
    points = usable(table, dataset)
    off = points[list(targets.names)].to_numpy(float) / targets.aim - 1
    points["error_percent"] = 100 * np.sqrt(
        (targets.weight * off**2).sum(axis=1) / targets.weight.sum()
    )
    points["best"] = points.index == points["error_percent"].idxmin()
    return points


def design(
    points: pd.DataFrame, space: ParameterSpace, section: ResponseSurfaceSettings
) -> pd.DataFrame:
    """Design the surface about the best point of the path, moved where a factor would leave its range.

    The outermost level of a factor lies `reach` of its range from the centre.
    """
    factors, reach = factors_of(points), section.reach
    coded, outermost = section.coded(len(factors))
    middle = space.unit(points.loc[points["best"], list(space.names)].to_numpy(float))
    places = [space.free.index(name) for name in factors]
    unit = np.repeat(middle, len(coded), axis=0)
    unit[:, places] = (
        np.clip(middle[:, places], reach, 1 - reach) + reach / outermost * coded
    )
    return samples("surface", space, unit, factors, coded)


def best_point(models: list[Model], targets: Targets) -> Optimum:
    """Find the optimum of the quadratic models, one for each target, inside the cube of the design."""
    return optimum(models, targets.aim, scale_of(targets), targets.low, targets.high)


def natural_unit(
    table: pd.DataFrame, points: np.ndarray, space: ParameterSpace
) -> np.ndarray:
    """Convert points (n, factors) or (factors,) in coded units to points (n, d) in the unit cube of the ranges.

    `table` has the samples of the surface.
    """
    unit = space.unit(table[list(space.names)].to_numpy(float))
    points = np.atleast_2d(points)
    natural = np.repeat(unit[:1], len(points), axis=0)
    for name, value in zip(factors_of(table), points.T, strict=True):
        # every factor has a low and a high level; natural levels are linear in coded levels
        place, coded = space.free.index(name), table[CODED + name].to_numpy(float)
        low, high = coded.argmin(), coded.argmax()
        slope = (unit[high, place] - unit[low, place]) / (coded[high] - coded[low])
        natural[:, place] = unit[low, place] + slope * (value - coded[low])
    return natural


def alternatives(
    models: list[Model], table: pd.DataFrame, study: Study
) -> tuple[np.ndarray, np.ndarray]:
    """Find parameter sets (n, p) of the design's cube with predictions (n, k) inside all ranges, the best first."""
    from scipy.stats import qmc

    space, targets, settings = study.parameters, study.targets, study.settings
    coded = (
        2 * qmc.Sobol(len(models[0].factors), rng=settings.design.seed).random(POINTS)
        - 1
    )
    predicted = np.column_stack([model.predict(coded) for model in models])
    inside = np.all((predicted >= targets.low) & (predicted <= targets.high), axis=1)
    order = np.argsort(
        (((predicted - targets.aim) / scale_of(targets)) ** 2).sum(axis=1),
        kind="stable",
    )
    order = order[inside[order]]
    unit = natural_unit(table, coded[order], space)
    kept = separated(unit, settings.miga)
    return space.values(unit[kept]), predicted[order][kept]


def check_samples(
    table: pd.DataFrame, best: Optimum, space: ParameterSpace, count: int
) -> pd.DataFrame:
    """Repeat the optimum `count` times, as samples of the check."""
    unit = np.repeat(natural_unit(table, best.coded, space), count, axis=0)
    return samples(
        "check",
        space,
        unit,
        factors_of(table),
        np.repeat(best.coded[None], count, axis=0),
    )


def notes(
    models: list[Model], best: Optimum, check: pd.DataFrame, study: Study
) -> dict[str, Any]:
    """Collect predictions and parameters at the optimum, and the result in words; `check` has the samples of the check.

    `met` is whether the surfaces meet the targets.
    """
    parameters = check.loc[0, list(study.parameters.names)].astype(float).to_dict()
    coded = dict(zip(models[0].factors, best.coded.tolist(), strict=True))
    optimum = {
        "parameters": parameters,
        "coded": coded,
        "met": best.met,
        "desirability": best.desirability,
    }
    why = f"the surfaces {'meet' if best.met else 'do not meet'} the targets: {parameters}"
    return {
        "predictions": predictions(models, best, study.targets, len(check)),
        "optimum": optimum,
        "why": why,
    }


def predictions(
    models: list[Model], best: Optimum, targets: Targets, runs: int
) -> pd.DataFrame:
    """Predict the responses at the optimum, with the 95 % interval of the mean, `mean_low` to `mean_high`.

    With 95 % probability the mean of some `runs` lies from `low` to `high` if the model is right.
    """
    from scipy import stats

    table = pd.DataFrame({"response": targets.names, "target": targets.aim})
    table["predicted"] = [float(model.predict(best.coded[None])[0]) for model in models]
    table["standard_error"] = [
        float(model.standard_error(best.coded[None])[0]) for model in models
    ]
    t = np.array(
        [
            float(stats.t.ppf((1 + LEVEL) / 2, model.df)) if model.df else np.nan
            for model in models
        ]
    )
    whole = np.sqrt(
        table["standard_error"] ** 2 + [model.variance / runs for model in models]
    )
    for name, error in (("mean_", table["standard_error"]), ("", whole)):
        table[f"{name}low"], table[f"{name}high"] = (
            table["predicted"] - t * error,
            table["predicted"] + t * error,
        )
    return table


def checked(predicted: pd.DataFrame, dataset: pd.DataFrame) -> pd.DataFrame:
    """Add the simulations of the check to the `predictions`; `as_predicted`: the mean lies from low to high."""
    table, ok = predicted.copy(), dataset[dataset["status"] == "ok"]
    values = ok[list(table["response"])].to_numpy(float)
    table["simulated"] = values.mean(axis=0) if len(ok) else np.nan
    table["simulated_error"] = (
        values.std(axis=0, ddof=1) / np.sqrt(len(ok)) if len(ok) > 1 else np.nan
    )
    table["deviation_percent"] = 100 * (table["simulated"] / table["target"] - 1)
    table["as_predicted"] = table["simulated"].between(table["low"], table["high"])
    return table
