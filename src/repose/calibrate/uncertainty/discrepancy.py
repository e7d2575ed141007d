"""Covariance of the discrepancies: deviations of the simulator that no parameters remove.

A shape study, where there is one, gives the evidence. Its plausible models have the axes, mass, volume and packing of
the measured grain, and differ in unknown features: surface, tension, filling, definition of the angle. Poured with
the same parameters they make different piles. Weighted by how well each describes the published piles, their spread
is the discrepancy (`of_shape_study`).

Otherwise the discrepancy is stated: a share of each response's value. Within a
bench test the discrepancies are correlated, for one wrong shape or filling moves all numbers of a pile at once. They
have the signs with which the responses vary together over the design: a steeper pile is higher and narrower.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.responses import derived
from repose.calibrate.targets import LARGEST, Targets
from repose.common.errors import require
from repose.common.files import Path_, read_table
from repose.common.tables import Column, refuse

FEWEST_MODELS = 5
DIFFERENCE = f"a finite number, at most {LARGEST:g} in size"
# Of an eligible model: its distance in standard deviations, beyond which its weight is 0, and how many times the value
# of a target a difference or an error may be.
FARTHEST, LARGEST_SHARE = 30.0, 3.0
MODEL = ("particle", "tension", "filling")


def of_targets(
    targets: Targets, runs: pd.DataFrame, percent: float, correlation: float
) -> np.ndarray:
    """Compute the covariance S_d (k, k) of the stated discrepancies of a study's k targets."""
    means = runs.groupby("sample")[list(targets.names)].mean().to_numpy()
    sd = percent / 100 * np.array([target.whole_value for target in targets])
    return covariance(
        [one.apparatus for one in targets.responses], sd, means, correlation
    )


class OfModels(NamedTuple):
    """Differences of the models of a shape study from the published piles."""

    mean: np.ndarray  # (k,), weighted mean of the differences, in the responses' units
    covariance: np.ndarray  # (k, k), about the mean
    models: float  # effective number of models by their weights, 1 / sum w^2


def of_shape_study(combinations_csv: Path_, targets: Targets) -> OfModels:
    """Compute mean and covariance of the responses over the plausible models of a shape study.

    The weight of a model is exp(-d^2 / 2), with its distance d from the published piles in standard deviations. The
    definitions of one model count as one. The pours of a combination are few: the mean square of its standard errors is
    subtracted from each variance; the correlation is that of the uncorrected differences.
    """
    columns = [derived(name, "difference") for name in targets.names]
    declared = [Column(name, str) for name in MODEL]
    declared += [Column("eligible", bool), Column("distance", low=0.0, empty=True)]
    declared += [
        Column(name, low=-LARGEST, high=LARGEST, empty=True, words=DIFFERENCE)
        for name in columns
    ]
    declared += [
        Column(name, low=0.0, high=LARGEST, empty=True) for name in targets.errors
    ]
    table = read_table(
        combinations_csv,
        declared,
        "a shape study of these targets (none: posterior.shape_study: null)",
    )
    plausible = table[table["eligible"]].dropna(subset=["distance", *columns])
    largest = [LARGEST_SHARE * abs(target.whole_value) for target in targets]
    most = {"distance": FARTHEST} | dict(
        zip((*columns, *targets.errors), largest * 2, strict=True)
    )
    far = plausible[list(most)].abs().gt(pd.Series(most)).stack()
    allowed = "at most {:g} in size of an eligible model"
    odd = (place for place, is_far in far.items() if is_far)
    refuse(
        combinations_csv,
        (
            (k, name, float(plausible.at[k, name]), allowed.format(most[name]))
            for k, name in odd
        ),
    )
    weight = np.exp(-(plausible["distance"] ** 2) / 2)
    weight /= weight.sum()
    squares = (weight.groupby([plausible[key] for key in MODEL]).sum() ** 2).sum()
    models = 1 / squares if len(plausible) else 0.0
    found = f"{models:.1f} models by their weights"
    require(
        models >= FEWEST_MODELS,
        combinations_csv,
        "eligible",
        found,
        f"at least {FEWEST_MODELS}",
    )
    values, errors = (
        plausible[list(of)].to_numpy(float) for of in (columns, targets.errors)
    )
    raw = np.atleast_2d(np.cov(values.T, aweights=weight, ddof=0)) / (1 - squares)
    noise = np.average(np.nan_to_num(errors) ** 2, axis=0, weights=weight)
    for name, has, hidden in zip(columns, np.diag(raw), noise, strict=True):
        require(
            has > hidden,
            combinations_csv,
            name,
            f"of variance {has:.3g}",
            f"above {hidden:.3g}, of its errors",
        )
    spread = np.sqrt(np.diag(raw) - noise)
    covariance = (
        raw / np.sqrt(np.outer(np.diag(raw), np.diag(raw))) * np.outer(spread, spread)
    )
    return OfModels(
        np.average(values, axis=0, weights=weight), covariance, float(models)
    )


def covariance(
    apparatus: Sequence[str], sd: np.ndarray, means: np.ndarray, correlation: float
) -> np.ndarray:
    """Compute the covariance S_d (k, k) of the discrepancies of responses of bench tests; these are independent."""
    matrix = np.diag(sd**2)
    for test in dict.fromkeys(apparatus):
        rows = np.flatnonzero([bench == test for bench in apparatus])
        along = _signs(means[:, rows]) * sd[rows]
        own = correlation * np.outer(along, along)
        np.fill_diagonal(own, sd[rows] ** 2)
        matrix[np.ix_(rows, rows)] = own
    return matrix


def _signs(means: np.ndarray) -> np.ndarray:
    """Find the signs (k,) of the responses in their first principal component; the first response has +1."""
    there = means[np.isfinite(means).all(axis=1)]
    if there.shape[1] == 1 or len(there) < 2:
        return np.ones(means.shape[1])
    spread = there.std(axis=0)
    scaled = (there - there.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    signs = np.where(np.linalg.svd(scaled, full_matrices=False)[2][0] < 0, -1.0, 1.0)
    return signs * signs[0]
