"""Compute the covariance of the discrepancies between simulator and reality.

A discrepancy is a deviation that no choice of the parameters can remove.

If there is a shape study, the discrepancy is estimated from it. The plausible models of
the study have the axes, mass, volume and packing of the measured grain, but differ in
unknown features: surface, tension, filling and definition of the angle. With the same
parameters, their piles differ. The discrepancy is the spread of these piles, weighted
by how well each model describes the published piles (`estimate_from_shape_study`).

Otherwise, the discrepancy is stated as a fraction of the value of each response
(`compute_stated_covariance`). Within a bench test the discrepancies are correlated,
because one wrong shape or filling changes all numbers of a pile at once. The signs of
the correlations are those with which the responses vary together over the design: a
steeper pile is higher and narrower.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.responses import name_derived_column
from repose.calibrate.targets import MAX_SIZE, Targets
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table
from repose.common.numbers import format_significant
from repose.common.tables import Column, refuse

MIN_MODELS = 5
DIFFERENCE_WORDS = f"a finite number, at most {MAX_SIZE:g} in size"
# Limits for a model that the shape study marks as eligible. Beyond this distance, in
# standard deviations, its weight is practically 0. A difference or an error must not
# exceed this multiple of the target's value.
MAX_DISTANCE = 30.0
MAX_RATIO = 3.0
MODEL_COLUMNS = ("particle", "tension", "filling")


class ShapeStudyDiscrepancy(NamedTuple):
    """Differences between the models of a shape study and the published piles."""

    mean: np.ndarray  # (k,), weighted mean of the differences, in the responses' units
    covariance: np.ndarray  # (k, k), about the mean
    models: float  # effective number of models by their weights, 1 / sum w^2


def compute_stated_covariance(
    targets: Targets, runs: pd.DataFrame, percent: float, correlation: float
) -> np.ndarray:
    """Compute the covariance S_d (k, k) of the stated discrepancies of k targets.

    Parameters
    ----------
    targets : Targets
        The targets of the study.
    runs : pandas.DataFrame
        The runs of the design, with `sample` and the responses.
    percent : float
        Standard deviation of a discrepancy, in percent of the target's value.
    correlation : float
        Absolute value of the correlation between the discrepancies of a bench test.
    """
    means = runs.groupby("sample")[list(targets.names)].mean().to_numpy()
    sd = percent / 100 * np.array([target.whole_value for target in targets])
    bench_tests = [response.apparatus for response in targets.responses]
    return compute_covariance(bench_tests, sd, means, correlation)


def estimate_from_shape_study(
    combinations_csv: StrPath, targets: Targets
) -> ShapeStudyDiscrepancy:
    """Estimate the discrepancy from the differences between models of a shape study.

    Only eligible models count, which have the size, mass and packing of the measured
    grain. The weight of such a model is exp(-d^2 / 2), where d is its distance from the
    published piles in standard deviations. A model may have several rows, with
    different definitions of the responses; they count as one model.

    Each combination has few simulations, so their noise enlarges the variances. To
    correct this, the mean square of the standard errors is subtracted from each
    variance. The correlation is that of the uncorrected differences.

    Parameters
    ----------
    combinations_csv : path
        Combinations of model, definition and parameters, with the differences of their
        piles from the published ones.
    targets : Targets
        The k responses.

    Returns
    -------
    ShapeStudyDiscrepancy

    Raises
    ------
    InputError
        If the file is invalid, if there are too few models, or if the standard errors
        explain a whole variance.
    """
    # Select the combinations that are eligible and were simulated.
    columns = [name_derived_column(name, "difference") for name in targets.names]
    table = _read_combinations(combinations_csv, targets, columns)
    eligible = table[table["eligible"]].dropna(subset=["distance", *columns])
    _reject_large_values(combinations_csv, targets, columns, eligible)

    # Weight each row by its distance, and each model by the sum over its rows.
    weight = np.exp(-(eligible["distance"] ** 2) / 2)
    weight /= weight.sum()
    weight_of_model = weight.groupby([eligible[key] for key in MODEL_COLUMNS]).sum()
    # n models of equal weight 1 / n have the sum of squares 1 / n. Its inverse is an
    # effective number of models, also for unequal weights.
    sum_of_squares = (weight_of_model**2).sum()
    effective_models = 1 / sum_of_squares if len(eligible) > 0 else 0.0
    if not effective_models >= MIN_MODELS:
        raise InputError(
            source=combinations_csv,
            key="eligible",
            value=f"{effective_models:.1f} models by their weights",
            allowed=f"at least {MIN_MODELS}",
        )

    # Compute the covariance of the differences. The rows of a model are not independent
    # of each other, but the models are. So the divisor that makes the covariance
    # unbiased is 1 minus the sum of the squared weights of the models, not of the rows.
    differences = eligible[columns].to_numpy(float)
    errors = eligible[list(targets.errors)].to_numpy(float)
    biased_covariance = np.cov(differences.T, aweights=weight, ddof=0)
    covariance = np.atleast_2d(biased_covariance) / (1 - sum_of_squares)

    # Subtract the noise of the simulations from the variances. A combination that was
    # simulated once has no standard error, and counts as if it had no noise.
    variances = np.diag(covariance)
    noise = np.average(np.nan_to_num(errors) ** 2, axis=0, weights=weight)
    _require_larger_variances(combinations_csv, columns, variances, noise)
    sd = np.sqrt(variances - noise)
    correlation = covariance / np.sqrt(np.outer(variances, variances))
    return ShapeStudyDiscrepancy(
        mean=np.average(differences, axis=0, weights=weight),
        covariance=correlation * np.outer(sd, sd),
        models=float(effective_models),
    )


def _require_larger_variances(
    path: StrPath, columns: Sequence[str], variances: np.ndarray, noise: np.ndarray
) -> None:
    """Raise InputError unless all variances (k,) exceed the variances of the noise (k,)."""
    for name, variance, noise_variance in zip(columns, variances, noise, strict=True):
        if not variance > noise_variance:
            raise InputError(
                source=path,
                key=name,
                value=f"of variance {format_significant(variance, 3)}",
                allowed=f"above {format_significant(noise_variance, 3)}, of its errors",
            )


def _read_combinations(
    path: StrPath, targets: Targets, columns: Sequence[str]
) -> pd.DataFrame:
    """Read and check the table of a shape study.

    Each row is a combination of a model of the grain, a definition of the responses and
    parameters. It has the differences between the simulated and the published piles.

    Parameters
    ----------
    path : path
        The file of the combinations.
    targets : Targets
        The targets of the study.
    columns : sequence of str
        Names of the columns with the differences, one for each target.

    Returns
    -------
    pandas.DataFrame
        A row for each combination. A combination that was not simulated has NaN in the
        columns of numbers.
    """
    model_columns = [Column(name, str) for name in MODEL_COLUMNS]
    is_eligible = Column("eligible", bool)
    distance = Column("distance", low=0.0, may_be_empty=True)
    differences = [
        Column(
            name,
            low=-MAX_SIZE,
            high=MAX_SIZE,
            may_be_empty=True,
            words=DIFFERENCE_WORDS,
        )
        for name in columns
    ]
    errors = [
        Column(name, low=0.0, high=MAX_SIZE, may_be_empty=True)
        for name in targets.errors
    ]
    return read_table(
        path,
        [*model_columns, is_eligible, distance, *differences, *errors],
        "a shape study of these targets "
        "(without a shape study, set posterior.shape_study: null)",
    )


def _reject_large_values(
    path: StrPath, targets: Targets, columns: Sequence[str], eligible: pd.DataFrame
) -> None:
    """Raise InputError for eligible models with a number that is far too large.

    Such a number is probably a mistake in the file.

    Parameters
    ----------
    path : path
        The file, for an error.
    targets : Targets
        The targets of the study.
    columns : sequence of str
        Names of the columns with the differences, one for each target in their order.
    eligible : pandas.DataFrame
        The rows of the eligible models.

    Raises
    ------
    InputError
        If a distance, a difference or an error is too large.
    """
    # The limit of the distance is a number. The limit of a difference or an error is a
    # multiple of the target's value.
    limits = {"distance": MAX_DISTANCE}
    for names in (columns, targets.errors):
        for name, target in zip(names, targets, strict=True):
            limits[name] = MAX_RATIO * abs(target.whole_value)
    errors = []
    for row, values in eligible[list(limits)].iterrows():
        for name, limit in limits.items():
            # A missing error is NaN, which is not above the limit.
            if abs(values[name]) > limit:
                allowed = f"at most {limit:g} in size, for an eligible model"
                errors.append((row, name, float(values[name]), allowed))
    refuse(path, errors)  # does nothing if the list is empty


def compute_covariance(
    bench_tests: Sequence[str], sd: np.ndarray, means: np.ndarray, correlation: float
) -> np.ndarray:
    """Compute the covariance S_d of the discrepancies of responses.

    Within a bench test, all pairs have the same absolute correlation. Its sign is
    positive if both responses rise together over the design (`_find_signs`).

    Parameters
    ----------
    bench_tests : sequence of str
        Name of the bench test of each of the k responses. Discrepancies of different
        bench tests are independent.
    sd : array (k,)
        Standard deviations of the discrepancies.
    means : array (n, k)
        Responses over the design, from which the signs of the correlations follow.
    correlation : float
        Absolute value of the correlation of two responses of the same bench test.

    Returns
    -------
    array (k, k)
    """
    matrix = np.diag(sd**2)
    for bench_test in dict.fromkeys(bench_tests):
        # The covariances of the responses of this bench test form a block of the
        # matrix.
        rows = np.flatnonzero([name == bench_test for name in bench_tests])
        signed_sd = _find_signs(means[:, rows]) * sd[rows]
        block = correlation * np.outer(signed_sd, signed_sd)
        np.fill_diagonal(block, sd[rows] ** 2)
        matrix[np.ix_(rows, rows)] = block
    return matrix


def _find_signs(means: np.ndarray) -> np.ndarray:
    """Find whether each response rises or falls when the first response rises.

    The signs are those of the first principal component of the responses, which is the
    direction of their largest common variation.

    Parameters
    ----------
    means : array (n, k)
        Responses over the design; NaN where there is none.

    Returns
    -------
    array (k,)
        1 for a response that rises with the first one, and for the first response
        itself; -1 for a response that falls. All are 1 if there is a single response,
        or if fewer than two samples are complete, because then the signs are unknown.
    """
    complete = means[np.isfinite(means).all(axis=1)]
    n_responses = means.shape[1]
    if n_responses == 1 or len(complete) < 2:
        return np.ones(n_responses)
    # Scale the responses to the same variance, so that their units do not matter.
    sd = complete.std(axis=0)
    scaled = (complete - complete.mean(axis=0)) / np.where(sd > 0, sd, 1.0)
    _, _, components = np.linalg.svd(scaled, full_matrices=False)
    # A response that does not vary has the component 0, and counts as rising.
    signs = np.where(components[0] < 0, -1.0, 1.0)
    # A component and its negative are equivalent, so make the first sign positive.
    return signs * signs[0]
