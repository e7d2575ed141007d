"""Compute the noise floor: the scatter of the runs, and what more seeds would gain.

The statistics are in `repose.calibrate.variance`.
"""

import math
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.runs import select_bench_runs
from repose.calibrate.targets import Target, Targets
from repose.calibrate.variance import (
    CONFIDENCE,
    Components,
    estimate_residual_correlation,
    variance_components,
)
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table, write_json, write_table

NOISE_FILE = "noise.csv"
SEEDS_FILE = "seeds.csv"
SUMMARY_FILE = "noise.json"
MAX_SEEDS = 64
ERROR_PERCENTS = (0.5, 1.0, 2.0)  # standard errors, in percent of the target

PairCorrelations = dict[str, dict[str, float]]
"""Correlations by the names of the two responses, ``"aor_deg, height_mm"``."""


class NoiseFloor(NamedTuple):
    """Tables of the noise floor."""

    # noise.csv: a row for each target, with variances, ICC and reachable R2
    responses: pd.DataFrame
    # seeds.csv: error and reachable R2 of a mean over 1 to `MAX_SEEDS` seeds
    seeds: pd.DataFrame
    # noise.json: the rows by response, and the correlations
    summary: dict[str, Any]


class WithinCorrelation(NamedTuple):
    """Correlation of the responses between runs of the same sample."""

    matrix: np.ndarray  # (k, k), 0 between bench tests
    pairs: PairCorrelations  # within a bench test, with intervals


def read_runs(runs_csv: StrPath, targets: Targets) -> pd.DataFrame:
    """Read all runs of a study, failed runs included, from runs.csv.

    Parameters
    ----------
    runs_csv : path
        The file.
    targets : Targets
        The responses that the runs must have.

    Returns
    -------
    pandas.DataFrame
        A row for each run.

    Raises
    ------
    InputError
        If fewer than two samples have a good run of a response, or if no sample has two
        of them.
    """
    runs = read_table(runs_csv, ("sample", "seed", "status", *targets.names))
    for name in targets.names:
        runs_of_sample = select_good_runs(runs, (name,)).groupby("sample").size()
        if len(runs_of_sample) < 2 or runs_of_sample.max() < 2:
            largest = int(runs_of_sample.max()) if len(runs_of_sample) else 0
            raise InputError(
                source=runs_csv,
                key="runs per sample",
                value=largest,
                allowed=f"at least two samples with a number for {name}, "
                "and at least two such runs of one of them",
            )
    return runs


def select_good_runs(runs: pd.DataFrame, names: tuple[str, ...]) -> pd.DataFrame:
    """Select the runs with status ok and a number for each of the responses."""
    has_numbers = runs[list(names)].notna().all(axis=1)
    return runs[(runs["status"] == "ok") & has_numbers]


def estimate_within_correlation(
    runs: pd.DataFrame, targets: Targets
) -> WithinCorrelation:
    """Estimate the correlation of the responses between runs of the same sample.

    It is the within-sample correlation: the responses of a run deviate together from
    the means of its sample.

    Parameters
    ----------
    runs : pandas.DataFrame
        Single runs with `sample`, `status` and the responses.
    targets : Targets
        The k responses.

    Returns
    -------
    WithinCorrelation
        Responses of different bench tests have the correlation 0.

    Raises
    ------
    ValueError
        If the runs of a bench test are too few, or if a response does not vary.
    """
    matrix = np.eye(len(targets))
    pairs: PairCorrelations = {}
    for responses in targets.benches.values():
        # Use the same runs for all pairs of a bench test. This makes the matrix
        # positive semidefinite.
        names = tuple(targets.names[k] for k in responses)
        complete = select_good_runs(runs, names)
        for i, j in combinations(responses, 2):
            first = targets.names[i]
            second = targets.names[j]
            correlation = estimate_residual_correlation(
                complete[first], complete[second], complete["sample"]
            )
            matrix[i, j] = correlation.value
            matrix[j, i] = correlation.value
            pairs[f"{first}, {second}"] = {
                "value": correlation.value,
                "low": correlation.low,
                "high": correlation.high,
                "degrees_of_freedom": correlation.degrees_of_freedom,
            }
    return WithinCorrelation(matrix, pairs)


def make_correlation_record(pairs: PairCorrelations) -> dict[str, Any]:
    """Convert correlations of pairs to their form in the JSON files.

    The record has an entry for each pair. If there is a single pair, the record is the
    entry of this pair.
    """
    if len(pairs) == 1:
        (only_pair,) = pairs.values()
        return only_pair
    return pairs


def compute_noise_floor(runs: pd.DataFrame, targets: Targets) -> NoiseFloor:
    """Compute how much the responses scatter, and what more seeds would gain.

    For each target, the variance of its response is divided into the variance within
    samples, which is noise, and the variance between samples.

    Parameters
    ----------
    runs : pandas.DataFrame
        Single runs with `sample`, `status` and the responses.
    targets : Targets
        The targets of the study.

    Returns
    -------
    NoiseFloor
        A table with a row for each target, a table with a row for each number of seeds,
        and a summary with the correlations of the noise between responses.

    Raises
    ------
    ValueError
        If the runs are too few.
    """
    n_seeds = np.arange(1, MAX_SEEDS + 1)
    seeds_table = pd.DataFrame({"seeds": n_seeds})
    rows = []
    for target in targets:
        # Each bench test has separate runs, which fail separately.
        bench_runs = select_bench_runs(runs, target.response.apparatus)
        good_runs = select_good_runs(bench_runs, (target.name,))
        failed_runs = bench_runs[bench_runs["status"] != "ok"]
        components = variance_components(good_runs[target.name], good_runs["sample"])
        seeds_table = seeds_table.assign(
            **_compute_seed_columns(n_seeds, target, components)
        )
        rows.append(_make_noise_row(target, components, good_runs, failed_runs))
    correlation = estimate_within_correlation(runs, targets)
    summary = {
        "responses": {row["response"]: row for row in rows},
        "correlation": make_correlation_record(correlation.pairs),
        "confidence": CONFIDENCE,
    }
    return NoiseFloor(pd.DataFrame(rows), seeds_table, summary)


