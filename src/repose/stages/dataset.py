"""Jobs of the bench tests to one table: the responses of each sample with their standard errors.

Section 4.1.1 of the paper leaves out samples that formed no stable pile. Here they stay in the table with a status and
a reason, and the readers of the table leave them out.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from repose.bench import bench
from repose.bench.parameters import named
from repose.calibrate.dataset_files import SUMMARY
from repose.calibrate.responses import Definitions
from repose.calibrate.runs import Recorded, summarise_runs
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.targets import Target, Targets
from repose.common.errors import InputError, require
from repose.common.files import Path_, read_json, write_json, write_table
from repose.measure.angles import CALIBRATED_ANGLE
from repose.measure.settings import MeasureSettings, line_of
from repose.stages.parameter_sets import read_samples

RUN = ("seed", "status", "reason")
ENDED = ("status", "reason", "n_seeds")
ROUNDING = 1.01  # a measured restitution may lie a little above 1
Job = Mapping[str, Any]
Jobs = Mapping[str, Mapping[int, Job]]  # by bench test, then by sample


def assemble(
    samples: pd.DataFrame, jobs: Jobs, targets: Targets
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Assemble dataset (a row for each sample, ok if so in every bench test) and single runs (a row for each run)."""
    record = {name: recorded(name, targets) for name in targets.apparatus}
    summaries = [
        _merged(
            {
                name: summarise_runs(jobs[name][sample]["runs"], columns)
                for name, columns in record.items()
            }
        )
        for sample in samples["sample"]
    ]
    pairs = (
        name
        for pair in zip(targets.names, targets.errors, strict=True)
        for name in pair
    )
    others = (name for columns in record.values() for name in columns.summary)
    means = pd.DataFrame(
        summaries, columns=list(dict.fromkeys((*ENDED, *pairs, *others)))
    )
    dataset = pd.concat(
        [samples[["sample", *named(samples)]].reset_index(drop=True), means], axis=1
    )
    return dataset, _all_runs(samples["sample"], jobs, targets)


def recorded(apparatus: str, targets: Targets) -> Recorded:
    """List a bench test's columns in the tables: its targets, then the responses that it always records."""
    return bench(apparatus).recorded.beginning_with(
        tuple(target.name for target in _own(targets, apparatus))
    )


def counts(dataset: pd.DataFrame, runs: pd.DataFrame) -> dict[str, Any]:
    """Count samples and runs by status, also as text."""
    by_status, of_runs = (
        dict(Counter(table["status"]).most_common()) for table in (dataset, runs)
    )
    left_out, runs_ok = dataset[dataset["status"] != "ok"], of_runs.get("ok", 0)
    ok, words = (
        by_status.get("ok", 0),
        ", ".join(f"{by_status[key]} {key}" for key in by_status if key != "ok"),
    )
    text = f"{ok} of {len(dataset)} samples can be used; "
    text += f"{len(left_out)} left out: {words}." if words else "none left out."
    found = {
        "samples": len(dataset),
        "ok": ok,
        "left_out": len(left_out),
        "by_status": by_status,
    }
    found["reasons"] = {str(row.sample): row.reason for row in left_out.itertuples()}
    found |= {"runs": len(runs), "runs_ok": runs_ok, "runs_by_status": of_runs}
    return found | {"text": f"{text} {runs_ok} of {len(runs)} single runs are ok."}


def run(
    samples_csv: Path_,
    paths: Iterable[Path_],
    targets: Targets,
    definitions: Definitions,
    out: Path_,
    prefix: str = "",
) -> dict[str, Any]:
    """Write dataset.csv, runs.csv and dataset_summary.json; return the summary.

    It is `counts` with `definitions`, and `line`, the line whose slope is the angle of repose, in words.
    """
    samples = read_samples(samples_csv)
    dataset, runs = assemble(samples, read_jobs(paths, samples, targets), targets)
    summary = counts(dataset, runs) | {"definitions": definitions}
    if "measure.response" in (angle := definitions.get(CALIBRATED_ANGLE, {})):
        section = {key.rpartition(".")[2]: value for key, value in angle.items()}
        summary["line"] = line_of(MeasureSettings(**section))
    for name, content in {"dataset.csv": dataset, "runs.csv": runs}.items():
        write_table(Path(out) / f"{prefix}{name}", content)
    write_json(Path(out) / f"{prefix}dataset{SUMMARY}", summary)
    return summary


