"""More responses of a pile that is there already: what else one look at it tells, measured on saved pours.

From the mean silhouette: R(z), half the pile's width at a height, outermost boundary to outermost boundary, mean of
all views. b is a berry's height and H the Height.

base_radius_mm   R(b)
lower_deg        slope of the lower flank, from b to H / 2:      atan((H / 2 - b) / (R(b) - R(H / 2)))
upper_deg        slope of the upper flank, from H / 2 to 0.8 H
packing_percent  volume of the pile's berries over that of the body of revolution, pi R^2 dz; a balance gives the first

From above, with all berries on the plate:
radius_90_mm     radius about the funnel's axis that holds 90 % of them, by their centres
loose_percent    share of them that does not touch the pile

discharge_s is the pour's own. The angle of repose by its other definitions comes with the runs (`angles`).
"""

import math
from pathlib import Path

import numpy as np

from repose.core.errors import InputError, NoFlankError
from repose.core.files import read_table
from repose.measure import pile, saved_pours
from repose.measure.angles import MEAN_KEYS, outermost_crossing
from repose.surrogate.bayesian_bp import RESPONSES

PROFILE = ("base_radius_mm", "lower_deg", "upper_deg", "packing_percent")
SCATTER = ("radius_90_mm", "loose_percent")
TIMES = ("discharge_s",)
MEASURED = (*PROFILE, *SCATTER)
# What an experimenter could take from the same pile beside the two that are calibrated.
HEAP = (*(MEAN_KEYS[name] for name in ("flank", "steepest", "whole")), *MEASURED, *TIMES)
DRUM = ("drum_slip_deg", "drum_rest_deg")
LABELS = {
    "aor_deg": "angle of repose",
    "height_mm": "Height",
    "aor_flank_deg": "angle, flank",
    "aor_secant_deg": "angle, secant",
    "aor_steepest_deg": "angle, steepest",
    "aor_whole_deg": "angle, whole side",
    "base_radius_mm": "base radius",
    "lower_deg": "lower flank",
    "upper_deg": "upper flank",
    "packing_percent": "packing",
    "radius_90_mm": "radius of 90 % of the berries",
    "loose_percent": "loose berries",
    "discharge_s": "discharge time",
    "drum_slip_deg": "drum, slip",
    "drum_rest_deg": "drum, after the slip",
}
HALF, UPPER, HELD = 0.5, 0.8, 0.9
LEVELS = 200  # heights at which the silhouette's width is taken for the volume


def mean_half_width(profiles, mm_per_pixel, levels_mm):
    """Half the width (levels,) in mm of silhouettes at heights over the plate, mean over the views.

    profiles: sequence of (W,) heights of the upper edge in pixels, as `pile.profile_of` gives them. A view that is
    lower than a level counts as 0 there.
    """
    levels = np.asarray(levels_mm, dtype=float) / mm_per_pixel
    total = np.zeros(len(levels))
    for profile in profiles:
        seen = levels < profile.max()
        left = outermost_crossing(profile, levels[seen])
        right = len(profile) - 1 - outermost_crossing(profile[::-1], levels[seen])
        total[seen] += 0.5 * (right - left)
    return total / len(profiles) * mm_per_pixel


def of_profile(profiles, mm_per_pixel, height_mm, berry_mm, berries_mm3):
    """The four numbers of the mean silhouette, by name.

    height_mm: the pile's; berry_mm: a berry's; berries_mm3: volume of the berries in the pile. Raises NoFlankError
    for a pile whose half is not above a berry.
    """
    if not HALF * height_mm > berry_mm:
        raise NoFlankError(f"half of {height_mm:.1f} mm is not above a berry, {berry_mm:.1f} mm")
    marks = np.array([berry_mm, HALF * height_mm, UPPER * height_mm])
    base, half, upper = mean_half_width(profiles, mm_per_pixel, marks)
    step = height_mm / LEVELS
    widths = mean_half_width(profiles, mm_per_pixel, step * (np.arange(LEVELS) + 0.5))
    return {
        "base_radius_mm": float(base),
        "lower_deg": math.degrees(math.atan2(marks[1] - marks[0], base - half)),
        "upper_deg": math.degrees(math.atan2(marks[2] - marks[1], half - upper)),
        "packing_percent": float(100 * berries_mm3 / (math.pi * step * (widths**2).sum())),
    }


