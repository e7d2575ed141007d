"""The goal: the targets within a tolerance, its probability, and its possible gain by further pours."""

from typing import NamedTuple, Self

import numpy as np
from scipy.special import ndtr

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import LEAST, within
from repose.calibrate.strategies.sequential.kriging import Kriging
from repose.calibrate.targets import Targets

LUCK = 3.0  # standard deviations by which further pours may move a predicted mean towards the target
MOST_NEEDED = 10**6  # pours; more are not counted


class Goal(NamedTuple):
    """The targets with a tolerance.

    A response is met if its mean lies within `half` of its `aim`. The score includes the prior of `space`.
    """

    aim: np.ndarray  # (k,)
    half: np.ndarray  # (k,), half width of the tolerance
    space: ParameterSpace
    weight: np.ndarray  # (k,), of Eq. 11 of the paper, over the width of the range

    @classmethod
    def of(
        cls, targets: Targets, tolerance_percent: float, space: ParameterSpace
    ) -> Self:
        """Make the goal of a study; the tolerance is in percent of each aim (`Target.whole`)."""
        weight = targets.weight / (targets.high - targets.low)
        return cls(targets.aim, tolerance_percent / 100 * targets.whole, space, weight)

    def of_responses(self, responses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute two deviations (...) of responses (..., k): the largest in tolerances, and F.

        The goal is met if the largest is at most 1; F is Eq. 11 of the paper.
        """
        off = np.abs(responses - self.aim)
        return (off / self.half).max(axis=-1), off @ self.weight

    def expected_deviation(
        self, mean: np.ndarray, covariance: np.ndarray
    ) -> np.ndarray:
        """Compute the mean (m,) of F, Eq. 11 of the paper, for mean responses (m, k) with covariance (m, k, k)."""
        off, sd = mean - self.aim, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        z = off / sd
        return (
            sd * np.sqrt(2 / np.pi) * np.exp(-(z**2) / 2) + off * (1 - 2 * ndtr(-z))
        ) @ self.weight

    def probability(self, mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """Compute the probability (m,) to meet all responses, for mean responses (m, k) with covariance (m, k, k)."""
        return within(mean, covariance, self.aim - self.half, self.aim + self.half)

    def score(self, model: Kriging, unit: np.ndarray) -> np.ndarray:
        """Add the log of the probability (m,) that points (m, d) meet the targets to the log of their prior density."""
        mean, covariance = model.predict(unit)
        off = mean - self.aim
        miss = np.einsum(
            "mi,mi->m", off, np.linalg.solve(covariance, off[:, :, None])[:, :, 0]
        )
        # where the probability underflows, the nearer point is better
        probability = np.maximum(self.probability(mean, covariance), LEAST)
        return np.log(probability) - 1e-6 * miss + self.space.log_prior(unit)

    def reachable(self, model: Kriging, unit: np.ndarray, pours: int) -> float:
        """Estimate the highest probability that further pours at one of the points (m, d) can give at best.

        They shrink the covariance C of its mean to (C^-1 + pours N^-1)^-1 with the noise N of a pour, and may move the
        mean towards the target by `LUCK` standard deviations of their information.
        """
        mean, covariance = model.predict(unit)
        rest = np.linalg.inv(
            np.linalg.inv(covariance) + pours * np.linalg.inv(model.noise)
        )
        gained = np.maximum(np.diagonal(covariance - rest, axis1=1, axis2=2), 0.0)
        off = mean - self.aim
        off = np.sign(off) * np.maximum(np.abs(off) - LUCK * np.sqrt(gained), 0.0)
        return float(self.probability(self.aim + off, rest).max())

    def needed(self, noise: np.ndarray, probability: float) -> int:
        """Count the pours at a point that fix its mean within the tolerance, by the noise (k, k) of a pour alone.

        `probability` holds for all responses together. At most `MOST_NEEDED`.
        """
        few, many = 0, 1

        def enough(pours: int) -> bool:
            return (
                self.probability(self.aim[None], noise[None] / pours)[0] >= probability
            )

        while many < MOST_NEEDED and not enough(many):
            few, many = many, 2 * many
        while many - few > 1:
            middle = (few + many) // 2
            few, many = (few, middle) if enough(middle) else (middle, many)
        return min(many, MOST_NEEDED)
