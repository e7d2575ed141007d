"""Few tests that narrow the parameters: the default berry's design, run in small versions of the further bench tests.

    python -m research.answers.joint_bench_tests --samples 60 --out results/joint

The rule `joint_targets` runs all samples in the vessels of `config/config.yaml`, for many hours. Here drum and funnel
hold 300 berries in place of 900 and 500, and the drum is 115 mm long in place of 340 mm. The piles are those of the
default study, measured already. The stages and the seeds are those of the workflow, called in one process; a run
that was stopped goes on after its last finished job. The bench tests are run in turn, sample by sample, so that a
stopped run has all of them for the same samples. `responses/` ranks them by bits a minute of work.
"""

import argparse
from pathlib import Path

import pandas as pd

from repose.config import loader
from repose.config.pipeline import PipelineConfig
from research.answers.real_campaigns import HEIGHT_ALONE, verb
from research.responses.__main__ import script
from research.streams import STREAMS

DRUM = {"berries": 300, "length_mm": 115.0}
SMALL = {"discharge": {"berries": 300}, "turning": DRUM, "drum": DRUM}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("results/joint"))
    parser.add_argument("--samples", type=int, default=110)
    parser.add_argument("--seeds", type=int, default=2)
    args = parser.parse_args()

    config = PipelineConfig.load("config/config.yaml").config
    for name, keys in SMALL.items():
        config[name] = config[name] | keys
    of_study = args.out / "config.json"
    loader.write_resolved(config, of_study)
    design = HEIGHT_ALONE / "design/samples.csv"
    samples = pd.read_csv(design)["sample"].tolist()
    # all over the design, as the workflow takes them
    last = args.samples - 1
    chosen = [samples[k * (len(samples) - 1) // last] for k in range(args.samples)]
    berry = {
        name: HEIGHT_ALONE / f"berry/{name}.json" for name in ("berry", "particle")
    }
    seeds = {"purpose": STREAMS["joint_targets"], "seeds": args.seeds}
    for sample in chosen:
        for name in SMALL:
            job = args.out / f"{name}_runs/{sample:03d}.json"
            if not job.exists():
                inputs = {
                    "samples": design,
                    "sample": sample,
                    **seeds,
                    **berry,
                    "config": of_study,
                }
                verb("pour", apparatus=name, **inputs, out=job.parent)
                verb(
                    "measure_runs",
                    job.with_suffix(".pours.json"),
                    config=of_study,
                    **berry,
                    out=job.parent,
                )
    tables = {
        "runs": HEIGHT_ALONE / "responses/runs.csv",
        "dataset": HEIGHT_ALONE / "dataset.csv",
    }
    arguments = [
        text for key, value in tables.items() for text in (f"--{key}", str(value))
    ]
    arguments += [
        "--jobs",
        *(str(args.out / f"{name}_runs") for name in SMALL),
        "--config",
        str(of_study),
    ]
    script.run(["joint", *arguments, "--out", str(args.out)])
    script.run(["second", *arguments, "--out", str(args.out / "responses")])


if __name__ == "__main__":
    main()
