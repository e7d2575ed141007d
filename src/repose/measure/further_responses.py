"""Responses of a pile besides its angle and height: widths, packing and loose grains.

Four of them come from the mean silhouette. R(z) is half the pile's width at the height
z, from outermost boundary to outermost boundary, as the mean of all views; b is the
height of a grain and H the height of the pile.

base_radius_mm
    R(b)
lower_deg
    Slope of the lower flank, from b to H / 2: atan((H / 2 - b) / (R(b) - R(H / 2))).
upper_deg
    Slope of the upper flank, from H / 2 to 0.8 H.
packing_percent
    Volume of the pile's grains over the volume of the body of revolution, the integral
    of pi R^2 dz. In an experiment, a balance gives the volume of the grains.

Two come from the view from above, with all grains on the plate.

radius_90_mm
    Radius about the funnel's axis that contains 90 % of the grains, by their centres.
loose_percent
    Percentage of the grains that do not touch the pile.

`discharge_s` comes with the pour. The angle of repose by its other definitions comes
with the runs (`angles`).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from repose.common.errors import NoFlankError
from repose.measure import pile
from repose.measure.definitions import (  # noqa: F401 (imported from here elsewhere)
    CALIBRATED_ANGLE,
)
from repose.measure.profile_points import find_outermost_crossing
from repose.measure.saved_pours import Arrays
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains, SolidBody

BENCH = "funnel"  # the bench test whose piles have these responses
RESPONSE_NAMES = (
    "base_radius_mm",
    "lower_deg",
    "upper_deg",
    "packing_percent",
    "radius_90_mm",
    "loose_percent",
)
# Upper ends of both flanks, as fractions of the pile's height. The upper flank begins
# at the end of the lower one. "Half of the pile" in messages means `LOWER_FLANK_TO`.
LOWER_FLANK_TO = 0.5
UPPER_FLANK_TO = 0.8
SCATTER_FRACTION = 0.9  # of the grains, within `radius_90_mm`; the name states it, too
N_LEVELS = 200  # heights at which the silhouette's width is measured for the volume


def measure_half_widths(
    profiles: Sequence[np.ndarray], mm_per_pixel: float, levels_mm: ArrayLike
) -> np.ndarray:
    """Measure half the width of a pile at several heights, as the mean over its views.

    The width is the distance between the outermost boundaries on both sides. It is
    measured to a fraction of a pixel.

    Parameters
    ----------
    profiles : sequence of ndarray
        For each view the heights (W,) of all columns over the plate in pixels.
    mm_per_pixel : float
        Scale of the views.
    levels_mm : array_like
        Heights (N,) over the plate at which the width is measured. The width is 0 in a
        view in which the pile is lower.

    Returns
    -------
    ndarray
        Half widths (N,) in mm.
    """
    levels = np.asarray(levels_mm, dtype=float) / mm_per_pixel
    sum_of_half_widths = np.zeros(len(levels))
    for profile in profiles:
        is_reached = levels < profile.max()
        reached_levels = levels[is_reached]
        left = find_outermost_crossing(profile, reached_levels)
        # The right side is searched backwards, from the last column.
        last_column = len(profile) - 1
        right = last_column - find_outermost_crossing(profile[::-1], reached_levels)
        sum_of_half_widths[is_reached] += 0.5 * (right - left)
    return sum_of_half_widths / len(profiles) * mm_per_pixel


def measure_silhouettes(
    profiles: Sequence[np.ndarray],
    mm_per_pixel: float,
    height_mm: float,
    grain_mm: float,
    grains_mm3: float,
) -> dict[str, float]:
    """Measure the responses of the mean silhouette: base, both flanks and packing.

    The packing is the fraction of the pile's volume that grains fill.

    Parameters
    ----------
    profiles : sequence of ndarray
        For each view the heights over the plate of all columns in pixels.
    mm_per_pixel : float
        Scale of the views.
    height_mm : float
        Height of the pile.
    grain_mm : float
        Height of a grain.
    grains_mm3 : float
        Volume of all grains in the pile; NaN if it is unknown.

    Returns
    -------
    dict
        ``base_radius_mm``, ``lower_deg``, ``upper_deg`` and ``packing_percent``.

    Raises
    ------
    NoFlankError
        If half of the pile is not higher than a grain.
    """
    # The lower flank goes from the height of a grain to the middle of the pile, the
    # upper flank from there up to the height `upper_mm`.
    middle_mm = LOWER_FLANK_TO * height_mm
    if middle_mm <= grain_mm:
        raise NoFlankError(
            f"half of {height_mm:.1f} mm is not above a grain, {grain_mm:.1f} mm"
        )
    upper_mm = UPPER_FLANK_TO * height_mm
    base_radius, middle_radius, upper_radius = measure_half_widths(
        profiles, mm_per_pixel, [grain_mm, middle_mm, upper_mm]
    )
    lower_angle = math.atan2(middle_mm - grain_mm, base_radius - middle_radius)
    upper_angle = math.atan2(upper_mm - middle_mm, middle_radius - upper_radius)

    # Add up the volume of the pile as a stack of thin discs.
    disc_mm = height_mm / N_LEVELS
    disc_middles_mm = disc_mm * (np.arange(N_LEVELS) + 0.5)
    radii = measure_half_widths(profiles, mm_per_pixel, disc_middles_mm)
    volume_mm3 = math.pi * disc_mm * (radii**2).sum()
    return {
        "base_radius_mm": float(base_radius),
        "lower_deg": math.degrees(lower_angle),
        "upper_deg": math.degrees(upper_angle),
        "packing_percent": float(100 * grains_mm3 / volume_mm3),
    }


def measure_scatter(
    centres_m: np.ndarray, in_pile: ArrayLike, plate_radius_mm: float
) -> dict[str, float]:
    """Measure how far the grains on the plate are scattered around the pile.

    Parameters
    ----------
    centres_m : ndarray
        Positions (N, 3) of all grains. The middle of the plate is the origin, and the
        upper side of the plate is z = 0.
    in_pile : array_like
        Mask (N,) of the grains that belong to the pile.
    plate_radius_mm : float
        Radius of the plate.

    Returns
    -------
    dict
        ``radius_90_mm`` is the radius around the middle of the plate that contains 90 %
        of the grains on the plate. ``loose_percent`` is the percentage of the grains on
        the plate that do not belong to the pile.

    Raises
    ------
    NoFlankError
        If no grain lies on the plate.
    """
    distance_mm = 1e3 * np.hypot(centres_m[:, 0], centres_m[:, 1])
    is_on_plate = (distance_mm <= plate_radius_mm) & (centres_m[:, 2] > 0)
    if not is_on_plate.any():
        raise NoFlankError("no grain lies on the plate")
    is_loose = is_on_plate & ~np.asarray(in_pile, bool)
    loose_percent = 100 * np.count_nonzero(is_loose) / np.count_nonzero(is_on_plate)
    return {
        "radius_90_mm": float(np.quantile(distance_mm[is_on_plate], SCATTER_FRACTION)),
        "loose_percent": float(loose_percent),
    }


def measure_pour(
    arrays: Arrays,
    particle: SolidBody,
    settings: MeasureSettings,
    plate_diameter_mm: float,
) -> dict[str, float]:
    """Measure the further responses of one pour, which `RESPONSE_NAMES` lists.

    `measure_silhouettes` measures four of them, and `measure_scatter` the other two.

    Parameters
    ----------
    arrays : mapping
        The pour's arrays by name: ``position``, ``quaternion``, ``in_pile`` and, if
        sizes differ, ``scale``.
    particle : SolidBody
        The shape of the grains.
    settings : MeasureSettings
        Settings of the measurement.
    plate_diameter_mm : float
        Diameter of the plate.

    Returns
    -------
    dict
        The responses by name.

    Raises
    ------
    NoFlankError
        If there is no pile.
    """
    complete_settings = pile.with_grain_height(settings, particle)
    grain_mm = complete_settings.berry_height_mm
    assert grain_mm is not None  # set by `with_grain_height`
    grains = Grains.of(arrays, particle)
    in_pile = arrays["in_pile"]
    height_m, views = pile.prepare_views(grains, complete_settings, in_pile)
    profiles = []
    for view in views:
        profile, _ = pile.find_profile(view)
        profiles.append(profile)
    # The packing needs the volume of all grains that the silhouettes show. A grain with
    # the scale s has s³ times the volume of the particle.
    scales = grains.scales[in_pile] if settings.largest_pile_only else grains.scales
    total_relative_volume = float((scales**3).sum())
    shape = measure_silhouettes(
        profiles,
        mm_per_pixel=complete_settings.mm_per_pixel,
        height_mm=1e3 * height_m,
        grain_mm=grain_mm,
        grains_mm3=1e9 * particle.volume_m3 * total_relative_volume,
    )
    scatter = measure_scatter(grains.centres_m, in_pile, plate_diameter_mm / 2)
    return shape | scatter
