#!/usr/bin/env python3
"""What a cluster job costs besides the work in it: time of the jobs that Slurm knows, less the benchmarks of a run.

overhead.py FOLDER: where the run worked. Times of the wall clock, so the machine must be idle otherwise.
"""

import subprocess
import sys
from datetime import datetime
from pathlib import Path

# Rules that the workflow keeps off the cluster: its localrules.
LOCAL = {
    "berry",
    "shape",
    "design",
    "dataset",
    "solutions",
    "published_solutions",
    "published_sets",
    "validate",
    "drum",
    "card",
}


def slurm_s(lines):
    """Times of the jobs that ended well, from lines STATE START END of squeue."""
    ended = [line.split() for line in lines if line.startswith("COMPLETED")]
    return [
        (datetime.fromisoformat(end) - datetime.fromisoformat(start)).total_seconds()
        for _, start, end in ended
    ]


def benchmarks_s(folder):
    paths = (Path(folder) / "results" / "benchmarks").rglob("*.tsv")
    return [
        float(path.read_text().splitlines()[1].split()[0])
        for path in paths
        if path.stem not in LOCAL
    ]


def main():
    command = ["squeue", "--noheader", "--states=all", "--format=%T %S %e"]
    listed = subprocess.run(
        command, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    jobs_s = slurm_s(listed)
    work_s = benchmarks_s(sys.argv[1])
    over_s = (sum(jobs_s) - sum(work_s)) / len(jobs_s)
    print(
        f"{len(jobs_s)} cluster jobs, {sum(jobs_s):.0f} s; {len(work_s)} jobs of the workflow, {sum(work_s):.0f} s"
    )
    print(f"{over_s:.1f} s of overhead for each cluster job")


if __name__ == "__main__":
    main()
