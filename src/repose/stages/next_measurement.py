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
    """Choose `N_PLAUSIBLE_SETS` parameter sets of a posterior, and write a table.

    The sets are chosen at random, and numbered from 1 as samples to simulate.

    Parameters
    ----------
    draws_csv : path
        Table of parameter sets that were drawn from the posterior.
    seed : int
        Seed of the random choice.
    out : path
        The table to write.

    Returns
    -------
    pandas.DataFrame
        The table that was written: `sample` and the parameters.

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
    # Ten digits are far more than the posterior has, and keep the table readable.
    write_table(out, samples, float_format="%.10g")
    return samples


def rank_responses(
    runs: pd.DataFrame, repetitions: int, discrepancy_percent: float
) -> pd.DataFrame:
    """Compute how much information the measurement of each response would add.

    A response is left out if fewer than `MIN_SETS` parameter sets have two runs of it,
    or if it never varies.

    Parameters
    ----------
    runs : pandas.DataFrame
        A row for each run and response: `apparatus` (the bench test), `response`,
        `sample` (the parameter set) and `value`.
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
        # If a response never varies, its error variance is 0, and the information
        # would be divided by zero. The comparison also skips a variance of NaN.
        if not error_variance > 0:
            continue
        # The information grows with the intraclass correlation. The ends of the
        # confidence interval of the correlation therefore give the ends of the interval
        # of the information.
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
                # `groups` and `values` are the numbers of parameter sets and of runs.
                "sets": variances.n_groups,
                "runs": variances.n_values,
            }
        )
    if not rows:
        # The rows have no file of their own, so the name of the subcommand takes its
        # place.
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
    fractions = correlations.clip(0, LARGEST_CORRELATION)
    between_variances = run_variance * fractions / (1 - fractions)
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
    job_paths: Iterable[StrPath],
    scene: Scene,
    out_dir: StrPath,
    *,
    targets: Targets,
    discrepancy_percent: float,
) -> pd.DataFrame:
    """Rank further responses by the information that measuring each of them would add.

    The saved runs are measured again, with all responses of their bench tests. The
    ranking is written as next.csv.

    Parameters
    ----------
    job_paths : iterable of path
        Files NAME.pours.json of the saved jobs. A job has the runs of one plausible
        parameter set in one bench test.
    scene : Scene
        The scene of the study. The caller must have replaced its targets by
        `list_all_responses`, since only responses of targets are measured.
    out_dir : path
        Folder for the measured runs and for next.csv.
    targets : Targets
        The present targets of the study. Their responses are not ranked. If the angle
        of repose is a target, none of its definitions is ranked.
    discrepancy_percent : float
        Discrepancy of the simulator, in percent of the mean of a response.

    Returns
    -------
    pandas.DataFrame
        The content of next.csv.
    """
    runs = _measure_responses(job_paths, scene, Path(out_dir))
    # Leave out what is already measured. A measurement of a pile gives its angle by
    # every definition. The values of `MEAN_KEYS` are the names of these responses.
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
    job_paths: Iterable[StrPath], scene: Scene, out: Path
) -> pd.DataFrame:
    """Measure all responses of the runs in saved jobs, and write the measured jobs.

    Parameters
    ----------
    job_paths : iterable of path
        Files NAME.pours.json of the saved jobs. The measured job is written into a
        folder of `out` that has the name of the job's own folder. Jobs of the same name
        must therefore come from folders of different names.
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
    for path in map(Path, job_paths):
        job = measure_job(scene, path, out / path.parent.name)
        bench_test = bench_of(job, path)
        for run in job["runs"]:
            for response in list_responses(bench_test.name):
                rows.append(
                    {
                        "apparatus": bench_test.name,
                        "sample": job["sample"],
                        "response": response.name,
                        # The value is None if the run could not be measured.
                        "value": response.of(run),
                    }
                )
    return pd.DataFrame(rows).dropna(subset="value")


def format_ranking(table: pd.DataFrame) -> str:
    """Format the result of `write_ranking` as lines for the terminal."""
    lines = ["Information that one more response would add, in bits:"]
    for row in table.itertuples():
        lines.append(
            f"{row.response} ({row.apparatus}): {row.bits:.2f} bits ({row.bits_low:.2f} "
            f"to {row.bits_high:.2f}) by the mean of {row.repetitions}"
        )
    return "\n".join(lines)