def _compute_seed_columns(
    n_seeds: np.ndarray, target: Target, components: Components
) -> dict[str, np.ndarray]:
    """Compute the columns of one target for seeds.csv.

    For means over n_seeds runs, a perfect predictor reaches
    R2 = ICC / (ICC + (1 - ICC) / n_seeds), where ICC is the intraclass correlation: the
    fraction of the variance of single runs that is between samples.

    Parameters
    ----------
    n_seeds : numpy.ndarray, (n,)
        How many seeds each sample has; one number for each row of the table.
    target : Target
        The target.
    components : Components
        Variance components of its response.

    Returns
    -------
    dict
        The columns (n,) by name: the standard error of a mean over seeds, in the unit
        of the response and in percent of the target, and the R2 with its interval. The
        interval follows from the interval of the ICC.
    """
    error = components.standard_error(n_seeds)
    quantity = target.response.quantity
    columns = {
        target.response.standard_error: error,
        f"{quantity}_se_percent": 100 * error / target.whole,
    }
    icc_by_suffix = {
        "": components.icc,
        "_low": components.icc_low,
        "_high": components.icc_high,
    }
    for suffix, icc in icc_by_suffix.items():
        columns[f"{quantity}_reachable_r2{suffix}"] = icc / (icc + (1 - icc) / n_seeds)
    return columns


def _make_noise_row(
    target: Target,
    components: Components,
    good_runs: pd.DataFrame,
    failed_runs: pd.DataFrame,
) -> dict[str, Any]:
    """Make the row of noise.csv for one target.

    Parameters
    ----------
    target : Target
        The target.
    components : Components
        Variance components of its response.
    good_runs : pandas.DataFrame
        The runs with a number for the response.
    failed_runs : pandas.DataFrame
        The runs of its bench test that failed.

    Returns
    -------
    dict
        The columns of the row, in the order of the file.
    """
    failed_samples = failed_runs["sample"].drop_duplicates()
    has_no_run = ~failed_samples.isin(good_runs["sample"])
    row = {
        "response": target.name,
        "samples": components.n_groups,
        "runs": components.n_values,
        "failed_runs": len(failed_runs),
        "samples_with_failures": int(failed_samples.nunique()),
        "samples_without_runs": int(has_no_run.sum()),
        "mean": components.mean,
        "sd_within": math.sqrt(components.within),
        "sd_within_low": math.sqrt(components.within_low),
        "sd_within_high": math.sqrt(components.within_high),
        "sd_between": math.sqrt(components.between),
        "icc": components.icc,
        "icc_low": components.icc_low,
        "icc_high": components.icc_high,
        # The within-sample variance over the harmonic mean is the mean over the samples
        # of the variance of a sample's mean.
        "mean_seeds": components.harmonic_seeds,
        "r2_single_runs": float(components.reachable_r2(1)),
        "r2_sample_means": float(components.reachable_r2(components.harmonic_seeds)),
    }
    for percent in ERROR_PERCENTS:
        error = percent / 100 * target.whole
        row[f"seeds_for_{percent:g}_percent"] = components.seeds_for(error)
    return row


def write_noise_floor(
    runs_csv: StrPath, targets: Targets, out_dir: StrPath
) -> dict[str, Any]:
    """Compute the noise floor of a study from its runs, and write its tables.

    Parameters
    ----------
    runs_csv : path
        Single runs of the study.
    targets : Targets
        The targets of the study.
    out_dir : path
        Folder for noise.csv, seeds.csv and noise.json.

    Returns
    -------
    dict
        The content of noise.json.

    Raises
    ------
    InputError
        If there are too few runs.
    """
    runs = read_runs(runs_csv, targets)
    # The statistical functions do not know the file, so the error is raised again with
    # it.
    try:
        floor = compute_noise_floor(runs, targets)
    except ValueError as error:
        raise InputError(
            source=runs_csv,
            key="runs",
            value=str(error),
            allowed="enough runs per sample for variances and correlations",
        ) from None
    out = Path(out_dir)
    write_table(out / NOISE_FILE, floor.responses)
    write_table(out / SEEDS_FILE, floor.seeds)
    write_json(out / SUMMARY_FILE, floor.summary)
    return floor.summary


def describe_noise_floor(summary: dict[str, Any], targets: Targets) -> str:
    """Describe the noise floor in text, with a line for each response."""
    lines = []
    for target in targets:
        row = summary["responses"][target.name]
        unit = target.response.unit
        lines.append(
            f"{row['response']}: sd {row['sd_within']:.2f} {unit} within a sample, "
            f"{row['sd_between']:.2f} between; intraclass correlation {row['icc']:.3f} "
            f"({row['icc_low']:.3f} to {row['icc_high']:.3f}); a perfect predictor "
            f"reaches R2 {row['r2_single_runs']:.3f} on single runs, "
            f"{row['r2_sample_means']:.3f} on the means here"
        )
    return "\n".join(lines)
