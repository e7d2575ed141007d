"""Measure how far the outline of a pile rises away from its crest, and falls at once.

The outline of a single pile does neither. Photographs and simulated piles share these
rules and their limits.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

# Begins each warning that a measured shape is not a single pile. A pile with such a
# warning is called doubtful.
DOUBTFUL = "doubtful"
# Limits, in heights of a grain and in heights of the pile; the larger one counts
LARGEST_RISE_GRAINS = 1.5  # of the outline, away from the crest
LARGEST_RISE_FRACTION = 0.12
LARGEST_DROP_GRAINS = 2.0  # of the outline within half a grain
LARGEST_DROP_FRACTION = 0.2


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
