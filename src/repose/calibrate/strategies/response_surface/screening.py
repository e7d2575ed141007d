"""First step: which parameters matter, by a Plackett-Burman design over the whole ranges; then the path of ascent.

Runs at the centre belong to the screening. The mean of the corners is no estimate of the centre where the response is
curved, and the path must know on which side of the targets it begins.
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
    samples,
    scale_of,
    usable,
)
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.common.errors import InputError

# Tables of a model by name, as in `repose.calibrate.designs.anova`.
TABLES = {
    "anova": anova,
    "effects": lambda model: effects(model).assign(
        **{f"limit_{k}": v for k, v in limits(model).items()}
    ),
    "statistics": lambda model: pd.DataFrame([statistics(model)]),
}


def screened(
    study: Study, table: pd.DataFrame, dataset: pd.DataFrame
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Analyse the screening's samples: return the samples of the ascent, and tables, result and a message as notes.

    InputError if they show no way towards the targets.
    """
    targets = study.targets
    corners, middle = corners_and_centre(table)
    models = models_of(corners, dataset, targets, "linear")
    centre = usable(middle, dataset)[list(targets.names)].mean()
    kept = kept_factors(models, study.settings.response_surface)
    try:
        climb = path(models, centre.to_numpy(), kept, study)
    except ValueError as error:
        raise InputError(
            "runs", "targets", str(error), "a way towards the targets"
        ) from None
    dropped = [name for name in study.parameters.free if name not in kept]
    means = dict(
        zip(targets.names, (float(model.constant) for model in models), strict=True)
    )
    result = {
        "kept": kept,
        "dropped": dropped,
        "centre": centre.to_dict(),
        "corners": means,
    }
    why = f"kept {', '.join(kept)}; dropped {', '.join(dropped) or 'none'}"
    return climb, {
        **analysis("screening", models, targets),
        "screening": result,
        "why": why,
    }


def design(space: ParameterSpace, section: ResponseSurfaceSettings) -> pd.DataFrame:
    """List the screening's samples: every free parameter at an end of its range; then the centre, `centres` times."""
    corners = plackett_burman(space.dimensions, section.screening_runs)
    coded = np.vstack([corners, np.zeros((section.centres, space.dimensions))])
    return samples("screening", space, (1 + coded) / 2, space.free, coded)


def corners_and_centre(table: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Split the samples of the screening into the corners and the centre."""
    at_centre = (table[[CODED + name for name in factors_of(table)]] == 0).all(axis=1)
    return table[~at_centre], table[at_centre]


def models_of(
    table: pd.DataFrame, dataset: pd.DataFrame, targets: Targets, order: str
) -> list[Model]:
    """Fit a polynomial to each response of a step (`fit`); InputError for too few usable samples."""
    runs, factors = usable(table, dataset), factors_of(table)
    coded = runs[[CODED + name for name in factors]].to_numpy(float)
    try:
        return [
            fit(coded, runs[target.name].to_numpy(float), factors, order)
            for target in targets
        ]
    except ValueError as error:
        raise InputError(
            "runs", "samples that are ok", str(error), "enough for the model"
        ) from None


def analysis(
    step: str, models: list[Model], targets: Targets
) -> dict[str, pd.DataFrame]:
    """Make the tables of a step's models, as in `repose.calibrate.designs.anova`, with the column `response` first.

    The effects also have the two limits of the Pareto chart.
    """
    tables: dict[str, pd.DataFrame] = {}
    for name, table_of in TABLES.items():
        joined = pd.concat(
            dict(zip(targets.names, map(table_of, models), strict=True)),
            names=["response", None],
        )
        tables[f"{step}_{name}"] = joined.reset_index("response").reset_index(drop=True)
    return tables


def kept_factors(models: list[Model], section: ResponseSurfaceSettings) -> list[str]:
    """Choose the parameters of the next steps: significant for at least one response, the most significant first.

    If fewer are significant than the surface needs, the next are taken; of more than `most_factors` the last are
    dropped.
    """
    tables = [effects(model).set_index("term")["p"] for model in models]
    best = (
        pd.concat(tables, axis=1)
        .min(axis=1)
        .reindex(models[0].factors)
        .sort_values(kind="stable")
    )
    count = int((best < section.significance).sum())
    return list(
        best.index[: min(max(count, section.fewest_factors), section.most_factors)]
    )


def path(
    models: list[Model], centre: np.ndarray, kept: list[str], study: Study
) -> pd.DataFrame:
    """Sample the steepest ascent from the centre of the ranges towards the targets, to the edge of the ranges.

    `centre` (k,) has the mean responses there. ValueError if the linear models show no way towards the targets.
    """
    space, targets = study.parameters, study.targets
    order = [models[0].factors.index(name) for name in kept]
    slopes = np.array([model.coefficients[order] for model in models])
    along = ascent.towards(slopes, targets.aim - centre, scale_of(targets))
    coded = ascent.path(along, study.settings.response_surface.steps)
    unit = np.full((len(coded), space.dimensions), 0.5)
    unit[:, [space.free.index(name) for name in kept]] += coded / 2
    return samples("ascent", space, unit, kept, coded)
