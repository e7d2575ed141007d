"""The whole profile of saved pours: half the pile's width over the height above the plate, mean over all views."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from repose.common.errors import NoFlankError
from repose.grain.particle import Particle
from repose.measure import further_responses, pile, saved_pours
from repose.measure.silhouette import Grains


def of_pours(
    pours_json: Iterable[str | Path],
    good: set[tuple[int, int]],
    particle: Particle,
    settings: pile.MeasureSettings,
    levels_mm: np.ndarray,
) -> pd.DataFrame:
    """Half-widths in mm of the good runs (sample, seed) in files of pours, each beside its ``NAME.npz``.

    Columns: ``sample``, ``seed`` and the number of each level of `levels_mm`; 0 above the crest. Runs without a pile
    are left out.
    """
    settings = pile.with_grain_height(settings, particle)
    rows = []
    for path in map(Path, pours_json):
        job = saved_pours.read_pours(path)
        arrays = saved_pours.read_positions(saved_pours.positions_file(path))
        for record in job["pours"]:
            if (job["sample"], record["seed"]) not in good:
                continue
            saved = saved_pours.select_pour(arrays, record["seed"], path)
            try:
                _, views = pile.prepare_views(
                    Grains.of(saved, particle), settings, saved["in_pile"]
                )
            except NoFlankError:
                continue
            profiles = [pile.find_profile(view)[0] for view in views]
            widths = further_responses.measure_half_widths(
                profiles, settings.mm_per_pixel, levels_mm
            )
            rows.append([job["sample"], record["seed"], *widths])
    return pd.DataFrame(rows, columns=["sample", "seed", *range(len(levels_mm))])
