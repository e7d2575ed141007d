"""Noise floor: scatter of the runs of one sample, differences between samples, gain from more seeds.

The statistics are in `repose.calibrate.variance`.
"""

import math
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.runs import of_bench
from repose.calibrate.targets import Target, Targets
from repose.calibrate.variance import (
    CONFIDENCE,
    Components,
    residual_correlation,
    variance_components,
)
from repose.common.errors import InputError
from repose.common.files import Path_, read_table, write_json, write_table

MOST_SEEDS = 64
WANTED_PERCENT = (0.5, 1.0, 2.0)  # standard errors, in percent of the target


class NoiseFloor(NamedTuple):
    """Tables of the noise floor."""

    responses: (
        pd.DataFrame
    )  # noise.csv: a row for each target with variances, ICC and reachable R2
    seeds: (
        pd.DataFrame
    )  # seeds.csv: error and reachable R2 of a mean over 1 to `MOST_SEEDS` seeds
    summary: dict[str, Any]  # noise.json: the rows by response, and the correlations


def read_runs(runs_csv: Path_, targets: Targets) -> pd.DataFrame:
    """Read all runs of a study, including failed runs, from the table of `repose.stages.dataset`."""
    runs = read_table(runs_csv, ("sample", "seed", "status", *targets.names))
    for name in targets.names:
        sizes = usable(runs, (name,)).groupby("sample").size()
        if len(sizes) < 2 or sizes.max() < 2:
            most = int(sizes.max()) if len(sizes) else 0
            raise InputError(
                runs_csv, "runs a sample", most, "2 or more, of 2 samples or more"
            )
    return runs


def usable(runs: pd.DataFrame, names: tuple[str, ...]) -> pd.DataFrame:
    """Select the runs with status ok and a number for each of the responses."""
    return runs[(runs["status"] == "ok") & runs[list(names)].notna().all(axis=1)]


def within_correlation(
    runs: pd.DataFrame, targets: Targets
) -> tuple[np.ndarray, dict[str, dict[str, float]]]:
    """Correlate the responses (k, k) from run to run of one sample, 0 between bench tests; also pair by pair."""
    matrix, pairs = np.eye(len(targets)), {}
    for rows in targets.benches.values():
        # the same runs for all pairs of a bench test, so that the matrix is positive semidefinite
        ok = usable(runs, tuple(targets.names[k] for k in rows))
        for i, j in combinations(rows, 2):
            first, second = targets.names[i], targets.names[j]
            correlation = residual_correlation(ok[first], ok[second], ok["sample"])
            matrix[i, j] = matrix[j, i] = correlation[0]
            names = ("value", "low", "high", "degrees_of_freedom")
            pairs[f"{first}, {second}"] = dict(zip(names, correlation, strict=True))
    return matrix, pairs


def correlation_record(pairs: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Return correlations as in the JSON files: by the names of the pair, or the only pair by itself."""
    return next(iter(pairs.values())) if len(pairs) == 1 else pairs


def noise_floor(runs: pd.DataFrame, targets: Targets) -> NoiseFloor:
    """Compute the variance components of every target, and the gain from more seeds."""
    seeds = np.arange(1, MOST_SEEDS + 1)
    table, rows = pd.DataFrame({"seeds": seeds}), []
    for target in targets:
        own = of_bench(runs, target.response.apparatus)
        ok = usable(own, (target.name,))
        components = variance_components(ok[target.name], ok["sample"])
        error, quantity = components.standard_error(seeds), target.response.quantity
        table[target.response.error] = error
        table[f"{quantity}_se_percent"] = 100 * error / target.whole
        for label, icc in (
            ("", components.icc),
            ("_low", components.icc_low),
            ("_high", components.icc_high),
        ):
            table[f"{quantity}_reachable_r2{label}"] = icc / (icc + (1 - icc) / seeds)
        rows.append(_row(target, components, ok, own[own["status"] != "ok"]))
    by_response, pairs = (
        {row["response"]: row for row in rows},
        within_correlation(runs, targets)[1],
    )
    summary = {
        "responses": by_response,
        "correlation": correlation_record(pairs),
        "confidence": CONFIDENCE,
    }
    return NoiseFloor(pd.DataFrame(rows), table, summary)


def run(runs_csv: Path_, targets: Targets, out_dir: Path_) -> dict[str, Any]:
    """Read the runs, write noise.csv, seeds.csv and noise.json; return the summary."""
    runs = read_runs(runs_csv, targets)
    try:
        floor = noise_floor(runs, targets)
    except ValueError as error:
        raise InputError(
            runs_csv,
            "runs",
            str(error),
            "enough runs a sample for variances and correlations",
        ) from None
    out = Path(out_dir)
    write_table(out / "noise.csv", floor.responses)
    write_table(out / "seeds.csv", floor.seeds)
    write_json(out / "noise.json", floor.summary)
    return floor.summary


def message(summary: dict[str, Any], targets: Targets) -> str:
    """Write the noise floor as text, a line for each response."""
    line = (
        "{response}: sd {sd_within:.2f} {unit} within a sample, {sd_between:.2f} between; intraclass "
        "correlation {icc:.3f} ({icc_low:.3f} to {icc_high:.3f}); a perfect predictor "
        "reaches R2 {r2_single_runs:.3f} on single runs, {r2_sample_means:.3f} on the means here"
    )
    rows = (
        (target.response.unit, summary["responses"][target.name]) for target in targets
    )
    return "\n".join(line.format(unit=unit, **row) for unit, row in rows)


def _row(
    target: Target, components: Components, ok: pd.DataFrame, failed: pd.DataFrame
) -> dict[str, Any]:
    """Make the row of noise.csv for one response."""
    found, unseen = components, ~failed["sample"].drop_duplicates().isin(ok["sample"])
    row = {
        "response": target.name,
        "samples": found.groups,
        "runs": found.values,
        "failed_runs": len(failed),
    }
    row |= {
        "samples_with_failures": int(failed["sample"].nunique()),
        "samples_without_runs": int(unseen.sum()),
    }
    row |= {"mean": found.mean, "sd_within": math.sqrt(found.within)}
    row |= {
        "sd_within_low": math.sqrt(found.within_low),
        "sd_within_high": math.sqrt(found.within_high),
    }
    row |= {"sd_between": math.sqrt(found.between), "icc": found.icc}
    row |= {
        "icc_low": found.icc_low,
        "icc_high": found.icc_high,
        "mean_seeds": found.harmonic_seeds,
    }
    row |= {"r2_single_runs": float(found.reachable_r2(1))}
    row |= {"r2_sample_means": float(found.reachable_r2(found.harmonic_seeds))}
    return row | {
        f"seeds_for_{p:g}_percent": found.seeds_for(p / 100 * target.whole)
        for p in WANTED_PERCENT
    }
