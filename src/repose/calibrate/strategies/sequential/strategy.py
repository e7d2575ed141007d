"""The strategy `sequential`: after each batch it proposes the next one, or the answer.

A kriging model determines where the next batch is simulated, and when to stop.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.answer import ENDS_NOT_SIMULATED, WITHIN_COLUMNS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import compute_box_probability
from repose.calibrate.strategies.base import SO_FAR, Answer, Batch, samples_of
from repose.calibrate.strategies.runs import (
    check_responses,
    describe_failures,
    find_next_sample,
)
from repose.calibrate.strategies.sequential.advise import (
    Advice,
    advise,
    find_alternatives,
    find_nearest,
    find_nearest_ends,
    has_run_at,
    make_start,
    no_point_meets,
    rank_points,
)
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import (
    Kriging,
    ObservedSamples,
    SpaceKriging,
)
from repose.calibrate.strategies.sequential.noise import Noise, find_noise
from repose.calibrate.strategies.sequential.optimism import (
    estimate_optimism_of_answer,
)
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.common.errors import InputError

NEAREST_REMARK = "the answer is the nearest"
NO_RUN_AT_END_REMARK = (
    "there is no run at an end of a range where the targets may be met, so simulate "
    "there"
)
# A sentence for each value of `Advice.stop`, the reason to stop.
STOP_SENTENCES = {
    "probability": "the answer meets the targets with the requested probability",
    "out_of_reach": f"probably no parameter set meets the targets: {NEAREST_REMARK}",
    "budget": "the budget of runs is used up",
    "noise": (
        "the remaining runs cannot make the answer more probable: the noise is "
        "too large"
    ),
}
# Notes of `_describe_state` that go into the summary of the answer.
SUMMARY_NOTES = ("answer", "probability", "stop", "needed", "in_reach", "nearest")
# Before another start, the responses are checked only if there are at least this many
# good samples for each failed one.
MIN_GOOD_PER_FAILED = 2


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose the next batch, or answer if there is a reason to stop.

    Parameters
    ----------
    study : Study
        The study.
    data : pandas.DataFrame
        All runs so far, as in `Strategy.propose`; empty at the start.

    Returns
    -------
    Batch or Answer
        The first batch, a further batch, another first batch (if too many samples
        failed), or the answer.
    """
    if data.empty:
        return _propose_start(study, data, notes={})
    space = study.parameters
    settings = study.settings.sequential
    goal = _make_goal(study)
    observed = arrange_runs(data, space, study.targets)
    try:
        # None means that the model estimates the noise from replicates.
        noise = find_known_noise(study, observed)
        advice = advise(
            observed, goal, settings, len(data), _make_generator(study, data), noise
        )
    except (InputError, ValueError) as error:
        # The runs do not determine a model. This raises an error if further runs would
        # not help.
        return _propose_another_start(study, data, observed, error)
    notes = _describe_state(advice, study)
    if advice.stop is None:
        first_number = find_next_sample(data)
        samples = samples_of(space, advice.batch, settings.seeds, first_number)
        return Batch(samples, notes)

    # There is a reason to stop, so return the answer.
    final_notes = notes | _describe_end(notes, study, data)
    return give_answer(
        study,
        data,
        advice.answer,
        is_nearest=advice.is_nearest,
        why=notes["why"],
        notes=final_notes,
        model=advice.model,
    )


def _propose_start(study: Study, data: pd.DataFrame, notes: Mapping[str, Any]) -> Batch:
    """Make the first batch, whose samples are spread over the whole ranges.

    Parameters
    ----------
    study : Study
        The study.
    data : pandas.DataFrame
        The runs so far. It is empty, unless most samples of an earlier start failed.
    notes : mapping
        The notes of the batch, as in `Batch`.

    Returns
    -------
    Batch
        As many samples as the key `start_samples` says, but no more than the budget
        allows.
    """
    space = study.parameters
    settings = study.settings.sequential
    # With the number of runs in the seed of the random numbers, another start has other
    # points.
    random_seed = study.settings.design.seed + len(data)
    unit_points = make_start(space, settings, random_seed)
    # `most_pours` is the budget of runs, and `seeds` the number of runs per sample.
    n_affordable = (settings.most_pours - len(data)) // settings.seeds
    first_number = 1 if data.empty else find_next_sample(data)
    samples = samples_of(
        space, unit_points[:n_affordable], settings.seeds, first_number
    )
    return Batch(samples, notes)


