"""The strategy `refined` as rounds of proposals: `repose.strategies.refined.refine` says how one follows another."""

from dataclasses import replace

import numpy as np
import pandas as pd

from repose.chain.invert import invert
from repose.strategies.base import Answer, Batch, Studied, samples_of
from repose.strategies.published import strategy as published
from repose.strategies.published.strategy import answer_of, fitted, probability_of, support_of
from repose.strategies.refined import refine
from repose.strategies.refined.rounds import PROPOSAL, goes_on, judge, round_of, why_stopped
from repose.strategies.runs import next_number, samples_of_runs


def propose(study: Studied, data: pd.DataFrame) -> Batch | Answer:
    """The published batch; then rounds, each with many runs of the answer so far and a few of its neighbours.

    Every proposal repeats the fits and searches of all rounds before it, so it depends on the runs alone.
    """
    if data.empty:
        return published.propose(study, data)
    space, targets, config = study.parameters, study.targets, study.config
    section, seed, names = config["refine"], config["design"]["seed"], list(space.names)
    good = data[list(targets.names)].notna().all(axis=1)
    data = data.assign(status=np.where(good, "ok", "failed"), reason="")
    number = data["sample"].map(round_of)
    samples = samples_of_runs(data, space, targets)
    parts = [samples[samples["sample"].map(round_of) == k] for k in range(-1, int(number.max()) + 1)]
    model = fitted(study, parts[0], data[number < 0])
    inversion = invert(model, space, targets, config["miga"], support=support_of(study, data[number < 0]))
    before, k = None, 0
    while True:
        proposal = refine.propose(inversion.solutions, model, space, targets, section, k, seed)
        own = data[number == k]
        if own.empty:
            return Batch(proposal[["sample", *names, "seeds"]])
        verdict = judge(proposal, own, targets, section, k, names)
        verdict |= {"usable": int((parts[k + 1]["status"] == "ok").sum())}
        if k == section["rounds"] or not goes_on(verdict, before):
            why = why_stopped(verdict, section["rounds"], targets, before)
            return _simulated(answer_of(study, model, inversion, data, why), study, proposal, own)
        before, k = verdict, k + 1
        so_far, runs = refine.extended(parts[0], parts[1 : k + 1]), data[number < k]
        centre = proposal.iloc[0][names].astype(float).to_dict()
        support = support_of(study, runs)
        refit = fitted(study, so_far, runs)
        model, inversion = refine.search(refit, so_far, centre, space, targets, config, None, support)


def _simulated(answer, study, proposal, runs):
    """The answer with the simulated means of its own runs in place of the predicted ones."""
    space, targets = study.parameters, study.targets
    numbers = proposal.loc[proposal["role"] == PROPOSAL, "sample"]
    values = runs.loc[runs["sample"].isin(numbers) & (runs["status"] == "ok"), list(targets.names)]
    mean, covariance = values.mean().to_numpy(), values.cov().to_numpy() / max(len(values), 1)
    if len(values) <= len(targets) or np.linalg.matrix_rank(covariance) < len(targets):
        return answer
    samples = samples_of(space, space.unit(answer.values), study.config["refine"]["seeds"], next_number(runs))
    probability = probability_of(mean[None], covariance[None], targets)
    return replace(answer, mean=mean, covariance=covariance, probability=probability, samples=samples)
