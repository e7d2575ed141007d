"""Which line a published angle can belong to: a rule of measured facts, and its verdicts.

A publication that says "by linear fitting" leaves open through which part of the boundary the line goes. Its mean
angle, Height and their scatter are known, and so are mass and number of the grains. The rule takes a line only if

1. the measured mean is possible: it lies within `FARTHEST_SD` standard deviations of what simulated piles of this mass
   and number have at the measured Height (their scatter over the design and the error of the mean together);
2. the scatter from pile to pile in one view agrees with the scatter of the measured piles, by a two-sided chi-squared
   test at `LEAST_P`;

and of these lines, among the ones whose bias on shapes of known angle is within `ALIKE_DEG` of the least, it chooses
the one with the largest ratio of the spread between samples to the scatter within them. It does not use how near the
answer of any calibration comes to the targets. It was written when the numbers of the design of 150 samples were known.

A pile keeps its volume. So a sample's angle is carried to the measured Height along tan(angle) ~ Height^1.5, as in a
cone.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from repose.bench.reach import convert_to_height
from repose.calibrate.targets import Target
from research.measurement.measurement_study import VARIANTS

FARTHEST_SD = 2.0
LEAST_P = 0.05
ALIKE_DEG = 0.5
# The same rule by other limits, to show what hangs on them.
OTHER_SD = (1.5, 2.0, 2.5)
OTHER_P = (0.01, 0.05, 0.1)
NEAR = 0.05  # share of the measured means


def scatter_p(measured_sd: float, piles: int, scatter: float) -> float:
    """Two-sided probability of so different a standard deviation of `piles` piles if piles scatter by `scatter`."""
    below = stats.chi2.cdf((piles - 1) * (measured_sd / scatter) ** 2, piles - 1)
    return float(2 * min(below, 1 - below))


def facts(
    piles: pd.DataFrame,
    noise: pd.DataFrame,
    bias: pd.DataFrame,
    angle: Target,
    height: Target,
    published: Sequence[Mapping[str, Any]] = (),
) -> pd.DataFrame:
    """Tabulate what the rule reads of each line, a row each.

    Parameters
    ----------
    piles, noise, bias : DataFrame
        From `measurement_study`: measured piles of the design, and its tables ``noise`` and ``bias``.
    angle, height : Target
        The measured means, with standard deviations and numbers of piles.
    published : sequence of mapping
        Rows with ``aor_simulated_deg`` and ``height_simulated_mm``: pairs that another simulator gave. Their distance
        from the design's band is shown, and the rule does not use it.
    """
    means = piles.groupby("sample")[[*VARIANTS, "Height"]].mean()
    noise = noise.set_index("measured")
    bias = bias.set_index("measured")
    error = angle.sd / np.sqrt(angle.repetitions)
    box = means["Height"].between(height.low, height.high)
    near = (means["Height"] / height.value - 1).abs() <= NEAR
    rows = []
    for name in VARIANTS:
        # the band of the design: its angles at the measured height
        band = convert_to_height(means[name], means["Height"], height.value)
        mean = float(np.nanmean(band))
        sd = float(np.nanstd(band, ddof=1))
        others = []
        for row in published:
            theirs = row["height_simulated_mm"]
            band_there = convert_to_height(means[name], means["Height"], theirs)
            others.append(row["aor_simulated_deg"] - np.nanmean(band_there))
        within = float(noise.loc[name, "within_view"])
        filled_bias = bias.loc[name, "filled_bias"]
        strewn_bias = bias.loc[name, "strewn_bias"]
        in_range = means[name].between(angle.low, angle.high)
        near_angle = (means[name] / angle.value - 1).abs() <= NEAR
        rows.append(
            {
                "line": name,
                "mean": means[name].mean(),
                "carried": mean,
                "carried_sd": sd,
                "carried_largest": float(np.nanmax(band)),
                "off_sd": (angle.value - mean) / float(np.hypot(sd, error)),
                "scatter_view": within,
                "scatter_p": scatter_p(angle.sd, angle.repetitions, within),
                "bias_filled": filled_bias,
                "bias_strewn": strewn_bias,
                "bias": (abs(filled_bias) + abs(strewn_bias)) / 2,
                "ratio": noise.loc[name, "ratio"],
                "ratio_view": noise.loc[name, "ratio_view"],
                "other_simulator_less_band": (
                    float(np.mean(others)) if others else np.nan
                ),
                "in_box": int((box & in_range).sum()),
                "within_5_percent": int((near & near_angle).sum()),
            }
        )
    return pd.DataFrame(rows)


def chosen(
    table: pd.DataFrame, farthest_sd: float = FARTHEST_SD, least_p: float = LEAST_P
) -> tuple[str | None, list[str]]:
    """Choose a line of `facts` by the rule, None if no line passes; also returns the lines that pass 1 and 2."""
    passed = table[
        (table["off_sd"].abs() <= farthest_sd) & (table["scatter_p"] >= least_p)
    ]
    if passed.empty:
        return None, []
    similar = passed[passed["bias"] <= passed["bias"].min() + ALIKE_DEG]
    return str(similar.loc[similar["ratio"].idxmax(), "line"]), passed["line"].tolist()


def verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """Choose by every limit of `OTHER_SD` and `OTHER_P`."""
    rows = []
    for sd in OTHER_SD:
        for p in OTHER_P:
            line, passed = chosen(table, sd, p)
            rows.append(
                {
                    "farthest_sd": sd,
                    "least_p": p,
                    "chosen": line or "none",
                    "passed": "; ".join(passed),
                }
            )
    return pd.DataFrame(rows)


def best_told_apart(table: pd.DataFrame) -> str:
    """Choose the line for one's own photographs, which the same code measures: the largest ratio over all views."""
    return str(table.loc[table["ratio"].idxmax(), "line"])