def _propose_another_start(
    study: Study, data: pd.DataFrame, observed: ObservedSamples, error: ValueError
) -> Batch:
    """Propose a further batch over the whole ranges if too few samples are good.

    It is for runs to which no model can be fitted.

    Parameters
    ----------
    study : Study
        The study.
    data : pandas.DataFrame
        The runs so far.
    observed : ObservedSamples
        The same runs as arrays.
    error : ValueError
        The error that the model raised.

    Returns
    -------
    Batch

    Raises
    ------
    InputError
        If enough samples are good, so that the model failed for another reason, or if
        the budget does not allow a further sample.
    """
    settings = study.settings.sequential
    n_failed = len(observed.failed)
    n_good = len(observed.unit_points)
    # First check the responses. If many samples failed, skip this check, because equal
    # responses of the few others may be a coincidence.
    if n_good >= MIN_GOOD_PER_FAILED * n_failed:
        check_responses(data, study.targets)
    has_too_few = n_good < settings.start_samples
    # `_propose_start` makes fewer samples if the budget is nearly used up, but it needs
    # at least one, which has `seeds` runs.
    can_afford_sample = len(data) + settings.seeds <= settings.most_pours
    if not (has_too_few and can_afford_sample):
        # The new error describes the old one, so leave the old one out of the message.
        raise _make_input_error(error, data, study.targets) from None
    why = (
        f"{n_failed} samples failed, and the other {n_good} are too few for a model, "
        "so another start follows"
    )
    return _propose_start(study, data, notes={"why": why})


def give_answer(
    study: Study,
    data: pd.DataFrame,
    point: np.ndarray | None = None,
    is_nearest: bool = False,
    why: str = SO_FAR,
    notes: Mapping[str, Any] | None = None,
    model: Kriging | None = None,
) -> Answer:
    """Make the answer that the runs so far lead to.

    Parameters
    ----------
    study : Study
        The study.
    data : pandas.DataFrame
        The runs so far.
    point : numpy.ndarray, (d,), optional
        The answer in the unit cube, if it is already chosen from the same runs. By
        default it is the point most likely to meet the targets, or the nearest one if
        none is predicted to meet them.
    is_nearest : bool, optional
        Whether `point` is the nearest one.
    why : str, optional
        Why no more runs are needed.
    notes : mapping, optional
        Further results, as in `Answer`.
    model : Kriging, optional
        The model of the same runs, if it is already fitted.

    Returns
    -------
    Answer

    Raises
    ------
    InputError
        If the runs do not determine a model.
    """
    space = study.parameters
    targets = study.targets
    observed = arrange_runs(data, space, targets)
    if model is None:
        try:
            model = Kriging(observed, find_known_noise(study, observed))
        except ValueError as error:
            raise _make_input_error(error, data, targets) from None
    # Find the best points, and further parameter sets that meet the targets.
    goal = _make_goal(study)
    ranking = rank_points(model, goal, observed, _make_generator(study, data))
    others = find_alternatives(ranking, model, targets, study.settings.miga)

    # Choose the answer if the caller has not, and explain this choice.
    all_notes = dict(notes or {})
    reasons = [why]
    if point is None:
        point = ranking.best
        # If no point is predicted to meet the targets, the point with the highest
        # probability is merely the one with the most uncertain prediction. Then the
        # nearest point is a better answer.
        is_nearest = no_point_meets(model, goal, ranking)
        if is_nearest:
            point = find_nearest(model, goal, observed, ranking.points)
            if not _are_ends_simulated((point, ranking.best), observed):
                reasons.append(NO_RUN_AT_END_REMARK)
                all_notes["stop"] = ENDS_NOT_SIMULATED
            reasons.append(NEAREST_REMARK)

    # Estimate how much too favourable the prediction is: by refits to runs that are
    # drawn again, each with a choice of its own.
    def choose_point(refitted: Kriging) -> np.ndarray:
        refitted_ranking = rank_points(
            refitted, goal, observed, _make_generator(study, data)
        )
        if not is_nearest:
            return refitted_ranking.best
        return find_nearest(refitted, goal, observed, refitted_ranking.points)

    all_notes["optimism"] = estimate_optimism_of_answer(
        study, data, model, choose_point
    )

    # Predict the responses of the answer. The functions take arrays of points, so make
    # an array of this single one.
    points = point[None]
    mean, covariance = model.predict(points)
    n_checks = study.settings.sequential.checks
    return Answer(
        values=space.values(points)[0],
        mean=mean[0],
        covariance=covariance[0],
        probability=_compute_probabilities(mean, covariance, targets, space),
        samples=samples_of(space, points, n_checks, find_next_sample(data)),
        why="; ".join(reasons),
        others=space.values(others.points),
        others_mean=others.mean,
        model=SpaceKriging(model, space),
        notes=all_notes,
    )


def _are_ends_simulated(
    points: Iterable[np.ndarray], observed: ObservedSamples
) -> bool:
    """Return whether runs were made at the ends of ranges where the points (d,) lie.

    A response may be steep at an end. Without a run there, it is unknown whether the
    targets are out of reach, even if the model predicts it.
    """
    return all(
        has_run_at(find_nearest_ends(point[None]), observed.simulated)
        for point in points
    )


