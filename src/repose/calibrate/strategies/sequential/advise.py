"""Choose the next samples to simulate, or the answer, from the runs so far.

No function of this module reads or writes a file.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from repose.calibrate.designs.allowed import make_allowed_design, take_allowed_points
from repose.calibrate.designs.latin_hypercube import optimal_lhs
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.strategies.answer import select_separated
from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import Kriging, ObservedSamples
from repose.calibrate.strategies.sequential.reach import Reach, estimate_reach
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets

# Number of points all over the ranges that are compared first.
N_CANDIDATES = 2048
# The search continues around the N_KEPT best points, with N_AROUND new points for each.
N_KEPT = 8
N_AROUND = 64
# Number of points that are drawn for each point of a batch. So many may be forbidden or
# near failed samples.
N_DRAWN_PER_SAMPLE = 64
# Standard deviations of the new points about the best ones, as fractions of the ranges.
# The search has a step for each of them.
STEP_SDS = (0.1, 0.03, 0.01)
# Standard deviation of the points of a batch about the answer. The unit is a quantile
# of the prior, from 0 to 1.
BATCH_SD = 0.1
# Limits of the probability that any point meets the targets. If it is below
# DOUBTFUL_PROBABILITY, half a batch is simulated where the draws of the model come
# nearest to the targets. If it is below UNREACHABLE_PROBABILITY, the search ends,
# provided that batches have followed the start.
DOUBTFUL_PROBABILITY = 0.8
UNREACHABLE_PROBABILITY = 0.3
# Points count as the same if their distance, in ranges, is smaller than this.
SAME_DISTANCE = 1e-9
# A point lies at an end of a range if it is at most this fraction of the range away
# from it.
END_FRACTION = 1e-3
# Seed of the search for the nearest point.
NEAREST_SEED = 1
# If further runs can raise the probability by less than this, the noise is the limit.
MIN_GAIN = 0.01

Score = Callable[[np.ndarray], np.ndarray]


class ScoredPoints(NamedTuple):
    """Points of the unit cube with their scores; a higher score is better."""

    points: np.ndarray  # (m, d)
    scores: np.ndarray  # (m,)

    @property
    def best(self) -> np.ndarray:
        """The point (d,) with the highest score."""
        return self.points[self.scores.argmax()]


class Alternatives(NamedTuple):
    """Further points that are predicted inside all ranges, the best first."""

    points: np.ndarray  # (n, d), of the unit cube
    mean: np.ndarray  # (n, k), predicted responses


class Advice(NamedTuple):
    """Advice after the runs so far.

    Attributes
    ----------
    stop : str or None
        Why no more runs are needed: "probability", "out_of_reach", "budget" or "noise".
        None if there is a further batch.
    batch : numpy.ndarray, (b, d)
        Points of the unit cube to simulate next.
    answer : numpy.ndarray, (d,)
        The point that meets the targets most probably. At the end it is the nearest
        point, if the targets are out of reach or no point is predicted to meet them.
    probability : float
        Probability that the answer meets the targets.
    mean, error : numpy.ndarray, (k,)
        Predicted mean responses of the answer, and their standard errors.
    reachable : float
        The highest value that `probability` may reach with the runs of the budget that
        are left.
    needed : int
        Number of runs at one point that the noise alone requires.
    reach : Reach
        How probably any parameter set meets the targets, and how near the nearest one
        comes to them.
    is_nearest : bool
        Whether the answer is the nearest point.
    model : Kriging
        The model of the runs.
    """

    stop: str | None
    batch: np.ndarray
    answer: np.ndarray
    probability: float
    mean: np.ndarray
    error: np.ndarray
    reachable: float
    needed: int
    reach: Reach
    is_nearest: bool
    model: Kriging


def make_start(
    space: ParameterSpace, settings: SequentialSettings, seed: int
) -> np.ndarray:
    """Make the first points (n, d) in the unit cube.

    The points are a Latin hypercube that is moved to the distribution of the priors.
    With constraints they are spread over the allowed part of the cube instead.
    """

    def design_of(size: int) -> np.ndarray:
        return optimal_lhs(size, space.dimensions, seed)

    return make_allowed_design(
        design_of, settings.start_samples, space, follows_prior=True
    )


def advise(
    observed: ObservedSamples,
    goal: Goal,
    settings: SequentialSettings,
    n_done: int,
    random: Generator,
    noise: np.ndarray | None,
) -> Advice:
    """Choose the next batch, or the answer.

    If possible, no proposed point is nearer to a failed sample than to a good one.

    Parameters
    ----------
    observed : ObservedSamples
        The runs so far.
    goal : Goal
        The targets within their tolerance.
    settings : SequentialSettings
        The section `sequential`.
    n_done : int
        Number of runs so far, including failed ones.
    random : numpy.random.Generator
        Source of the random numbers.
    noise : numpy.ndarray, (k, k), or None
        Known covariance of a single run. None estimates it from replicates.

    Raises
    ------
    ValueError
        If the runs are too few for `Kriging`.
    """
    # Model the runs, and rank points all over the ranges by the probability that they
    # meet the targets.
    model = Kriging(observed, noise)
    ranking = rank_points(model, goal, observed, random)
    reach = estimate_reach(model, goal, random.spawn(1)[0])
    answer = ranking.best
    probability = _compute_probability(model, goal, answer)

    # Decide whether to stop. The key `most_pours` is the budget of runs.
    runs_left = max(settings.most_pours - n_done, 0)
    n_samples = min(settings.batch, runs_left // settings.seeds)
    allowed = ranking.points
    if goal.space.constraints:
        allowed = allowed[goal.space.is_allowed(allowed)]
    reachable = max(goal.estimate_reachable(model, allowed, runs_left), probability)
    # The response may be steep at an end of a range, and a model without runs there
    # only extrapolates the slope. Therefore require a run at these ends before calling
    # the targets out of reach. If the ends are forbidden (NaN), no run is required.
    ends = find_nearest_ends(reach.points)
    if not goal.space.is_allowed(np.where(np.isfinite(ends), ends, answer)[None])[0]:
        ends = np.full(len(ends), np.nan)
    is_past_start = n_done > settings.start_samples * settings.seeds
    stop = _find_reason_to_stop(
        settings,
        probability=probability,
        reachable=reachable,
        reach_probability=reach.probability,
        n_samples=n_samples,
        is_past_start=is_past_start,
        is_end_simulated=has_run_at(ends, observed.simulated),
    )

    # If the targets cannot be met, the most probable point is merely the one with the
    # largest error, and the nearest point is the best answer.
    is_unmet = stop in ("budget", "noise") and no_point_meets(model, goal, ranking)
    is_nearest = stop == "out_of_reach" or is_unmet
    if is_nearest:
        answer = find_nearest(model, goal, observed, ranking.points)
        probability = _compute_probability(model, goal, answer)

    batch = np.empty((0, len(answer)))
    if stop is None:
        batch = _choose_batch(answer, n_samples, reach, goal, observed, random)
        if reach.probability < UNREACHABLE_PROBABILITY and is_past_start:
            batch = _move_to_ends(ends, batch, observed, goal.space)

    mean, covariance = model.predict(answer[None])
    return Advice(
        stop=stop,
        batch=batch,
        answer=answer,
        probability=probability,
        mean=mean[0],
        error=np.sqrt(np.diagonal(covariance[0])),
        reachable=reachable,
        needed=goal.count_needed_runs(model.noise, settings.probability),
        reach=reach,
        is_nearest=is_nearest,
        model=model,
    )


def _choose_batch(
    answer: np.ndarray,
    n_samples: int,
    reach: Reach,
    goal: Goal,
    observed: ObservedSamples,
    random: Generator,
) -> np.ndarray:
    """Choose the points of the next batch.

    Parameters
    ----------
    answer : numpy.ndarray, (d,)
        The answer so far.
    n_samples : int
        Largest number of points.
    reach : Reach
        Probability that any parameter set meets the targets, and the points where the
        draws of the model come nearest to the targets.
    goal : Goal
        The targets within their tolerance.
    observed : ObservedSamples
        The samples so far.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    numpy.ndarray, (batch, d)
        Points of the unit cube, at most `n_samples`.
    """
    if reach.probability < DOUBTFUL_PROBABILITY:
        # The targets may be out of reach. To decide this, simulate half a batch,
        # rounded up, where draws of the model come nearest to the targets.
        points = random.permutation(reach.points)
        new_points = _select_new(points, observed.simulated)
        n_half = math.ceil(n_samples / 2)
        batch = _select_points(new_points, observed, n_half)
        # The batch is empty if all these points are already simulated. Then continue
        # around the answer.
        if len(batch) > 0:
            return batch
    return _draw_around(answer, n_samples, goal, observed, random)


def _find_reason_to_stop(
    settings: SequentialSettings,
    *,
    probability: float,
    reachable: float,
    reach_probability: float,
    n_samples: int,
    is_past_start: bool,
    is_end_simulated: bool,
) -> str | None:
    """Find the reason for ending the search, if there is one.

    Parameters
    ----------
    settings : SequentialSettings
        The section `sequential`.
    probability : float
        Probability that the answer meets the targets, given the runs so far.
    reachable : float
        Highest value that `probability` may reach with the runs that are left.
    reach_probability : float
        Probability that any parameter set at all meets the targets.
    n_samples : int
        Number of samples in a further batch that the budget allows.
    is_past_start : bool
        Whether there are more runs than those of the start.
    is_end_simulated : bool
        Whether a run was made at the ends of the ranges where the draws come nearest to
        the targets. Without such a run, the targets are not called out of reach.

    Returns
    -------
    str or None
        The attribute `stop` of `Advice`. None means to simulate another batch.
    """
    # If several reasons apply, the first one says the most about the answer.
    if probability >= settings.probability:
        return "probability"
    is_unreachable = reach_probability < UNREACHABLE_PROBABILITY
    if is_unreachable and is_past_start and is_end_simulated:
        return "out_of_reach"
    if n_samples == 0:
        return "budget"
    # If the targets seem out of reach, further runs are still worth while, because they
    # may confirm it.
    if reachable < probability + MIN_GAIN and not is_unreachable:
        return "noise"
    return None


def find_nearest_ends(points: np.ndarray) -> np.ndarray:
    """Find the ends of ranges at which most points (n, d) of the unit cube lie.

    Returns
    -------
    numpy.ndarray, (d,)
        0 or 1 for each parameter, or NaN if fewer than half the points lie at one end.
    """
    ends = np.full(points.shape[1], np.nan)
    for end in (0.0, 1.0):
        fraction_at_end = (np.abs(points - end) <= END_FRACTION).mean(axis=0)
        ends[fraction_at_end >= 0.5] = end
    return ends


def has_run_at(ends: np.ndarray, simulated: np.ndarray) -> bool:
    """Return whether one of the samples (n, d) lies at all ends.

    `ends` (d,) is a result of `find_nearest_ends`.
    """
    is_end = np.isfinite(ends)
    is_there = np.abs(simulated[:, is_end] - ends[is_end]) <= END_FRACTION
    return bool(is_there.all(axis=1).any())


def _move_to_ends(
    ends: np.ndarray,
    batch: np.ndarray,
    observed: ObservedSamples,
    space: ParameterSpace,
) -> np.ndarray:
    """Return the batch with its first point moved to the ends.

    The verdict that the targets are out of reach is then based on a run at these ends.
    The batch is returned unchanged if a sample already lies there, or if the moved
    point is forbidden.
    """
    if has_run_at(ends, observed.simulated) or not len(batch):
        return batch
    moved = batch.copy()
    is_end = np.isfinite(ends)
    moved[0, is_end] = ends[is_end]
    return moved if space.is_allowed(moved[:1])[0] else batch


def no_point_meets(model: Kriging, goal: Goal, ranking: ScoredPoints) -> bool:
    """Return whether no ranked point is predicted inside the ranges of all targets."""
    points = ranking.points[np.isfinite(ranking.scores)]
    mean, _ = model.predict(points)
    return not goal.is_in_ranges(mean).any()


def find_nearest(
    model: Kriging, goal: Goal, observed: ObservedSamples, points: np.ndarray
) -> np.ndarray:
    """Find the point whose predicted responses are nearest to the targets.

    Its expected deviation from the targets is the smallest. The deviation is the
    weighted sum of Eq. 11 of the paper, without a prior. Only points near samples are
    considered. Far from all samples, as in the corners of a Box-Behnken design, the
    model is so uncertain that a point there may seem near the targets by chance.

    Parameters
    ----------
    model : Kriging
        Model of the runs.
    goal : Goal
        The targets within their tolerance.
    observed : ObservedSamples
        The runs so far.
    points : numpy.ndarray, (m, d)
        Points of the unit cube from which the search starts, besides the samples.

    Returns
    -------
    numpy.ndarray, (d,)
        The point in the unit cube.
    """
    d = observed.unit_points.shape[1]
    names = [str(k) for k in range(d)]
    support = Support(
        observed.unit_points, low=np.zeros(d), high=np.ones(d), names=names
    )

    def score(unit_points: np.ndarray) -> np.ndarray:
        """Return minus the expected deviation; -inf where a point is not considered."""
        mean, covariance = model.predict(unit_points)
        deviation = goal.expected_deviation(mean, covariance)
        is_excluded = support.is_sparse(unit_points) | ~goal.space.is_allowed(
            unit_points
        )
        return np.where(is_excluded, -np.inf, -deviation)

    # With a fixed seed, the same runs always give the same point.
    random = np.random.default_rng(NEAREST_SEED)
    starts = np.vstack([observed.unit_points, points])
    return _refine_search(starts, score, observed, random).best


def _compute_probability(model: Kriging, goal: Goal, point: np.ndarray) -> float:
    """Compute the probability that a point meets the targets."""
    mean, covariance = model.predict(point[None])
    return float(goal.probability(mean, covariance)[0])


def _refine_search(
    points: np.ndarray, score: Score, observed: ObservedSamples, random: Generator
) -> ScoredPoints:
    """Search for points of high score around the best points, in ever smaller steps.

    Parameters
    ----------
    points : numpy.ndarray, (m, d)
        Points of the unit cube from which the search starts.
    score : callable
        Function of points (n, d) that returns their scores (n,). Higher is better.
    observed : ObservedSamples
        The samples. A point nearer to a failed one than to a good one scores -inf.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    ScoredPoints
        The starting points, and all points that were tried.
    """

    def score_avoiding_failures(unit_points: np.ndarray) -> np.ndarray:
        """Score points (n, d); -inf for a point that a failed sample is nearest to."""
        return np.where(
            observed.avoids_failures(unit_points), score(unit_points), -np.inf
        )

    scores = score_avoiding_failures(points)
    for step in STEP_SDS:
        best = points[np.argsort(-scores)[:N_KEPT]]
        # Try points around the best ones.
        centres = np.repeat(best, N_AROUND, axis=0)
        shifts = step * random.standard_normal(centres.shape)
        new_points = np.clip(centres + shifts, 0, 1)
        points = np.vstack([points, new_points])
        scores = np.concatenate([scores, score_avoiding_failures(new_points)])
    return ScoredPoints(points, scores)


def rank_points(
    model: Kriging, goal: Goal, observed: ObservedSamples, random: Generator
) -> ScoredPoints:
    """Score points all over the ranges, and then points around the best of them.

    The score is `Goal.score`. It is minus infinity for a point that is nearer to a
    failed sample than to a good one.
    """
    from scipy.stats import qmc

    dimensions = observed.unit_points.shape[1]
    sequence = qmc.Sobol(dimensions, rng=random)
    points = take_allowed_points(sequence, N_CANDIDATES, goal.space)
    return _refine_search(points, partial(goal.score, model), observed, random)


def find_alternatives(
    ranking: ScoredPoints, model: Kriging, targets: Targets, settings: MigaSettings
) -> Alternatives:
    """Choose points with a minimum distance that are predicted inside all ranges.

    Parameters
    ----------
    ranking : ScoredPoints
        Result of `rank_points`.
    model : Kriging
        Model of the runs.
    targets : Targets
        The targets of the study.
    settings : MigaSettings
        Its keys `solutions` and `distance` are the largest number of points and their
        minimum distance.

    Returns
    -------
    Alternatives
        The chosen points, those with the highest score first.
    """
    mean = model.predict(ranking.points)[0]
    is_in_ranges = ((mean >= targets.low) & (mean <= targets.high)).all(axis=1)
    is_suitable = is_in_ranges & np.isfinite(ranking.scores)
    # Find the row numbers of the suitable points, the best first.
    best_first = np.argsort(-ranking.scores, kind="stable")
    suitable_rows = best_first[is_suitable[best_first]]
    # `select_separated` returns positions in the list of suitable points.
    positions = select_separated(ranking.points[suitable_rows], settings)
    chosen_rows = suitable_rows[positions]
    return Alternatives(ranking.points[chosen_rows], mean[chosen_rows])


def _draw_around(
    answer: np.ndarray,
    n_samples: int,
    goal: Goal,
    observed: ObservedSamples,
    random: Generator,
) -> np.ndarray:
    """Draw normally distributed points around the answer.

    Because they differ from the answer, the model learns slopes as well as the mean.

    Parameters
    ----------
    answer : numpy.ndarray, (d,)
        The answer so far.
    n_samples : int
        Largest number of points.
    goal : Goal
        Its parameter space has the priors and constraints of the parameters.
    observed : ObservedSamples
        The samples so far.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    numpy.ndarray, (batch, d)
        Points of the unit cube that obey the constraints. With constraints there may be
        fewer than `n_samples`.
    """
    # Draw quantiles of the prior (values of its distribution function) instead of
    # coordinates. The points then spread further where the prior is wider. Without a
    # prior, the quantiles are the coordinates themselves.
    centre = goal.space.prior_cdf(answer[None])
    shape = (N_DRAWN_PER_SAMPLE * n_samples, len(answer))
    quantiles = np.clip(centre + BATCH_SD * random.standard_normal(shape), 0, 1)
    points = goal.space.transform_to_prior(quantiles)
    if goal.space.constraints:
        # Add the answer, which is allowed, so that at least one point remains.
        points = np.vstack([points[goal.space.is_allowed(points)], answer])
    return _select_points(points, observed, n_samples)


def _select_points(
    points: np.ndarray, observed: ObservedSamples, count: int
) -> np.ndarray:
    """Select the first `count` points (n, d), but prefer those that avoid failures.

    A point avoids failures if it is at least as near to a good sample as to a failed
    one. Other points are selected only if there are too few of these.
    """
    order = np.argsort(~observed.avoids_failures(points), kind="stable")
    return points[order[:count]]


def _select_new(points: np.ndarray, simulated: np.ndarray) -> np.ndarray:
    """Select the points (n, d) that are not among the simulated ones (m, d).

    Of equal points only one is kept, because many draws end in the same corner.
    """
    from scipy.spatial.distance import cdist

    first_equal = np.argmax(cdist(points, points) < SAME_DISTANCE, axis=1)
    is_first_copy = first_equal == np.arange(len(points))
    is_new = (cdist(points, simulated) >= SAME_DISTANCE).all(axis=1)
    return points[is_first_copy & is_new]
