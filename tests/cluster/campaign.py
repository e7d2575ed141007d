"""A campaign on many cores, simulated: how long it takes, and what share of the cores' time pours, by samples a job.

    python tests/cluster/campaign.py --samples 10000 --cores 1000

Each job starts when it has been submitted and a core is free. It takes its start, then its samples one after another.
Times of samples are drawn from measured ones, the benchmarks of the rules pour and measure_runs: CPU times, since the
machine that measured may have been busy.
"""

import argparse
import heapq
from pathlib import Path

import numpy as np

PER_JOB = (1, 5, 10, 20, 50, 100)


def makespan_s(jobs_s, cores, start_s, submitted_per_s):
    """Time until the last job has ended; jobs are submitted in their order at a constant rate."""
    free_s = [0.0] * min(cores, len(jobs_s))
    for number, takes_s in enumerate(jobs_s):
        heapq.heappush(
            free_s,
            max(heapq.heappop(free_s), number / submitted_per_s) + start_s + takes_s,
        )
    return max(free_s)


def measured_s(folder):
    """CPU times of the samples of a run, pour and measurement together."""

    def seconds(path):
        names, values = (line.split("\t") for line in path.read_text().splitlines()[:2])
        return float(values[names.index("cpu_time")])

    pours = [
        path
        for path in Path(folder).glob("*.tsv")
        if not path.stem.endswith("_measured")
    ]
    return [
        seconds(path) + seconds(path.with_stem(f"{path.stem}_measured"))
        for path in pours
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--cores", type=int, default=1000)
    parser.add_argument(
        "--benchmarks", help="folder benchmarks/heaps of a run, whose times are drawn"
    )
    parser.add_argument(
        "--sample-s",
        type=float,
        default=11.0,
        help="time of a sample, where no run is given (11)",
    )
    parser.add_argument(
        "--start-s", type=float, default=2.7, help="start of a cluster job (2.7)"
    )
    parser.add_argument(
        "--inner-s",
        type=float,
        default=2.7,
        help="start of one job of the workflow in it (2.7)",
    )
    parser.add_argument(
        "--submitted-per-s",
        type=float,
        default=2.0,
        help="jobs submitted in a second (2)",
    )
    args = parser.parse_args()
    known_s = measured_s(args.benchmarks) if args.benchmarks else [args.sample_s]
    samples_s = np.random.default_rng(1).choice(known_s, args.samples)
    print(
        "| samples per job | jobs | minutes | core hours | share that pours |\n|---|---|---|---|---|"
    )
    for size in PER_JOB:
        cuts = np.arange(0, args.samples, size)
        jobs_s = np.add.reduceat(samples_s, cuts) + 2 * args.inner_s * np.diff(
            [*cuts, args.samples]
        )
        whole_s = makespan_s(jobs_s, args.cores, args.start_s, args.submitted_per_s)
        used_s = jobs_s.sum() + args.start_s * len(jobs_s)
        print(
            f"| {size} | {len(jobs_s)} | {whole_s / 60:.1f} | {used_s / 3600:.1f} | {samples_s.sum() / used_s:.0%} |"
        )


if __name__ == "__main__":
    main()
