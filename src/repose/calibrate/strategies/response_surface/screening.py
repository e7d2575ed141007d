"""The screening: find the parameters that matter, and the direction to the targets.

A Plackett-Burman design over the whole ranges shows which parameters matter. The
screening also has runs at the centre of the ranges, where the path of ascent begins. If
the response is curved, the mean of the corners does not estimate the response there.

If constraints forbid a corner, a D-optimal run takes its place. If the path of ascent
meets a constraint, it follows the constraint: each point is the nearest allowed one.
"""

from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.designs import ascent
from repose.calibrate.designs.anova import (
    compute_pareto_limits,
    compute_statistics,
    list_effects,
    make_anova_table,
)
from repose.calibrate.designs.model import Model, fit_model
from repose.calibrate.designs.plackett_burman import plackett_burman
from repose.calibrate.designs.region import Region
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.response_surface import ResponseSurfaceSettings
from repose.calibrate.strategies.response_surface.steps import (
    CODED_PREFIX,
    add_new_run_column,
    compute_scale,
    count_new_runs,
    describe_new_runs,
    list_factors,
    make_region,
    make_samples,
    move_forbidden_runs,
    select_good_samples,
)
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.common.errors import InputError


def _tabulate_effects(model: Model) -> pd.DataFrame:
    """Make the table of effects, with the two limits of the Pareto chart."""
    columns = {
        f"limit_{name}": limit for name, limit in compute_pareto_limits(model).items()
    }
    return list_effects(model).assign(**columns)


def _tabulate_statistics(model: Model) -> pd.DataFrame:
    """Make the table of statistics, which has a single row."""
    return pd.DataFrame([compute_statistics(model)])


# For each kind of table, the function that makes it from a model.
TABLE_MAKERS = {
    "anova": make_anova_table,
    "effects": _tabulate_effects,
    "statistics": _tabulate_statistics,
}


