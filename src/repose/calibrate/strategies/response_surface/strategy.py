"""The strategy `response_surface`: screening, ascent, surface and check, step by step."""

from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.strategies.base import Answer, Batch, samples_of
from repose.calibrate.strategies.published.strategy import compute_probabilities
from repose.calibrate.strategies.response_surface import (
    ResponseSurfaceSettings,
    screening,
    surface,
)
from repose.calibrate.strategies.response_surface.steps import (
    count_new_runs,
    describe_new_runs,
    list_factors,
)
from repose.calibrate.strategies.runs import find_next_sample, summarise_samples
from repose.calibrate.study import Study


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose the samples of the next step, or give the answer after the last step.

    Each step is computed again from the runs of the previous steps. The first step
    without runs is proposed. The notes have the tables of all steps so far, and `why`,
    a sentence that explains the last decision.

    Parameters
    ----------
    study : Study
        The study.
    data : pandas.DataFrame
        All runs so far, as in `Strategy.propose`; empty at the start.
    """
    space = study.parameters
    targets = study.targets
    settings = study.settings.response_surface
    notes: dict[str, Any] = {}

    def batch(samples: pd.DataFrame) -> Batch:
        return Batch(samples.assign(seeds=settings.seeds), notes)

    # Screen the parameters.
    screening_samples = screening.make_screening_samples(space, settings)
    if _is_not_simulated(data, screening_samples):
        return batch(screening_samples)
    dataset = summarise_samples(data, space, targets)

    # Follow the steepest ascent of those that matter.
    ascent_samples, screening_notes = screening.analyse_screening(
        study, screening_samples, dataset
    )
    notes |= screening_notes
    if _is_not_simulated(data, ascent_samples):
        return batch(ascent_samples)

    # Design a surface about the best point of the path.
    points = surface.rank_path_points(ascent_samples, dataset, targets)
    nearest = points[points["best"]].iloc[0]
    notes["path"] = points
    notes["why"] = (
        f"sample {nearest['sample']} is nearest to the targets, "
        f"{nearest['error_percent']:.2f} % off"
    )
    surface_samples = surface.make_surface_samples(points, space, settings)
    if count_new_runs(surface_samples):
        sentence = describe_new_runs(surface_samples)
        notes["why"] += "." + sentence.removesuffix(".")
    if _is_not_simulated(data, surface_samples):
        return batch(surface_samples)

    # Simulate the optimum of the surface.
    models = screening.fit_models(surface_samples, dataset, targets, "quadratic")
    region = surface.make_surface_region(surface_samples, space)
    optimum = surface.find_best_point(models, targets, region)
    check = surface.make_check_samples(surface_samples, optimum, space, settings.checks)
    notes |= screening.make_analysis_tables("surface", models, targets)
    notes["surface"] = surface_samples
    notes |= surface.make_notes(models, optimum, check, study)
    if _is_not_simulated(data, check):
        return batch(check)

    # Answer with it.
    checked = dataset[dataset["sample"].isin(check["sample"])]
    notes["check"] = surface.add_check(notes["predictions"], checked)
    notes["summary"] = {"surfaces_meet_targets": optimum.met}
    notes["steps"] = _describe_steps(settings, screening_samples, surface_samples)
    unit_points = surface.convert_to_unit_cube(surface_samples, optimum.coded, space)
    mean = optimum.predicted
    covariance = np.diag(notes["predictions"]["standard_error"] ** 2)
    others = surface.find_alternatives(models, surface_samples, study)
    return Answer(
        values=space.values(unit_points)[0],
        mean=mean,
        covariance=covariance,
        probability=compute_probabilities(mean[None], covariance[None], targets),
        samples=samples_of(space, unit_points, settings.checks, find_next_sample(data)),
        why="the optimum of the surfaces is simulated",
        others=others.sets,
        others_mean=others.mean,
        notes=notes,
        simulated=tuple(check["sample"]),
    )


def _describe_steps(
    settings: ResponseSurfaceSettings,
    screening_samples: pd.DataFrame,
    surface_samples: pd.DataFrame,
) -> tuple[str, ...]:
    """Describe in sentences the steps that led to the answer."""
    kept = ", ".join(list_factors(surface_samples))
    return (
        f"Screening: {settings.screening_runs} runs of a Plackett-Burman design and "
        f"{settings.centres} of the centre; kept: {kept}."
        f"{describe_new_runs(screening_samples)}",
        "Steepest ascent towards the targets, to the best point of the path.",
        f"Surface: {len(surface_samples)} parameter sets about it ({settings.surface}), "
        "a quadratic model for each response, and its optimum."
        f"{describe_new_runs(surface_samples)}",
    )


def _is_not_simulated(data: pd.DataFrame, samples: pd.DataFrame) -> bool:
    """Return whether no sample of a step is simulated yet."""
    return data.empty or not data["sample"].isin(samples["sample"]).any()
