"""Estimate whether any parameter set meets the goal, and how near the nearest one is.

The estimate uses random draws of possible responses. A draw is a function of the
parameters that agrees with the runs within their errors. A search finds the best point
of each draw, so the estimate holds for all parameter sets together, not for a single
set.

- (RR08) Rahimi & Recht 2008, Random features for large-scale kernel machines, NeurIPS
  20
- (W20) Wilson et al. 2020, Efficiently sampling functions from Gaussian process
  posteriors, ICML 119: a draw of the prior from random features, corrected by the runs
  with the exact covariance (pathwise conditioning, Matheron's rule)
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
    """Best possible agreement with the goal over all parameter sets.

    F is the weighted sum of the deviations from the targets (Eq. 11 of the paper).
    """

    probability: float  # probability that some parameter set meets the goal
    deviation: float  # smallest F of any parameter set, mean over the draws
    deviation_sd: float  # standard deviation of the smallest F over the draws
    points: np.ndarray  # (draws, d), the point of each draw that is nearest to the goal


class _BestPoints(NamedTuple):
    """Result of the search for the best points in each of several draws.

    The two minima of a draw may be at different points.
    """

    # (draws,), minimum over the points of the largest deviation from a target, in
    # tolerances.
    largest: np.ndarray
    F: np.ndarray  # (draws,), minimum over the points of F (Eq. 11 of the paper)
    points: np.ndarray  # (draws, d), where the largest deviation has its minimum


def estimate_reach(model: Kriging, goal: Goal, random: np.random.Generator) -> Reach:
    """Estimate the probability that any parameter set meets the goal.

    The model is uncertain about the responses. So possible responses are drawn, each a
    function of the parameters. The probability is the fraction of these functions whose
    best parameter set meets the goal.

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
        The probability, and how near the best points come to the goal.
    """
    from scipy.stats import qmc

    # Start the search from points all over the unit cube and from corners, which are
    # these points with rounded coordinates.
    d = model.centred_points.shape[1]
    sequence = qmc.Sobol(d, rng=random)
    everywhere = take_allowed_points(sequence, N_CANDIDATES, goal.space)
    starts = np.vstack([everywhere, np.round(everywhere)])
    starts = starts[goal.space.is_allowed(starts)]

    # Search in the functions that are drawn from each set of processes.
    results = []
    for set_index in range(len(model.process_sets)):
        draws = Draws(model, set_index, random)
        results.append(_search_draws(draws, goal, starts, random))

    # Combine all draws. A draw meets the goal if its largest deviation is at most one
    # tolerance.
    largest = np.concatenate([result.largest for result in results])
    F = np.concatenate([result.F for result in results])
    return Reach(
        probability=float((largest <= 1).mean()),
        deviation=float(F.mean()),
        deviation_sd=float(F.std()),
        points=np.concatenate([result.points for result in results]),
    )


def _search_draws(
    draws: "Draws", goal: Goal, starts: np.ndarray, random: np.random.Generator
) -> _BestPoints:
    """Search each draw for the points with the smallest deviations from the goal.

    There are two criteria: the largest deviation from a target, and F, the weighted sum
    of the deviations (Eq. 11 of the paper). The search tries random points around the
    best ones so far, in ever smaller steps.

    Parameters
    ----------
    draws : Draws
        The functions to search. A call with points returns their responses.
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
    # Both criteria have the shape (draws, points).
    largest_deviations, F = goal.compute_deviations(draws(points))
    for step in STEP_SDS:
        # Choose two points of each draw, the best by either criterion.
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

        # Every draw is evaluated at all points, also at those that were tried because
        # of another draw.
        points = np.vstack([points, new_points])
        largest_deviations = np.hstack([largest_deviations, new_largest_deviations])
        F = np.hstack([F, new_F])
    return _BestPoints(
        largest=largest_deviations.min(axis=1),
        F=F.min(axis=1),
        points=points[largest_deviations.argmin(axis=1)],
    )


class _DrawnProcess(NamedTuple):
    """A process of one combination of the responses, and functions drawn from it.

    A drawn function is prior + covariances with the samples @ corrections (W20).
    """

    process: "Process | SparseProcess"
    # The functions drawn from the prior: from points (m, d) to values (m, functions).
    prior: Callable[[np.ndarray], np.ndarray]
    corrections: np.ndarray  # (n, functions), K^-1 (values - prior - noise)


