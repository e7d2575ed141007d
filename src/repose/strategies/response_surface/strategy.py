"""Proposals of the strategy `response_surface`: each step follows from the runs of the steps before it."""

import numpy as np
import pandas as pd

from repose.strategies.base import Answer, Batch, Studied, samples_of
from repose.strategies.published.strategy import probability_of
from repose.strategies.response_surface import screening, surface
from repose.strategies.runs import next_number, samples_of_runs


def propose(study: Studied, data: pd.DataFrame) -> Batch | Answer:
    """The samples of the next step, or the answer."""
    space, targets, section = study.parameters, study.targets, study.config["response_surface"]

    def batch(table):
        return Batch(table[["sample", *space.names]].assign(seeds=section["seeds"]))

    table = screening.design(space, section)
    if _lacks(data, table):
        return batch(table)
    dataset = samples_of_runs(data, space, targets)
    path = screening.screened(table, dataset, space, targets, section, "runs").path
    if _lacks(data, path):
        return batch(path)
    table = surface.design(surface.walked(path, dataset, targets), space, section)
    if _lacks(data, table):
        return batch(table)
    models = screening.models_of(table, dataset, targets, "quadratic", "runs")
    best = surface.best_point(models, targets)
    check = surface.check_samples(table, best, space, section)
    if _lacks(data, check):
        return batch(check)
    others, predicted = surface.alternatives(models, table, space, targets, study.config)
    unit = surface.natural_unit(table, best.coded, space)
    error = np.array([float(model.standard_error(best.coded[None])[0]) for model in models])
    mean, covariance = best.predicted, np.diag(error**2)
    return Answer(
        space.values(unit)[0],
        mean,
        covariance,
        probability_of(mean[None], covariance[None], targets),
        samples_of(space, unit, section["checks"], next_number(data)),
        "the optimum of the surfaces is simulated",
        others,
        predicted,
    )


def _lacks(data, table):
    """Whether a step is not simulated yet."""
    return data.empty or not data["sample"].isin(table["sample"]).any()
