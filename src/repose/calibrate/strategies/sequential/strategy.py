"""Proposals of the strategy `sequential`: kriging says where the next batch is simulated, and when to stop."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.answer import WITHIN
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import within
from repose.calibrate.strategies.base import SO_FAR, Answer, Batch, samples_of
from repose.calibrate.strategies.runs import check_responses, next_number
from repose.calibrate.strategies.sequential.advise import (
    NO_CHANCE,
    Advice,
    advise,
    alternatives,
    nearest,
    ranked,
    start,
)
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import (
    Kriging,
    Observed,
    SpaceKriging,
)
from repose.calibrate.strategies.sequential.noise import Noise, noise_of
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.common.errors import InputError

NEAREST = "the answer is the nearest"
WHY = {
    "probability": "the answer meets the targets with the requested probability",
    "out_of_reach": f"probably no parameter set meets the targets: {NEAREST}",
    "budget": "the budget of pours is used up",
    "noise": "the pours that are left cannot make the answer more probable: the noise is too large",
}


def propose(study: Study, data: pd.DataFrame) -> Batch | Answer:
    """Propose the next batch, or answer if there is a reason to stop."""
    space, section = study.parameters, study.settings.sequential
    if data.empty:
        return _start(study, data)
    goal = _goal(study)
    observed = observed_of(data, space, study.targets)
    try:
        noise = known_noise(study, observed)
        advice = advise(observed, goal, section, len(data), _random(study, data), noise)
    except (InputError, ValueError) as error:
        failed, good = len(observed.failed), len(observed.unit)
        if good >= 2 * failed:  # else what they share may be chance
            check_responses(data, study.targets)
        if (
            good < section.start_samples
            and len(data) + section.seeds <= section.most_pours
        ):
            few = f"{failed} samples failed, and the other {good} are too few for a model: a further start"
            return _start(study, data, why=few)
        raise _cause(error, data, study.targets) from None
    notes = _notes(advice, study)
    if advice.stop is None:
        return Batch(
            samples_of(space, advice.batch, section.seeds, next_number(data)), notes
        )
    return answer(
        study,
        data,
        advice.answer,
        why=notes["why"],
        notes=notes | _end(notes, study, data),
    )


def _start(study: Study, data: pd.DataFrame, **notes: str) -> Batch:
    """Sample all over the ranges, at the beginning or where too few samples are good for a model."""
    space, section = study.parameters, study.settings.sequential
    unit = start(space, section, study.settings.design.seed + len(data))
    unit = unit[: (section.most_pours - len(data)) // section.seeds]
    return Batch(
        samples_of(space, unit, section.seeds, 1 if data.empty else next_number(data)),
        notes,
    )


def answer(
    study: Study, data: pd.DataFrame, point: np.ndarray | None = None, **about: Any
) -> Answer:
    """Answer with the set that meets the targets most probably, the nearest, or a point (d,) of the unit cube."""
    space, targets, section = study.parameters, study.targets, study.settings.sequential
    observed = observed_of(data, space, targets)
    try:
        model = Kriging(observed, known_noise(study, observed))
    except ValueError as error:
        raise _cause(error, data, targets) from None
    goal = _goal(study)
    points, scores = ranked(model, goal, observed, _random(study, data))
    others, predicted = alternatives(
        (points, scores), model, targets, study.settings.miga
    )
    unit = (points[scores.argmax()] if point is None else point)[None]
    if point is None and goal.probability(*model.predict(unit))[0] < NO_CHANCE:
        unit, about = (
            nearest(model, goal, observed, points)[None],
            {"why": f"{SO_FAR}; {NEAREST}"} | about,
        )
    mean, covariance = model.predict(unit)
    goals = {
        column: Goal.of(targets, percent, space) for percent, column in WITHIN.items()
    }
    probability = {
        column: float(goal.probability(mean, covariance)[0])
        for column, goal in goals.items()
    }
    return Answer(
        values=space.values(unit)[0], mean=mean[0], covariance=covariance[0],
        probability=probability | {"inside": float(within(mean, covariance, targets.low, targets.high)[0])},
        samples=samples_of(space, unit, section.checks, next_number(data)), others=space.values(others),
        others_mean=predicted, model=SpaceKriging(model, space), **{"why": SO_FAR} | about,
    )  # fmt: skip


def _cause(error: ValueError, data: pd.DataFrame, targets: Targets) -> InputError:
    """Say why there is no model."""
    check_responses(data, targets)
    few = InputError("runs", "pours", str(error), "enough for an estimate of the noise")
    return error if isinstance(error, InputError) else few


def observed_of(
    data: pd.DataFrame, space: ParameterSpace, targets: Targets
) -> Observed:
    """Arrange the samples and their runs as arrays."""
    names = list(targets.names)
    number, samples = pd.factorize(data["sample"])
    run = data[names].notna().any(axis=1).to_numpy()
    place = data[run].groupby("sample").cumcount().to_numpy()
    values = np.full((len(samples), int(place.max(initial=0)) + 1, len(names)), np.nan)
    values[number[run], place] = data.loc[run, names].to_numpy(float)
    unit = space.unit(data.drop_duplicates("sample")[list(space.names)].to_numpy(float))
    # as in `repose.calibrate.runs.summarise_runs`: at least half of the runs of each bench test
    enough = (2 * np.isfinite(values).sum(axis=1) >= np.bincount(number)[:, None]).all(
        axis=1
    )
    good = np.isfinite(values).all(axis=2).any(axis=1) & enough
    return Observed(unit[good], values[good], unit[~good])


def noise_from(study: Study, observed: Observed) -> Noise:
    """Estimate the noise of a single run as well as the runs allow."""
    return noise_of(observed, study.targets.names, study.settings.noise_sd or {})


def known_noise(study: Study, observed: Observed) -> np.ndarray | None:
    """Return the covariance (k, k) of a single run; None if the replicates alone give it."""
    if study.settings.noise_sd is None:
        return None
    return noise_from(study, observed).covariance


def _goal(study: Study) -> Goal:
    """Return the targets within the tolerance of the section."""
    return Goal.of(
        study.targets, study.settings.sequential.tolerance_percent, study.parameters
    )


def _random(study: Study, data: pd.DataFrame) -> np.random.Generator:
    """Seed the random numbers of a proposal by the number of the last batch, or by the number of runs."""
    turn = int(data["batch"].max()) if "batch" in data else len(data)
    return np.random.default_rng([study.settings.design.seed, turn])


def _notes(advice: Advice, study: Study) -> dict[str, Any]:
    """Describe the state after the runs so far; `needed` are the pours that the noise alone asks for."""
    space = study.parameters
    answer = dict(
        zip(space.names, space.values(advice.answer[None])[0].tolist(), strict=True)
    )
    state: dict[str, Any] = {
        "probability": advice.probability,
        "reachable": advice.reachable,
    }
    state |= {
        "in_reach": advice.reach.probability,
        "needed": advice.needed,
        "stop": advice.stop,
    }
    row = state.copy()
    for name, mean, error in zip(
        study.targets.names, advice.mean, advice.error, strict=True
    ):
        row |= {f"{name}_mean": float(mean), f"{name}_error": float(error)}
    why = (
        WHY[advice.stop]
        if advice.stop
        else f"{len(advice.batch)} more samples are poured"
    )
    why += (
        f"; {NEAREST}"
        if advice.stop in ("budget", "noise") and advice.probability < NO_CHANCE
        else ""
    )
    least = {"deviation": advice.reach.nearest, "error": advice.reach.error}
    return {
        **state,
        "nearest": least,
        "answer": answer,
        "row": row | answer,
        "why": why,
    }


def _end(notes: Mapping[str, Any], study: Study, data: pd.DataFrame) -> dict[str, Any]:
    """Describe the end of the search, for the summary and the report."""
    section = study.settings.sequential
    kept = ("answer", "probability", "stop", "needed", "in_reach", "nearest")
    tolerance = section.tolerance_percent
    steps = (
        f"Start: {section.start_samples} parameter sets all over the ranges, each poured {section.seeds} times.",
        f"Batches: each about the best point so far; {len(data)} pours in all. They stopped: {notes['why']}.",
        f"Model: kriging of the samples' means with their known errors. The answer lies within "
        f"{tolerance:g} % of all targets with probability {notes['probability']:.2f}.",
    )
    end = {
        "summary": {name: notes[name] for name in kept}
        | {"tolerance_percent": tolerance},
        "steps": steps,
    }
    return end | (
        {"note": _out_of_reach(notes, study.targets)}
        if notes["stop"] == "out_of_reach"
        else {}
    )


def _out_of_reach(notes: Mapping[str, Any], targets: Targets) -> str:
    """Say in a sentence how near the answer comes."""
    off = []
    for target in targets:
        mean, error = (
            notes["row"][f"{target.name}_{what}"] for what in ("mean", "error")
        )
        percent, scatter = (
            100 * (mean - target.aim) / target.whole,
            100 * error / target.whole,
        )
        off.append(
            f"{percent:+.1f} ± {abs(scatter):.1f} % off the target of {target.response.symbol}"
        )
    chance = f"some parameter set meets them with probability {notes['in_reach']:.2f}"
    return f"The targets are probably out of reach: {chance}. The answer is the nearest: {', '.join(off)}."
