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
    """Choose the parameters that matter from the screening, and plan the ascent.

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
    names = list(targets.names)
    settings = study.settings.response_surface
    # Fit the models to the corners, and choose the parameters by them.
    corner_samples, centre_samples = split_corners_and_centre(table, settings.centres)
    models = fit_models(corner_samples, dataset, targets, "linear")
    kept = choose_factors(models, settings)

    # The ascent starts at the centre, so it needs the mean responses there. They have
    # the order of the targets.
    corner_means = select_good_samples(corner_samples, dataset)[names].mean()
    centre_means = select_good_samples(centre_samples, dataset)[names].mean()
    try:
        ascent_samples = make_ascent_samples(
            models, centre_means.to_numpy(), kept, study
        )
    except ValueError as error:
        raise InputError(
            source="runs",
            key="targets",
            value=str(error),
            allowed="models that show a direction towards the targets",
        ) from None

    # Describe the result. The result and the reason go into the notes.
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
        # The description begins with a blank and ends with a full stop, but `why` must
        # not end with one.
        why += "." + describe_new_runs(table).removesuffix(".")
    tables = make_analysis_tables("screening", models, targets)
    return ascent_samples, {**tables, "screening": result, "why": why}


def make_screening_samples(
    space: ParameterSpace, settings: ResponseSurfaceSettings
) -> pd.DataFrame:
    """Make the samples of the screening.

    First come the corners, samples in which every free parameter is at an end of its
    range. Then the centre is repeated `centres` times. Samples that violate a
    constraint are replaced with allowed ones. A run of the design is a sample.

    Parameters
    ----------
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
        If the runs that the constraints allow do not determine a linear model.
    """
    corners = plackett_burman(space.dimensions, settings.screening_runs)
    region = _make_region_of_ranges(space)
    # The linear model is fitted to the corners alone.
    allowed_corners = move_forbidden_runs(corners, region, "linear", space)
    centre = np.zeros(space.dimensions) if region is None else region.centre
    centre_runs = np.tile(centre, (settings.centres, 1))
    coded = np.vstack([allowed_corners.coded, centre_runs])
    # The runs of the centre replace forbidden ones if the centre of the cube, which is
    # 0 in coded units, is forbidden.
    is_moved = np.full(settings.centres, centre.any())
    is_new = np.append(allowed_corners.is_new, is_moved)
    unit_points = _convert_ranges_to_unit(coded)
    table = make_samples("screening", space, unit_points, space.free, coded)
    return add_new_run_column(table, is_new, space)


def _convert_ranges_to_unit(coded: np.ndarray) -> np.ndarray:
    """Convert coded units over the whole ranges, -1 to 1, to the unit cube, 0 to 1."""
    return (1 + coded) / 2


def _make_region_of_ranges(space: ParameterSpace) -> Region | None:
    """Make the allowed region of the whole ranges; None if all of it is allowed."""
    return make_region(space, _convert_ranges_to_unit, space.dimensions)


def split_corners_and_centre(
    table: pd.DataFrame, centres: int
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Split the samples of the screening into the corners and the last `centres` ones."""
    return table[:-centres], table[-centres:]


def fit_models(
    table: pd.DataFrame, dataset: pd.DataFrame, targets: Targets, order: str
) -> list[Model]:
    """Fit a polynomial to the good samples of a step, for each response.

    Parameters
    ----------
    table : pandas.DataFrame
        The samples of the step, from `make_samples`, with their coded factors.
    dataset : pandas.DataFrame
        The samples of all steps so far, with their statuses and responses.
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
        If the good samples do not determine all coefficients.
    """
    samples = select_good_samples(table, dataset)
    factors = list_factors(table)
    coded = samples[[CODED_PREFIX + name for name in factors]].to_numpy(float)
    models = []
    for name in targets.names:
        response = samples[name].to_numpy(float)
        try:
            model = fit_model(coded, response, factors, order)
        except ValueError as error:
            # This is the only error of `fit_model`: too few different samples.
            raise InputError(
                source="runs",
                key="samples that are ok",
                value=str(error),
                allowed="enough for the model",
            ) from None
        models.append(model)
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
            # `make_table` returns a new table, which may be changed here.
            part = make_table(model)
            part.insert(0, "response", response)
            parts.append(part)
        # `ResponseSurface.files` has the same names, for the files of the workflow.
        tables[f"{step}_{name}"] = pd.concat(parts, ignore_index=True)
    return tables


def choose_factors(models: list[Model], settings: ResponseSurfaceSettings) -> list[str]:
    """Choose the parameters of the next steps, the most significant first.

    A parameter is significant if its effect on at least one response is. If there are
    fewer significant parameters than the surface needs, the next ones are added. At
    most `most_factors` are kept.
    """
    p_of_models = [list_effects(model).set_index("term")["p"] for model in models]
    # Rank each factor by its most significant effect. Ties keep the usual order.
    least_p = pd.concat(p_of_models, axis=1).min(axis=1)
    ranking = least_p.reindex(models[0].factors).sort_values(kind="stable")
    n_significant = int((ranking < settings.significance).sum())
    count = min(max(n_significant, settings.min_factors), settings.most_factors)
    return list(ranking.index[:count])


def make_ascent_samples(
    models: list[Model], centre_means: np.ndarray, kept: list[str], study: Study
) -> pd.DataFrame:
    """Make samples along the steepest ascent from the centre towards the targets.

    The path ends at the edge of the ranges. A point that violates a constraint is
    replaced by the nearest allowed one, so the path continues along the edge of the
    constraint.

    Parameters
    ----------
    models : list of Model
        A linear model for each response.
    centre_means : numpy.ndarray, (k,)
        The mean responses at the centre, in the order of the targets.
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
    # Collect the slopes (responses, kept parameters) of the models. The factors of the
    # models are all free parameters.
    factor_numbers = [models[0].factors.index(name) for name in kept]
    slopes = np.array([model.coefficients[factor_numbers] for model in models])
    direction = ascent.compute_ascent_direction(
        slopes, targets.aim - centre_means, compute_scale(targets)
    )
    # Start at the centre of the ranges, or of their allowed part. `start` has all free
    # parameters in coded units.
    region_of_ranges = _make_region_of_ranges(space)
    start = np.zeros(space.dimensions)
    if region_of_ranges is not None:
        start = region_of_ranges.centre
    kept_columns = [space.free.index(name) for name in kept]

    def convert_to_unit(coded: np.ndarray) -> np.ndarray:
        """Convert coded points of the kept parameters to points of the unit cube.

        The other parameters stay at the start.
        """
        all_coded = np.repeat(start[None], len(coded), axis=0)
        all_coded[:, kept_columns] = coded
        return _convert_ranges_to_unit(all_coded)

    # Make the path in coded units of the kept parameters.
    steps = study.settings.response_surface.steps
    path = ascent.make_ascent_path(direction, steps, start[kept_columns])
    region = make_region(space, convert_to_unit, len(kept))
    if region is not None:
        path = np.array([region.find_nearest(point) for point in path])
    return make_samples("ascent", space, convert_to_unit(path), kept, path)
