"""Heap jobs to one table: what each designed sample's runs gave, with its standard error.

Section 4.1.1 of the paper leaves out samples that formed no stable pile; here they stay in the table with a
status and a reason, and are left out by whoever reads it.
"""

import json
import math
from collections import Counter
from pathlib import Path

from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.core.runs import STATUSES, summarise_runs
from repose.measure.angles import MAIN_RESPONSES, RECORDED

RUN_COLUMNS = ("seed", "status", "reason", *RECORDED.single)


def run(samples_csv, heap_json_paths, out_dir, prefix=""):
    """Write dataset.csv, runs.csv and dataset_summary.json into out_dir; return the summary.

    samples_csv: the design. heap_json_paths: one heap job's JSON file for each of its samples, in any order.
    prefix: put before the three names.
    Raises InputError naming the file that is missing, corrupt, of another sample or of other parameters.
    """
    import pandas as pd  # here and below, not above: each heap job imports this module for summarise_runs

    samples = read_samples(samples_csv)
    jobs = read_jobs(heap_json_paths, samples)
    rows, single = [], []
    for sample in samples["sample"]:
        runs = jobs[sample]["runs"]
        rows.append(summarise_runs(runs, RECORDED))
        single.extend({"sample": sample, **{key: one.get(key) for key in RUN_COLUMNS}} for one in runs)
    dataset = pd.concat(
        [samples[["sample", *PARAMETERS]], pd.DataFrame(rows, columns=list(RECORDED.summary))], axis=1
    )
    all_runs = pd.DataFrame(single, columns=["sample", *RUN_COLUMNS])
    summary = _counts(dataset, all_runs)
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    dataset.to_csv(out / f"{prefix}dataset.csv", index=False)
    all_runs.to_csv(out / f"{prefix}runs.csv", index=False)
    (out / f"{prefix}dataset_summary.json").write_text(json.dumps(summary, indent=1) + "\n")
    return summary


def read_samples(path):
    """Table with the columns sample (int, each once) and the six parameters, or InputError."""
    samples = read_table(path, ("sample", *PARAMETERS))
    twice = samples["sample"][samples["sample"].duplicated()]
    if len(twice):
        raise InputError(path, "sample", int(twice.iloc[0]), "each sample once")
    return samples


def read_jobs(paths, samples):
    """Heap jobs by sample number, checked against the table they were run from, or InputError."""
    expected = samples.set_index("sample")[list(PARAMETERS)]
    jobs, source = {}, {}
    for path in paths:
        job = read_job(path)
        sample = job["sample"]
        if sample not in expected.index or sample in jobs:
            allowed = (
                f"a sample of the table, once; also in {source[sample]}" if sample in jobs else "in the table"
            )
            raise InputError(path, "sample", sample, allowed)
        for name in PARAMETERS:
            value, wanted = job["parameters"].get(name), float(expected.at[sample, name])
            if not isinstance(value, int | float) or not math.isclose(
                value, wanted, rel_tol=1e-6, abs_tol=1e-9
            ):
                raise InputError(path, f"parameters.{name}", value, f"{wanted}, as in the table of samples")
        jobs[sample], source[sample] = job, path
    missing = [int(sample) for sample in expected.index if sample not in jobs]
    if missing:
        raise InputError("heap jobs", "samples without a file", missing, "one JSON file for each sample")
    return jobs


def read_job(path):
    """One heap job as a dict whose runs have a known status and, when ok, finite responses; or InputError."""
    try:
        job = json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise InputError(path, "heap job", str(error), "a heap job's JSON file") from error
    for key, kind in (("sample", int), ("parameters", dict), ("runs", list)):
        if not isinstance(job, dict) or not isinstance(job.get(key), kind):
            raise InputError(path, key, job.get(key) if isinstance(job, dict) else job, f"{kind.__name__}")
    if not job["runs"]:
        raise InputError(path, "runs", [], "at least one run")
    for i, one in enumerate(job["runs"]):
        if not isinstance(one, dict) or one.get("status") not in STATUSES:
            value = one.get("status") if isinstance(one, dict) else one
            raise InputError(path, f"runs[{i}].status", value, ", ".join(STATUSES))
        for key in MAIN_RESPONSES:
            value = one.get(key)
            finite = isinstance(value, int | float) and math.isfinite(value)
            if one["status"] == "ok" and not finite:
                raise InputError(path, f"runs[{i}].{key}", value, "a finite number, as the run is ok")
    return job


def _counts(dataset, runs):
    """How many samples and runs ended how, and the same in words."""
    by_status = {status: int(n) for status, n in Counter(dataset["status"]).most_common()}
    left_out = dataset[dataset["status"] != "ok"]
    words = ", ".join(f"{n} {status}" for status, n in by_status.items() if status != "ok")
    text = f"{len(dataset) - len(left_out)} of {len(dataset)} samples can be used; "
    text += f"{len(left_out)} left out: {words}." if len(left_out) else "none left out."
    runs_ok = int((runs["status"] == "ok").sum())
    text += f" {runs_ok} of {len(runs)} single runs are ok."
    return {
        "samples": len(dataset),
        "ok": len(dataset) - len(left_out),
        "left_out": len(left_out),
        "by_status": by_status,
        "reasons": {str(row.sample): row.reason for row in left_out.itertuples()},
        "runs": len(runs),
        "runs_ok": runs_ok,
        "runs_by_status": {status: int(n) for status, n in Counter(runs["status"]).most_common()},
        "text": text,
    }
