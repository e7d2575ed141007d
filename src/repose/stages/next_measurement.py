"""Rank further responses by the information that their measurement would add.

Parameter sets are drawn from the posterior, and each is simulated a few times in every
bench test of the configuration. A response that differs more between these sets than
from run to run can tell them apart. Let tau^2 be the variance of its true mean between
the sets. The mean of n repetitions has the error variance s^2 = sigma^2 / n + d^2,
where sigma^2 is the variance of a single run and d is the discrepancy of the simulator.
For normal variables the information is

    bits = 1/2 log2(1 + tau^2 / s^2)

(Cover & Thomas 2006, Elements of Information Theory, section 9.1). Responses share
information, so the ranking is only valid for the first response that is added. Once
this response is a target, make the table again.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench import Scene, bench_of, bench_tests
from repose.bench.parameters import PARAMETERS, parameters_among
from repose.calibrate.responses import list_responses
from repose.calibrate.targets import Targets
from repose.calibrate.variance import variance_components
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table, write_table
from repose.measure.angles import MEAN_KEYS
from repose.measure.further_responses import CALIBRATED_ANGLE
from repose.stages.job import measure_job
from repose.stages.settings import N_PLAUSIBLE_SETS

COLUMNS = [
    "response",
    "apparatus",
    "mean",
    "sd_between_sets",
    "sd_of_a_run",
    "repetitions",
    "bits",
    "bits_low",
    "bits_high",
    "sets",
    "runs",
]
# Smallest number of sets that must have two runs with a response.
MIN_SETS = 4
# Largest correlation. Larger ones are set to this, because 1 would give infinite
# information.
LARGEST_CORRELATION = 1 - 1e-12


def draw_plausible_sets(draws_csv: StrPath, seed: int, out: StrPath) -> pd.DataFrame:
    """Choose `N_PLAUSIBLE_SETS` draws of the posterior at random, and write a table.

    Parameters
    ----------
    draws_csv : path
        Draws of the posterior.
    seed : int
        Seed of the random choice.
    out : path
        The table to write.

    Returns
    -------
    pandas.DataFrame
        The table: `sample` and the parameters.

    Raises
    ------
    InputError
        If there are fewer draws than sets to choose.
    """
    draws = read_table(draws_csv, PARAMETERS)
    if len(draws) < N_PLAUSIBLE_SETS:
        raise InputError(
            draws_csv,
            key="rows",
            value=len(draws),
            allowed=f"{N_PLAUSIBLE_SETS} or more",
        )
    generator = np.random.default_rng(seed)
    rows = np.sort(generator.choice(len(draws), N_PLAUSIBLE_SETS, replace=False))
    samples = draws.loc[rows, list(parameters_among(draws))].reset_index(drop=True)
    samples.insert(0, "sample", range(1, N_PLAUSIBLE_SETS + 1))
    write_table(out, samples, float_format="%.10g")
    return samples


def rank_responses(
    runs: pd.DataFrame, repetitions: int, discrepancy_percent: float
) -> pd.DataFrame:
    """Compute how much information the measurement of each response would add.

    A response is left out if fewer than `MIN_SETS` sets have two runs of it, or if
    it never varies.

    Parameters
    ----------
    runs : pandas.DataFrame
        A row for each run and response: `apparatus`, `response`, `sample`, `value`.
    repetitions : int
        Number of repetitions of the measurement.
    discrepancy_percent : float
        Discrepancy of the simulator, in percent of the mean of a response.

    Returns
    -------
    pandas.DataFrame
        The columns `COLUMNS`, the most informative response first.

    Raises
    ------
    InputError
        If no response has enough runs.
    """
    rows = []
    groups = runs.groupby(["apparatus", "response"], sort=False)
    for (bench_test, response), response_runs in groups:
        has_several_runs = response_runs.groupby("sample").size() > 1
        if has_several_runs.sum() < MIN_SETS:
            continue
        variances = variance_components(response_runs["value"], response_runs["sample"])

        # Compute the variance of the difference between a measurement and the
        # simulator.
        discrepancy = discrepancy_percent / 100 * variances.mean
        error_variance = variances.within / repetitions + discrepancy**2
        # Skip a response that never varies, because its scatter of 0 would be a
        # divisor.
        if not error_variance > 0:
            continue
        # The ends of the interval of the intraclass correlation give those of the
        # information.
        bits, bits_low, bits_high = _compute_information(
            np.array([variances.icc, variances.icc_low, variances.icc_high]),
            run_variance=variances.within,
            error_variance=error_variance,
        )
        rows.append(
            {
                "response": response,
                "apparatus": bench_test,
                "mean": variances.mean,
                "sd_between_sets": np.sqrt(variances.between),
                "sd_of_a_run": np.sqrt(variances.within),
                "repetitions": repetitions,
                "bits": bits,
                "bits_low": bits_low,
                "bits_high": bits_high,
                "sets": variances.groups,
                "runs": variances.values,
            }
        )
    if not rows:
        raise InputError(
            "next",
            key="runs",
            value=len(runs),
            allowed=f"{MIN_SETS} sets or more with two runs of a response",
        )
    table = pd.DataFrame(rows, columns=COLUMNS)
    return table.sort_values("bits", ascending=False, kind="stable", ignore_index=True)


def _compute_information(
    correlations: np.ndarray, run_variance: float, error_variance: float
) -> np.ndarray:
    """Compute the information that the measurement of a response would add.

    Parameters
    ----------
    correlations : ndarray
        Intraclass correlations (n,) of the response: the variance between the parameter
        sets as a fraction of the variance of all runs. An estimate below 0 counts as 0.
    run_variance : float
        Variance of the runs of one parameter set.
    error_variance : float
        Variance of the difference between a measurement and the simulator.

    Returns
    -------
    ndarray
        The information (n,) in bits, for each correlation.
    """
    shares = correlations.clip(0, LARGEST_CORRELATION)
    between_variances = run_variance * shares / (1 - shares)
    # This is the information about a normal variable that is measured with a normal
    # error.
    return 0.5 * np.log2(1 + between_variances / error_variance)


def list_all_responses() -> list[dict[str, str]]:
    """List the responses of all bench tests as targets of a scene, to measure them all.

    Returns
    -------
    list of dict
        `response` and `apparatus` of each, as in the section `targets`.
    """
    entries = []
    for test in bench_tests():
        for response in test.responses:
            entries.append({"response": response.name, "apparatus": test.name})
    return entries


def write_ranking(
    pours: Iterable[StrPath],
    scene: Scene,
    out_dir: StrPath,
    *,
    targets: Targets,
    discrepancy_percent: float,
) -> pd.DataFrame:
    """Rank further responses of saved runs by the information that each would add.

    The runs are measured again, and the ranking is written as next.csv.

    Parameters
    ----------
    pours : iterable of path
        Saved runs of plausible parameter sets, in any bench tests.
    scene : Scene
        The scene of the study, whose targets are `list_all_responses`.
    out_dir : path
        Folder for the measured runs and for next.csv.
    targets : Targets
        The present targets. They are not ranked, nor are other definitions of their
        angle.
    discrepancy_percent : float
        Discrepancy of the simulator, in percent of the mean of a response.

    Returns
    -------
    pandas.DataFrame
        The content of next.csv.
    """
    runs = _measure_responses(pours, scene, Path(out_dir))
    # Leave out what is already measured. A measurement of a pile gives its angle by
    # every definition.
    known_responses = set(targets.names)
    if CALIBRATED_ANGLE in known_responses:
        known_responses.update(MEAN_KEYS.values())
    new_runs = runs[~runs["response"].isin(known_responses)]

    # Assume that a further response would be measured as often as the present targets.
    repetitions = round(np.mean([target.repetitions for target in targets]))
    table = rank_responses(new_runs, repetitions, discrepancy_percent)
    write_table(Path(out_dir) / "next.csv", table, float_format="%.6g")
    return table


def _measure_responses(
    pours: Iterable[StrPath], scene: Scene, out: Path
) -> pd.DataFrame:
    """Measure all responses of saved runs, and write the measured jobs.

    Parameters
    ----------
    pours : iterable of path
        Saved jobs. Each job is written into a folder with the name of its own folder.
    scene : Scene
        The scene, whose targets are `list_all_responses`.
    out : Path
        Folder for the measured jobs.

    Returns
    -------
    pandas.DataFrame
        A row for each run and response that could be measured: `apparatus`, `sample`,
        `response` and `value`.
    """
    rows = []
    for path in map(Path, pours):
        job = measure_job(scene, path, out / path.parent.name)
        test = bench_of(job, path)
        for run in job["runs"]:
            for response in list_responses(test.name):
                rows.append(
                    {
                        "apparatus": test.name,
                        "sample": job["sample"],
                        "response": response.name,
                        "value": response.of(run),
                    }
                )
    return pd.DataFrame(rows).dropna(subset="value")


def format_ranking(table: pd.DataFrame) -> str:
    """Write the ranking of `write_ranking` in lines for the terminal."""
    lines = ["Information that one more response would add, in bits:"]
    for row in table.itertuples():
        lines.append(
            f"{row.response} ({row.apparatus}): {row.bits:.2f} bits ({row.bits_low:.2f} "
            f"to {row.bits_high:.2f}) by the mean of {row.repetitions}"
        )
    return "\n".join(lines)
