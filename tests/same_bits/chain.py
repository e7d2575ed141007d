"""The chain of a tiny study, verb after verb in one process: `python tests/same_bits/chain.py`, in an empty folder.

The verbs and their options are those of the workflow's rules.
"""

import sys
from pathlib import Path

from repose import cli
from repose.common.files import write_json
from repose.config.pipeline import PipelineConfig

ROOT = Path(__file__).parents[2]
BODY = "--berry results/berry/berry.json --particle results/berry/particle.json"


def verbs(samples):
    """The command lines in the order in which the data flow."""
    yield "berry --out results/berry"
    yield "shape --berry results/berry/berry.json --out results/berry"
    yield "design --out results/design"
    yield from poured(
        "results/heaps", "results/design/samples.csv", "design", samples, 2
    )
    yield "dataset results/heaps --samples results/design/samples.csv --out results"
    yield "network --dataset results/dataset.csv --runs results/runs.csv --out results/network"
    yield "miga --network results/network/network.json --dataset results/dataset.csv --out results/miga"
    posterior = "posterior --network results/network/network.json --predictions results/network/predictions.csv"
    posterior += " --dataset results/dataset.csv --runs results/runs.csv --feasible results/miga/feasible.csv"
    yield f"{posterior} --out results/posterior"
    yield "sensitivity --network results/network/network.json --out results/sensitivity"
    yield "solutions --feasible results/miga/feasible.csv --out results/validation"
    heaps = "results/validation/heaps"
    table = "results/validation/solutions.csv"
    solutions = len(Path(table).read_text().splitlines()) - 1
    yield from poured(heaps, table, "validation", solutions, 1)
    jobs = " ".join(f"{heaps}/{number:03d}.json" for number in range(1, solutions + 1))
    yield f"validate {jobs} --solutions {table} --dataset results/dataset.csv --out results/validation"
    yield f"silhouette {heaps}/001.npz --particle results/berry/particle.json --out results/measure/silhouette.png"
    measured = "measure_silhouette results/measure/silhouette.png --berry results/berry/berry.json"
    yield f"{measured} --overlay results/measure/overlay.png --out results/measure/measured.json"


def arguments_of(line):
    split = line.split()
    return [cli.STAGE, *split] if split[0] in cli.STAGES else split


def poured(folder, table, purpose, count, seeds):
    """Pours of the first rows of a table, and their measurement."""
    for number in range(1, count + 1):
        pour = f"pour --apparatus funnel --samples {table} --sample {number:03d} --seeds {seeds} --purpose {purpose}"
        yield f"{pour} {BODY} --keep-runs --out {folder}"
        yield f"measure_runs {folder}/{number:03d}.pours.json {BODY} --out {folder}"


def main():
    config = PipelineConfig.load(
        ROOT / "config/quick.yaml", Path(__file__).with_name("tiny.yaml")
    ).config
    write_json("results/config.json", config)
    for line in verbs(config["design"]["samples"]):
        status = cli.main([*arguments_of(line), "--config", "results/config.json"])
        if status:
            print(line, file=sys.stderr)
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main())