class Draws:
    """Functions drawn from a set of processes: possible responses of the simulator.

    A call with points (m, d) of the unit cube returns responses (draws, m, k).

    Parameters
    ----------
    model : Kriging
        Model of the runs.
    set_index : int
        Index of the set of processes in `model.process_sets`.
    random : numpy.random.Generator
        Source of the random numbers.
    """

    def __init__(
        self, model: Kriging, set_index: int, random: np.random.Generator
    ) -> None:
        """Draw random functions for each combination (weighted sum) of the responses.

        Functions are drawn from the prior, and then corrected so that they agree with
        the samples within their noise. This is pathwise conditioning, as in Wilson et
        al. 2020 (W20).

        Parameters
        ----------
        model : Kriging
            Model of the runs.
        set_index : int
            Index of the set of processes in `model.process_sets`.
        random : numpy.random.Generator
            Source of the random numbers.
        """
        self.model = model
        # All sets together have about `N_FUNCTIONS` functions.
        n_functions = N_FUNCTIONS // len(model.process_sets)
        self._processes = []
        for k, process in enumerate(model.process_sets[set_index]):
            # Draw functions from the prior, and noise at the samples.
            prior = _draw_prior(
                process.kernel,
                d=model.centred_points.shape[1],
                n_functions=n_functions,
                random=random,
            )
            values = model.values[:, k, None]
            noise_sd = np.sqrt(model.noise_variances[:, k, None])
            noise = noise_sd * random.standard_normal((len(values), n_functions))
            # Compute the corrections, which move the functions to the samples.
            residuals = values - prior(model.centred_points) - noise
            corrections = process.compute_weights(residuals)
            self._processes.append(_DrawnProcess(process, prior, corrections))

    def __call__(self, unit_points: np.ndarray) -> np.ndarray:
        """Compute the responses of all drawn functions at some points.

        Parameters
        ----------
        unit_points : numpy.ndarray, (m, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (draws, m, k)
        """
        centred = unit_points - 0.5
        # The factor of the model applies to variances, so its root to deviations.
        widening = math.sqrt(self.model.factor)
        combinations = []
        for process, prior, corrections in self._processes:
            # Covariances of the points (m) with the samples (n) of an exact process, or
            # with the centres of a sparse one.
            covariances = process.kernel(centred, process.x)
            mean = (covariances @ process.weights)[:, None]
            # Correct the functions of the prior by the samples (W20).
            draws = prior(centred) + covariances @ corrections
            combinations.append(mean + widening * (draws - mean))
        # Convert combinations (m, draws, k) to responses (draws, m, k).
        drawn_combinations = np.stack(combinations, axis=-1)
        return self.model.unmix(drawn_combinations).transpose(1, 0, 2)


def _draw_prior(
    kernel: Any, d: int, n_functions: int, random: np.random.Generator
) -> Callable[[np.ndarray], np.ndarray]:
    """Draw functions from the prior of a Gaussian process.

    A function is the sum of a constant, a linear part, and a smooth part. The smooth
    part is a sum of cosines with random frequencies and phases. Such random features
    approximate the Matern covariance (Rahimi & Recht 2008, RR08).

    Parameters
    ----------
    kernel : kernel of scikit-learn
        The sum `make_linear_kernel(...) + make_smooth_kernel(...)` of
        `repose.calibrate.surrogates.process`, in this order. Its smoothness must be
        `SMOOTHNESS`.
    d : int
        Number of inputs.
    n_functions : int
        Number of functions to draw.
    random : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    callable
        It maps centred points (m, d) to values (m, n_functions).
    """
    # The kernel is the sum k1 + k2 of these two parts, and each part is the product
    # k1 * k2 of a constant and a kernel.
    linear = kernel.k1
    smooth = kernel.k2
    slope_variance = linear.k1.constant_value
    variance = smooth.k1.constant_value
    matern = smooth.k2
    # Draw frequencies, phases and amplitudes of the cosines. The frequencies of the
    # Matern covariance have Student's t distribution: normal numbers divided by the
    # root of a chi-squared number over its degrees of freedom.
    degrees_of_freedom = 2 * SMOOTHNESS
    frequencies = random.standard_normal((N_FEATURES, d)) / matern.length_scale
    frequencies /= np.sqrt(
        random.chisquare(degrees_of_freedom, (N_FEATURES, 1)) / degrees_of_freedom
    )
    phases = 2 * np.pi * random.random(N_FEATURES)
    amplitudes = np.sqrt(2 * variance / N_FEATURES) * random.standard_normal(
        (N_FEATURES, n_functions)
    )
    # Draw the slope of the linear part in each input, and the constant, which has the
    # variance 1 in `make_linear_kernel`.
    slopes = np.sqrt(slope_variance) * random.standard_normal((d, n_functions))
    constants = random.standard_normal(n_functions)

    def evaluate(centred_points: np.ndarray) -> np.ndarray:
        waves = np.cos(centred_points @ frequencies.T + phases)
        return constants + centred_points @ slopes + waves @ amplitudes

    return evaluate
