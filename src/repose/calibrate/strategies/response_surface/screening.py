"""The screening: which parameters matter, and which way leads to the targets.

A Plackett-Burman design over the whole ranges shows these parameters. Runs at the centre
belong to the screening: the mean of the corners is no estimate of the centre where the
response is curved, and the path must know on which side of the targets it begins.
"""

from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.designs import ascent
from repose.calibrate.designs.anova import anova, effects, limits, statistics
from repose.calibrate.designs.model import Model, fit
from repose.calibrate.designs.plackett_burman import plackett_burman
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.response_surface import ResponseSurfaceSettings
from repose.calibrate.strategies.response_surface.steps import (
    CODED,
    factors_of,
    good_samples,
    samples,
    scale_of,
)
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.common.errors import InputError


def _effects_with_limits(model: Model) -> pd.DataFrame:
    """Make the table of effects, with the two limits of the Pareto chart."""
    columns = {f"limit_{name}": limit for name, limit in limits(model).items()}
    return effects(model).assign(**columns)


def _statistics(model: Model) -> pd.DataFrame:
    """Make the table of statistics, one row."""
    return pd.DataFrame([statistics(model)])


# Tables of a model by name, as in `repose.calibrate.designs.anova`.
TABLES = {
    "anova": anova,
    "effects": _effects_with_limits,
    "statistics": _statistics,
}


def analyse_screening(
    study: Study, table: pd.DataFrame, dataset: pd.DataFrame
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Analyse the samples of the screening.

    Parameters
    ----------
    study : Study
    table : pandas.DataFrame
        The samples, from `design`.
    dataset : pandas.DataFrame
        All samples with their responses.

    Returns
    -------
    pandas.DataFrame
        The samples of the ascent.
    dict
        Notes: the tables of the models, the result `screening`, and `why`.

    Raises
    ------
    InputError
        If the models show no direction towards the targets.
    """
    targets = study.targets
    names = targets.names
    corner_samples, centre_samples = corners_and_centre(table)
    models = fit_models(corner_samples, dataset, targets, "linear")
    centre_means = good_samples(centre_samples, dataset)[list(names)].mean()
    kept = kept_factors(models, study.settings.response_surface)
    try:
        ascent_samples = path(models, centre_means.to_numpy(), kept, study)
    except ValueError as error:
        raise InputError(
            "runs", "targets", str(error), "a way towards the targets"
        ) from None

    dropped = [name for name in study.parameters.free if name not in kept]
    # The constant of a model is the mean response of the corners.
    corner_means = {
        name: float(model.constant) for name, model in zip(names, models, strict=True)
    }
    result = {
        "kept": kept,
        "dropped": dropped,
        "centre": centre_means.to_dict(),
        "corners": corner_means,
    }
    why = f"kept {', '.join(kept)}; dropped {', '.join(dropped) or 'none'}"
    tables = analysis_tables("screening", models, targets)
    return ascent_samples, {**tables, "screening": result, "why": why}


def design(space: ParameterSpace, section: ResponseSurfaceSettings) -> pd.DataFrame:
    """List the samples of the screening.

    Every free parameter is at an end of its range; the centre follows `centres` times.
    """
    corners = plackett_burman(space.dimensions, section.screening_runs)
    centre = np.zeros((section.centres, space.dimensions))
    coded = np.vstack([corners, centre])
    return samples("screening", space, (1 + coded) / 2, space.free, coded)


def corners_and_centre(table: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Split the samples of the screening into the corners and the centre."""
    coded = table[[CODED + name for name in factors_of(table)]]
    is_centre = (coded == 0).all(axis=1)
    return table[~is_centre], table[is_centre]


def fit_models(
    table: pd.DataFrame, dataset: pd.DataFrame, targets: Targets, order: str
) -> list[Model]:
    """Fit a polynomial to each response of a step.

    Parameters
    ----------
    table : pandas.DataFrame
        The samples of the step.
    dataset : pandas.DataFrame
        All samples with their responses.
    targets : Targets
    order : str
        Order of the polynomial, as in `repose.calibrate.designs.model.fit`.

    Raises
    ------
    InputError
        If too few samples are usable.
    """
    rows = good_samples(table, dataset)
    factors = factors_of(table)
    coded = rows[[CODED + name for name in factors]].to_numpy(float)
    models = []
    for name in targets.names:
        try:
            models.append(fit(coded, rows[name].to_numpy(float), factors, order))
        except ValueError as error:
            raise InputError(
                "runs", "samples that are ok", str(error), "enough for the model"
            ) from None
    return models


def analysis_tables(
    step: str, models: list[Model], targets: Targets
) -> dict[str, pd.DataFrame]:
    """Make the tables of the models of a step, as in `repose.calibrate.designs.anova`.

    Parameters
    ----------
    step : str
        The name of a table begins with it.
    models : list of Model
        One for each response.
    targets : Targets

    Returns
    -------
    dict
        The tables of `TABLES` by name, each with the rows of all responses. Their first
        column is `response`.
    """
    tables: dict[str, pd.DataFrame] = {}
    for name, make_table in TABLES.items():
        parts = []
        for response, model in zip(targets.names, models, strict=True):
            part = make_table(model)
            part.insert(0, "response", response)
            parts.append(part)
        tables[f"{step}_{name}"] = pd.concat(parts, ignore_index=True)
    return tables


def kept_factors(models: list[Model], section: ResponseSurfaceSettings) -> list[str]:
    """Choose the parameters of the next steps, the most significant first.

    They are significant for at least one response. If these are fewer than the surface
    needs, the next ones follow; beyond `most_factors` they are dropped.
    """
    p_of_models = [effects(model).set_index("term")["p"] for model in models]
    # A factor counts by its most significant effect. Equals stay in the usual order.
    least_p = pd.concat(p_of_models, axis=1).min(axis=1)
    ranking = least_p.reindex(models[0].factors).sort_values(kind="stable")
    n_significant = int((ranking < section.significance).sum())
    count = min(max(n_significant, section.fewest_factors), section.most_factors)
    return list(ranking.index[:count])


def path(
    models: list[Model], centre: np.ndarray, kept: list[str], study: Study
) -> pd.DataFrame:
    """Sample the steepest ascent from the centre of the ranges towards the targets.

    It ends at the edge of the ranges.

    Parameters
    ----------
    models : list of Model
        A linear model for each response.
    centre : numpy.ndarray, (k,)
        The mean responses at the centre.
    kept : list of str
        The parameters that are varied.
    study : Study

    Raises
    ------
    ValueError
        If the models show no direction towards the targets.
    """
    space = study.parameters
    targets = study.targets
    # The slopes (responses, kept factors) of the models.
    order = [models[0].factors.index(name) for name in kept]
    slopes = np.array([model.coefficients[order] for model in models])
    direction = ascent.ascent_direction(slopes, targets.aim - centre, scale_of(targets))
    coded = ascent.path(direction, study.settings.response_surface.steps)
    # Keep the other parameters at 0.5 in the unit cube, which is 0 in coded units.
    unit = np.full((len(coded), space.dimensions), 0.5)
    columns = [space.free.index(name) for name in kept]
    unit[:, columns] += coded / 2
    return samples("ascent", space, unit, kept, coded)
