"""Check whether a single mean grain can represent all of the measured grains."""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.integrate import quad

FEWEST_GRAINS = 4  # enough for two groups of two grains
# Probability that grains of a single group are mistaken for two groups
SIGNIFICANCE = 0.01
# Number of random samples from which this probability is estimated, and their seed
N_SAMPLES = 2000
SEED = 2026


class Split(NamedTuple):
    """A split of values into two groups, the smaller and the larger values.

    Attributes
    ----------
    n_small : int
        Number of values in the group of the smaller values.
    explained : float
        Fraction of the variance that the means of the two groups explain.
    """

    n_small: int
    explained: float


class SizeGroups(NamedTuple):
    """Two groups of grains, the small and the large ones.

    Attributes
    ----------
    counts : tuple of int
        Number of grains in each group, the small ones first.
    diameters_mm : tuple of float
        Geometric mean of the equivalent diameters in each group.
    """

    counts: tuple[int, int]
    diameters_mm: tuple[float, float]

    @property
    def ratio(self) -> float:
        """Diameter of the large grains over that of the small ones."""
        small, large = self.diameters_mm
        return large / small


def find_best_split(values: np.ndarray) -> Split:
    """Split values into small and large ones so that the split explains most variance.

    The result is the exact solution of k-means for two groups in one dimension. For
    many normally distributed values it explains the fraction 2/pi of the variance, and
    for many uniformly distributed values the fraction 3/4.

    Parameters
    ----------
    values : ndarray
        The values (N,), in any order.

    Returns
    -------
    Split
        The number of small values, and the fraction of the variance that the split
        explains.
    """
    sorted_values = np.sort(np.asarray(values, float))
    deviations = sorted_values - sorted_values.mean()
    sum_of_squares = float(deviations @ deviations)
    if sum_of_squares == 0:
        return Split(len(sorted_values), 0.0)

    # Compute the sum of squares between the groups for each possible number of small
    # values. If the deviations of the n_small small values have the sum s, those of the
    # n_large others have the sum -s. So the sum of squares is
    # s^2 / n_small + s^2 / n_large = s^2 n / (n_small n_large).
    n = len(sorted_values)
    n_small = np.arange(1, n)
    n_large = n - n_small
    small_sums = np.cumsum(deviations)[:-1]
    squares_between = small_sums**2 * n / (n_small * n_large)
    best = int(np.argmax(squares_between))
    # The entry with the index 0 is the split with one small value.
    return Split(best + 1, float(squares_between[best]) / sum_of_squares)


@cache
def estimate_chance_share(n_values: int) -> float:
    """Estimate the fraction of the variance that the best split explains by chance.

    The best split of uniformly distributed values exceeds this fraction with the
    probability `SIGNIFICANCE`. The dip test also compares a sample with the uniform
    distribution, because it is the least favourable one with a single mode.

    Parameters
    ----------
    n_values : int
        Number of values.

    Returns
    -------
    float
        The fraction, from 0 to 1.

    Notes
    -----
    J. A. Hartigan and P. M. Hartigan, The dip test of unimodality, Annals of Statistics
    13 (1985) 70-84.
    """
    rng = np.random.default_rng(SEED)
    shares = [find_best_split(rng.random(n_values)).explained for _ in range(N_SAMPLES)]
    return float(np.quantile(shares, 1 - SIGNIFICANCE))


def find_size_groups(diameters_mm: np.ndarray) -> SizeGroups | None:
    """Find out whether the grains form two groups by size, and describe the groups.

    They do if the best split of the logarithms of the sizes explains more of the
    variance than it would by chance (`estimate_chance_share`).

    Parameters
    ----------
    diameters_mm : ndarray
        Equivalent diameters (N,) of the grains.

    Returns
    -------
    SizeGroups or None
        The groups; None if the grains may well be a single group.
    """
    logarithms = np.sort(np.log(np.asarray(diameters_mm, float)))
    n_grains = len(logarithms)
    split = find_best_split(logarithms)
    # With fewer grains, two groups cannot be told from chance.
    if n_grains < FEWEST_GRAINS or split.explained <= estimate_chance_share(n_grains):
        return None
    small = logarithms[: split.n_small]
    large = logarithms[split.n_small :]
    return SizeGroups(
        counts=(len(small), len(large)),
        diameters_mm=(math.exp(small.mean()), math.exp(large.mean())),
    )


def compute_largest_volume(axes: Sequence[float]) -> float:
    """Compute the largest volume that a body with given full axes can have.

    The long axis is the largest extent of the body in any direction. If the body is
    symmetric about three perpendicular planes, it lies both in the ball whose diameter
    is the long axis and in the box around the axes. The result is the volume of the
    intersection of the ball and the box.

    Parameters
    ----------
    axes : sequence of float
        Full lengths of the body along its three axes, the longest first.

    Returns
    -------
    float
        The volume, in the unit of the axes cubed.

    Notes
    -----
    A body without this symmetry is not larger (isodiametric inequality): Steiner's
    symmetrisation makes any body symmetric. It keeps the volume, and increases no
    extent.
    """
    ball_radius, half_width, half_height = (0.5 * axis for axis in axes)

    def compute_quarter_area(y: float) -> float:
        """Compute a quarter of the area of the cross-section at the distance y.

        The distance is measured from the centre, along the second axis. The
        cross-section of the ball is a disc. The box cuts off its parts above
        `half_height` and below -`half_height`.
        """
        # Radius of the disc. Rounding errors could make the differences of squares
        # negative, here and below.
        circle_radius = math.sqrt(max(ball_radius**2 - y**2, 0.0))
        cut_height = min(half_height, circle_radius)
        if cut_height == 0:
            return 0.0
        # A horizontal line at `cut_height` cuts the disc. The quarter below it consists
        # of a triangle from the centre to the ends of half of this chord, and of a
        # sector of the disc between the triangle and the horizontal axis.
        half_chord = math.sqrt(max(circle_radius**2 - cut_height**2, 0.0))
        sector_angle = math.asin(min(cut_height / circle_radius, 1.0))
        return 0.5 * (cut_height * half_chord + circle_radius**2 * sector_angle)

    # The quarter of the cross-section, integrated over half of the width, is an eighth
    # of the volume.
    eighth, _error = quad(compute_quarter_area, 0.0, half_width)
    return 8 * float(eighth)
