"""Proposals of the strategy `published`: a Latin hypercube, then the answer of a search on its surrogate."""

import numpy as np
import pandas as pd

from repose.calibrate.answer import WITHIN
from repose.calibrate.designs import latin_hypercube as design
from repose.calibrate.inversion import Inversion, invert
from repose.calibrate.probability import within
from repose.calibrate.strategies.base import Answer, Batch, samples_of
from repose.calibrate.strategies.runs import next_number, runs_by_bench, samples_of_runs
from repose.calibrate.study import Study
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.calibrate.training import Training, train


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose one batch, then answer."""
    if data.empty:
        section = study.settings.design
        unit = design.points(
            section.samples, study.parameters.dimensions, section.method, section.seed
        )
        return Batch(samples_of(study.parameters, unit, study.settings.seeds))
    training, support = fitted(
        study, samples_of_runs(data, study.parameters, study.targets), data
    )
    inversion = invert(
        training.model,
        study.parameters,
        study.targets,
        study.settings.miga,
        support=support,
    )
    why = "the batch is simulated: the search on its surrogate answers"
    return answer_of(study, training.model, inversion, data, why, study.settings.seeds)


def fitted(
    study: Study, samples: pd.DataFrame, data: pd.DataFrame
) -> tuple[Training, Support]:
    """Fit the surrogate of the study to the samples of its runs; return also the region that the good ones cover."""
    settings, names, runs = (
        study.settings,
        study.parameters.names,
        runs_by_bench(data, study.targets),
    )
    good = samples.loc[samples["status"] == "ok", list(names)].to_numpy(float)
    training = train(
        samples,
        runs,
        study.targets,
        settings.network,
        names=names,
        definitions={},
        source="runs",
        surrogate=settings.surrogate,
    )
    return training, Support.of(good, study.parameters)


def answer_of(
    study: Study,
    model: Surrogate,
    found: Inversion,
    data: pd.DataFrame,
    why: str,
    seeds: int,
) -> Answer:
    """Answer with the representative solution of a search, and the other feasible ones."""
    space, targets, solutions = study.parameters, study.targets, found.solutions
    names = list(space.names)
    values = solutions.loc[0, names].to_numpy(float)
    others = solutions[solutions["feasible"] & ~solutions["representative"]]
    mean, covariance = model.predict(values[None]), model.covariance(values[None])
    return Answer(
        values=values, mean=mean[0], covariance=covariance[0],
        probability=probability_of(mean, covariance, targets),
        samples=samples_of(space, space.unit(values), seeds, next_number(data)), why=why,
        others=others[names].to_numpy(float), others_mean=others[list(targets.predicted)].to_numpy(float),
        model=model, notes={"message": found.summary["message"]},
    )  # fmt: skip


def probability_of(
    mean: np.ndarray, covariance: np.ndarray, targets: Targets
) -> dict[str, float]:
    """Compute the probabilities that means (1, k) lie within 1 % and 2 % of all targets, and `inside` all ranges."""
    near = {
        column: percent * (targets.whole / 100) for percent, column in WITHIN.items()
    }
    ends = {
        column: (targets.aim - reach, targets.aim + reach)
        for column, reach in near.items()
    }
    ends["inside"] = targets.low, targets.high
    return {
        name: float(within(mean, covariance, *pair)[0]) for name, pair in ends.items()
    }
