"""Make the table of samples from the measured runs of the bench tests.

It has the responses of each sample with their standard errors. Section 4.1.1 of the
paper leaves out samples that formed no stable pile. Here they stay in the table with a
status and a reason, and the readers of the table leave them out.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from repose.bench import bench
from repose.calibrate.dataset_files import SUMMARY_SUFFIX
from repose.calibrate.responses import Definitions
from repose.calibrate.runs import Recorded, summarise_runs
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.targets import OWN_BENCH, Target, Targets
from repose.common.errors import InputError
from repose.common.files import StrPath, read_json, write_json, write_table
from repose.common.statuses import describe_failures
from repose.measure.angles import CALIBRATED_ANGLE
from repose.measure.outline_shape import (
    DOUBTFUL_VIEWS,
    MEASURED_VIEWS,
    describe_doubtful_views,
)
from repose.measure.settings import MeasureSettings, line_of
from repose.stages.parameter_sets import list_parameters, read_samples
from repose.stages.settings import RUN_STATUSES

RUN_COLUMNS = ("seed", "status", "reason")
STATUS_COLUMNS = ("status", "reason", "n_seeds")
# Numbers of views, which the table of runs has for piles
VIEW_COLUMNS = (MEASURED_VIEWS, DOUBTFUL_VIEWS)
# A measured restitution may lie slightly above its limit of 1.
ROUNDING_FACTOR = 1.01
# The parameters of a sample may be rounded differently in the file of a job and in the
# table of samples. The absolute tolerance is for values near 0.
PARAMETER_RELATIVE_TOLERANCE = 1e-6
PARAMETER_TOLERANCE = 1e-9
Job = Mapping[str, Any]
# Jobs by bench test, then by sample.
Jobs = Mapping[str, Mapping[int, Job]]


def make_tables(
    samples: pd.DataFrame,
    jobs: Jobs,
    targets: Targets,
    parameter_names: Sequence[str] | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make the table of samples and the table of single runs.

    Parameters
    ----------
    samples : pandas.DataFrame
        Number and parameters of each sample.
    jobs : mapping
        The measured jobs by bench test, and then by number of the sample. A job has its
        measured runs under the key `runs`.
    targets : Targets
        The targets of the study.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    pandas.DataFrame
        A row for each sample: parameters, status, and the mean of each response with
        its standard error. The status is ok if all bench tests of the sample are ok.
    pandas.DataFrame
        A row for each run.
    """
    recorded_by_bench_test = {
        bench_test: list_recorded_columns(bench_test, targets)
        for bench_test in targets.apparatus
    }

    # Summarise the runs of each sample, in one row for all bench tests.
    summaries = []
    for sample in samples["sample"]:
        summaries_of_sample = {
            bench_test: summarise_runs(jobs[bench_test][sample]["runs"], recorded)
            for bench_test, recorded in recorded_by_bench_test.items()
        }
        summaries.append(_merge_summaries(summaries_of_sample))

    # After the status, each target and its standard error come first, then the other
    # columns that the bench tests record.
    columns = list(STATUS_COLUMNS)
    for name, error_column in zip(targets.names, targets.errors, strict=True):
        columns += [name, error_column]
    for recorded in recorded_by_bench_test.values():
        columns += recorded.summary
    summary_table = pd.DataFrame(summaries, columns=_drop_repeated(columns))

    parameters = list_parameters(samples, parameter_names)
    parameter_sets = samples[["sample", *parameters]].reset_index(drop=True)
    dataset = pd.concat([parameter_sets, summary_table], axis=1)
    return dataset, _tabulate_runs(samples["sample"], jobs, targets)


def _drop_repeated(columns: Iterable[str]) -> list[str]:
    """Drop repeated names, because the response of a target may be recorded anyway."""
    return list(dict.fromkeys(columns))


def list_recorded_columns(bench_test: str, targets: Targets) -> Recorded:
    """List the columns of a bench test in the tables of samples and of runs.

    The responses of the targets come first, then those that the bench test always
    records. `OWN_BENCH` stands for the user's own program, which records only targets.
    """
    names = tuple(target.name for target in _select_targets(targets, bench_test))
    if bench_test == OWN_BENCH:
        return Recorded(means=names, single=names)
    return bench(bench_test).recorded.put_targets_first(names)


