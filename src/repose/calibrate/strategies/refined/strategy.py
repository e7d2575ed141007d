"""The strategy `refined` as rounds of proposals: `repose.calibrate.strategies.refined.refine` says how one follows another."""

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
    fitted,
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
from repose.common.errors import require


class Round(NamedTuple):
    """A proposal, with the fit and the search behind it."""

    training: Training
    model: Surrogate  # of the training, corrected near the last proposal
    inversion: Inversion
    proposal: pd.DataFrame  # of `refine.propose`


def follow(study: Study, data: pd.DataFrame, number: int) -> Round:
    """Make the round of a number from the runs of the design and of the rounds before it."""
    space, targets, settings = study.parameters, study.targets, study.settings
    allowed = f"below {OF_A_ROUND}, from where the samples of the rounds are numbered"
    require(
        settings.design.samples < OF_A_ROUND,
        "configuration",
        "design.samples",
        settings.design.samples,
        allowed,
    )
    data = data[data["sample"].map(round_of) < number]
    samples = samples_of_runs(data, space, targets)
    own = samples["sample"].map(round_of)
    samples["round"] = own.where(own >= 0).astype("Int64")
    training, support = fitted(study, samples, data)
    model = training.model
    if number == 0:
        inversion = invert(model, space, targets, settings.miga, support=support)
    else:
        centre = (
            samples[own == number - 1]
            .iloc[0][list(space.names)]
            .astype(float)
            .to_dict()
        )
        model, inversion = refine.search(model, samples, centre, study, support)
    return Round(
        training,
        model,
        inversion,
        refine.propose(inversion.solutions, model, study, number),
    )


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose the published batch; then rounds, each with many runs of the answer and a few of its neighbours."""
    if data.empty:
        return published.propose(study, data)
    targets, section = study.targets, study.settings.refine
    number = int(data["sample"].map(round_of).max())
    if number < 0:
        return _batch(
            follow(study, data, 0), {"why": "the answer of the search is simulated"}
        )
    now, runs = follow(study, data, number), runs_by_bench(data, targets)
    verdict = judge(now.proposal, runs, study, number)
    samples = samples_of_runs(data, study.parameters, targets)
    verdict["usable"] = int(
        samples.loc[samples["status"] == "ok", "sample"].map(round_of).eq(number).sum()
    )
    before = (
        {"objective": objective_of(jobs(section, number - 1), runs, targets)}
        if number
        else None
    )
    if number < section.rounds and goes_on(verdict, before):
        why = f"round {number} is {verdict['outcome']}: {verdict['reason']}"
        return _batch(follow(study, data, number + 1), {"row": verdict, "why": why})
    why = why_stopped(verdict, section.rounds, targets, before)
    best = answer_of(study, now.model, now.inversion, data, why, section.seeds)
    best = replace(
        best, notes={**best.notes, "row": verdict, **_end(verdict, why, study)}
    )
    return _simulated(best, study, now.proposal, data)


def _batch(following: Round, notes: dict[str, Any]) -> Batch:
    """Make the batch of a round; its notes also have the fit and the search behind it."""
    found = {"fit": following.training.metrics, "search": following.inversion.summary}
    return Batch(following.proposal, notes | found)


def _end(verdict: Mapping[str, Any], why: str, study: Study) -> dict[str, Any]:
    """Describe the end of the rounds, for the summary and the report."""
    solution = {name: verdict[name] for name in study.parameters.names}
    met, claimed = verdict["outcome"] == "within", claim(verdict, study.targets)
    steps = (
        f"Design: {study.settings.design.samples} parameter sets, and a search on their surrogate.",
        f"Rounds: {verdict['round'] + 1}, each of the search's answer and its neighbours. They stopped: {why}.",
        f"Simulated: {claimed}.",
    )
    summary = {
        "met": met,
        "rounds": verdict["round"] + 1,
        "solution": solution,
        "claim": claimed,
    }
    return {"summary": summary, "steps": steps}


def _simulated(
    answer: Answer, study: Study, proposal: pd.DataFrame, data: pd.DataFrame
) -> Answer:
    """Replace the answer's predicted means by the simulated means of its own runs."""
    targets = study.targets
    numbers = proposal.loc[proposal["role"] == PROPOSAL, "sample"]
    answer = replace(answer, simulated=tuple(numbers))
    values = data.loc[data["sample"].isin(numbers), list(targets.names)].dropna()
    mean, covariance = (
        values.mean().to_numpy(),
        values.cov().to_numpy() / max(len(values), 1),
    )
    if len(values) <= len(targets) or np.linalg.matrix_rank(covariance) < len(targets):
        return answer
    probability = probability_of(mean[None], covariance[None], targets)
    return replace(answer, mean=mean, covariance=covariance, probability=probability)