def read_jobs(
    paths: Iterable[Path_], samples: pd.DataFrame, targets: Targets
) -> dict[str, dict[int, Job]]:
    """Read jobs by bench test, then by sample, and check them against the table of samples."""
    expected = samples.set_index("sample")[list(named(samples))]
    jobs: dict[str, dict[int, Job]] = {name: {} for name in targets.apparatus}
    source: dict[tuple[str, int], object] = {}
    for path in paths:
        job, apparatus = read_job(path, targets)
        sample = job["sample"]
        require(sample in expected.index, path, "sample", sample, "in the table")
        if sample in jobs[apparatus]:
            allowed = (
                f"a sample of the table, once; also in {source[apparatus, sample]}"
            )
            raise InputError(path, "sample", sample, allowed)
        for name in expected:
            value, expected_value = (
                job["parameters"].get(name),
                float(expected.at[sample, name]),
            )
            number = value if isinstance(value, int | float) else math.nan
            if not math.isclose(number, expected_value, rel_tol=1e-6, abs_tol=1e-9):
                raise InputError(
                    path,
                    f"parameters.{name}",
                    value,
                    f"{expected_value}, as in the table of samples",
                )
        jobs[apparatus][sample], source[apparatus, sample] = job, path
    for name, by_sample in jobs.items():
        missing = [int(sample) for sample in expected.index if sample not in by_sample]
        require(
            not missing,
            f"jobs of the {name}",
            "samples without a file",
            missing,
            "one file a sample",
        )
    return jobs


def read_job(path: Path_, targets: Targets) -> tuple[Job, str]:
    """Read and check a job; return it with the name of its bench test."""
    job = read_json(
        path, {"sample": int, "parameters": dict, "runs": list}, "a job's JSON file"
    )
    apparatus = job.get("apparatus", UNNAMED)
    if apparatus not in targets.apparatus:
        raise InputError(
            path,
            "apparatus",
            apparatus,
            f"a bench test of the targets, {', '.join(targets.apparatus)}",
        )
    require(job["runs"], path, "runs", [], "at least one run")
    statuses = bench(apparatus, path).statuses
    for i, run in enumerate(job["runs"]):
        if not isinstance(run, dict) or run.get("status") not in statuses:
            value = run.get("status") if isinstance(run, dict) else run
            raise InputError(path, f"runs[{i}].status", value, ", ".join(statuses))
        if run["status"] == "ok":
            for target in _own(targets, apparatus):
                value, most = run.get(target.name), target.response.high
                number = value if isinstance(value, int | float) else math.nan
                if not (math.isfinite(number) and abs(number) <= ROUNDING * most):
                    limit = (
                        f", up to {most:g}"
                        if math.isfinite(number)
                        else ", as the run is ok"
                    )
                    raise InputError(
                        path,
                        f"runs[{i}].{target.name}",
                        value,
                        f"a finite number{limit}",
                    )
    seeds = [run.get("seed") for run in job["runs"]]
    if None in seeds or len(set(map(str, seeds))) < len(seeds):
        raise InputError(path, "seed", seeds, "a seed for each run, and none twice")
    return job, apparatus


def _own(targets: Targets, apparatus: str) -> tuple[Target, ...]:
    """Select the targets of a bench test."""
    return tuple(target for target in targets if target.response.apparatus == apparatus)


def _merged(summaries: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Merge the summaries of a sample's bench tests, which come by name."""
    if len(summaries) == 1:
        return next(iter(summaries.values()))
    merged = {
        key: value for summary in summaries.values() for key, value in summary.items()
    }
    reasons = (
        f"{name}: {summary['reason']}"
        for name, summary in summaries.items()
        if summary["reason"]
    )
    return merged | {
        "status": next(
            (one["status"] for one in summaries.values() if one["status"] != "ok"), "ok"
        ),
        "reason": "; ".join(reasons),
        "n_seeds": min(summary["n_seeds"] for summary in summaries.values()),
    }


def _all_runs(samples: Iterable[int], jobs: Jobs, targets: Targets) -> pd.DataFrame:
    """Make the table of single runs: sample after sample, bench test after bench test."""
    several = ["apparatus"] if len(targets.apparatus) > 1 else []
    others = (
        name for bench in targets.apparatus for name in recorded(bench, targets).single
    )
    columns = dict.fromkeys(("sample", *several, *RUN, *targets.names, *others))
    pairs = product(samples, targets.apparatus)
    rows = [
        {"sample": sample, "apparatus": name, **run}
        for sample, name in pairs
        for run in jobs[name][sample]["runs"]
    ]
    return pd.DataFrame(rows, columns=list(columns))
