"""Check whether one mean grain can stand for all of the measured grains."""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.integrate import quad

FEWEST = 4  # grains that can form two groups: two in each
# Probability that grains of one kind seem to be two groups
SIGNIFICANCE = 0.01
N_SAMPLES = 2000  # of grains of one kind, from which the limit is estimated
SEED = 2026  # of these samples


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
    """Split values into small and large ones so that the split explains most variance.

    This is the exact solution of k-means for two groups in one dimension. For many
    normally distributed values, the best split explains the share 2/pi of the variance.
    For many uniformly distributed values the share is 3/4.

    Parameters
    ----------
    values : ndarray
        The values (N,), in any order.

    Returns
    -------
    Split
        The number of small values, and the share of the variance that the split
        explains.
    """
    sorted_values = np.sort(np.asarray(values, float))
    deviations = sorted_values - sorted_values.mean()
    sum_of_squares = float(deviations @ deviations)
    if sum_of_squares == 0:
        return Split(len(sorted_values), 0.0)

    # The sum of squares between the groups, for each number of small values. The
    # deviations of both groups add up to zero, so one sum gives both means.
    n = len(sorted_values)
    n_small = np.arange(1, n)
    n_large = n - n_small
    small_sums = np.cumsum(deviations)[:-1]
    squares_between = small_sums**2 * n / (n_small * n_large)
    best = int(np.argmax(squares_between))
    # The first entry is the split with one small value.
    return Split(best + 1, float(squares_between[best]) / sum_of_squares)


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
    shares = [best_split(rng.random(n_values)).explained for _ in range(N_SAMPLES)]
    return float(np.quantile(shares, 1 - SIGNIFICANCE))


def find_groups(diameters_mm: np.ndarray) -> SizeGroups | None:
    """Find out whether the sizes of grains form two groups.

    They do if the best split of their logarithms explains more of the variance than
    chance does (`explained_by_chance`).

    Parameters
    ----------
    diameters_mm : ndarray
        Equivalent diameters (N,) of the grains.

    Returns
    -------
    SizeGroups or None
        The groups; None if all grains may be of one kind.
    """
    logarithms = np.sort(np.log(np.asarray(diameters_mm, float)))
    n_grains = len(logarithms)
    split = best_split(logarithms)
    if n_grains < FEWEST or split.explained <= explained_by_chance(n_grains):
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

    Parameters
    ----------
    axes : sequence of float
        The three full axes, the longest first.

    Returns
    -------
    float
        The volume, in the unit of the axes cubed.

    Notes
    -----
    Steiner's symmetrisation makes any body symmetric, keeps its volume, and increases
    no extent; so no other body is larger (isodiametric inequality).
    """
    ball_radius, half_width, half_height = (0.5 * axis for axis in axes)

    def quarter_area(y: float) -> float:
        """Compute a quarter of the area of the body's section at y.

        The section of the ball is a circle, which the box cuts off at the half height.
        """
        circle_radius = math.sqrt(max(ball_radius**2 - y**2, 0.0))
        cut_height = min(half_height, circle_radius)
        if cut_height == 0:
            return 0.0
        # The quarter consists of a triangle and a sector of the circle.
        half_chord = math.sqrt(max(circle_radius**2 - cut_height**2, 0.0))
        sector_angle = math.asin(min(cut_height / circle_radius, 1.0))
        return 0.5 * (cut_height * half_chord + circle_radius**2 * sector_angle)

    # A quarter of each section, over half of the width, is an eighth of the body.
    eighth, _error = quad(quarter_area, 0.0, half_width)
    return 8 * float(eighth)
