"""Proposals of each method for the targets, from one set of simulated samples.

  best_sample        the simulated sample whose means lie nearest to the target: no model at all
  linear             plane by least squares, inverted by a local search
  quadratic          all squares and products, ridge by leave-one-out, inverted by a local search
  network            the surrogate as the study trains it, inverted by a local search
  network_miga       the same surrogate, inverted by the island genetic algorithm
  network_all        the surrogate trained on all of the samples, no validation or test part, local search

The local search is SLSQP on the squared deviations in widths of the targets' ranges, from the centre of the parameters'
ranges and from random points; another start replaces the centre's only where it comes nearer by more than NEARER.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy import optimize

from repose.bench.parameters import PARAMETERS
from repose.calibrate import training as train
from repose.calibrate.inversion import restrict_to_free_parameters
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.objective import Objective, search_points
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.surrogates import Surrogate, make
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.support import compute_quadratic_terms
from repose.calibrate.targets import Targets
from research.comparison.points import Points

METHODS = (
    "best_sample",
    "linear",
    "quadratic",
    "network",
    "network_miga",
    "network_all",
)
NEARER = 1e-4
RIDGES = np.geomspace(1e-4, 1e2, 13)
Model = Callable[[np.ndarray], np.ndarray]


def surface(unit: np.ndarray, means: np.ndarray, terms: Model) -> Model:
    """Fit a surface by ridge regression with leave-one-out, from places (m, d) to responses (m, k).

    `unit` (n, d) are places of the samples in the ranges, `means` (n, k) their responses; `terms` maps places to the
    terms of the surface (m, t).
    """
    from sklearn.linear_model import RidgeCV

    models = [
        RidgeCV(RIDGES, fit_intercept=False).fit(terms(unit), y - y.mean())
        for y in means.T
    ]
    return lambda x: (
        np.column_stack([m.predict(terms(np.atleast_2d(x))) for m in models])
        + means.mean(axis=0)
    )


def plane(unit: np.ndarray, means: np.ndarray) -> Model:
    """Fit a plane by least squares; arguments and result as for `surface`."""
    X = np.column_stack([np.ones(len(unit)), unit])
    found = np.linalg.lstsq(X, means, rcond=None)[0]
    return lambda x: (
        np.column_stack([np.ones(len(np.atleast_2d(x))), np.atleast_2d(x)]) @ found
    )


def local_search(
    respond: Model,
    objective: Objective,
    dimensions: int,
    starts: int,
    random: np.random.Generator,
) -> tuple[np.ndarray, int]:
    """Search by SLSQP, a local method, on the squared deviations from the targets.

    It starts from the centre of the ranges and from random points, and returns the best place (d,) in the ranges, from
    0 to 1, and the number of evaluations of the model.
    """
    evaluations = 0

    def deviation(x):
        nonlocal evaluations
        evaluations += 1
        residuals = (
            respond(np.clip(x, 0, 1)[None])[0] - objective.target
        ) / objective.width
        return float(residuals @ residuals)

    best: Any = None
    for start in [
        np.full(dimensions, 0.5),
        *random.uniform(size=(starts - 1, dimensions)),
    ]:
        # tighter than its default, which ends far from the minimum of a squared deviation
        found = optimize.minimize(
            deviation,
            start,
            method="SLSQP",
            bounds=[(0, 1)] * dimensions,
            options={"ftol": 1e-12},
        )
        if best is None or found.fun < best.fun - NEARER:
            best = found
    return np.clip(best.x, 0, 1), evaluations


def tables_of(
    samples: Points, space: ParameterSpace, targets: Targets
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Put the samples into the two tables of the dataset stage: samples with means and errors, and their good runs.

    `samples.X` (n, d) are places in the ranges; the responses are those of the targets, in their order.
    """
    table = pd.DataFrame(space.values(samples.X), columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(len(table)))
    table["status"] = "ok"
    columns = zip(targets.responses, samples.means().T, samples.errors().T, strict=True)
    for response, mean, error in columns:
        table[response.name] = mean
        table[response.standard_error] = error
    good = samples.good()
    runs = pd.DataFrame(samples.values[good], columns=list(targets.names))
    runs.insert(0, "sample", np.nonzero(good)[0])
    runs["status"] = "ok"
    return table, runs


def study_surrogate(
    samples: Points,
    space: ParameterSpace,
    targets: Targets,
    settings: Mapping[str, Any],
) -> Surrogate:
    """Train the surrogate as the study does on these samples; `settings` is the section `network`."""
    kind = settings.get("surrogate", "network")
    network_settings = NetworkSettings.from_keys(settings)
    dataset, runs = tables_of(samples, space, targets)
    return train.train_surrogate(
        dataset, runs, targets, network_settings, names=space.names, surrogate=kind
    ).model


def proposed(
    samples: Points,
    space: ParameterSpace,
    targets: Targets,
    settings: Mapping[str, Any],
    random: np.random.Generator,
) -> dict[str, tuple[np.ndarray, int]]:
    """Find the proposal of each method: place in the ranges (d,), from 0 to 1, and number of evaluations of the model.

    `samples.X` (n, d) are places in the ranges. `settings` holds ``local_starts`` and the sections ``network`` and
    ``miga``.
    """
    means = samples.means()
    section = settings["network"]
    objective = Objective(targets)
    F, V = objective(means)
    found = {"best_sample": (samples.X[objective.fitness(F, V).argmin()], 0)}
    surrogate = study_surrogate(samples, space, targets, section)
    everything = make(
        section.get("surrogate", "network"),
        NetworkSettings.from_keys(section),
        "network.surrogate",
    )
    noise = samples.replicates() if section.get("replicates", False) else {}
    models = {
        "linear": plane(samples.X, means),
        "quadratic": surface(samples.X, means, compute_quadratic_terms),
        "network": lambda x: surrogate.predict(space.values(x)),
        "network_all": everything.fit(samples.X, means, **noise).predict,
    }
    for name, model in models.items():
        found[name] = local_search(
            model, objective, space.dimensions, settings["local_starts"], random
        )
    islands = MigaSettings.model_construct(
        **{**settings["miga"], "seed": int(random.integers(2**31))}
    )
    respond = restrict_to_free_parameters(surrogate, space)
    archive, history, _ = search_points(respond, objective, space.dimensions, islands)
    found["network_miga"] = ((archive.points[0] + 1) / 2, history[-1][2])
    return found
