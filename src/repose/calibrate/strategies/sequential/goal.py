"""The goal of a calibration: to meet all targets within a tolerance.

This module computes the probability that a parameter set meets the goal, and how much
further runs may raise this probability.
"""

from typing import NamedTuple, Self

import numpy as np
from scipy.special import ndtr

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import MIN_PROBABILITY, compute_box_probability
from repose.calibrate.strategies.sequential.kriging import Kriging
from repose.calibrate.targets import Targets

# Number of standard deviations by which further runs may move a predicted mean towards
# its target.
LUCKY_SDS = 3.0
MAX_NEEDED = 10**6  # largest number of runs that is counted
# Weight of the squared distance in the score. It decides only where the probability
# underflows.
DISTANCE_WEIGHT = 1e-6


class Deviations(NamedTuple):
    """Two measures of how far responses (..., k) are from the goal."""

    largest: np.ndarray  # (...), largest of the k deviations, in units of the tolerance
    F: np.ndarray  # (...), weighted sum over the responses (Eq. 11 of the paper)


class Goal(NamedTuple):
    """The targets with a tolerance.

    A target is met if the mean of its response lies within `half` of `aim`. The score
    includes the prior of `space`.
    """

    aim: np.ndarray  # (k,)
    half: np.ndarray  # (k,), half width of the tolerance
    space: ParameterSpace
    weight: np.ndarray  # (k,), of Eq. 11 of the paper, over the width of the range
    low: np.ndarray  # (k,), of the ranges of the targets
    high: np.ndarray  # (k,)

    @classmethod
    def from_targets(
        cls, targets: Targets, tolerance_percent: float, space: ParameterSpace
    ) -> Self:
        """Make the goal of a study.

        The tolerance is in percent of each aim (`Target.whole`).
        """
        return cls(
            aim=targets.aim,
            half=tolerance_percent / 100 * targets.whole,
            space=space,
            weight=targets.weight / (targets.high - targets.low),
            low=targets.low,
            high=targets.high,
        )

    def is_in_ranges(self, responses: np.ndarray) -> np.ndarray:
        """Mark the responses (m, k) that lie in the ranges of all targets."""
        is_inside = (responses >= self.low) & (responses <= self.high)
        return np.all(is_inside, axis=1)

    def compute_deviations(self, responses: np.ndarray) -> Deviations:
        """Compute the deviations of responses (..., k) from the goal.

        The goal is met if the largest is at most 1.
        """
        deviation = np.abs(responses - self.aim)
        return Deviations(
            largest=(deviation / self.half).max(axis=-1), F=deviation @ self.weight
        )

    def expected_deviation(
        self, mean: np.ndarray, covariance: np.ndarray
    ) -> np.ndarray:
        """Compute the mean of F, Eq. 11 of the paper, for uncertain responses.

        A normal deviation has mean m and standard deviation s. With z = m / s and the
        distribution function P of the standard normal, the mean of its size is

            s sqrt(2 / pi) exp(-z^2 / 2) + m (1 - 2 P(-z))

        Parameters
        ----------
        mean : array (m, k)
            Means of the responses.
        covariance : array (m, k, k)
            Covariances of the responses.

        Returns
        -------
        array (m,)
        """
        deviation = mean - self.aim
        sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        z = deviation / sd
        expected_size = sd * np.sqrt(2 / np.pi) * np.exp(-(z**2) / 2) + deviation * (
            1 - 2 * ndtr(-z)
        )
        return expected_size @ self.weight

    def probability(self, mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """Compute the probability (m,) that all responses are met.

        The responses have means (m, k) and covariances (m, k, k).
        """
        return compute_box_probability(
            mean, covariance, self.aim - self.half, self.aim + self.half
        )

    def score(self, model: Kriging, unit_points: np.ndarray) -> np.ndarray:
        """Score points (m, d) of the unit cube; the best point has the highest score.

        The score is the log of the probability that a point meets the targets, plus the
        log of its prior density. Where the probability underflows, the point nearer to
        the targets is better.
        """
        mean, covariance = model.predict(unit_points)
        deviation = mean - self.aim
        scaled = np.linalg.solve(covariance, deviation[:, :, None])[:, :, 0]
        squared_distance = np.einsum("mi,mi->m", deviation, scaled)
        probability = np.maximum(self.probability(mean, covariance), MIN_PROBABILITY)
        return (
            np.log(probability)
            - DISTANCE_WEIGHT * squared_distance
            + self.space.log_prior(unit_points)
        )

    def estimate_reachable(
        self, model: Kriging, unit_points: np.ndarray, n_runs: int
    ) -> float:
        """Estimate the highest probability of meeting the goal after further runs.

        It is optimistic. Let C be the covariance of a predicted mean, and N the
        covariance of a single run, `model.noise`. Then n further runs at the point
        reduce C to R = (C^-1 + n N^-1)^-1, the remaining covariance. In a good case,
        they also move the mean towards the target. The move has the covariance C - R.
        The best case that counts is a move of `LUCKY_SDS` standard deviations.

        Parameters
        ----------
        model : Kriging
            Model of the runs.
        unit_points : array (m, d)
            Points of the unit cube.
        n_runs : int
            Number n of further runs, all at one of the points.

        Returns
        -------
        float
            The largest of the probabilities of all points.
        """
        mean, covariance = model.predict(unit_points)
        # Covariance after the further runs.
        precision = np.linalg.inv(covariance) + n_runs * np.linalg.inv(model.noise)
        remaining_covariance = np.linalg.inv(precision)
        # Move each mean towards its target `aim`, but not beyond it.
        variance_of_move = np.diagonal(
            covariance - remaining_covariance, axis1=1, axis2=2
        )
        largest_move = LUCKY_SDS * np.sqrt(np.maximum(variance_of_move, 0.0))
        deviation = mean - self.aim
        distance = np.maximum(np.abs(deviation) - largest_move, 0.0)
        lucky_mean = self.aim + np.sign(deviation) * distance
        return float(self.probability(lucky_mean, remaining_covariance).max())

    def count_needed_runs(self, noise: np.ndarray, probability: float) -> int:
        """Count the runs at one point that are needed to know its mean well enough.

        The mean is known well enough if it lies within the tolerance with a given
        probability. The noise of the runs is the only uncertainty that is considered.

        Parameters
        ----------
        noise : array (k, k)
            Covariance of a single run.
        probability : float
            Required probability that all means lie within the tolerance.

        Returns
        -------
        int
            The smallest number, but at most `MAX_NEEDED`.
        """

        def is_enough(n_runs: int) -> bool:
            # The best case is a mean at the aims.
            return (
                self.probability(self.aim[None], noise[None] / n_runs)[0] >= probability
            )

        # Double the number of runs until it is enough, then bisect.
        too_few = 0
        enough = 1
        while enough < MAX_NEEDED and not is_enough(enough):
            too_few = enough
            enough = 2 * enough
        while enough - too_few > 1:
            middle = (too_few + enough) // 2
            if is_enough(middle):
                enough = middle
            else:
                too_few = middle
        return min(enough, MAX_NEEDED)
