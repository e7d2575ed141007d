"""Estimate whether any parameter set meets the goal, and how near the nearest one is.

The estimate uses random draws of possible responses. A draw is a function of the
parameters that agrees with the runs within their errors. A search finds the best point
of each draw, so the estimate holds for all parameter sets together, not for a single
set.

- (RR08) Rahimi & Recht 2008, Random features for large-scale kernel machines, NeurIPS
  20
- (W20) Wilson et al. 2020, Efficiently sampling functions from Gaussian process
  posteriors, ICML 119: a draw of the prior from random features, corrected by the runs
  with the exact covariance
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose.calibrate.designs.allowed import take_allowed_points
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import SMOOTHNESS, Kriging

if TYPE_CHECKING:  # scikit-learn takes half a second to load
    from repose.calibrate.surrogates.process import Process, SparseProcess

N_FEATURES = 128
N_FUNCTIONS = 128  # number of drawn functions, spread evenly over the sets of lengths
N_CANDIDATES = 256  # number of points all over the ranges, and number of corners
N_AROUND = 16  # number of points around each best point of a draw
STEP_SDS = (0.2, 0.07, 0.02)  # standard deviations of those points, in ranges


class Reach(NamedTuple):
    """Best possible agreement with the goal over all parameter sets."""

    probability: float  # probability that some parameter set meets the goal
    nearest: float  # least F (Eq. 11) of a parameter set, mean over the draws
    error: float  # standard deviation of this F over the draws
    points: np.ndarray  # (draws, d), the point of each draw that is nearest to the goal


class _BestPoints(NamedTuple):
    """Result of the search for the best point in each of several draws."""

    largest: np.ndarray  # (draws,), minimum of the largest deviation, in tolerances
    F: np.ndarray  # (draws,), minimum of F
    points: np.ndarray  # (draws, d), where the largest deviation has its minimum


def estimate_reach(model: Kriging, goal: Goal, random: np.random.Generator) -> Reach:
    """Estimate the probability that any parameter set meets the goal.

    The model is uncertain, so it draws random functions of the parameters. The
    probability is the fraction of these functions whose best parameter set meets the
    goal.

    Parameters
    ----------
    model : Kriging
        Model of the runs.
    goal : Goal
        The targets within their tolerance.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    Reach
        The probability, and the least deviations from the goal. F is the weighted
        deviation of Eq. 11 of the paper.
    """
    from scipy.stats import qmc

    # Start the search from points all over the ranges and from corners.
    d = model.unit.shape[1]
    sequence = qmc.Sobol(d, rng=random)
    everywhere = take_allowed_points(sequence, N_CANDIDATES, goal.space)
    starts = np.vstack([everywhere, np.round(everywhere)])
    starts = starts[goal.space.is_allowed(starts)]

    # Search in the draws of each set of processes.
    results = []
    for number in range(len(model.sets)):
        draws = Draws(model, number, random)
        results.append(_search_draws(draws, goal, starts, random))

    # Combine all draws. A draw meets the goal if its largest deviation is at most one
    # tolerance.
    largest = np.concatenate([result.largest for result in results])
    F = np.concatenate([result.F for result in results])
    return Reach(
        probability=float((largest <= 1).mean()),
        nearest=float(F.mean()),
        error=float(F.std()),
        points=np.concatenate([result.points for result in results]),
    )


def _search_draws(
    draws: "Draws", goal: Goal, starts: np.ndarray, random: np.random.Generator
) -> _BestPoints:
    """Search each draw for the points that deviate least from the goal.

    The search tries random points around the best ones so far, in ever smaller steps.

    Parameters
    ----------
    draws : Draws
        The draws to search.
    goal : Goal
        The targets within their tolerance.
    starts : numpy.ndarray, (m, d)
        Points of the unit cube where the search begins.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    _BestPoints
    """
    points = starts
    # Compute the largest deviation and F, the weighted sum, both (draws, points).
    largest_deviations, F = goal.compute_deviations(draws(points))
    for step in STEP_SDS:
        # Choose the best points of each draw, by the largest deviation and by F.
        best_rows = np.concatenate(
            [largest_deviations.argmin(axis=1), F.argmin(axis=1)]
        )
        best = points[best_rows]

        # Try points around them.
        centres = np.repeat(best, N_AROUND, axis=0)
        shifts = step * random.standard_normal(centres.shape)
        new_points = np.clip(centres + shifts, 0, 1)
        new_points = new_points[goal.space.is_allowed(new_points)]
        new_largest_deviations, new_F = goal.compute_deviations(draws(new_points))

        # Add them to the points of all draws, so that each draw may use every point.
        points = np.vstack([points, new_points])
        largest_deviations = np.hstack([largest_deviations, new_largest_deviations])
        F = np.hstack([F, new_F])
    return _BestPoints(
        largest=largest_deviations.min(axis=1),
        F=F.min(axis=1),
        points=points[largest_deviations.argmin(axis=1)],
    )


class _DrawnProcess(NamedTuple):
    """A process of one combination of the responses, with draws of it (W20)."""

    process: "Process | SparseProcess"
    prior: Callable[[np.ndarray], np.ndarray]  # from points (m, d) to (m, functions)
    corrections: np.ndarray  # (n, functions), K^-1 (values - prior - errors)


class Draws:
    """Functions drawn from a set of processes.

    A call with points (m, d) of the unit cube returns responses (draws, m, k).

    Parameters
    ----------
    model : Kriging
        Model of the runs.
    number : int
        Number of the set of processes in `model.sets`.
    random : numpy.random.Generator
        Source of the random numbers.
    """

    def __init__(
        self, model: Kriging, number: int, random: np.random.Generator
    ) -> None:
        """Draw functions for each combination of the responses (W20).

        Functions are drawn from the prior, and then corrected so that they agree with
        the samples within their errors.

        Parameters
        ----------
        model : Kriging
            Model of the runs.
        number : int
            Number of the set of processes in `model.sets`.
        random : numpy.random.Generator
            Source of the random numbers.
        """
        self.model = model
        n_functions = N_FUNCTIONS // len(model.sets)
        self._processes = []
        for k, process in enumerate(model.sets[number]):
            # Draw functions from the prior, and noise at the samples.
            prior = _draw_prior(
                process.kernel,
                d=model.unit.shape[1],
                n_functions=n_functions,
                random=random,
            )
            values = model.values[:, k, None]
            errors = model.errors[:, k, None]
            noise = np.sqrt(errors) * random.standard_normal((len(values), n_functions))
            # Compute the weights of the corrections (W20).
            residuals = values - prior(model.unit) - noise
            corrections = process.compute_weights(residuals)
            self._processes.append(_DrawnProcess(process, prior, corrections))

    def __call__(self, unit: np.ndarray) -> np.ndarray:
        """Compute the responses of all draws at some points.

        Parameters
        ----------
        unit : numpy.ndarray, (m, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (draws, m, k)
        """
        centred = unit - 0.5
        widening = math.sqrt(self.model.factor)
        combinations = []
        for process, prior, corrections in self._processes:
            # Covariances of the points (m) with the samples (n), or with centres.
            covariances = process.kernel(centred, process.x)
            mean = (covariances @ process.weights)[:, None]
            draws = prior(centred) + covariances @ corrections
            # Widen the draws about their mean: the factor applies to the variance.
            combinations.append(mean + widening * (draws - mean))
        # Convert combinations (m, draws, k) to responses (draws, m, k).
        drawn_combinations = np.stack(combinations, axis=-1)
        return self.model.unmix(drawn_combinations).transpose(1, 0, 2)


def _draw_prior(
    kernel: Any, d: int, n_functions: int, random: np.random.Generator
) -> Callable[[np.ndarray], np.ndarray]:
    """Draw functions from the prior of a process by random features (RR08).

    A function is the sum of a constant, a linear part, and a smooth part. The smooth
    part is a sum of cosines with random frequencies and phases, which approximates the
    Matern covariance.

    Parameters
    ----------
    kernel : kernel of scikit-learn
        Sum of a linear and a smooth kernel of `repose.calibrate.surrogates.process`.
    d : int
        Number of inputs.
    n_functions : int
        Number of functions to draw.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    callable
        It maps points (m, d) to values (m, n_functions).
    """
    # The kernel is the sum of these two parts, and each part is a product.
    linear = kernel.k1
    smooth = kernel.k2
    slope_variance = linear.k1.constant_value
    variance = smooth.k1.constant_value
    matern = smooth.k2
    # Draw frequencies, phases and amplitudes of the cosines. The frequencies of the
    # Matern covariance have Student's t distribution.
    degrees_of_freedom = 2 * SMOOTHNESS
    frequencies = random.standard_normal((N_FEATURES, d)) / matern.length_scale
    frequencies /= np.sqrt(
        random.chisquare(degrees_of_freedom, (N_FEATURES, 1)) / degrees_of_freedom
    )
    phases = 2 * np.pi * random.random(N_FEATURES)
    amplitudes = np.sqrt(2 * variance / N_FEATURES) * random.standard_normal(
        (N_FEATURES, n_functions)
    )
    # Draw the slope of the linear part in each input, and the constant.
    slopes = np.sqrt(slope_variance) * random.standard_normal((d, n_functions))
    constants = random.standard_normal(n_functions)

    def evaluate(unit: np.ndarray) -> np.ndarray:
        waves = np.cos(unit @ frequencies.T + phases)
        return constants + unit @ slopes + waves @ amplitudes

    return evaluate
