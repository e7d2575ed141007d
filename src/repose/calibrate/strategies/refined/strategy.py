"""Proposals of the strategy `refined`: the published batch, then rounds.

`repose.calibrate.strategies.refined.refine` says how one round follows from another.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.inversion import Inversion, invert
from repose.calibrate.strategies.base import Answer, Batch
from repose.calibrate.strategies.published import strategy as published
from repose.calibrate.strategies.published.strategy import (
    answer_of,
    fit_surrogate,
    probability_of,
)
from repose.calibrate.strategies.refined import refine
from repose.calibrate.strategies.refined.rounds import (
    OF_A_ROUND,
    PROPOSAL,
    claim,
    goes_on,
    jobs,
    judge,
    objective_of,
    round_of,
    why_stopped,
)
from repose.calibrate.strategies.runs import runs_by_bench, samples_of_runs
from repose.calibrate.study import Study
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.training import Training
from repose.common.errors import InputError


class Round(NamedTuple):
    """A proposal, with the fit and the search behind it."""

    training: Training
    model: Surrogate  # of the training, corrected near the last proposal
    inversion: Inversion
    proposal: pd.DataFrame  # of `refine.propose`


def follow(study: Study, data: pd.DataFrame, number: int) -> Round:
    """Make a round from the runs of the design and of the rounds before it.

    Parameters
    ----------
    study : Study
    data : pandas.DataFrame
        All runs; those of this round and later ones are left out.
    number : int
        Of the round, from 0.
    """
    space = study.parameters
    settings = study.settings
    if settings.design.samples >= OF_A_ROUND:
        allowed = (
            f"below {OF_A_ROUND}, from where the samples of the rounds are numbered"
        )
        raise InputError(
            "configuration", "design.samples", settings.design.samples, allowed
        )
    earlier = data[data["sample"].map(round_of) < number]
    samples = samples_of_runs(earlier, space, study.targets)
    rounds = samples["sample"].map(round_of)
    samples["round"] = rounds.where(rounds >= 0).astype("Int64")
    training, support = fit_surrogate(study, samples, earlier)
    model = training.model
    if number == 0:
        inversion = invert(model, space, study.targets, settings.miga, support=support)
    else:
        # The proposal is the first sample of the last round.
        last_proposal = samples[rounds == number - 1].iloc[0]
        centre = last_proposal[list(space.names)].astype(float).to_dict()
        model, inversion = refine.search(model, samples, centre, study, support)
    proposal = refine.propose(inversion.solutions, model, study, number)
    return Round(training, model, inversion, proposal)


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose the published batch, then rounds, then answer."""
    if data.empty:
        return published.propose(study, data)
    number = int(data["sample"].map(round_of).max())
    if number < 0:
        why = "the answer of the search is simulated"
        return _batch(follow(study, data, 0), {"why": why})

    # Judge the last round by its runs.
    targets = study.targets
    section = study.settings.refine
    last_round = follow(study, data, number)
    runs = runs_by_bench(data, targets)
    verdict = judge(last_round.proposal, runs, study, number)
    verdict["usable"] = _count_usable(study, data, number)
    verdict_before = None
    if number > 0:
        objective = objective_of(jobs(section, number - 1), runs, targets)
        verdict_before = {"objective": objective}

    if number < section.rounds and goes_on(verdict, verdict_before):
        why = f"round {number} is {verdict['outcome']}: {verdict['reason']}"
        next_round = follow(study, data, number + 1)
        return _batch(next_round, {"row": verdict, "why": why})
    why = why_stopped(verdict, section.rounds, targets, verdict_before)
    answer = answer_of(
        study, last_round.model, last_round.inversion, data, why, section.seeds
    )
    notes = {**answer.notes, "row": verdict, **_notes_of_end(verdict, why, study)}
    answer = replace(answer, notes=notes)
    return _with_simulated_means(answer, study, last_round.proposal, data)


def _count_usable(study: Study, data: pd.DataFrame, number: int) -> int:
    """Count the good samples of a round."""
    samples = samples_of_runs(data, study.parameters, study.targets)
    good = samples.loc[samples["status"] == "ok", "sample"]
    return int(good.map(round_of).eq(number).sum())


def _batch(round_: Round, notes: Mapping[str, Any]) -> Batch:
    """Make the batch of a round; its notes also have the fit and the search behind it."""
    return Batch(
        round_.proposal,
        {**notes, "fit": round_.training.metrics, "search": round_.inversion.summary},
    )


def _notes_of_end(verdict: Mapping[str, Any], why: str, study: Study) -> dict[str, Any]:
    """Describe the end of the rounds, for the summary and the report."""
    n_rounds = verdict["round"] + 1
    simulated = claim(verdict, study.targets)
    steps = (
        f"Design: {study.settings.design.samples} parameter sets, and a search on their "
        "surrogate.",
        f"Rounds: {n_rounds}, each of the search's answer and its neighbours. They "
        f"stopped: {why}.",
        f"Simulated: {simulated}.",
    )
    summary = {
        "met": verdict["outcome"] == "within",
        "rounds": n_rounds,
        "solution": {name: verdict[name] for name in study.parameters.names},
        "claim": simulated,
    }
    return {"summary": summary, "steps": steps}


def _with_simulated_means(
    answer: Answer, study: Study, proposal: pd.DataFrame, data: pd.DataFrame
) -> Answer:
    """Replace the predicted means of the answer by the means of its own runs.

    They stay where the runs are too few for a covariance.
    """
    targets = study.targets
    numbers = proposal.loc[proposal["role"] == PROPOSAL, "sample"]
    answer = replace(answer, simulated=tuple(numbers))
    is_of_answer = data["sample"].isin(numbers)
    values = data.loc[is_of_answer, list(targets.names)].dropna()
    mean = values.mean().to_numpy()
    covariance = values.cov().to_numpy() / max(len(values), 1)
    if len(values) <= len(targets) or np.linalg.matrix_rank(covariance) < len(targets):
        return answer
    probability = probability_of(mean[None], covariance[None], targets)
    return replace(answer, mean=mean, covariance=covariance, probability=probability)
