"""The angle by each line beside that of a cone of the same Height and volume: the table of `repose.bench.reach`."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.bench import funnel
from repose.bench.reach import LINE_KEYS, compute_cone_slope
from repose.common.errors import InputError, NoFlankError
from repose.common.files import write_table
from repose.grain.particle import Particle
from repose.measure import pile, saved_pours
from repose.measure.angles import DEFINITIONS, measure_sides
from repose.measure.settings import MeasureSettings, line_of
from repose.measure.silhouette import Grains

RULES = ("columns", "levels", "rows")
BANDS = ((0.1, 0.8), (0.2, 0.9), (0.3, 0.8), (0.3, 0.9))
WINDOWS = (0.25, 0.333, 0.5, 0.333)
# Settings whose lines are measured; a definition reads some of their keys.
SETTINGS: list[dict[str, Any]] = [
    {"flank": rule, "fit_from": low, "fit_to": high, "smallest_window": window}
    for rule in RULES
    for (low, high), window in zip(BANDS, WINDOWS, strict=True)
]


def lines() -> dict[str, dict[str, Any]]:
    """Every line of the table by its words: the definition and the settings that it reads."""
    return {
        line_of(MeasureSettings.with_defaults(**changes), definition): {
            "definition": definition
        }
        | {key: changes[key] for key in LINE_KEYS[definition]}
        for definition in DEFINITIONS
        for changes in SETTINGS
    }


def run(
    heaps: Sequence[str | PathLike],
    particle: Particle,
    config: Mapping[str, Any],
    berry: Mapping[str, Any],
    out: str | PathLike,
) -> pd.DataFrame:
    """Write and return the table of the samples in `heaps`: ``NAME.npz``, with ``NAME.pours.json`` beside each."""
    settings = pile.with_grain_height(
        pile.MeasureSettings.with_defaults(**config["measure"]).for_grain(berry),
        particle,
    )
    samples = pd.DataFrame(
        filter(None, (sample(path, particle, settings) for path in heaps))
    )
    if len(samples) < 2:
        raise InputError(
            "command line", "heaps", len(samples), "piles of two samples or more"
        )
    table = ratios(
        samples, config["funnel"]["berries"] * particle.volume_m3 / funnel.PACKING
    )
    write_table(out, table, float_format="%.4g")
    return table


def sample(
    npz: str | PathLike, particle: Particle, settings: pile.MeasureSettings
) -> dict[str, float]:
    """Means of a sample's good pours: ``Height`` [mm] and each line [deg]; empty if there are none."""
    npz = Path(npz)
    arrays = saved_pours.read_positions(npz)
    found = []
    for record in saved_pours.read_pours(
        npz.with_name(npz.stem + saved_pours.POURS_ENDING)
    )["pours"]:
        if record["status"] == "ok":
            poured = saved_pours.select_pour(arrays, record["seed"], npz)
            try:
                found.append(measured(poured, particle, settings))
            except NoFlankError:
                continue
    return pd.DataFrame(found).mean().to_dict() if found else {}


def measured(
    poured: Mapping[str, np.ndarray], particle: Particle, settings: pile.MeasureSettings
) -> dict[str, float]:
    """Height [mm] of one pile and each line [deg], the mean of the views."""
    height_m, views = pile.prepare_views(
        Grains.of(poured, particle), settings, poured.get("in_pile")
    )
    rows = []
    for view in views:
        profile, crest = pile.find_profile(view)
        row: dict[str, float] = {}
        for changes in SETTINGS:
            line_settings = settings.model_copy(update=changes)
            sides = measure_sides(profile, crest, line_settings)[0]
            row |= {
                line_of(line_settings, name): angle
                for name, (angle, *_) in sides.items()
            }
        rows.append(row)
    return {"Height": 1e3 * height_m} | pd.DataFrame(rows).mean().to_dict()


def ratios(samples: pd.DataFrame, volume_m3: float) -> pd.DataFrame:
    """Mean, standard deviation and largest of tan(angle by a line) / tan(cone of the sample's Height) of a volume."""
    cones = np.array(
        [compute_cone_slope(height, volume_m3) for height in samples["Height"]]
    )
    rows = []
    for line, keys in lines().items():
        ratio = np.tan(np.radians(samples[line])) / cones
        numbers = {"mean": ratio.mean(), "sd": ratio.std(), "largest": ratio.max()}
        rows.append(keys | {"samples": int(ratio.count())} | numbers)
    columns = [
        "definition",
        "flank",
        "fit_from",
        "fit_to",
        "smallest_window",
        "samples",
    ]
    return pd.DataFrame(rows)[[*columns, "mean", "sd", "largest"]]
