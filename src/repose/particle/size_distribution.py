"""Sizes of single berries: scales from a truncated normal distribution whose mean volume is that of the particle."""

import math
from collections.abc import Mapping

import numpy as np
from scipy.special import ndtr, ndtri

from repose.core.errors import InputError

# Range of n = 50 normal values expected, in standard deviations (Tippett 1925): what Table 1 lets us infer.
PUBLISHED_N, PUBLISHED_RANGE_SD = 50, 4.498
KEYS = ("scale_sd", "scale_low", "scale_high")
# A stream of its own: the places and orientations of a pour stay those of berries that are all alike.
STREAM = 1


def of_sizes(diameters_mm):
    """(relative standard deviation, smallest, largest) of measured equivalent diameters (N,), over their mean."""
    mean = float(np.mean(diameters_mm))
    return (
        float(np.std(diameters_mm, ddof=1)) / mean,
        float(min(diameters_mm)) / mean,
        float(max(diameters_mm)) / mean,
    )


def of_range(maximum, minimum, mean):
    """The same of a published range of 50: the expected range of 50 normal values is 4.498 standard deviations."""
    return (maximum - minimum) / PUBLISHED_RANGE_SD / mean, minimum / mean, maximum / mean


def normalisation(sd, low, high):
    """Cube root of E[x^3] of a normal x of mean 1 cut off at low and high: x over it keeps the mean volume."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x = low + (high - low) * (nodes + 1) / 2
    density = weights * np.exp(-0.5 * ((x - 1) / sd) ** 2)
    return float(np.cbrt(density @ x**3 / density.sum()))


def smallest(distribution: str, berry: Mapping[str, float]) -> float:
    """The smallest scale that `of_pour` can draw."""
    sd, low, high = (berry[key] for key in KEYS)
    return 1.0 if distribution == "none" or sd == 0 else low / normalisation(sd, low, high)


def draw(rng, count, sd, low, high):
    """Scales (count,) of single berries, E[s^3] = 1; all 1 where sd is 0."""
    if sd == 0:
        return np.ones(count)
    bottom, top = ndtr((low - 1) / sd), ndtr((high - 1) / sd)
    x = 1 + sd * ndtri(bottom + (top - bottom) * rng.random(count))
    return np.clip(x, low, high) / normalisation(sd, low, high)


def of_pour(distribution, berry, seed, count):
    """(scales (count,), largest scale there can be) of one pour.

    distribution: "none" or "measured"; berry: mapping with scale_sd, scale_low, scale_high, as `berry.run`
    writes it. Raises InputError where these are missing.
    """
    if distribution == "none":
        return np.ones(count), 1.0
    for key in KEYS:
        if key not in berry or not (math.isfinite(berry[key]) and berry[key] >= 0):
            raise InputError("berry.json", key, berry.get(key), "a number, as the verb berry writes it")
    sd, low, high = (berry[key] for key in KEYS)
    scales = draw(np.random.default_rng([STREAM, seed]), count, sd, low, high)
    return scales, high / normalisation(sd, low, high) if sd else 1.0