def analyse_screening(
    study: Study, table: pd.DataFrame, dataset: pd.DataFrame
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Analyse the samples of the screening.

    Parameters
    ----------
    study : Study
        The study.
    table : pandas.DataFrame
        The samples, from `make_screening_samples`.
    dataset : pandas.DataFrame
        All samples with their responses.

    Returns
    -------
    pandas.DataFrame
        The samples of the ascent.
    dict
        Notes of the proposal: the tables that analyse the models, a mapping `screening`
        with the result, and a sentence `why`.

    Raises
    ------
    InputError
        If the models show no direction towards the targets.
    """
    targets = study.targets
    names = targets.names
    section = study.settings.response_surface
    corner_samples, centre_samples = split_corners_and_centre(table, section.centres)
    models = fit_models(corner_samples, dataset, targets, "linear")
    corner_means = select_good_samples(corner_samples, dataset)[list(names)].mean()
    centre_means = select_good_samples(centre_samples, dataset)[list(names)].mean()
    kept = choose_factors(models, section)
    try:
        ascent_samples = make_ascent_samples(
            models, centre_means.to_numpy(), kept, study
        )
    except ValueError as error:
        raise InputError(
            source="runs",
            key="targets",
            value=str(error),
            allowed="a way towards the targets",
        ) from None

    # Describe the result.
    dropped = [name for name in study.parameters.free if name not in kept]
    result = {
        "kept": kept,
        "dropped": dropped,
        "centre": centre_means.to_dict(),
        "corners": corner_means.to_dict(),
    }
    why = f"kept {', '.join(kept)}; dropped {', '.join(dropped) or 'none'}"
    n_new_runs = count_new_runs(table)
    if n_new_runs > 0:
        result["new_runs"] = n_new_runs
        why += "." + describe_new_runs(table).removesuffix(".")
    tables = make_analysis_tables("screening", models, targets)
    return ascent_samples, {**tables, "screening": result, "why": why}


def make_screening_samples(
    space: ParameterSpace, section: ResponseSurfaceSettings
) -> pd.DataFrame:
    """Make the samples of the screening.

    First come the corners, samples in which every free parameter is at an end of its
    range. Then the centre is repeated `centres` times. Runs that violate a constraint
    are replaced by allowed ones.

    Returns
    -------
    pandas.DataFrame
        See `make_samples`.

    Raises
    ------
    InputError
        If allowed runs do not determine a linear model.
    """
    corners = plackett_burman(space.dimensions, section.screening_runs)
    region = _make_region_of_ranges(space)
    # The linear model is fitted to the corners alone.
    runs = move_forbidden_runs(corners, region, "linear", space)
    centre = np.zeros(space.dimensions) if region is None else region.centre
    coded = np.vstack([runs.coded, np.tile(centre, (section.centres, 1))])
    is_new = np.append(runs.is_new, np.full(section.centres, centre.any()))
    table = make_samples("screening", space, (1 + coded) / 2, space.free, coded)
    return add_new_run_column(table, is_new, space)


def _make_region_of_ranges(space: ParameterSpace) -> Region | None:
    """Make the allowed region of the whole ranges; None if all of it is allowed."""
    return make_region(space, lambda coded: (1 + coded) / 2, space.dimensions)


def split_corners_and_centre(
    table: pd.DataFrame, centres: int
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Split the samples of the screening into the corners and the last `centres` ones."""
    return table[:-centres], table[-centres:]


def fit_models(
    table: pd.DataFrame, dataset: pd.DataFrame, targets: Targets, order: str
) -> list[Model]:
    """Fit a polynomial to the samples of a step, for each response.

    Parameters
    ----------
    table : pandas.DataFrame
        The samples of the step.
    dataset : pandas.DataFrame
        All samples with their responses.
    targets : Targets
        The targets of the study.
    order : str
        Order of the polynomial, as in `repose.calibrate.designs.model.fit_model`.

    Returns
    -------
    list of Model
        One for each response.

    Raises
    ------
    InputError
        If too few samples are usable.
    """
    samples = select_good_samples(table, dataset)
    factors = list_factors(table)
    coded = samples[[CODED_PREFIX + name for name in factors]].to_numpy(float)
    models = []
    for name in targets.names:
        response = samples[name].to_numpy(float)
        try:
            models.append(fit_model(coded, response, factors, order))
        except ValueError as error:
            raise InputError(
                source="runs",
                key="samples that are ok",
                value=str(error),
                allowed="enough for the model",
            ) from None
    return models


def make_analysis_tables(
    step: str, models: list[Model], targets: Targets
) -> dict[str, pd.DataFrame]:
    """Make the tables that analyse the models of a step, such as the ANOVA table.

    Parameters
    ----------
    step : str
        Name of the step, with which the names of the tables begin.
    models : list of Model
        One for each response.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        A table for each of `TABLE_MAKERS` by name. It has the rows of all responses,
        and its first column is `response`.
    """
    tables: dict[str, pd.DataFrame] = {}
    for name, make_table in TABLE_MAKERS.items():
        parts = []
        for response, model in zip(targets.names, models, strict=True):
            part = make_table(model)
            part.insert(0, "response", response)
            parts.append(part)
        tables[f"{step}_{name}"] = pd.concat(parts, ignore_index=True)
    return tables


def choose_factors(models: list[Model], section: ResponseSurfaceSettings) -> list[str]:
    """Choose the parameters of the next steps, the most significant first.

    A parameter is significant if its effect on at least one response is. If there are
    fewer significant parameters than the surface needs, the next ones are added. At
    most `most_factors` are kept.
    """
    p_of_models = [list_effects(model).set_index("term")["p"] for model in models]
    # Rank each factor by its most significant effect. Ties keep the usual order.
    least_p = pd.concat(p_of_models, axis=1).min(axis=1)
    ranking = least_p.reindex(models[0].factors).sort_values(kind="stable")
    n_significant = int((ranking < section.significance).sum())
    count = min(max(n_significant, section.fewest_factors), section.most_factors)
    return list(ranking.index[:count])


def make_ascent_samples(
    models: list[Model], centre: np.ndarray, kept: list[str], study: Study
) -> pd.DataFrame:
    """Make samples along the steepest ascent from the centre towards the targets.

    The path ends at the edge of the ranges. A point that violates a constraint is
    replaced by the nearest allowed one, so the path continues along the edge of the
    constraint.

    Parameters
    ----------
    models : list of Model
        A linear model for each response.
    centre : numpy.ndarray, (k,)
        The mean responses at the centre.
    kept : list of str
        Names of the parameters that are varied. The others stay at the centre.
    study : Study
        The study.

    Returns
    -------
    pandas.DataFrame
        The samples along the path, from `make_samples`.

    Raises
    ------
    ValueError
        If the models show no direction towards the targets.
    """
    space = study.parameters
    targets = study.targets
    # Collect the slopes (responses, kept parameters) of the models.
    factor_numbers = [models[0].factors.index(name) for name in kept]
    slopes = np.array([model.coefficients[factor_numbers] for model in models])
    direction = ascent.compute_ascent_direction(
        slopes, targets.aim - centre, compute_scale(targets)
    )
    # Start at the centre of the ranges, or of their allowed part.
    region_of_ranges = _make_region_of_ranges(space)
    start = np.zeros(space.dimensions)
    if region_of_ranges is not None:
        start = region_of_ranges.centre
    columns = [space.free.index(name) for name in kept]

    def convert_to_unit(coded: np.ndarray) -> np.ndarray:
        """Convert coded points of the kept parameters to points of the unit cube."""
        unit = np.repeat((1 + start[None]) / 2, len(coded), axis=0)
        unit[:, columns] = (1 + coded) / 2
        return unit

    steps = study.settings.response_surface.steps
    coded = ascent.make_ascent_path(direction, steps, start[columns])
    region = make_region(space, convert_to_unit, len(kept))
    if region is not None:
        coded = np.array([region.find_nearest(point) for point in coded])
    return make_samples("ascent", space, convert_to_unit(coded), kept, coded)
