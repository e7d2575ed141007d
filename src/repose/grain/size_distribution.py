"""Draw the sizes of single grains from the spread of measured sizes."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from repose.common.errors import InputError

# The published table has the range of 50 diameters, but no standard deviation. The
# expected range of 50 normal values is this number of standard deviations (Tippett
# 1925).
PUBLISHED_RANGE_SD = 4.498
# Keys of the mean grain for the spread of its sizes
SPREAD_KEYS = ("scale_sd", "scale_low", "scale_high")
# The sizes of a pour are drawn from a random stream of their own, so that positions and
# orientations are the same as in a pour of equal grains.
SIZE_STREAM = 1
QUADRATURE_NODES = 60  # of the Gauss-Legendre rule


class Spread(NamedTuple):
    """Truncated normal distribution of relative sizes.

    Attributes
    ----------
    sd : float
        Standard deviation before the truncation; 0 for equal sizes.
    low, high : float
        Smallest and largest size. The mean is 1.
    """

    sd: float
    low: float
    high: float


def compute_spread(diameters_mm: np.ndarray) -> Spread:
    """Compute the spread of equivalent diameters (N,), relative to their mean."""
    mean = float(np.mean(diameters_mm))
    sd = float(np.std(diameters_mm, ddof=1))
    smallest_mm = float(min(diameters_mm))
    largest_mm = float(max(diameters_mm))
    return Spread(sd / mean, smallest_mm / mean, largest_mm / mean)


def estimate_spread(maximum: float, minimum: float, mean: float) -> Spread:
    """Estimate the relative spread of 50 equivalent diameters from their range.

    The standard deviation is the range over `PUBLISHED_RANGE_SD`.
    """
    sd = (maximum - minimum) / PUBLISHED_RANGE_SD / mean
    return Spread(sd, minimum / mean, maximum / mean)


def compute_normalisation(sd: float, low: float, high: float) -> float:
    """Compute the cube root of E[x^3] for sizes x with a truncated normal distribution.

    If the sizes are divided by this number, their mean volume is that of a grain of
    size 1.

    Parameters
    ----------
    sd : float
        Standard deviation before the truncation, above 0.
    low, high : float
        Smallest and largest size. The mean before the truncation is 1.

    Returns
    -------
    float
        The cube root.
    """
    # Integrate by Gauss-Legendre quadrature, with its nodes mapped from the interval
    # (-1, 1) to the interval (low, high).
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE_NODES)
    x = low + (high - low) * (nodes + 1) / 2
    density = weights * np.exp(-0.5 * ((x - 1) / sd) ** 2)
    return float(np.cbrt(density @ x**3 / density.sum()))


def compute_smallest_scale(distribution: str, grain: Mapping[str, float]) -> float:
    """Compute the smallest scale that `draw_scales` can draw.

    Parameters
    ----------
    distribution : str
        "none" for equal grains, or "measured".
    grain : mapping
        The mean grain, with the spread of its sizes.

    Returns
    -------
    float
        The size of the smallest grain over that of the mean grain.
    """
    spread = _read_spread(distribution, grain)
    if spread.sd == 0:
        return 1.0
    return spread.low / compute_normalisation(*spread)


def draw_sizes(
    rng: np.random.Generator, count: int, sd: float, low: float, high: float
) -> np.ndarray:
    """Draw the relative sizes of single grains from a truncated normal distribution.

    Parameters
    ----------
    rng : Generator
        Random generator, which is advanced by one number for each grain. It is not
        advanced if `sd` is 0.
    count : int
        Number of grains.
    sd : float
        Standard deviation before the truncation; 0 gives grains of size 1.
    low, high : float
        Smallest and largest size. The mean before the truncation is 1.

    Returns
    -------
    ndarray
        Sizes s (count,) with E[s^3] = 1, so that the mean volume is preserved. To
        achieve this, the drawn sizes are divided by `compute_normalisation`.
    """
    if sd == 0:
        return np.ones(count)
    # This module is slow to import, and equal grains do not need it.
    from scipy.special import ndtr, ndtri

    # Draw probabilities uniformly between those of the two ends. The inverse of the
    # cumulative normal distribution converts them to sizes.
    low_probability = ndtr((low - 1) / sd)
    high_probability = ndtr((high - 1) / sd)
    uniform_numbers = rng.random(count)
    probabilities = (
        low_probability + (high_probability - low_probability) * uniform_numbers
    )
    sizes = 1 + sd * ndtri(probabilities)
    # Rounding errors may move a size beyond an end.
    return np.clip(sizes, low, high) / compute_normalisation(sd, low, high)


def _read_spread(distribution: str, grain: Mapping[str, float]) -> Spread:
    """Read how much the sizes of the grains differ, from the values of a mean grain.

    Parameters
    ----------
    distribution : str
        "none" if all grains are equal, or "measured" for the spread in `grain`.
    grain : mapping
        Values of the mean grain by key, as in berry.json.

    Returns
    -------
    Spread
        Standard deviation, smallest and largest size, relative to the mean size.

    Raises
    ------
    InputError
        If a value is missing, not finite or negative.
    """
    if distribution == "none":
        # Standard deviation 0; smallest and largest size 1
        return Spread(0.0, 1.0, 1.0)
    for key in SPREAD_KEYS:
        value = grain.get(key)
        if value is None or not math.isfinite(value) or value < 0:
            allowed = "a number, as the verb berry writes it"
            raise InputError("berry.json", key, value, allowed)
    # `SPREAD_KEYS` has the order of the fields of `Spread`.
    return Spread(*(grain[key] for key in SPREAD_KEYS))


def draw_scales(
    distribution: str, grain: Mapping[str, Any], seed: int, count: int
) -> tuple[np.ndarray, float]:
    """Draw the scale of each grain of a pour: its size over that of the mean grain.

    Parameters
    ----------
    distribution : str
        "none" for equal grains, or "measured".
    grain : mapping
        The mean grain, with the spread of its sizes.
    seed : int
        Seed of the pour.
    count : int
        Number of grains.

    Returns
    -------
    scales : ndarray
        The scale of each grain (count,).
    largest_scale : float
        The largest scale that can be drawn.

    Raises
    ------
    InputError
        If the mean grain has no spread of sizes, or one that is out of range.
    """
    spread = _read_spread(distribution, grain)
    # The random numbers of the sizes are independent of those of the positions.
    rng = np.random.default_rng([SIZE_STREAM, seed])
    scales = draw_sizes(rng, count, *spread)
    if spread.sd == 0:
        return scales, 1.0
    return scales, spread.high / compute_normalisation(*spread)