def _compute_probabilities(
    mean: np.ndarray, covariance: np.ndarray, targets: Targets, space: ParameterSpace
) -> dict[str, float]:
    """Compute the probabilities that an answer meets the targets.

    Parameters
    ----------
    mean : numpy.ndarray, (1, k)
        Predicted mean responses of the answer.
    covariance : numpy.ndarray, (1, k, k)
        Covariance of these predictions.
    targets : Targets
        The targets of the study.
    space : ParameterSpace
        The parameters of the study. They do not change the result.

    Returns
    -------
    dict
        The attribute `probability` of `Answer`.
    """
    probabilities = {}
    # Each tolerance in percent has its own name in the result.
    for percent, column in WITHIN_COLUMNS.items():
        goal = Goal.from_targets(targets, percent, space)
        probabilities[column] = float(goal.probability(mean, covariance)[0])
    inside = compute_box_probability(mean, covariance, targets.low, targets.high)
    probabilities["inside"] = float(inside[0])
    return probabilities


def _make_input_error(
    error: ValueError, data: pd.DataFrame, targets: Targets
) -> InputError:
    """Make the error for runs that do not determine a model.

    Raises
    ------
    InputError
        If the responses themselves are unusable, which is the better explanation.
    """
    check_responses(data, targets)
    if isinstance(error, InputError):
        failures = describe_failures(data["status"]) if "status" in data else ""
        remark = f"; runs failed with {failures}" if failures else ""
        return InputError(
            error.source, error.key, error.value, f"{error.allowed}{remark}"
        )
    return InputError(
        source="runs",
        key="runs",
        value=str(error),
        allowed="enough for an estimate of the noise",
    )


def arrange_runs(
    data: pd.DataFrame, space: ParameterSpace, targets: Targets
) -> ObservedSamples:
    """Convert the table of runs to arrays with a row for each sample.

    Parameters
    ----------
    data : pandas.DataFrame
        A row for each run: `sample`, parameters and responses. The responses of a
        failed run are NaN.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.

    Returns
    -------
    ObservedSamples
        The good samples with their runs, and the points of the failed samples.
    """
    names = list(targets.names)
    # Number the samples from 0, in the order of their first runs. All arrays below have
    # the samples in this order.
    sample_index, samples = pd.factorize(data["sample"])
    runs_of_sample = np.bincount(sample_index)

    # Put the runs with any response into an array (samples, runs, responses). It has
    # NaN where a response is missing, or where a sample has fewer runs than others.
    has_response = data[names].notna().any(axis=1).to_numpy()
    run_index = data[has_response].groupby("sample").cumcount().to_numpy()
    max_runs = int(run_index.max(initial=0)) + 1
    values = np.full((len(samples), max_runs, len(names)), np.nan)
    responses = data.loc[has_response, names].to_numpy(float)
    values[sample_index[has_response], run_index] = responses

    # A sample is good if it has each response in at least half of its runs, and all
    # responses in at least one. `repose.calibrate.runs.summarise_runs` has the same
    # rule for each bench test.
    is_finite = np.isfinite(values)
    n_finite = is_finite.sum(axis=1)  # (samples, responses)
    has_half_of_runs = (2 * n_finite >= runs_of_sample[:, None]).all(axis=1)
    has_complete_run = is_finite.all(axis=2).any(axis=1)
    is_good = has_complete_run & has_half_of_runs

    # All runs of a sample have the same parameters, so take them from its first run.
    # This also gives the order of `sample_index`.
    parameter_sets = data.drop_duplicates("sample")[list(space.names)]
    unit_points = space.unit(parameter_sets.to_numpy(float))
    return ObservedSamples(unit_points[is_good], values[is_good], unit_points[~is_good])


def estimate_noise(study: Study, observed: ObservedSamples) -> Noise:
    """Estimate the noise of a single run as well as the runs allow."""
    return find_noise(observed, study.targets.names, study.settings.noise_sd or {})


def find_known_noise(study: Study, observed: ObservedSamples) -> np.ndarray | None:
    """Return the covariance (k, k) of a single run.

    It is None if the replicates alone show the noise.
    """
    if study.settings.noise_sd is None:
        return None
    return estimate_noise(study, observed).covariance


def _make_goal(study: Study) -> Goal:
    """Return the targets within the tolerance of the settings."""
    tolerance = study.settings.sequential.tolerance_percent
    return Goal.from_targets(study.targets, tolerance, study.parameters)


