"""Sizes of single grains: scales from a truncated normal distribution; their mean volume is the particle's."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from repose.common.errors import InputError

# Expected range of n = 50 normal values, in standard deviations (Tippett 1925): all that Table 1 allows.
PUBLISHED_N, PUBLISHED_RANGE_SD = 50, 4.498
KEYS = ("scale_sd", "scale_low", "scale_high")
# A stream of its own: the places and orientations of a pour are the same as with equal berries.
STREAM = 1


def of_sizes(diameters_mm: np.ndarray) -> tuple[float, float, float]:
    """Compute standard deviation, smallest and largest of measured equivalent diameters (N,), over their mean."""
    mean, sd = float(np.mean(diameters_mm)), float(np.std(diameters_mm, ddof=1))
    return sd / mean, float(min(diameters_mm)) / mean, float(max(diameters_mm)) / mean


def of_range(maximum: float, minimum: float, mean: float) -> tuple[float, float, float]:
    """Estimate sd, smallest and largest of 50 equivalent diameters over their mean by the published range.

    The expected range of 50 normal values is 4.498 standard deviations.
    """
    return (
        (maximum - minimum) / PUBLISHED_RANGE_SD / mean,
        minimum / mean,
        maximum / mean,
    )


def normalisation(sd: float, low: float, high: float) -> float:
    """Compute the cube root of E[x^3] of a truncated normal x of mean 1; x over it keeps the mean volume."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x = low + (high - low) * (nodes + 1) / 2
    density = weights * np.exp(-0.5 * ((x - 1) / sd) ** 2)
    return float(np.cbrt(density @ x**3 / density.sum()))


def smallest(distribution: str, grain: Mapping[str, float]) -> float:
    """Return the smallest scale of `of_pour`; arguments as there."""
    sd, low, high = _spread(distribution, grain)
    return low / normalisation(sd, low, high) if sd else 1.0


def draw(
    rng: np.random.Generator, count: int, sd: float, low: float, high: float
) -> np.ndarray:
    """Draw scales s (count,) of single grains with E[s^3] = 1; all 1 if `sd` is 0."""
    if sd == 0:
        return np.ones(count)
    from scipy.special import ndtr, ndtri  # slow to import: where sizes differ

    bottom, top = ndtr((low - 1) / sd), ndtr((high - 1) / sd)
    x = 1 + sd * ndtri(bottom + (top - bottom) * rng.random(count))
    return np.clip(x, low, high) / normalisation(sd, low, high)


def _spread(distribution: str, grain: Mapping[str, float]) -> list[float]:
    """Return the three numbers of the spread, or raise InputError."""
    if distribution == "none":
        return [0.0, 1.0, 1.0]
    for key in KEYS:
        if key not in grain or not (math.isfinite(grain[key]) and grain[key] >= 0):
            raise InputError(
                "berry.json",
                key,
                grain.get(key),
                "a number, as the verb berry writes it",
            )
    return [grain[key] for key in KEYS]


def of_pour(
    distribution: str, grain: Mapping[str, Any], seed: int, count: int
) -> tuple[np.ndarray, float]:
    """Draw scales (count,) of the grains of a pour, and the largest possible scale."""
    sd, low, high = _spread(distribution, grain)
    scales = draw(np.random.default_rng([STREAM, seed]), count, sd, low, high)
    return scales, high / normalisation(sd, low, high) if sd else 1.0
