"""Comparison of the lines whose slope may be the angle of repose: bias on known shapes, noise, signal over a design.

Every saved pile is measured by all definitions, and by other bands and points of the flank, each time on the same
silhouettes. research/docs/angle_line_tests.md shows and discusses the tables.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.common.errors import InputError, NoFlankError
from repose.common.files import write_table
from repose.grain.particle import Particle
from repose.measure import pile, saved_pours
from repose.measure.angles import measure_sides
from repose.measure.silhouette import Grains
from research.measurement.pour_correlation import correlations

BANDS = ((0.1, 0.8), (0.1, 0.9), (0.2, 0.8), (0.2, 0.9), (0.3, 0.8), (0.3, 0.9))
POINTS = ("columns", "rows", "levels")
# Smallest window of the straightest line, as a share of the side; its source does not give it.
WINDOWS = {"1/2": 1 / 2, "1/3": 1 / 3, "1/4": 1 / 4}


def _lines() -> dict[str, tuple[dict[str, Any], str]]:
    """Every line by its name in the tables: changes of the configuration's measurement, and the definition."""
    lines: dict[str, tuple[dict[str, Any], str]] = {
        "whole": ({}, "whole"),
        "secant": ({}, "secant"),
    }
    for low, high in BANDS:
        for rule in POINTS:
            name = f"flank {100 * low:.0f}-{100 * high:.0f} %, {rule}"
            lines[name] = ({"fit_from": low, "fit_to": high, "flank": rule}, "flank")
    lines["steepest 10-80 %, columns"] = (
        {"fit_from": 0.1, "fit_to": 0.8, "flank": "columns"},
        "steepest",
    )
    for share, smallest in WINDOWS.items():
        lines[f"straightest, at least {share}"] = (
            {"smallest_window": smallest},
            "straightest",
        )
    return lines


VARIANTS = _lines()
ANGLES_DEG = (20, 25, 30, 35, 40, 45)
CONE_HEIGHT_MM = 62.0
CONE_BERRIES = 500
DISC_RADII_MM = (5.0, 10.0)
SHAPE_SEED = 1


def tables_of(
    piles: pd.DataFrame,
    fixed: pd.DataFrame,
    particle: Particle,
    settings: pile.MeasureSettings,
    shapes: int = 8,
) -> dict[str, pd.DataFrame]:
    """Make the tables ``noise``, ``correlation``, ``pour_correlation`` and ``bias``.

    `piles` are those of the design, `fixed` those of one parameter set, both from `measured_piles`. `settings` need the
    height of a berry; `shapes` is the number of piles of each known shape and angle.
    """
    return {
        "noise": noise_table(piles, fixed),
        "correlation": correlation_table(piles),
        "pour_correlation": correlations(piles, VARIANTS),
        "bias": bias_table(particle, settings, shapes),
    }


def run(
    heaps: Sequence[str | Path],
    representative: str | Path | None,
    particle: Particle,
    section: Mapping[str, Any],
    berry: Mapping[str, Any],
    out_dir: str | Path,
    shapes: int = 8,
) -> dict[str, pd.DataFrame]:
    """Write piles.csv and the tables of `tables_of` into out_dir; return these tables and ``piles``.

    `heaps` are ``NAME.npz`` of the design's jobs, with ``NAME.pours.json`` beside each; `representative` is that of one
    parameter set with more pours, by default the first of the design. `section` is `measure` of the configuration,
    `berry` the result of the verb berry. InputError with fewer than two jobs.
    """
    if len(heaps) < 2:
        raise InputError(
            "command line", "heaps", len(heaps), "at least two jobs of the design"
        )
    settings = pile.with_grain_height(
        pile.MeasureSettings.with_defaults(**section).for_grain(berry), particle
    )
    piles = pd.concat(
        [measured_piles(path, particle, settings) for path in heaps], ignore_index=True
    )
    fixed = measured_piles(representative or heaps[0], particle, settings)
    tables = tables_of(piles, fixed, particle, settings, shapes)
    write_table(
        Path(out_dir) / "piles.csv",
        pd.concat([piles, fixed]) if representative else piles,
    )
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table, index=name == "correlation")
    return tables | {"piles": piles}


# --- the piles of a study -------------------------------------------------------------------------