def of_scatter(centres_m, in_pile, on_plate_mm):
    """Radius that holds 90 % of the berries on the plate, and the share of them outside the pile, by name.

    centres_m (N, 3); in_pile (N,); on_plate_mm: radius of the plate about the axis x = y = 0; centres below the
    plate or beyond it are left out. Raises NoFlankError where nothing lies on the plate.
    """
    distance = 1e3 * np.hypot(centres_m[:, 0], centres_m[:, 1])
    there = (distance <= on_plate_mm) & (centres_m[:, 2] > 0)
    if not there.any():
        raise NoFlankError("no berry lies on the plate")
    loose = 100 * np.count_nonzero(there & ~np.asarray(in_pile, bool)) / np.count_nonzero(there)
    return {"radius_90_mm": float(np.quantile(distance[there], HELD)), "loose_percent": float(loose)}


def of_pour(arrays, particle, settings, plate_mm):
    """All of MEASURED of one pour; NoFlankError where there is no pile.

    arrays: position, quaternion, in_pile and perhaps scale; settings: `pile.MeasureSettings`; plate_mm: the plate's
    diameter.
    """
    settings = pile.with_berry_height(settings, particle)
    centres, members = arrays["position"].astype(float), arrays["in_pile"]
    scales = arrays.get("scale")
    height_m, views = pile.pile_views(centres, arrays["quaternion"], particle, settings, members, scales)
    profiles = [pile.profile_of(view)[0] for view in views]
    sizes = np.ones(len(centres)) if scales is None else scales.astype(float)
    kept = members if settings.largest_pile_only else np.ones(len(centres), bool)
    volume = 1e9 * particle.volume_m3 * float((sizes[kept] ** 3).sum())
    scale, berry = settings.mm_per_pixel, settings.berry_height_mm
    found = of_profile(profiles, scale, 1e3 * height_m, berry, volume)
    return found | of_scatter(centres, members, plate_mm / 2)


def run(config, pours_json, runs_csv, particle, berry, out_csv):
    """Measure every good run of a study's pours; write and return the table: sample, seed, status, all responses.

    pours_json: NAME.pours.json of `heap.pour_job`, with NAME.npz beside each; runs_csv: as `dataset` writes it,
    for the responses that are there already. Raises InputError for a bad file and for a run that is in no pour.
    """
    known = (*RESPONSES, *(name for name in HEAP if name not in MEASURED))
    runs = read_table(runs_csv, ("sample", "seed", "status", *known))
    runs = runs.drop(
        columns=[column for column in runs if column not in ("sample", "seed", "status", *known)]
    )
    settings = pile.MeasureSettings.of(config["measure"], berry)
    good = set(map(tuple, runs.loc[runs["status"] == "ok", ["sample", "seed"]].to_numpy()))
    found = {}
    for path in map(Path, pours_json):
        job = saved_pours.read_pours(path)
        with saved_pours.saved_positions(
            path.with_name(path.name.replace(saved_pours.POURS, ".npz"))
        ) as arrays:
            for record in job["pours"]:
                key = (job["sample"], record["seed"])
                if key in good:
                    saved = saved_pours.pour_arrays(arrays, record["seed"], path)
                    found[key] = _or_nothing(saved, particle, settings, config["funnel"]["plate_diameter_mm"])
    missing = sorted(good - set(found))
    if missing:
        raise InputError(runs_csv, "runs without a pour", missing[:3], "runs of the pours that are given")
    for name in MEASURED:
        runs[name] = [
            found.get(key, {}).get(name, math.nan)
            for key in runs[["sample", "seed"]].itertuples(index=False, name=None)
        ]
    Path(out_csv).parent.mkdir(parents=True, exist_ok=True)
    runs.to_csv(out_csv, index=False)
    return runs


def _or_nothing(saved, particle, settings, plate_mm):
    try:
        return of_pour(saved, particle, settings, plate_mm)
    except NoFlankError:
        return {}
