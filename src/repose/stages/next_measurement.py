"""The next measurement: the information that each further response would add to the present targets.

Parameter sets are drawn from the posterior, and each is simulated a few times in every bench test of the configuration.
A response that differs more between these sets than from run to run separates them. Between plausible sets it has the
variance tau^2, its mean over n repetitions the error s^2 = sigma^2 / n + d^2, with the scatter sigma^2 of a run and the
discrepancy d of the simulator. For normal variables the information is

    bits = 1/2 log2(1 + tau^2 / s^2)

(Cover & Thomas 2006, Elements of Information Theory, section 9.1). Responses share information: the table ranks the
first response to add, and is made again once that one is a target.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench import Scene, bench_of, bench_tests
from repose.bench.parameters import PARAMETERS, named
from repose.calibrate.responses import responses_of
from repose.calibrate.targets import Targets
from repose.calibrate.variance import variance_components
from repose.common.errors import require
from repose.common.files import Path_, read_table, write_table
from repose.measure.angles import MEAN_KEYS
from repose.measure.further_responses import CALIBRATED_ANGLE
from repose.stages.job import measure_job

SETS = 16  # of the posterior's draws
SEEDS = 2  # runs of each in each bench test: the fewest that show the scatter
COLUMNS = [
    "response",
    "apparatus",
    "mean",
    "sd_between_sets",
    "sd_of_a_run",
    "repetitions",
]
COLUMNS += ["bits", "bits_low", "bits_high", "sets", "runs"]
FEWEST_SETS = 4  # that must have two runs with a response


def plausible_sets(draws_csv: Path_, seed: int, out: Path_) -> pd.DataFrame:
    """Write and return `SETS` of the posterior's draws as samples; InputError if there are fewer."""
    draws = read_table(draws_csv, PARAMETERS)
    require(len(draws) >= SETS, draws_csv, "rows", len(draws), f"{SETS} or more")
    rows = np.sort(np.random.default_rng(seed).choice(len(draws), SETS, replace=False))
    samples = draws.loc[rows, list(named(draws))].reset_index(drop=True)
    samples.insert(0, "sample", range(1, SETS + 1))
    write_table(out, samples, float_format="%.10g")
    return samples


def information(
    runs: pd.DataFrame, repetitions: int, discrepancy_percent: float
) -> pd.DataFrame:
    """Compute the bits that the mean of `repetitions` measurements of each response would add, most first.

    Responses with fewer than `FEWEST_SETS` sets of two runs, or that never differ, are left out.
    """
    rows = []
    for (apparatus, name), own in runs.groupby(["apparatus", "response"], sort=False):
        if (own.groupby("sample").size() > 1).sum() < FEWEST_SETS:
            continue
        parts = variance_components(own["value"], own["sample"])
        error = (
            parts.within / repetitions + (discrepancy_percent / 100 * parts.mean) ** 2
        )
        if not error > 0:
            continue
        icc = np.array([parts.icc, parts.icc_low, parts.icc_high]).clip(0, 1 - 1e-12)
        bits = 0.5 * np.log2(1 + parts.within * icc / (1 - icc) / error)
        spreads = np.sqrt(parts.between), np.sqrt(parts.within)
        rows.append(
            (
                name,
                apparatus,
                parts.mean,
                *spreads,
                repetitions,
                *bits,
                parts.groups,
                parts.values,
            )
        )
    require(
        rows,
        "next",
        "runs",
        len(runs),
        f"{FEWEST_SETS} sets or more with two runs of a response",
    )
    return pd.DataFrame(rows, columns=COLUMNS).sort_values(
        "bits", ascending=False, kind="stable", ignore_index=True
    )


def every_response() -> list[dict[str, str]]:
    """List the responses of all bench tests as targets of a scene, to measure them all."""
    entries = []
    for test in bench_tests():
        for response in test.responses:
            entries.append({"response": response.name, "apparatus": test.name})
    return entries


def run(
    pours: Iterable[Path_],
    scene: Scene,
    out_dir: Path_,
    *,
    targets: Targets,
    discrepancy_percent: float,
) -> pd.DataFrame:
    """Rank the responses of saved runs by the information that each would add.

    Parameters
    ----------
    pours : iterable of path
        Saved runs of plausible parameter sets, in any bench tests.
    scene : Scene
        The scene of the study, whose targets are `every_response`.
    out_dir : path
        Folder for the measured runs and for next.csv.
    targets : Targets
        The present targets. They, and other definitions of their angle, are no further
        responses.
    discrepancy_percent : float
        Of the simulator, in percent of a response's mean.

    Returns
    -------
    pandas.DataFrame
        The content of next.csv.
    """
    rows = []
    for path in map(Path, pours):
        job = measure_job(scene, path, Path(out_dir) / path.parent.name)
        test = bench_of(job, path)
        for run in job["runs"]:
            for response in responses_of(test.name):
                rows.append(
                    {
                        "apparatus": test.name,
                        "sample": job["sample"],
                        "response": response.name,
                        "value": response.of(run),
                    }
                )
    measured = set(targets.names)
    if CALIBRATED_ANGLE in measured:
        measured.update(MEAN_KEYS.values())
    runs = pd.DataFrame(rows).dropna(subset="value")
    runs = runs[~runs["response"].isin(measured)]
    repetitions = round(np.mean([target.repetitions for target in targets]))
    table = information(runs, repetitions, discrepancy_percent)
    write_table(Path(out_dir) / "next.csv", table, float_format="%.6g")
    return table


def message(table: pd.DataFrame) -> str:
    """Write the table in lines, most informative response first."""
    lines = ["Information that one more response would add, in bits:"]
    for row in table.itertuples():
        bits = f"{row.bits:.2f} bits ({row.bits_low:.2f} to {row.bits_high:.2f})"
        lines.append(
            f"{row.response} ({row.apparatus}): {bits} by the mean of {row.repetitions}"
        )
    return "\n".join(lines)
