"""Proposals of the strategy `response_surface`: each step follows from the runs of the steps before it."""

from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.strategies.base import Answer, Batch, samples_of
from repose.calibrate.strategies.published.strategy import probability_of
from repose.calibrate.strategies.response_surface import screening, surface
from repose.calibrate.strategies.runs import next_number, samples_of_runs
from repose.calibrate.study import Study


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose the next step's samples, or answer; the notes are the tables of all steps so far, and `why` in words."""
    space, section = study.parameters, study.settings.response_surface
    notes: dict[str, Any] = {}

    def batch(table: pd.DataFrame) -> Batch:
        return Batch(table.assign(seeds=section.seeds), notes)

    table = screening.design(space, section)
    if _lacks(data, table):
        return batch(table)
    targets = study.targets
    dataset = samples_of_runs(data, space, targets)
    climb, found = screening.screened(study, table, dataset)
    notes |= found
    if _lacks(data, climb):
        return batch(climb)
    points = surface.walked(climb, dataset, targets)
    table = surface.design(points, space, section)
    nearest = points[points["best"]].iloc[0]
    why = f"sample {nearest['sample']} is nearest to the targets, {nearest['error_percent']:.2f} % off"
    notes |= {"path": points, "why": why}
    if _lacks(data, table):
        return batch(table)
    models = screening.models_of(table, dataset, targets, "quadratic")
    best = surface.best_point(models, targets)
    check = surface.check_samples(table, best, space, section.checks)
    notes |= screening.analysis("surface", models, targets) | {"surface": table}
    notes |= surface.notes(models, best, check, study)
    if _lacks(data, check):
        return batch(check)
    others, predicted = surface.alternatives(models, table, study)
    unit = surface.natural_unit(table, best.coded, space)
    mean, covariance = (
        best.predicted,
        np.diag(notes["predictions"]["standard_error"] ** 2),
    )
    poured = dataset[dataset["sample"].isin(check["sample"])]
    notes |= {
        "check": surface.checked(notes["predictions"], poured),
        "summary": {"surfaces_meet_targets": best.met},
    }
    screened = f"{section.screening_runs} runs of a Plackett-Burman design and {section.centres} of the centre"
    models_of_it = "a quadratic model for each response, and its optimum"
    notes["steps"] = (
        f"Screening: {screened}; kept: {', '.join(notes['screening']['kept'])}.",
        "Steepest ascent towards the targets, to the best point of the path.",
        f"Surface: {len(table)} parameter sets about it ({section.surface}), {models_of_it}.",
    )
    return Answer(
        values=space.values(unit)[0], mean=mean, covariance=covariance,
        probability=probability_of(mean[None], covariance[None], targets),
        samples=samples_of(space, unit, section.checks, next_number(data)),
        why="the optimum of the surfaces is simulated", others=others, others_mean=predicted, notes=notes,
        simulated=tuple(check["sample"]),
    )  # fmt: skip


def _lacks(data: pd.DataFrame, table: pd.DataFrame) -> bool:
    """Return whether a step is not simulated yet."""
    return data.empty or not data["sample"].isin(table["sample"]).any()
