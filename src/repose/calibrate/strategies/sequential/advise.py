"""The next batch of pours, or the answer with its probability: a function of the data alone, without any file."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from repose.calibrate.designs.latin_hypercube import optimal_lhs
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.strategies.answer import separated
from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import Kriging, Observed
from repose.calibrate.strategies.sequential.reach import Reach, reach
from repose.calibrate.targets import Targets

CANDIDATES = 2048  # over the whole ranges
KEPT, AROUND = 8, 64  # the best of them, and points around each
STEPS = (0.1, 0.03, 0.01)  # standard deviations of those, in ranges
SPREAD = 0.1  # of a batch about the answer, standard deviation in ranges
# Probability that any point meets the targets: below the first half a batch is poured where the draws come nearest;
# below the second, once pours have followed the start, the search ends.
IN_DOUBT, OUT_OF_REACH = 0.8, 0.3
SAME = 1e-9  # nearer points are one, in ranges
NO_CHANCE = 1e-6  # of the most probable point: below it that is the least certain one, and the nearest is the answer
LEAST_GAIN = 0.01  # a probability that cannot rise by more has reached the noise bound

Score = Callable[[np.ndarray], np.ndarray]
Scored = tuple[
    np.ndarray, np.ndarray
]  # points (m, d) of the unit cube, and their scores (m,)


class Advice(NamedTuple):
    """Advice after the pours so far."""

    stop: (
        str | None
    )  # "probability", "out_of_reach", "budget" or "noise"; None: the pours go on
    batch: np.ndarray  # (b, d), points to pour next, in the unit cube
    answer: np.ndarray  # (d,), the most probable point; at the end the nearest, out of reach or without a chance
    probability: float  # that the answer meets the targets
    mean: np.ndarray  # (k,), predicted mean responses of the answer
    error: np.ndarray  # (k,), their standard errors
    reachable: float  # the highest probability that the remaining pours can give
    needed: int  # pours at one point that the noise alone requires
    reach: Reach


def start(space: ParameterSpace, section: SequentialSettings, seed: int) -> np.ndarray:
    """Make the points (n, d) of the start in the unit cube: a Latin hypercube, spread as the prior."""
    return space.from_prior(optimal_lhs(section.start_samples, space.dimensions, seed))


def advise(
    observed: Observed,
    goal: Goal,
    section: SequentialSettings,
    done: int,
    random: Generator,
    noise: np.ndarray | None,
) -> Advice:
    """Choose the next batch, or the answer; ValueError as in `Kriging`.

    A proposed point is never nearer to a failed sample than to a good one. `done` counts failed pours too.
    """
    model = Kriging(observed, noise)
    points, scores = ranked(model, goal, observed, random)
    attainable = reach(model, goal, random.spawn(1)[0])
    answer = points[scores.argmax()]
    probability = _probability(model, goal, answer)
    left = max(section.most_pours - done, 0)
    samples = min(section.batch, left // section.seeds)
    reachable = max(goal.reachable(model, points, left), probability)
    stop = None
    if probability >= section.probability:
        stop = "probability"
    elif (
        attainable.probability < OUT_OF_REACH
        and done > section.start_samples * section.seeds
    ):
        stop = "out_of_reach"
    elif samples == 0:
        stop = "budget"
    elif (
        reachable < probability + LEAST_GAIN and attainable.probability >= OUT_OF_REACH
    ):
        stop = "noise"
    if stop == "out_of_reach" or (stop and probability < NO_CHANCE):
        answer = nearest(model, goal, observed, points)
        probability = _probability(model, goal, answer)
    batch = np.empty((0, len(answer)))
    if stop is None and attainable.probability < IN_DOUBT:
        batch = _soundest(
            _new(random.permutation(attainable.points), observed.simulated),
            observed,
            -(-samples // 2),
        )
    if stop is None and not len(batch):
        batch = _around(answer, samples, goal, observed, random)
    mean, covariance = model.predict(answer[None])
    error = np.sqrt(np.diagonal(covariance[0]))
    needed = goal.needed(model.noise, section.probability)
    return Advice(
        stop, batch, answer, probability, mean[0], error, reachable, needed, attainable
    )


def nearest(
    model: Kriging, goal: Goal, observed: Observed, points: np.ndarray
) -> np.ndarray:
    """Find the point (d,) of least expected deviation from the targets (Eq. 11 of the paper), without a prior."""

    def score(unit: np.ndarray) -> np.ndarray:
        return -goal.expected_deviation(*model.predict(unit))

    points, scores = _refined(points, score, observed, np.random.default_rng(1))
    return points[scores.argmax()]


def _probability(model: Kriging, goal: Goal, point: np.ndarray) -> float:
    """Compute the probability that a point meets the targets."""
    return float(goal.probability(*model.predict(point[None]))[0])


def _refined(
    points: np.ndarray, score: Score, observed: Observed, random: Generator
) -> Scored:
    """Search ever nearer to the best of the points; return all with their scores, minus infinity for unsound ones."""

    def scored(unit: np.ndarray) -> np.ndarray:
        return np.where(observed.is_sound(unit), score(unit), -np.inf)

    scores = scored(points)
    for step in STEPS:
        near = np.repeat(points[np.argsort(-scores)[:KEPT]], AROUND, axis=0)
        near = np.clip(near + step * random.standard_normal(near.shape), 0, 1)
        points, scores = (
            np.vstack([points, near]),
            np.concatenate([scores, scored(near)]),
        )
    return points, scores


def ranked(model: Kriging, goal: Goal, observed: Observed, random: Generator) -> Scored:
    """Score points over the ranges and ever nearer around the best of them by `Goal.score`.

    The score is minus infinity where a failed sample is nearer than a good one.
    """
    from scipy.stats import qmc

    points = goal.space.from_prior(
        qmc.Sobol(observed.unit.shape[1], rng=random).random(CANDIDATES)
    )
    return _refined(points, partial(goal.score, model), observed, random)


def alternatives(
    found: Scored, model: Kriging, targets: Targets, section: MigaSettings
) -> Scored:
    """Choose of the `ranked` points those inside all ranges and apart from each other, the best first.

    Return them (n, d) with their predictions (n, k).
    """
    points, scores = found
    mean = model.predict(points)[0]
    inside = ((mean >= targets.low) & (mean <= targets.high)).all(axis=1) & np.isfinite(
        scores
    )
    order = np.argsort(-scores, kind="stable")
    order = order[inside[order]]
    kept = order[separated(points[order], section)]
    return points[kept], mean[kept]


def _around(
    answer: np.ndarray, samples: int, goal: Goal, observed: Observed, random: Generator
) -> np.ndarray:
    """Draw points about the answer, normal in shares of the prior: there slopes are learned with the mean."""
    share = goal.space.prior_cdf(answer[None])
    share = np.clip(
        share + SPREAD * random.standard_normal((AROUND * samples, len(answer))), 0, 1
    )
    return _soundest(goal.space.from_prior(share), observed, samples)


def _soundest(points: np.ndarray, observed: Observed, count: int) -> np.ndarray:
    """Select the first sound points, then the first others."""
    return points[np.argsort(~observed.is_sound(points), kind="stable")[:count]]


def _new(points: np.ndarray, done: np.ndarray) -> np.ndarray:
    """Select the points (n, d) not among the simulated ones (m, d), each once: many draws end in one corner."""
    from scipy.spatial.distance import cdist

    first = np.argmax(cdist(points, points) < SAME, axis=1) == np.arange(len(points))
    return points[first & (cdist(points, done) >= SAME).all(axis=1)]
