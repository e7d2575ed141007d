"""The strategy `published`: one design, then a search on the surrogate of its runs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.answer import WITHIN_COLUMNS
from repose.calibrate.designs import latin_hypercube as design
from repose.calibrate.inversion import Inversion, invert
from repose.calibrate.optimism import (
    ReplicateRuns,
    estimate_optimism,
    list_rows,
    make_representative_search,
)
from repose.calibrate.probability import compute_box_probability
from repose.calibrate.strategies.base import Answer, Batch, samples_of
from repose.calibrate.strategies.runs import (
    find_next_sample,
    split_by_bench,
    summarise_samples,
)
from repose.calibrate.study import Study
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.calibrate.training import Training, train_surrogate

NOT_LATIN_WARNING = (
    "the samples are spread evenly over what the constraints allow; they are not a "
    "Latin hypercube"
)


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose the design, or give the answer if the design was already simulated.

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
    space = study.parameters
    settings = study.settings
    if data.empty:
        return make_design_batch(study, settings.seeds)
    # Fit a surrogate to the means of the samples, and search on it by the genetic
    # algorithm (miga).
    samples = summarise_samples(data, space, study.targets)
    training, support = fit_surrogate(study, samples, data)
    inversion = invert(
        training.model, space, study.targets, settings.miga, support=support
    )
    why = "the batch is simulated, and the search on its surrogate gives the answer"
    answer = make_answer(
        study, training.model, inversion, data, why, n_checks=settings.seeds
    )
    # `Published.files` names the last three notes.
    notes = {
        **answer.notes,
        "optimism": estimate_optimism_of_answer(
            study, training, support, samples, data
        ),
        "metrics": training.metrics,
        "accuracy": training.predictions,
        "intervals": inversion.intervals,
    }
    return replace(answer, notes=notes)


def make_design_batch(study: Study, seeds: int) -> Batch:
    """Make the batch of the design, in which each sample has `seeds` runs."""
    space = study.parameters
    section = study.settings.design
    unit = design.make_points_in_space(
        space, section.samples, section.method, section.seed
    )
    notes = {"why": NOT_LATIN_WARNING} if space.constraints else {}
    return Batch(samples_of(space, unit, seeds), notes)


def fit_surrogate(
    study: Study, samples: pd.DataFrame, data: pd.DataFrame
) -> tuple[Training, Support]:
    """Fit the surrogate of the study.

    Parameters
    ----------
    study : Study
        The study.
    samples : pandas.DataFrame
        The samples to fit, from `summarise_samples`.
    data : pandas.DataFrame
        Their runs.

    Returns
    -------
    Training
        The fitted surrogate.
    Support
        The region that the good samples cover.
    """
    settings = study.settings
    names = study.parameters.names
    training = train_surrogate(
        samples,
        split_by_bench(data, study.targets),
        study.targets,
        settings.network,
        names=names,
        definitions={},
        source="runs",
        surrogate=settings.surrogate,
        scale=study.parameters.scale,
    )
    good = samples.loc[samples["status"] == "ok", list(names)].to_numpy(float)
    return training, Support.from_space(good, study.parameters)


def make_answer(
    study: Study,
    model: Surrogate,
    inversion: Inversion,
    data: pd.DataFrame,
    why: str,
    n_checks: int,
) -> Answer:
    """Make the answer from the representative solution of a search.

    The representative solution is the first one of the table of solutions, whether it
    is feasible or not (see `repose.calibrate.inversion.invert`).

    Parameters
    ----------
    study : Study
        The study.
    model : Surrogate
        The surrogate that was searched.
    inversion : Inversion
        The result of the search.
    data : pandas.DataFrame
        All runs so far.
    why : str
        Why no more runs are needed.
    n_checks : int
        Number of runs that check the answer.

    Returns
    -------
    Answer
        Its attribute `others` has the other feasible solutions.
    """
    space = study.parameters
    targets = study.targets
    solutions = inversion.solutions
    names = list(space.names)
    # `invert` puts the representative solution first.
    values = solutions.loc[0, names].to_numpy(float)
    is_other = solutions["feasible"] & ~solutions["representative"]
    others = solutions[is_other]
    # Predict the responses of the answer, and their covariance.
    mean = model.predict(values[None])
    covariance = model.covariance(values[None])
    # The answer becomes a new sample, whose runs check it.
    samples = samples_of(space, space.unit(values), n_checks, find_next_sample(data))
    return Answer(
        values=values,
        mean=mean[0],
        covariance=covariance[0],
        probability=compute_probabilities(mean, covariance, targets),
        samples=samples,
        why=why,
        others=others[names].to_numpy(float),
        others_mean=others[list(targets.predicted)].to_numpy(float),
        model=model,
        notes={"message": inversion.summary["message"], **_note_stop(inversion)},
    )


def _note_stop(inversion: Inversion) -> dict[str, Any]:
    """Return the notes `stop` and `summary` about a search that ended far from samples.

    There are no notes if the search ended near samples.
    """
    if "stop" not in inversion.summary:
        return {}
    stop = {"stop": inversion.summary["stop"]}
    return {**stop, "summary": stop}


def compute_probabilities(
    mean: np.ndarray, covariance: np.ndarray, targets: Targets
) -> dict[str, float]:
    """Compute the probabilities that an answer meets the targets.

    Parameters
    ----------
    mean : numpy.ndarray, (1, k)
        Predicted responses of the answer.
    covariance : numpy.ndarray, (1, k, k)
        Covariance of the predictions.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        The attribute `probability` of `Answer`: probabilities that the true means lie
        within a tolerance of all targets, one for each name in `WITHIN_COLUMNS`, and
        `inside` all ranges.
    """
    probabilities = {}
    for percent, name in WITHIN_COLUMNS.items():
        # `whole` is the number that counts as 100 % of each target.
        tolerance = percent * (targets.whole / 100)
        low = targets.aim - tolerance
        high = targets.aim + tolerance
        probabilities[name] = float(
            compute_box_probability(mean, covariance, low, high)[0]
        )
    inside = compute_box_probability(mean, covariance, targets.low, targets.high)
    probabilities["inside"] = float(inside[0])
    return probabilities


def estimate_optimism_of_answer(
    study: Study,
    training: Training,
    support: Support,
    samples: pd.DataFrame,
    data: pd.DataFrame,
) -> list[dict[str, object]]:
    """Estimate how much too good the prediction of the answer probably is.

    A search prefers parameter sets for which the noise makes the surrogate agree with
    the targets. So the predictions there are too near to the targets on average. This
    is the optimism.

    Parameters
    ----------
    study : Study
        The study.
    training : Training
        The surrogate of these runs.
    support : Support
        The region that the good samples cover.
    samples : pandas.DataFrame
        The samples to which the surrogate was fitted.
    data : pandas.DataFrame
        The runs of these samples.

    Returns
    -------
    list of dict
        A row for each response. It is empty if the noise cannot be estimated, because
        no sample has two runs, or if the key `miga.replicates` is 0.
    """
    settings = study.settings.miga
    runs_of_bench_tests = split_by_bench(data, study.targets)
    pours = ReplicateRuns.collect(
        training.model, samples, runs_of_bench_tests, study.targets
    )
    if pours is None or not settings.replicates:
        return []
    table = estimate_optimism(
        training.model,
        pours,
        make_representative_search(study.parameters, study.targets, settings, support),
        study.targets,
        replicates=settings.replicates,
        seed=settings.seed,
    )
    return list_rows(table)