def measured_piles(
    npz: str | Path, particle: Particle, settings: pile.MeasureSettings
) -> pd.DataFrame:
    """Measurements of the good pours of a job's .npz file: ``sample``, ``seed``, ``Height`` and every variant.

    A variant is the mean of all views; with " (view)" behind its name it is that of the first view.
    """
    npz = Path(npz)
    job = saved_pours.read_pours(npz.with_name(npz.stem + saved_pours.POURS_ENDING))
    rows = []
    arrays = saved_pours.read_positions(npz)
    for record in job["pours"]:
        if record["status"] != "ok":
            continue
        poured = saved_pours.select_pour(arrays, record["seed"], npz)
        try:
            found = variants_of(poured, particle, settings)
        except NoFlankError:
            continue
        rows.append({"sample": job["sample"], "seed": record["seed"], **found})
    return pd.DataFrame(rows)


def variants_of(
    poured: Mapping[str, np.ndarray], particle: Particle, settings: pile.MeasureSettings
) -> dict[str, float]:
    """Height [mm] and every variant [deg] of the angle of one pour, all from the same silhouettes.

    `poured` holds ``position``, ``quaternion``, and perhaps ``in_pile`` and ``scale`` of the berries. Values are means
    over the views, or of the first view with " (view)" behind the name; NaN where a variant cannot be measured in half
    of the views. NoFlankError if there is no pile.
    """
    height_m, views = pile.prepare_views(
        Grains.of(poured, particle), settings, poured.get("in_pile")
    )
    angles = []
    heights = []
    for view in views:
        profile, crest = pile.find_profile(view)
        angles.append(variants_of_profile(profile, crest, settings))
        heights.append(profile[crest] * settings.mm_per_pixel)
    angles = pd.DataFrame(angles)
    means = angles.mean().where(2 * angles.notna().sum() >= len(angles))
    found = {"Height": 1e3 * height_m, "Height (view)": heights[0], **means}
    return found | {f"{name} (view)": angles[name][0] for name in VARIANTS}


def variants_of_profile(
    profile: np.ndarray, crest: int, settings: pile.MeasureSettings
) -> dict[str, float]:
    """Every variant [deg] on one profile; NaN where it cannot be measured.

    `profile` (W,) is the height of the upper edge in pixels, `crest` the column of the crest.
    """
    found = {}
    for name, (changed, definition) in VARIANTS.items():
        measured, _ = measure_sides(
            profile, crest, settings.model_copy(update=changed), (definition,)
        )
        found[name] = measured[definition][0] if definition in measured else math.nan
    return found


def noise_table(piles: pd.DataFrame, fixed: pd.DataFrame) -> pd.DataFrame:
    """Noise and signal of Height and of each variant.

    ``published_mean`` and ``published_sd`` (from seed to seed) are of the published solution. Over the design,
    ``within`` is the scatter from seed to seed, ``between`` the spread from sample to sample without that noise, and
    ``ratio`` their ratio; they are over all views, and in one (``_view``).
    """
    rows = []
    for name in ("Height", *VARIANTS):
        row = {
            "measured": name,
            "piles": int(piles[name].notna().sum()),
            "mean": piles[name].mean(),
            "published_mean": fixed[name].mean(),
            "published_sd": fixed[name].std(),
        }
        for view in ("", " (view)"):
            within, between = spreads(piles, name + view)
            end = "_view" if view else ""
            row |= {
                f"within{end}": within,
                f"between{end}": between,
                f"ratio{end}": between / within,
            }
        rows.append(row)
    return pd.DataFrame(rows)


def spreads(piles: pd.DataFrame, name: str) -> tuple[float, float]:
    """Estimate the standard deviation within a sample, from seed to seed, and between the samples' noise-free means.

    One-way analysis of variance: within^2 is the mean of the samples' variances weighted by their degrees of
    freedom; the variance of the samples' means is that of the noise-free means plus the mean of within^2 / n.
    """
    groups = piles.dropna(subset=[name]).groupby("sample")[name]
    count = groups.count()
    variance = groups.var()
    several = count > 1
    free = count[several] - 1
    within = float((variance[several] * free).sum() / free.sum())
    between = float(groups.mean().var() - within * (1 / count).mean())
    return math.sqrt(within), math.sqrt(max(between, 0.0))