def count_by_status(dataset: pd.DataFrame, runs: pd.DataFrame) -> dict[str, Any]:
    """Count samples and runs by their status, and describe the counts in a sentence.

    Parameters
    ----------
    dataset : pandas.DataFrame
        A row for each sample, with `status` and `reason`.
    runs : pandas.DataFrame
        A row for each run, with `status`.

    Returns
    -------
    dict
        Numbers of samples and of runs, in total and by status; ``reasons``, the reasons
        why samples are left out; and ``text``, the sentence. If the runs are piles, it
        also has the numbers of `count_views`.
    """
    samples_by_status = dict(Counter(dataset["status"]).most_common())
    runs_by_status = dict(Counter(runs["status"]).most_common())
    n_ok = samples_by_status.get("ok", 0)
    n_runs_ok = runs_by_status.get("ok", 0)

    left_out = dataset[dataset["status"] != "ok"]
    views = count_views(runs.to_dict("records"))
    return {
        "samples": len(dataset),
        "ok": n_ok,
        "left_out": len(left_out),
        "by_status": samples_by_status,
        "reasons": {str(row.sample): row.reason for row in left_out.itertuples()},
        "runs": len(runs),
        "runs_ok": n_runs_ok,
        "runs_by_status": runs_by_status,
        **views,
        "text": describe_counts(samples_by_status, runs_by_status, views),
    }


