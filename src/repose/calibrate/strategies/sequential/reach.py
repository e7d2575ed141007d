"""Whether any parameter set meets the goal, and how near the nearest comes, by draws of possible responses.

A draw is a function of the parameters that agrees with the pours within their errors. In each draw the best point is
searched for, so the answer is about all parameter sets together, not about a single set.

- (RR08) Rahimi & Recht 2008, Random features for large-scale kernel machines, NeurIPS 20
- (W20) Wilson et al. 2020, Efficiently sampling functions from Gaussian process posteriors, ICML 119: a draw of the
  prior from random features, corrected by the pours with the exact covariance
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import SMOOTHNESS, Kriging

FEATURES = 128
FUNCTIONS = 16  # drawn for each set of lengths
CANDIDATES = 256  # all over the ranges, and as many of their corners
AROUND = 16  # points around the best of each draw
STEPS = (0.2, 0.07, 0.02)  # standard deviations of those, in ranges


class Reach(NamedTuple):
    """Best possible agreement with the goal over all parameter sets, by draws of the responses."""

    probability: float  # that some parameter set meets the goal
    nearest: float  # least deviation of a parameter set, F of Eq. 11: mean of the draws
    error: float  # their standard deviation
    points: (
        np.ndarray
    )  # (draws, d), where each draw comes nearest to the goal, in the unit cube


def reach(model: Kriging, goal: Goal, random: np.random.Generator) -> Reach:
    """Estimate the probability that any parameter set meets the goal, and the least deviation of a set."""
    from scipy.stats import qmc

    wide = goal.space.from_prior(
        qmc.Sobol(model.unit.shape[1], rng=random).random(CANDIDATES)
    )
    wide = np.vstack([wide, np.round(wide)])
    found = []
    for number in range(len(model.sets)):
        draws = Draws(model, number, random)
        points, misses, deviation = wide, *goal.of_responses(draws(wide))
        for step in STEPS:
            best = points[
                np.concatenate([misses.argmin(axis=1), deviation.argmin(axis=1)])
            ]
            near = np.repeat(best, AROUND, axis=0)
            near = np.clip(near + step * random.standard_normal(near.shape), 0, 1)
            points = np.vstack([points, near])
            more = goal.of_responses(draws(near))
            misses, deviation = (
                np.hstack([misses, more[0]]),
                np.hstack([deviation, more[1]]),
            )
        found.append(
            (misses.min(axis=1), deviation.min(axis=1), points[misses.argmin(axis=1)])
        )
    least, nearest, best = map(np.concatenate, zip(*found, strict=True))
    return Reach(
        float((least <= 1).mean()), float(nearest.mean()), float(nearest.std()), best
    )


class Draws:
    """Functions drawn from set `number` of processes: called with points (m, d) they give responses (draws, m, k)."""

    def __init__(
        self, model: Kriging, number: int, random: np.random.Generator
    ) -> None:
        self.model, self.parts = model, []
        for k, process in enumerate(model.sets[number]):
            prior = _prior(process.kernel, model.unit.shape[1], random)
            values, errors = model.values[:, k, None], model.errors[:, k, None]
            off = np.sqrt(errors) * random.standard_normal((len(values), FUNCTIONS))
            corrections = linalg.cho_solve(
                (process.root, True), values - prior(model.unit) - off
            )
            self.parts.append((process, prior, corrections))

    def __call__(self, unit: np.ndarray) -> np.ndarray:
        unit, mixed, root = unit - 0.5, [], math.sqrt(self.model.factor)
        for process, prior, corrections in self.parts:
            between = process.kernel(unit, self.model.unit)
            mean = (between @ process.weights)[:, None]
            mixed.append(mean + root * (prior(unit) + between @ corrections - mean))
        return self.model.unmixed(np.stack(mixed, axis=-1)).transpose(1, 0, 2)


def _prior(
    kernel: Any, d: int, random: np.random.Generator
) -> Callable[[np.ndarray], np.ndarray]:
    """Draw functions of the prior, from points (m, d) to values (m, FUNCTIONS), by random features (RR08)."""
    matern, size = kernel.k2.k2, kernel.k2.k1.constant_value
    # frequencies of Matern's covariance are distributed as Student's t
    freedom = 2 * SMOOTHNESS
    frequencies = random.standard_normal((FEATURES, d)) / matern.length_scale
    frequencies /= np.sqrt(random.chisquare(freedom, (FEATURES, 1)) / freedom)
    phase = 2 * np.pi * random.random(FEATURES)
    weights = np.sqrt(2 * size / FEATURES) * random.standard_normal(
        (FEATURES, FUNCTIONS)
    )
    slopes = np.sqrt(kernel.k1.k1.constant_value) * random.standard_normal(
        (d, FUNCTIONS)
    )
    constant = random.standard_normal(FUNCTIONS)
    return lambda unit: (
        constant + unit @ slopes + np.cos(unit @ frequencies.T + phase) @ weights
    )
