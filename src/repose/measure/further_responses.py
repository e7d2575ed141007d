"""More responses of an existing pile, measured on saved pours.

From the mean silhouette: R(z), half the pile's width at the height z, from outermost boundary to outermost boundary,
mean of all views. b is the height of a grain and H the Height.

base_radius_mm   R(b)
lower_deg        slope of the lower flank, from b to H / 2:      atan((H / 2 - b) / (R(b) - R(H / 2)))
upper_deg        slope of the upper flank, from H / 2 to 0.8 H
packing_percent  volume of the pile's grains over that of the body of revolution, pi R^2 dz; a balance gives the first

From above, with all grains on the plate:
radius_90_mm     radius about the funnel's axis that holds 90 % of the grains, by their centres
loose_percent    share of the grains that does not touch the pile

`discharge_s` comes with the pour. The angle of repose by its other definitions comes with the runs (`angles`).
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.responses import responses_of
from repose.common.errors import require_flank
from repose.grain.particle import Particle
from repose.measure import pile
from repose.measure.angles import CALIBRATED_ANGLE, MEAN_KEYS
from repose.measure.profile_points import outermost_crossing
from repose.measure.saved_pours import Arrays
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains

BENCH = "funnel"
MEASURED = (
    "base_radius_mm",
    "lower_deg",
    "upper_deg",
    "packing_percent",
    "radius_90_mm",
    "loose_percent",
)
HALF, UPPER, HELD = 0.5, 0.8, 0.9
LEVELS = 200  # heights at which the silhouette's width is taken for the volume


def offered(targets: Iterable[str], definition: str) -> tuple[str, ...]:
    """Further responses that an experimenter could measure on the same pile, in the registry's order."""
    targeted = {CALIBRATED_ANGLE, *targets}
    if CALIBRATED_ANGLE in targets:
        targeted.add(MEAN_KEYS[definition])
    return tuple(
        response.name
        for response in responses_of(BENCH)
        if response.name not in targeted
    )


def mean_half_width(
    profiles: Sequence[np.ndarray], mm_per_pixel: float, levels_mm: ArrayLike
) -> np.ndarray:
    """Half the width of silhouettes in mm at heights over the plate, mean over the views."""
    levels = np.asarray(levels_mm, dtype=float) / mm_per_pixel
    total = np.zeros(len(levels))
    for profile in profiles:
        seen = levels < profile.max()
        left = outermost_crossing(profile, levels[seen])
        right = len(profile) - 1 - outermost_crossing(profile[::-1], levels[seen])
        total[seen] += 0.5 * (right - left)
    return total / len(profiles) * mm_per_pixel


def of_profile(
    profiles: Sequence[np.ndarray],
    mm_per_pixel: float,
    height_mm: float,
    berry_mm: float,
    berries_mm3: float,
) -> dict[str, float]:
    """Measure the four responses of the mean silhouette by name; `berries_mm3` is the volume of all grains."""
    require_flank(
        HALF * height_mm > berry_mm,
        f"half of {height_mm:.1f} mm is not above a grain, {berry_mm:.1f} mm",
    )
    marks = np.array([berry_mm, HALF * height_mm, UPPER * height_mm])
    base, half, upper = mean_half_width(profiles, mm_per_pixel, marks)
    step = height_mm / LEVELS
    widths = mean_half_width(profiles, mm_per_pixel, step * (np.arange(LEVELS) + 0.5))
    return {
        "base_radius_mm": float(base),
        "lower_deg": math.degrees(math.atan2(marks[1] - marks[0], base - half)),
        "upper_deg": math.degrees(math.atan2(marks[2] - marks[1], half - upper)),
        "packing_percent": float(
            100 * berries_mm3 / (math.pi * step * (widths**2).sum())
        ),
    }


def of_scatter(
    centres_m: np.ndarray, in_pile: ArrayLike, on_plate_mm: float
) -> dict[str, float]:
    """``radius_90_mm`` and ``loose_percent`` of the grains over the plate of radius `on_plate_mm`."""
    distance = 1e3 * np.hypot(centres_m[:, 0], centres_m[:, 1])
    there = (distance <= on_plate_mm) & (centres_m[:, 2] > 0)
    require_flank(there.any(), "no grain lies on the plate")
    loose = (
        100
        * np.count_nonzero(there & ~np.asarray(in_pile, bool))
        / np.count_nonzero(there)
    )
    return {
        "radius_90_mm": float(np.quantile(distance[there], HELD)),
        "loose_percent": float(loose),
    }


def of_pour(
    arrays: Arrays, particle: Particle, settings: MeasureSettings, plate_mm: float
) -> dict[str, float]:
    """All responses of `MEASURED` of one pour, by name."""
    settings = pile.with_berry_height(settings, particle)
    assert settings.berry_height_mm is not None
    grains, members = Grains.of(arrays, particle), arrays["in_pile"]
    height_m, views = pile.pile_views(grains, settings, members)
    profiles = [pile.profile_of(view)[0] for view in views]
    sizes = grains.scales[members] if settings.largest_pile_only else grains.scales
    volume = 1e9 * particle.volume_m3 * float((sizes**3).sum())
    responses = of_profile(
        profiles,
        settings.mm_per_pixel,
        1e3 * height_m,
        settings.berry_height_mm,
        volume,
    )
    return responses | of_scatter(grains.centres_m, members, plate_mm / 2)
