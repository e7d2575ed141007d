"""Correlation of the angle and the Height of one pile, by definition of the angle and number of views.

From pile to pile of the same parameters both vary by chance, and together: a pile that is steeper than the mean is also
higher. How much depends on how they are measured. Who measured physical piles in another way than the simulated ones
takes the correlation of that way for `posterior.measured_correlation`.
"""

from collections.abc import Iterable
from typing import Any

import pandas as pd

from repose.calibrate.variance import estimate_residual_correlation

WAYS = {"all views": "", "one view": " (view)"}
COLUMNS = ("measured", "views", "correlation", "low", "high", "degrees_of_freedom")
FEWEST = 4  # degrees of freedom


def correlations(piles: pd.DataFrame, lines: Iterable[str]) -> pd.DataFrame:
    """Correlation of each angle with the Height, from pile to pile of one sample.

    `piles` come from `measurement_study.measured_piles`. A row for each definition and number of views;
    ``low`` and ``high`` are the 95 % interval (Fisher's transformation). Rows with fewer than four degrees of freedom
    are left out.
    """
    rows: list[dict[str, Any]] = []
    for views, suffix in WAYS.items():
        for definition in lines:
            columns = [definition + suffix, "Height" + suffix]
            known = piles.dropna(subset=columns)
            if len(known) - known["sample"].nunique() < FEWEST:
                continue
            found = estimate_residual_correlation(
                known[columns[0]], known[columns[1]], known["sample"]
            )
            rows.append(dict(zip(COLUMNS, (definition, views, *found), strict=True)))
    return pd.DataFrame(rows, columns=list(COLUMNS))
