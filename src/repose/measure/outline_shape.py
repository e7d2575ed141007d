"""Find out whether the outline of a pile is that of a single pile.

The outline of a single pile neither rises away from its crest nor falls at once, and
its two sides have similar angles. Photographs and simulated piles share these rules and
their limits.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

# Begins each warning that a measured shape is not a single pile. A pile with such a
# warning is called doubtful.
DOUBTFUL = "doubtful"
# Limits, in heights of a grain and in heights of the pile; the larger one counts
LARGEST_RISE_GRAINS = 1.5  # of the outline, away from the crest
LARGEST_RISE_FRACTION = 0.12
LARGEST_DROP_GRAINS = 2.0  # of the outline within half a grain
LARGEST_DROP_FRACTION = 0.2
LARGEST_SIDE_DIFFERENCE_DEG = 10.0  # of the angles of the two sides, in one view
# Number of views of a simulated pile, and of those whose sides differ by more
MEASURED_VIEWS = "measured_views"
DOUBTFUL_VIEWS = "doubtful_views"


def sides_differ(left_deg: ArrayLike, right_deg: ArrayLike) -> np.ndarray:
    """Tell whether the angles of the two sides differ by more than the limit.

    A photograph of such a pile is doubtful, and so is such a view of a simulated pile.
    Both count in the mean, because leaving out lopsided piles would shift it.

    Parameters
    ----------
    left_deg, right_deg : float or ndarray
        Angles of the left and of the right side in degrees; NaN if not measured.

    Returns
    -------
    ndarray
        A boolean for each view, which is false if an angle was not measured.
    """
    return np.abs(np.subtract(left_deg, right_deg)) > LARGEST_SIDE_DIFFERENCE_DEG


def describe_doubtful_views(n_doubtful: int, n_measured: int) -> str:
    """Describe how many side views of simulated piles are doubtful."""
    return (
        f"{n_doubtful} of {n_measured} side views have two sides that differ by more "
        f"than {LARGEST_SIDE_DIFFERENCE_DEG:g} degrees; they count"
    )


class PileSize(NamedTuple):
    """Size of a pile."""

    height_mm: float
    grain_mm: float  # height of a grain
    mm_per_pixel: float

    @property
    def largest_rise_mm(self) -> float:
        """Largest rise of the outline of a single pile, away from its crest."""
        return max(
            LARGEST_RISE_GRAINS * self.grain_mm, LARGEST_RISE_FRACTION * self.height_mm
        )

    @property
    def largest_drop_mm(self) -> float:
        """Largest drop of the outline of a single pile within half a grain."""
        return max(
            LARGEST_DROP_GRAINS * self.grain_mm, LARGEST_DROP_FRACTION * self.height_mm
        )


def split_sides(profile: np.ndarray, crest: int) -> tuple[np.ndarray, np.ndarray]:
    """Split the profile (W,) of a pile into the heights of each side.

    Both sides run from the column `crest` outwards.
    """
    return profile[: crest + 1][::-1], profile[crest:]


def measure_rise(sides: Sequence[np.ndarray], size: PileSize) -> float:
    """Measure by how much the outline of a pile rises again away from the crest.

    Parameters
    ----------
    sides : sequence of ndarray
        For each side the heights in pixels, from the crest outwards.
    size : PileSize
        Size of the pile.

    Returns
    -------
    float
        The largest rise in mm.
    """
    # Compare the height of each column with the lowest one between it and the crest.
    rises_px = [float((side - np.minimum.accumulate(side)).max()) for side in sides]
    return size.mm_per_pixel * max(rises_px)


def measure_drop(sides: Sequence[np.ndarray], size: PileSize) -> float:
    """Measure by how much the outline of a pile falls within half a grain.

    Parameters
    ----------
    sides : sequence of ndarray
        For each side the heights in pixels, from the crest outwards.
    size : PileSize
        Size of the pile.

    Returns
    -------
    float
        The largest drop in mm.
    """
    half_grain_px = max(1, round(0.5 * size.grain_mm / size.mm_per_pixel))
    drops_px = []
    for side in sides:
        falls = side[:-half_grain_px] - side[half_grain_px:]
        drops_px.append(float(falls.max(initial=0.0)))
    return size.mm_per_pixel * max(drops_px)
