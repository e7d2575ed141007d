"""The strategy `refined`: a design, single runs near the targets, then the answer.

`repose.calibrate.strategies.refined.places` chooses the places of the second stage.
docs/refinement.md explains why.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from repose.calibrate.inversion import invert
from repose.calibrate.seeds import PURPOSE_STREAMS
from repose.calibrate.strategies.base import Answer, Batch, samples_of
from repose.calibrate.strategies.published.strategy import (
    estimate_optimism_of_answer,
    fit_surrogate,
    make_answer,
    make_design_batch,
)
from repose.calibrate.strategies.refined.places import draw_near_targets
from repose.calibrate.strategies.runs import (
    find_next_sample,
    summarise_samples,
)
from repose.calibrate.study import Study
from repose.calibrate.training import Training


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose the design, then the second stage, and finally give the answer.

    The samples in `data` decide which comes next: no samples, the design; only samples
    of the design, the second stage; samples of both stages, the answer.

    Parameters
    ----------
    study : Study
        The study.
    data : pandas.DataFrame
        All runs so far, as in `Strategy.propose`; empty at the start.

    Returns
    -------
    Batch or Answer
    """
    settings = study.settings.refine
    if data.empty:
        return make_design_batch(study, settings.design_seeds)
    space = study.parameters
    samples = summarise_samples(data, space, study.targets)
    # `train_surrogate` uses samples with a number in the column `round` only for
    # training. So mark the second stage, and the test samples stay those of the design.
    is_second_stage = _mark_second_stage(samples["sample"], study)
    samples["round"] = (
        pd.Series(1, samples.index).where(is_second_stage).astype("Int64")
    )
    training, support = fit_surrogate(study, samples, data)
    if not is_second_stage.any():
        return _propose_second_stage(study, training, data)

    # Both stages are simulated: search on the surrogate of all runs. `support` is the
    # region that the good samples cover, in which the surrogate can be trusted.
    inversion = invert(
        training.model, space, study.targets, study.settings.miga, support=support
    )
    why = (
        "the parameter sets near the targets are simulated; the search on the surrogate "
        "of all runs gives the answer"
    )
    answer = make_answer(
        study, training.model, inversion, data, why, n_checks=settings.seeds
    )
    notes = {
        **answer.notes,
        "steps": _describe_steps(study, n_refined=int(is_second_stage.sum())),
        "fit": training.metrics,
        "optimism": estimate_optimism_of_answer(
            study, training, support, samples, data
        ),
    }
    return replace(answer, notes=notes)


def _describe_steps(study: Study, n_refined: int) -> tuple[str, ...]:
    """Describe in sentences the steps that led to the answer.

    `n_refined` is the number of samples of the second stage.
    """
    return (
        f"Design: {study.settings.design.samples} parameter sets, and a surrogate of "
        "their runs.",
        f"Second stage: {n_refined} parameter sets with which this surrogate may meet "
        "the targets, a run of each.",
        "Search: the surrogate of all runs, over the whole ranges.",
    )


def _mark_second_stage(numbers: pd.Series, study: Study) -> pd.Series:
    """Mark the samples of the second stage: their numbers follow those of the design."""
    return pd.to_numeric(numbers) > study.settings.design.samples


def _propose_second_stage(
    study: Study, training: Training, data: pd.DataFrame
) -> Batch:
    """Propose the second stage: single runs of parameter sets near the targets.

    Parameters
    ----------
    study : Study
        The study.
    training : Training
        The surrogate of the design.
    data : pandas.DataFrame
        All runs so far.

    Returns
    -------
    Batch
        The samples also have the responses that the surrogate predicts.
    """
    settings = study.settings.refine
    space = study.parameters
    random = np.random.default_rng(
        [study.settings.design.seed, PURPOSE_STREAMS["refined"]]
    )
    points = draw_near_targets(
        training.model,
        space,
        study.targets,
        count=settings.pours,
        tolerance_percent=settings.tolerance_percent,
        random=random,
    )
    # `_mark_second_stage` recognises these samples by their numbers, which must be
    # larger than the number of samples in the design.
    first_number = max(find_next_sample(data), study.settings.design.samples + 1)
    samples = samples_of(space, points, seeds=1, first=first_number)
    parameter_sets = samples[list(space.names)].to_numpy(float)
    # Add the predictions, to compare them with the runs later.
    samples[list(study.targets.predicted)] = training.model.predict(parameter_sets)
    why = (
        "the surrogate may meet the targets with these parameter sets; a run of each "
        "decides"
    )
    return Batch(samples, {"why": why, "fit": training.metrics})
