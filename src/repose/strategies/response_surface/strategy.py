"""Proposals of the strategy `response_surface`: each step follows from the runs of the steps before it."""

from typing import Any

import numpy as np
import pandas as pd

from repose.strategies.base import Answer, Batch, Studied, samples_of
from repose.strategies.published.strategy import probability_of
from repose.strategies.response_surface import screening, surface
from repose.strategies.runs import next_number, samples_of_runs


def propose(study: Studied, data: pd.DataFrame) -> Batch | Answer:
    """The samples of the next step, or the answer; the notes are the tables of the last step, and `why` in words."""
    space, section = study.parameters, study.config["response_surface"]

    def batch(table: pd.DataFrame, **notes: Any) -> Batch:
        return Batch(table.assign(seeds=section["seeds"]), notes)

    table = screening.design(space, section)
    if _lacks(data, table):
        return batch(table)
    targets = study.targets
    dataset = samples_of_runs(data, space, targets)
    found = screening.screened(table, dataset, space, targets, section, "runs")
    if _lacks(data, found.path):
        return batch(found.path, **screening.notes(found, space, targets))
    points = surface.walked(found.path, dataset, targets)
    table = surface.design(points, space, section)
    if _lacks(data, table):
        best = points[points["best"]].iloc[0]
        why = f"sample {best['sample']} is nearest to the targets, {best['error_percent']:.2f} % off"
        return batch(table, path=points, why=why)
    models = screening.models_of(table, dataset, targets, "quadratic", "runs")
    best = surface.best_point(models, targets)
    check = surface.check_samples(table, best, space, section)
    notes = screening.analysis(models, targets)._asdict()
    notes |= surface.notes(models, best, check, space, targets)
    if _lacks(data, check):
        return batch(check, **notes)
    others, predicted = surface.alternatives(models, table, space, targets, study.config)
    unit = surface.natural_unit(table, best.coded, space)
    error = np.array([float(model.standard_error(best.coded[None])[0]) for model in models])
    mean, covariance = best.predicted, np.diag(error**2)
    poured = dataset[dataset["sample"].isin(check["sample"])]
    return Answer(
        space.values(unit)[0],
        mean,
        covariance,
        probability_of(mean[None], covariance[None], targets),
        samples_of(space, unit, section["checks"], next_number(data)),
        "the optimum of the surfaces is simulated",
        others,
        predicted,
        notes=notes | {"check": surface.checked(notes["predictions"], poured)},
    )


def _lacks(data, table):
    """Whether a step is not simulated yet."""
    return data.empty or not data["sample"].isin(table["sample"]).any()