def count_views(runs: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """Count the side views of simulated piles, and those that are doubtful.

    Parameters
    ----------
    runs : iterable of mapping
        Measured runs.

    Returns
    -------
    dict
        The numbers by the names in `VIEW_COLUMNS`, over all good runs that have them.
        It is empty if there is no such run.
    """
    # In the table of runs, a run of another bench test has empty cells.
    counted_runs = [
        run
        for run in runs
        if run["status"] == "ok"
        and all(math.isfinite(run.get(name, math.nan)) for name in VIEW_COLUMNS)
    ]
    if not counted_runs:
        return {}
    return {name: int(sum(run[name] for run in counted_runs)) for name in VIEW_COLUMNS}


def describe_views(views: Mapping[str, int]) -> str:
    """Describe how many side views of simulated piles are doubtful.

    `views` is the result of `count_views`. The text is empty if it has no numbers.
    """
    if MEASURED_VIEWS not in views:
        return ""
    return f"{describe_doubtful_views(views[DOUBTFUL_VIEWS], views[MEASURED_VIEWS])}."


def describe_counts(
    samples: Mapping[str, int], runs: Mapping[str, int], views: Mapping[str, int]
) -> str:
    """Describe how many samples and runs can be used, and why the others cannot.

    Parameters
    ----------
    samples, runs : mapping
        Numbers of samples and of runs by their status.
    views : mapping
        A mapping with the numbers of `count_views`, if the runs are piles.

    Returns
    -------
    str
        Two or three sentences.
    """
    left_out = {status: count for status, count in samples.items() if status != "ok"}
    failed = {status: count for status, count in runs.items() if status != "ok"}
    left_out_text = describe_failures(left_out, "left out") or "none left out"
    failed_text = describe_failures(failed, "failed") or "none failed"
    text = (
        f"{samples.get('ok', 0)} of {sum(samples.values())} samples can be used; "
        f"{left_out_text}. "
        f"{runs.get('ok', 0)} of {sum(runs.values())} single runs can be measured; "
        f"{failed_text}."
    )
    return f"{text} {describe_views(views)}".rstrip()


def write_dataset(
    samples_csv: StrPath,
    paths: Iterable[StrPath],
    targets: Targets,
    definitions: Definitions,
    out: StrPath,
    prefix: str = "",
    parameter_names: Sequence[str] | None = None,
) -> dict[str, Any]:
    """Write the table of samples, the table of their runs, and a summary of both.

    The files are dataset.csv, runs.csv and dataset_summary.json.

    Parameters
    ----------
    samples_csv : path
        Table of the parameter sets that were simulated.
    paths : iterable of path
        Files of the measured jobs.
    targets : Targets
        The targets of the study.
    definitions : mapping
        How the configuration defines the responses.
    out : path
        Folder for the files.
    prefix : str, optional
        Text that is put before the names of the files.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    dict
        The content of dataset_summary.json. It has the entries of `count_by_status` and
        ``definitions``. The angle of repose is the slope of a line along the side of
        the pile. If this angle is a target, ``line`` describes the line.
    """
    samples = read_samples(samples_csv, parameter_names=parameter_names)
    jobs = read_jobs(paths, samples, targets, parameter_names)
    dataset, runs = make_tables(samples, jobs, targets, parameter_names)
    summary = count_by_status(dataset, runs) | {"definitions": definitions}

    definition_of_angle = definitions.get(CALIBRATED_ANGLE, {})
    if "measure.response" in definition_of_angle:
        # Remove the name of the section from the keys: `measure.response` becomes
        # `response`.
        settings = {
            key.rpartition(".")[2]: value for key, value in definition_of_angle.items()
        }
        summary["line"] = line_of(MeasureSettings.with_defaults(**settings))

    folder = Path(out)
    write_table(folder / f"{prefix}dataset.csv", dataset)
    write_table(folder / f"{prefix}runs.csv", runs)
    write_json(folder / f"{prefix}dataset{SUMMARY_SUFFIX}", summary)
    return summary


def read_jobs(
    paths: Iterable[StrPath],
    samples: pd.DataFrame,
    targets: Targets,
    parameter_names: Sequence[str] | None = None,
) -> dict[str, dict[int, Job]]:
    """Read all jobs, and check them against the table of samples.

    Each sample must have exactly one job in each bench test of the targets.

    Parameters
    ----------
    paths : iterable of path
        The files of the measured jobs.
    samples : pandas.DataFrame
        A row for each sample, with its number and its parameters.
    targets : Targets
        The targets of the study.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    dict
        The jobs by bench test, and then by number of the sample.

    Raises
    ------
    InputError
        If a job is damaged, belongs to no sample or no bench test of the targets, or
        has other parameters than its sample. Also if a sample has no job in a bench
        test, or several.
    """
    parameter_columns = list(list_parameters(samples, parameter_names))
    parameters_of_samples = samples.set_index("sample")[parameter_columns]
    jobs: dict[str, dict[int, Job]] = {
        bench_test: {} for bench_test in targets.apparatus
    }
    # The path of each job by its bench test and sample, for the message about a second
    # one.
    path_of_job: dict[tuple[str, int], object] = {}
    for path in paths:
        # `read_job` has checked that `bench_test` is a key of `jobs`.
        job, bench_test = read_job(path, targets)
        sample = job["sample"]
        if sample not in parameters_of_samples.index:
            raise InputError(path, key="sample", value=sample, allowed="in the table")
        if sample in jobs[bench_test]:
            first_path = path_of_job[bench_test, sample]
            raise InputError(
                path,
                key="sample",
                value=sample,
                allowed=f"a sample of the table, once; also in {first_path}",
            )
        _check_parameters(job, parameters_of_samples.loc[sample], path)
        jobs[bench_test][sample] = job
        path_of_job[bench_test, sample] = path

    _require_all_samples(jobs, samples["sample"])
    return jobs


def _require_all_samples(jobs: Jobs, samples: Iterable[int]) -> None:
    """Raise an InputError if a sample has no job in one of the bench tests."""
    for bench_test, jobs_by_sample in jobs.items():
        missing_samples = [
            int(sample) for sample in samples if sample not in jobs_by_sample
        ]
        if missing_samples:
            raise InputError(
                f"jobs of the {bench_test}",
                key="samples without a file",
                value=missing_samples,
                allowed="one file per sample",
            )


def _check_parameters(job: Job, parameters: pd.Series, path: object) -> None:
    """Raise an InputError if a job has other parameters than its sample."""
    for name, sample_value in parameters.items():
        expected = float(sample_value)
        value = job["parameters"].get(name)
        # Treat a missing value or a string as NaN, which fails the comparison.
        number = value if isinstance(value, int | float) else math.nan
        if not math.isclose(
            number,
            expected,
            rel_tol=PARAMETER_RELATIVE_TOLERANCE,
            abs_tol=PARAMETER_TOLERANCE,
        ):
            raise InputError(
                path,
                key=f"parameters.{name}",
                value=value,
                allowed=f"{expected}, as in the table of samples",
            )


def read_job(path: StrPath, targets: Targets) -> tuple[Job, str]:
    """Read the file of a measured job, and check its runs.

    A job has all runs of one parameter set in one bench test. A good run must have the
    responses of all targets that this bench test measures.

    Parameters
    ----------
    path : path
        The file.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        The content of the file.
    str
        The name of the job's bench test.

    Raises
    ------
    InputError
        If no target belongs to this bench test. Also if a run has an unknown status, no
        seed or the seed of another run, or if a good run lacks a response.
    """
    required_keys = {"sample": int, "parameters": dict, "runs": list}
    job = read_json(path, required_keys, "a job's JSON file")
    # The key `apparatus` names the bench test. Jobs of the funnel, `UNNAMED`, lack it.
    bench_test = job.get("apparatus", UNNAMED)
    if bench_test not in targets.apparatus:
        raise InputError(
            path,
            key="apparatus",
            value=bench_test,
            allowed=f"a bench test of the targets, {', '.join(targets.apparatus)}",
        )
    if not job["runs"]:
        raise InputError(path, key="runs", value=[], allowed="at least one run")

    # The statuses that a run may have depend on its bench test. `OWN_BENCH` stands for
    # the user's own program, which is no bench test of repose.
    if bench_test == OWN_BENCH:
        statuses: tuple[str, ...] = RUN_STATUSES
    else:
        statuses = bench(bench_test, path).statuses
    for position, run in enumerate(job["runs"]):
        run_key = f"runs[{position}]"
        _check_status(run, run_key, statuses=statuses, path=path)
        # Only a good run must have the responses.
        if run["status"] == "ok":
            for target in _select_targets(targets, bench_test):
                _check_response(run, run_key, target=target, path=path)
    _check_seeds(job["runs"], path)
    return job, bench_test


def _check_status(
    run: object, run_key: str, statuses: Sequence[str], path: object
) -> None:
    """Raise an InputError if an entry is not a run, or its status is unknown.

    Parameters
    ----------
    run : object
        The entry of the file, which should be a mapping with a `status`.
    run_key : str
        Key of the entry in its file, for the message.
    statuses : sequence of str
        The statuses that a run may have.
    path : path
        File of the job, for the message.
    """
    status = run.get("status") if isinstance(run, dict) else run
    if not isinstance(run, dict) or status not in statuses:
        raise InputError(
            path, key=f"{run_key}.status", value=status, allowed=", ".join(statuses)
        )


def _check_seeds(runs: Sequence[Mapping[str, Any]], path: object) -> None:
    """Raise an InputError if a run has no seed, or if two runs have the same seed."""
    seeds = [run.get("seed") for run in runs]
    # Compare seeds as strings, because a damaged seed may be of any type.
    has_repeated_seed = len(set(map(str, seeds))) < len(seeds)
    if None in seeds or has_repeated_seed:
        raise InputError(
            path, key="seed", value=seeds, allowed="a seed for each run, and none twice"
        )


def _check_response(
    run: Mapping[str, Any], run_key: str, target: Target, path: object
) -> None:
    """Raise an InputError if the response of a good run is missing or impossible.

    Parameters
    ----------
    run : mapping
        The measured run.
    run_key : str
        Key of the run in its file, for the message.
    target : Target
        Its response must be finite, and may exceed its upper limit only by rounding.
    path : path
        File of the job, for the message.
    """
    value = run.get(target.name)
    highest = target.response.high
    number = value if isinstance(value, int | float) else math.nan
    key = f"{run_key}.{target.name}"
    if not math.isfinite(number):
        raise InputError(
            path, key=key, value=value, allowed="a finite number, as the run is ok"
        )
    if abs(number) > ROUNDING_FACTOR * highest:
        raise InputError(
            path, key=key, value=value, allowed=f"a finite number, up to {highest:g}"
        )


def _select_targets(targets: Targets, bench_test: str) -> tuple[Target, ...]:
    """Select the targets whose responses a bench test measures."""
    return tuple(
        target for target in targets if target.response.apparatus == bench_test
    )


def _merge_summaries(summaries: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Merge the summaries of a sample, one for each bench test, into one row.

    The status is that of the first bench test that failed. The number of runs is the
    smallest one of all bench tests.

    Parameters
    ----------
    summaries : mapping
        Results of `summarise_runs`, by name of the bench test.

    Returns
    -------
    dict
        All columns of the summaries.
    """
    if len(summaries) == 1:
        (summary,) = summaries.values()
        return summary

    merged: dict[str, Any] = {}
    statuses = []
    reasons = []
    for bench_test, summary in summaries.items():
        merged |= summary
        statuses.append(summary["status"])
        if summary["reason"]:
            reasons.append(f"{bench_test}: {summary['reason']}")
    # Every summary has these three columns. Without the following lines, those of the
    # last bench test would remain.
    merged["status"] = next((status for status in statuses if status != "ok"), "ok")
    merged["reason"] = "; ".join(reasons)
    merged["n_seeds"] = min(summary["n_seeds"] for summary in summaries.values())
    return merged


def _tabulate_runs(
    samples: Iterable[int], jobs: Jobs, targets: Targets
) -> pd.DataFrame:
    """Make the table of single runs, ordered by sample and then by bench test.

    Parameters
    ----------
    samples : iterable of int
        Numbers of the samples.
    jobs : mapping
        The measured jobs by bench test, and then by number of the sample.
    targets : Targets
        The targets of the study.

    Returns
    -------
    pandas.DataFrame
        A row for each run. If there are several bench tests, the column `apparatus`
        names the one that made the run.
    """
    columns = ["sample"]
    if len(targets.apparatus) > 1:
        columns.append("apparatus")
    columns += [*RUN_COLUMNS, *targets.names]
    # `single` are the columns that the table of single runs has of a bench test.
    for bench_test in targets.apparatus:
        columns += list_recorded_columns(bench_test, targets).single

    # A row may have more entries than the table has columns, such as `apparatus` with a
    # single bench test. `columns` selects the ones that are kept.
    rows = []
    for sample, bench_test in product(samples, targets.apparatus):
        for run in jobs[bench_test][sample]["runs"]:
            rows.append({"sample": sample, "apparatus": bench_test, **run})
    columns += [name for name in VIEW_COLUMNS if any(name in row for row in rows)]
    return pd.DataFrame(rows, columns=_drop_repeated(columns))