def _make_generator(study: Study, data: pd.DataFrame) -> np.random.Generator:
    """Make the random generator of a proposal; the same runs give the same numbers.

    Parameters
    ----------
    study : Study
        The seed of its design is used.
    data : pandas.DataFrame
        The runs so far. The number of the last batch, or the number of runs, also
        enters the seed.
    """
    number = int(data["batch"].max()) if "batch" in data else len(data)
    return np.random.default_rng([study.settings.design.seed, number])


def _describe_state(advice: Advice, study: Study) -> dict[str, Any]:
    """Make the notes of a proposal, which describe the state of the search.

    Parameters
    ----------
    advice : Advice
        The advice after the runs so far.
    study : Study
        The study.

    Returns
    -------
    dict
        Numbers and text that JSON can hold. `probability`, `reachable`, `needed` and
        `stop` are the attributes of `Advice`. `in_reach` is the probability that any
        parameter set meets the targets. `nearest` has the smallest deviation F (Eq. 11
        of the paper) of any parameter set and its error. `answer` has the parameters,
        and `why` explains in a sentence how the search goes on. `row` is the row of
        this proposal in the table of batches, which repeats some of these values.
    """
    space = study.parameters
    values = space.values(advice.answer[None])[0].tolist()
    parameters = dict(zip(space.names, values, strict=True))
    # These values are both notes and columns of the table of batches.
    state = {
        "probability": advice.probability,
        "reachable": advice.reachable,
        "in_reach": advice.reach.probability,
        "needed": advice.needed,
        "stop": advice.stop,
    }
    predictions = {}
    for name, mean, error in zip(
        study.targets.names, advice.mean, advice.error, strict=True
    ):
        predictions[f"{name}_mean"] = float(mean)
        predictions[f"{name}_error"] = float(error)
    return {
        **state,
        "nearest": {
            "deviation": advice.reach.deviation,
            "error": advice.reach.deviation_sd,
        },
        "answer": parameters,
        "row": {**state, **predictions, **parameters},
        "why": _explain(advice),
    }


def _explain(advice: Advice) -> str:
    """Explain in words why the search stops, or how it continues."""
    if advice.stop is None:
        return f"{len(advice.batch)} more samples are simulated"
    why = STOP_SENTENCES[advice.stop]
    # The sentence about targets out of reach already says so.
    if advice.stop in ("budget", "noise") and advice.is_nearest:
        return f"{why}; {NEAREST_REMARK}"
    return why


def _describe_end(
    notes: Mapping[str, Any], study: Study, data: pd.DataFrame
) -> dict[str, Any]:
    """Make the notes of the answer for its summary and the report.

    Parameters
    ----------
    notes : mapping
        The result of `_describe_state` for the last proposal.
    study : Study
        The study.
    data : pandas.DataFrame
        All runs.

    Returns
    -------
    dict
        `summary`, a mapping; `steps`, a sentence for each step of the search; and, if
        the targets are out of reach, `note`, a text that says how far.
    """
    settings = study.settings.sequential
    tolerance = settings.tolerance_percent
    summary = {name: notes[name] for name in SUMMARY_NOTES}
    summary["tolerance_percent"] = tolerance
    steps = (
        f"Start: {settings.start_samples} parameter sets all over the ranges, each "
        f"simulated {settings.seeds} times.",
        f"Batches: each around the best point so far; {len(data)} runs in total. They "
        f"stopped: {notes['why']}.",
        "Model: kriging of the samples' means with their known errors. The answer lies "
        f"within {tolerance:g} % of all targets with probability "
        f"{notes['probability']:.2f}.",
    )
    end: dict[str, Any] = {"summary": summary, "steps": steps}
    # The reason to stop is one of the keys of `STOP_SENTENCES`.
    if notes["stop"] == "out_of_reach":
        end["note"] = _describe_deviations(notes, study.targets)
    return end


def _describe_deviations(notes: Mapping[str, Any], targets: Targets) -> str:
    """Describe in words how close the answer comes to targets that are out of reach.

    Parameters
    ----------
    notes : mapping
        Result of `_describe_state`.
    targets : Targets
        The targets of the study.

    Returns
    -------
    str
        A sentence with the probability that the targets can be met, and one with the
        deviation of the answer from each target.
    """
    # `_describe_state` gives each response these two columns.
    row = notes["row"]
    deviations = []
    for target in targets:
        mean = row[f"{target.name}_mean"]
        error = row[f"{target.name}_error"]
        # `whole` is the number that counts as 100 % of the target, above 0.
        deviation_percent = 100 * (mean - target.aim) / target.whole
        error_percent = 100 * error / target.whole
        symbol = target.response.symbol
        deviations.append(
            f"{deviation_percent:+.1f} ± {error_percent:.1f} % off the target of "
            f"{symbol}"
        )
    return (
        "The targets are probably out of reach: some parameter set meets them with "
        f"probability {notes['in_reach']:.2f}. The answer is the nearest: "
        f"{', '.join(deviations)}."
    )
