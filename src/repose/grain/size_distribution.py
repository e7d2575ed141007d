"""Draw the sizes of single grains from the spread of measured sizes."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from repose.common.errors import InputError

# Expected range of n = 50 normal values, in standard deviations (Tippett 1925): the
# published table has no standard deviation.
PUBLISHED_N = 50
PUBLISHED_RANGE_SD = 4.498
KEYS = ("scale_sd", "scale_low", "scale_high")
# A random stream for the sizes alone: positions and orientations of a pour are the same
# as with equal grains.
STREAM = 1


class Spread(NamedTuple):
    """Truncated normal distribution of sizes of mean 1."""

    sd: float
    low: float
    high: float


def spread_of_sizes(diameters_mm: np.ndarray) -> Spread:
    """Compute the spread of measured equivalent diameters (N,), over their mean."""
    mean = float(np.mean(diameters_mm))
    sd = float(np.std(diameters_mm, ddof=1))
    smallest_mm = float(min(diameters_mm))
    largest_mm = float(max(diameters_mm))
    return Spread(sd / mean, smallest_mm / mean, largest_mm / mean)


def spread_of_range(maximum: float, minimum: float, mean: float) -> Spread:
    """Estimate the spread of 50 equivalent diameters from their published range.

    The expected range of 50 normal values is 4.498 standard deviations.
    """
    sd = (maximum - minimum) / PUBLISHED_RANGE_SD / mean
    return Spread(sd, minimum / mean, maximum / mean)


def normalisation(sd: float, low: float, high: float) -> float:
    """Compute the cube root of E[x^3] of a truncated normal x of mean 1.

    Divided by it, x keeps the mean volume.

    Parameters
    ----------
    sd : float
        Standard deviation before the truncation, above 0.
    low, high : float
        Ends of the distribution.
    """
    # Gauss-Legendre quadrature; the nodes are moved from (-1, 1) to (low, high).
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x = low + (high - low) * (nodes + 1) / 2
    density = weights * np.exp(-0.5 * ((x - 1) / sd) ** 2)
    return float(np.cbrt(density @ x**3 / density.sum()))


def smallest_scale(distribution: str, grain: Mapping[str, float]) -> float:
    """Compute the smallest scale that `draw_scales` can draw.

    Parameters
    ----------
    distribution : str
        "none" for equal grains, or "measured".
    grain : mapping
        The mean grain, with the spread of its sizes.
    """
    spread = _read_spread(distribution, grain)
    if spread.sd == 0:
        return 1.0
    return spread.low / normalisation(*spread)


def draw(
    rng: np.random.Generator, count: int, sd: float, low: float, high: float
) -> np.ndarray:
    """Draw the relative sizes of single grains from a truncated normal distribution.

    Parameters
    ----------
    rng : Generator
        Random generator. One number is drawn for each grain, and none if `sd` is 0.
    count : int
        Number of grains.
    sd : float
        Standard deviation before the truncation; 0 gives grains of size 1.
    low, high : float
        Smallest and largest size, for sizes of mean 1.

    Returns
    -------
    ndarray
        Sizes s (count,), divided by the `normalisation`: E[s^3] = 1 keeps the mean
        volume.
    """
    if sd == 0:
        return np.ones(count)
    from scipy.special import ndtr, ndtri  # slow to import: where sizes differ

    # Draw uniform numbers between the probabilities of both ends, and convert them to
    # sizes by the inverse of the normal distribution.
    low_probability = ndtr((low - 1) / sd)
    high_probability = ndtr((high - 1) / sd)
    uniform_numbers = rng.random(count)
    probabilities = (
        low_probability + (high_probability - low_probability) * uniform_numbers
    )
    sizes = 1 + sd * ndtri(probabilities)
    return np.clip(sizes, low, high) / normalisation(sd, low, high)


def _read_spread(distribution: str, grain: Mapping[str, float]) -> Spread:
    """Read the spread of the sizes from the values of a mean grain.

    Parameters
    ----------
    distribution : str
        The key `size_distribution`. With ``none`` all grains have the same size.
    grain : mapping
        Values of the mean grain by key, as in berry.json.

    Returns
    -------
    Spread
        The spread of sizes of mean 1.

    Raises
    ------
    InputError
        If a value is missing or impossible.
    """
    if distribution == "none":
        return Spread(0.0, 1.0, 1.0)
    for key in KEYS:
        value = grain.get(key)
        if value is None or not math.isfinite(value) or value < 0:
            allowed = "a number, as the verb berry writes it"
            raise InputError("berry.json", key, value, allowed)
    return Spread(*(grain[key] for key in KEYS))


def draw_scales(
    distribution: str, grain: Mapping[str, Any], seed: int, count: int
) -> tuple[np.ndarray, float]:
    """Draw the scales of the grains of a pour.

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
        Size of each grain (count,), over that of the mean grain.
    largest_scale : float
        The largest size that can be drawn.

    Raises
    ------
    InputError
        If the mean grain has no possible spread.
    """
    spread = _read_spread(distribution, grain)
    rng = np.random.default_rng([STREAM, seed])
    scales = draw(rng, count, *spread)
    if spread.sd == 0:
        return scales, 1.0
    return scales, spread.high / normalisation(*spread)
