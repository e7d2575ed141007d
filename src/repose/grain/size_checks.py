"""Whether one grain can stand for the measured ones: groups, spread, largest volume."""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.integrate import quad

FEWEST = 4  # grains that can form two groups: two in each
# Probability that grains of one kind are taken for two groups.
SIGNIFICANCE = 0.01
SAMPLES = 2000  # of grains of one kind, for its quantile
SEED = 2026


class Split(NamedTuple):
    """Values in two groups: the smallest values, and the others.

    Attributes
    ----------
    n_small : int
        Number of values in the first group.
    explained : float
        Share of the variance that lies between the means of the groups.
    """

    n_small: int
    explained: float


class SizeGroups(NamedTuple):
    """Two groups of grains.

    Attributes
    ----------
    counts : tuple of int
        Number of grains in the group of the small and of the large ones.
    diameters_mm : tuple of float
        Geometric means of their equivalent diameters.
    """

    counts: tuple[int, int]
    diameters_mm: tuple[float, float]

    @property
    def ratio(self) -> float:
        """The diameter of the large grains over that of the small ones."""
        small, large = self.diameters_mm
        return large / small


def best_split(values: np.ndarray) -> Split:
    """Split values (N,) at the place that explains most of their variance.

    This is the exact solution of k-means for two groups in one dimension. Normal values
    give 2/pi and uniform ones 3/4, for many values.
    """
    ordered = np.sort(np.asarray(values, float))
    deviations = ordered - ordered.mean()
    total = float(deviations @ deviations)
    if total == 0:
        return Split(len(ordered), 0.0)
    n = len(ordered)
    n_small = np.arange(1, n)
    sums = np.cumsum(deviations)[:-1]
    between = sums**2 * n / (n_small * (n - n_small))
    best = int(np.argmax(between))
    return Split(best + 1, float(between[best]) / total)


@cache
def explained_by_chance(n_values: int) -> float:
    """Estimate the share that the best split of uniform values rarely exceeds.

    `SIGNIFICANCE` is the probability to exceed it. The uniform distribution is the
    widest with one mode, the reference of the dip test, too.

    Notes
    -----
    J. A. Hartigan and P. M. Hartigan, The dip test of unimodality, Annals of Statistics
    13 (1985) 70-84.
    """
    rng = np.random.default_rng(SEED)
    shares = [best_split(rng.random(n_values)).explained for _ in range(SAMPLES)]
    return float(np.quantile(shares, 1 - SIGNIFICANCE))


def find_groups(diameters_mm: np.ndarray) -> SizeGroups | None:
    """Find out whether equivalent diameters (N,) form two groups.

    They do if the best split of their logarithms explains more of the variance than
    chance does (`explained_by_chance`).

    Returns
    -------
    SizeGroups or None
        The groups; None if all grains may be of one kind.
    """
    logarithms = np.sort(np.log(np.asarray(diameters_mm, float)))
    split = best_split(logarithms)
    if len(logarithms) < FEWEST or split.explained <= explained_by_chance(
        len(logarithms)
    ):
        return None
    small = logarithms[: split.n_small]
    large = logarithms[split.n_small :]
    return SizeGroups(
        counts=(len(small), len(large)),
        diameters_mm=(math.exp(small.mean()), math.exp(large.mean())),
    )


def largest_volume(axes: Sequence[float]) -> float:
    """Compute the largest volume of a body with three full axes, the longest first.

    The long axis is the largest extent in any direction. A body with this extent that
    is symmetric to three planes lies in the ball around the long axis, and in the box
    around the axes; for equal axes this is the sphere.

    Notes
    -----
    Steiner's symmetrisation makes any body symmetric, keeps its volume, and increases
    no extent; so no other body is larger (isodiametric inequality).
    """
    radius, half_width, half_height = (0.5 * axis for axis in axes)

    def half_section(y: float) -> float:
        """Integrate the half length of the body over z, from 0 to its top, at y."""
        rim = math.sqrt(max(radius**2 - y**2, 0.0))
        top = min(half_height, rim)
        if top == 0:
            return 0.0
        chord = math.sqrt(max(rim**2 - top**2, 0.0))
        return 0.5 * (top * chord + rim**2 * math.asin(min(top / rim, 1.0)))

    return 8 * float(quad(half_section, 0.0, half_width)[0])
