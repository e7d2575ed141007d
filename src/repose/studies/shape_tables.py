"""How combinations of particle, filling and definition of the angle are judged: the tables of the shape study.

A combination is judged by three things: how far its piles are from the published ones, in units of the physical pile's
standard deviations; whether its particle has the measured axes and mass; and the signal-to-noise ratio of its angle
(of the first target, where the angle is none) over a designed set of parameters.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from repose.core.responses import derived
from repose.core.targets import Target
from repose.measure.angles import DEFINITIONS, MEAN_KEYS
from repose.measure.further_responses import CALIBRATED_ANGLE

# A particle stands for the measured berry when its extents and its mass are as near as this.
NEAR_AXES, NEAR_MASS = 0.05, 0.02
LEAST_SIGNAL_TO_NOISE = 1.3
COMBINATION = ["particle", "filling", "definition"]
NOISE_COLUMNS = (
    "particle",
    "filling",
    "response",
    "signal",
    "noise",
    "signal_to_noise",
    "standard_error",
    "sets",
)


def run_columns(targets: Iterable[Target]) -> tuple[str, ...]:
    """Columns of a cell's table of pours: where it belongs, the targets, and the angle by every definition.

    Parameters
    ----------
    targets : iterable of Target

    Returns
    -------
    tuple of str
    """
    own = (one.name for one in targets if one.name != CALIBRATED_ANGLE)
    about = ("kind", "particle", "filling", "set", "seed", "status")
    return tuple(dict.fromkeys((*about, *own, *MEAN_KEYS.values())))


def measured_as(target: Target, definition: str) -> str:
    """Column of the runs that holds a target where the angle is of a given definition.

    Parameters
    ----------
    target : Target
    definition : str

    Returns
    -------
    str
    """
    return MEAN_KEYS[definition] if target.name == CALIBRATED_ANGLE else target.name


def tables_of(
    runs: pd.DataFrame,
    abouts: Iterable[Mapping[str, Any]],
    published: pd.DataFrame,
    targets: Sequence[Target],
    mass_g: float,
) -> tuple[dict[str, pd.DataFrame], dict[str, Any] | None]:
    """All tables of the study, and its choice.

    Parameters
    ----------
    runs : pandas.DataFrame
        Pours of all cells, with the columns of `run_columns`.
    abouts : iterable of mappings
        The particle of each cell: ``particle``, ``axes_mm``, ``measured_axes_mm``, ``mass_g``, ``volume_mm3``.
    published : pandas.DataFrame
        ``set`` and the published pile of each.
    targets : sequence of Target
        Those that are compared.
    mass_g : float
        Of the measured berry.

    Returns
    -------
    tables : dict
        ``sets``: mean and standard error of every particle, filling, definition and parameter set beside the published
        pile. ``combinations``: the sets of a combination taken together, the best first. ``noise``: signal to noise
        over the design. ``particles``.
    choice : dict or None
        The first eligible combination.
    """
    runs = runs.assign(set=runs["set"].astype(str))
    particles = pd.DataFrame([particle_row(about, mass_g) for about in abouts]).drop_duplicates("particle")
    noise = noise_table(runs[runs["kind"] == "design"], targets)
    sets = set_table(runs[runs["kind"] != "design"], published, targets)
    combinations = combination_table(sets[sets["kind"] == "published"], noise, particles, targets)
    eligible = combinations[combinations["eligible"]]
    choice = None if eligible.empty else eligible.iloc[0].to_dict()
    tables = {"sets": sets, "combinations": combinations, "noise": noise, "particles": particles}
    return tables, choice


def particle_row(about: Mapping[str, Any], mass_g: float) -> dict[str, Any]:
    """Axes and mass of a cell's particle, and whether they are the measured berry's.

    Parameters
    ----------
    about : mapping
        Content of the cell's file.
    mass_g : float
        Of the measured berry.

    Returns
    -------
    dict
    """
    axes, measured = np.array(about["axes_mm"]), np.array(about["measured_axes_mm"])
    off_axes, off_mass = float(np.abs(axes / measured - 1).max()), abs(about["mass_g"] / mass_g - 1)
    return {
        "particle": about["particle"],
        **{f"axis_{k + 1}_mm": value for k, value in enumerate(axes)},
        "mass_g": about["mass_g"],
        "volume_mm3": about["volume_mm3"],
        "largest_axis_deviation": off_axes,
        "mass_deviation": off_mass,
        "measured_berry": off_axes <= NEAR_AXES and off_mass <= NEAR_MASS,
    }


def set_table(runs: pd.DataFrame, published: pd.DataFrame, targets: Sequence[Target]) -> pd.DataFrame:
    """Mean, standard error and difference from the published pile of each cell, definition and parameter set.

    Parameters
    ----------
    runs, published : pandas.DataFrame
    targets : sequence of Target

    Returns
    -------
    pandas.DataFrame
    """
    rows, pairs = [], published.set_index("set")
    for (kind, particle, filling, name), group in runs.groupby(
        ["kind", "particle", "filling", "set"], sort=False
    ):
        for definition in DEFINITIONS:
            row = {"kind": kind, "particle": particle, "filling": filling}
            row |= {"definition": definition, "set": name}
            for one in targets:
                row[one.name], row[one.response.error] = _mean(group[measured_as(one, definition)])
            for one in targets:
                difference = row[one.name] - pairs.at[name, one.response.simulated]
                row[derived(one.name, "difference")] = difference
            row |= {"n_ok": int((group["status"] == "ok").sum()), "n": len(group)}
            rows.append(row)
    return pd.DataFrame(rows)


def combination_table(
    sets: pd.DataFrame, noise: pd.DataFrame, particles: pd.DataFrame, targets: Sequence[Target]
) -> pd.DataFrame:
    """Each combination over all published sets, eligible ones first.

    Parameters
    ----------
    sets, noise, particles : pandas.DataFrame
    targets : sequence of Target

    Returns
    -------
    pandas.DataFrame

    Notes
    -----
    Mean differences with standard errors; the number of sets within the physical pile's standard deviations
    sd_i; and the distance, the root of the mean over the sets of the sum of (difference_i / sd_i)^2.
    """
    rows, measured = [], particles.set_index("particle")["measured_berry"]
    with_angle = any(one.name == CALIBRATED_ANGLE for one in targets)
    for (particle, filling, definition), group in sets.groupby(COMBINATION, sort=False):
        count = len(group)
        off, within = np.zeros(count), np.ones(count, bool)
        row = {"particle": particle, "filling": filling, "definition": definition}
        for one in targets:
            difference = group[derived(one.name, "difference")]
            row[difference.name] = difference.mean()
            row[one.response.error] = math.sqrt((group[one.response.error] ** 2).sum()) / count
            off = off + (difference / one.sd) ** 2
            within = within & (difference.abs() <= one.sd)
        judged = definition if with_angle else targets[0].response.quantity
        signal, signal_se = _signal_of(noise, particle, filling, judged)
        row |= {
            "sets_within": int(within.sum()),
            "sets": count,
            "distance": math.sqrt(off.mean()),
            "signal_to_noise": signal,
            "signal_to_noise_se": signal_se,
            "measured_berry": bool(measured[particle]),
        }
        enough = signal + 2 * signal_se >= LEAST_SIGNAL_TO_NOISE
        row["eligible"] = bool(row["measured_berry"] and enough and not math.isnan(row["distance"]))
        rows.append(row)
    table = pd.DataFrame(rows)
    return table.sort_values(["eligible", "distance"], ascending=[False, True], ignore_index=True)


def _signal_of(noise, particle, filling, response):
    """Signal-to-noise ratio and its standard error; of the first filling that has one where this has none."""
    rows = noise[(noise["particle"] == particle) & (noise["response"] == response)]
    own = rows[rows["filling"] == filling]
    row = own if len(own) else rows.head(1)
    if row.empty:
        return math.nan, math.nan
    return float(row["signal_to_noise"].iloc[0]), float(row["standard_error"].iloc[0])


def noise_table(runs: pd.DataFrame, targets: Sequence[Target]) -> pd.DataFrame:
    """Signal and noise of every definition of the angle and of the other targets, for each particle and filling.

    Parameters
    ----------
    runs : pandas.DataFrame
    targets : sequence of Target

    Returns
    -------
    pandas.DataFrame

    Notes
    -----
    noise: standard deviation from seed to seed. signal: that of the true means over the designed parameter
    sets: the spread of the sets' means less what the noise adds to it. The standard error of their ratio
    comes from leaving out one set at a time (jackknife).
    """
    others = [one for one in targets if one.name != CALIBRATED_ANGLE]
    columns = MEAN_KEYS | {one.response.quantity: one.name for one in others}
    rows = []
    for (particle, filling), group in runs.groupby(["particle", "filling"], sort=False):
        for response, column in columns.items():
            by_set = [one[column].dropna().to_numpy() for _, one in group.groupby("set")]
            moments = [
                (values.var(ddof=1), values.mean(), len(values)) for values in by_set if len(values) > 1
            ]
            sets = np.array(moments).reshape(-1, 3)
            signal, noise = _signal_and_noise(sets)
            left_out = [_ratio(np.delete(sets, k, axis=0)) for k in range(len(sets))]
            spread = (len(sets) - 1) * np.var(left_out) if moments else math.nan
            found = (signal, noise, _ratio(sets), math.sqrt(spread), len(sets))
            rows.append((particle, filling, response, *found))
    return pd.DataFrame(rows, columns=list(NOISE_COLUMNS))


def _signal_and_noise(sets):
    """Standard deviations of the true means and of single runs, from variance, mean and number of runs of each set."""
    if len(sets) < 3:
        return math.nan, math.nan
    variance, mean, count = sets.T
    within = np.average(variance, weights=count - 1)
    added = within * np.mean(1 / count)
    return math.sqrt(max(np.var(mean, ddof=1) - added, 0.0)), math.sqrt(within)


def _ratio(sets):
    """Signal over noise, NaN without noise."""
    signal, noise = _signal_and_noise(sets)
    return signal / noise if noise else math.nan


def _mean(values):
    """Mean and standard error of what is there."""
    values = values.dropna().astype(float)
    if len(values) < 2:
        return math.nan, math.nan
    return float(values.mean()), float(values.std(ddof=1) / math.sqrt(len(values)))