def correlation_table(piles: pd.DataFrame) -> pd.DataFrame:
    """Correlation of the samples' means of every line and Height."""
    return piles.groupby("sample")[[*VARIANTS, "Height"]].mean().corr()


# --- known shapes ---------------------------------------------------------------------------------


def bias_table(
    particle: Particle, settings: pile.MeasureSettings, shapes: int
) -> pd.DataFrame:
    """Bias of every variant over piles of every angle: mean and root mean square of its errors [deg].

    `shapes` is the number of filled cones of each angle; the strewn triangles are four times as many.
    """
    errors: dict[str, list[dict[str, float]]] = {"filled": [], "strewn": []}
    for angle in ANGLES_DEG:
        rng = np.random.default_rng([SHAPE_SEED, angle])
        for _ in range(shapes):
            centres, quaternions = filled_cone(angle, particle, rng)
            found = variants_of(
                {"position": centres, "quaternion": quaternions}, particle, settings
            )
            errors["filled"].append({name: found[name] - angle for name in VARIANTS})
        for _ in range(4 * shapes):
            profile = strewn_triangle(angle, rng, settings.mm_per_pixel)
            found = variants_of_profile(profile, int(profile.argmax()), settings)
            errors["strewn"].append({name: found[name] - angle for name in VARIANTS})
    filled, strewn = (pd.DataFrame(rows) for rows in errors.values())
    table = {"measured": list(VARIANTS)}
    for shape, error in (("filled", filled), ("strewn", strewn)):
        table[f"{shape}_bias"] = error.mean().to_numpy()
        table[f"{shape}_rms"] = np.sqrt((error**2).mean()).to_numpy()
    return pd.DataFrame(table)


def filled_cone(
    angle_deg: float,
    particle: Particle,
    rng: np.random.Generator,
    berries: int = CONE_BERRIES,
) -> tuple[np.ndarray, np.ndarray]:
    """Random berries that fill a cone: centres (N, 3) [m] and quaternions (N, 4).

    The berries may overlap. Their centres fill a cone one mean radius inside the cone of 62 mm and the given angle.
    """
    a = math.radians(angle_deg)
    height = 1e-3 * CONE_HEIGHT_MM
    reach = pile.equivalent_diameter(particle) / 2
    half = [height / math.tan(a)] * 2 + [height]
    centres = np.empty((0, 3))
    while len(centres) < berries:
        points = rng.uniform([-1, -1, reach / height], 1, (4000, 3)) * half
        # distance along the normal of the slope, which is at height cos(a)
        radius = np.hypot(points[:, 0], points[:, 1])
        along_normal = radius * math.sin(a) + points[:, 2] * math.cos(a)
        inside = along_normal < height * math.cos(a) - reach
        centres = np.concatenate([centres, points[inside]])
    return centres[:berries], rng.normal(size=(berries, 4))


def strewn_triangle(
    angle_deg: float, rng: np.random.Generator, mm_per_pixel: float
) -> np.ndarray:
    """Profile (W,) in pixels of a triangle of 62 mm with discs strewn along both flanks.

    The discs are 10 to 20 mm wide, and their tops scatter 4 mm about the flank.
    """
    a = math.radians(angle_deg)
    half = CONE_HEIGHT_MM / math.tan(a) + 25
    u = (np.arange(round(2 * half / mm_per_pixel)) + 0.5) * mm_per_pixel - half
    profile = np.maximum(
        CONE_HEIGHT_MM - 8 / math.cos(a) - np.abs(u) * math.tan(a), 0.0
    )
    for side in (-1, 1):
        along = rng.uniform(0, 8)
        while along < CONE_HEIGHT_MM / math.sin(a):
            r = rng.uniform(*DISC_RADII_MM)
            depth = r + rng.uniform(-4, 4)
            centre = side * (
                CONE_HEIGHT_MM / math.tan(a) - along * math.cos(a) - depth * math.sin(a)
            )
            chord = r**2 - (u - centre) ** 2
            top = (
                along * math.sin(a)
                - depth * math.cos(a)
                + np.sqrt(np.maximum(chord, 0.0))
            )
            profile = np.where(chord > 0, np.maximum(profile, top), profile)
            along += r * rng.uniform(1.2, 2.2)
    return profile / mm_per_pixel
