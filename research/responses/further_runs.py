"""Runs of further bench tests over a design, beside those of the pile."""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench import bench
from repose.calibrate.responses import response
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import read_json, read_table
from repose.measure import further_responses
from research.responses import responses_over_design
from research.responses.responses_over_design import Data, over_design

JOB = "a job of a bench test, measured by the verb measure_runs"


def jobs_in(folders: Iterable[str | Path]) -> list[Path]:
    """Measured jobs in some folders of the verb measure_runs, sorted in each folder.

    A folder without a job raises InputError.
    """
    found: list[Path] = []
    for folder in folders:
        jobs = sorted(
            path for path in Path(folder).glob("*.json") if path.stem.isdigit()
        )
        if not jobs:
            raise InputError(
                folder,
                "jobs",
                0,
                "a folder with NUMBER.json files of the verb measure_runs",
            )
        found += jobs
    return found


def read_jobs(
    paths: Iterable[str | Path], samples: np.ndarray
) -> dict[str, pd.DataFrame]:
    """Good runs of each further bench test, by its name: ``sample`` and its responses.

    `samples` are numbers of the design's usable samples. InputError if a file is bad, of the pile, or of another
    sample.
    """
    rows: dict[str, list[dict]] = {}
    for path in paths:
        job = read_json(path, {"sample": int, "apparatus": str, "runs": list}, JOB)
        if job["apparatus"] == further_responses.BENCH:
            raise InputError(
                path,
                "apparatus",
                job["apparatus"],
                "another bench test than that of the pile",
            )
        if job["sample"] not in samples:
            raise InputError(
                path, "sample", job["sample"], "a usable sample of the design"
            )
        names = [response.name for response in bench(job["apparatus"], path).responses]
        bench_rows = rows.setdefault(job["apparatus"], [])
        for run in job["runs"]:
            try:
                if run["status"] == "ok":
                    # a response that is no target here may lack in a good run
                    numbers = {
                        name: math.nan if run[name] is None else float(run[name])
                        for name in names
                    }
                    bench_rows.append({"sample": job["sample"]} | numbers)
            except (KeyError, TypeError, ValueError) as error:
                raise InputError(path, "runs", str(error), JOB) from error
    return {name: pd.DataFrame(bench_rows) for name, bench_rows in rows.items()}


def with_jobs(
    data: Data,
    samples: np.ndarray,
    jobs: dict[str, pd.DataFrame],
    source: object = "runs",
) -> Data:
    """Add the responses of further bench tests; a response that the data have already stays as it is.

    `samples` (m,) are the numbers of the data's samples in their order; `jobs` come from `read_jobs`. InputError, which
    names `source`, if too few samples of a bench test have two good runs for an estimate of the noise.
    """
    known = dict(data.known)
    runs = [data.runs]
    for apparatus, table in jobs.items():
        for name in table.columns.drop("sample") if len(table) else ():
            if name in known or table[name].isna().all():  # no run was asked for it
                continue
            try:
                known[name] = over_design(
                    table[name].to_numpy(float), table["sample"].to_numpy(), samples
                )
            except ValueError as error:
                allowed = f"two or more good runs of most samples in the bench test {apparatus}"
                raise InputError(
                    source, response(name).name, str(error), allowed
                ) from None
        runs.append(table)
    return Data(data.X, known, pd.concat(runs, ignore_index=True))


def read(
    runs_csv: str | Path,
    dataset_csv: str | Path,
    targets: Targets,
    definition: str,
    folders: Iterable[str | Path] = (),
) -> Data:
    """Responses of the pile, and of other bench tests that were run with samples of the same design.

    `folders` are those of the verb measure_runs, for other bench tests; the other arguments are as for
    `responses_over_design.read`.
    """
    data = responses_over_design.read(runs_csv, dataset_csv, targets, definition)
    table = read_table(dataset_csv, ("sample", "status"))
    samples = table.loc[table["status"] == "ok", "sample"].to_numpy()
    return with_jobs(data, samples, read_jobs(jobs_in(folders), samples))
