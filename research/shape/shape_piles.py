"""One pile by every definition of the angle and every rule for points on its flank, and the bulk density inside it.

All come from the same pictures, which cost more than the measurements.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from repose.grain.particle import Particle
from repose.measure import pile
from repose.measure.angles import MEAN_KEYS
from repose.measure.further_responses import measure_half_widths
from repose.measure.profile_points import FLANK_RULES
from repose.measure.silhouette import Grains

# Columns of the definitions. `steepest` and `whole` follow the rule of the configuration, `secant` needs none.
FLANKS = {rule: f"flank_{rule}" for rule in FLANK_RULES}
COLUMNS = {
    "secant": MEAN_KEYS["secant"],
    **{name: f"aor_{name}_deg" for name in FLANKS.values()},
    "steepest": MEAN_KEYS["steepest"],
    "whole": MEAN_KEYS["whole"],
}
DENSITY = "pile_density_kg_m3"
LEVELS = 200


def measured(
    arrays: Mapping[str, np.ndarray], particle: Particle, settings: pile.MeasureSettings
) -> dict[str, float | None]:
    """Numbers of a pile: ``height_mm``, the angle by each definition of `COLUMNS`, and `DENSITY`.

    `arrays` holds ``position``, ``quaternion``, ``in_pile`` and ``scale`` of a pour. An angle is the mean over the
    views, None where fewer than half of them have it. NoFlankError if there is no pile.
    """
    settings = pile.with_grain_height(settings, particle)
    grains = Grains.of(arrays, particle)
    members = arrays["in_pile"]
    height_m, views = pile.prepare_views(grains, settings, members)
    angles: dict[str, list[float]] = {name: [] for name in COLUMNS}
    profiles = []
    for view in views:
        profiles.append(pile.find_profile(view)[0])
        by_rule = {
            rule: pile.measure_segmented(
                view, settings.model_copy(update={"flank": rule})
            ).angles
            for rule in FLANKS
        }
        for name in COLUMNS:
            # "flank_RULE" is the flank by another rule; other definitions do not depend on the rule
            rule = name.removeprefix("flank_")
            if rule in by_rule:
                angle = by_rule[rule].get("flank")
            else:
                angle = by_rule[settings.flank].get(name)
            angles[name].append(math.nan if angle is None else angle.aor_deg)
    found: dict[str, float | None] = {
        COLUMNS[name]: _mean(values) for name, values in angles.items()
    }
    assert settings.berry_height_mm is not None
    lengths_mm = settings.mm_per_pixel, 1e3 * height_m, settings.berry_height_mm
    masses = particle.mass_kg * grains.scales[members] ** 3
    density = core_density(grains.centres_m[members], masses, profiles, *lengths_mm)
    return found | {"height_mm": 1e3 * height_m, DENSITY: density}


def core_density(
    centres_m: np.ndarray,
    masses_kg: np.ndarray,
    profiles: Sequence[np.ndarray],
    mm_per_pixel: float,
    height_mm: float,
    berry_mm: float,
) -> float | None:
    """Bulk density in the core of a pile [kg/m3]: mass of the berries with centres there, over the core's volume.

    The core begins one berry's height below the surface of the body of revolution of the mean silhouette. Near the
    plate berries lie in layers, and a sharp lower end would count a layer or miss it; so mass and volume get a weight
    that rises from 0 to 1 over one berry's height, from half a berry above the plate. `centres_m` is (N, 3),
    `masses_kg` (N,), the profiles (W,) come from `pile.find_profile`. None where the pile has no core.
    """
    top = height_mm - berry_mm
    if top <= 1.5 * berry_mm:
        return None
    levels = (np.arange(LEVELS) + 0.5) * top / LEVELS
    radii = measure_half_widths(profiles, mm_per_pixel, levels + berry_mm)
    volume_mm3 = (
        math.pi * float((_weight(levels, berry_mm) * radii**2).sum()) * top / LEVELS
    )
    x, y, z = 1e3 * np.asarray(centres_m).T
    away = np.hypot(x - x.mean(), y - y.mean())
    inside = (z < top) & (away < np.interp(z, levels, radii))
    return float((masses_kg * _weight(z, berry_mm))[inside].sum()) / (1e-9 * volume_mm3)


def _weight(height_mm, berry_mm):
    """Share of a height that belongs to the core."""
    return np.clip(height_mm / berry_mm - 0.5, 0.0, 1.0)


def _mean(values):
    """Mean of the finite values, None where more than half are not."""
    kept = [value for value in values if math.isfinite(value)]
    return float(np.mean(kept)) if kept and 2 * len(kept) >= len(values) else None
