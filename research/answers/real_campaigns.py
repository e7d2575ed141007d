"""Campaigns with real pours: how often a strategy ends within 1 % of its target, judged by seeds that it has not seen.

    python -m research.answers.real_campaigns sequential --out results/real

The stages and the seeds are those of the workflow. They are called in one process, which saves the start of a Python
for each job. A campaign that was stopped goes on after its last finished job.

Rule, written before the runs:

sequential
    Five campaigns of the default berry as `config/config.yaml` has it. Their targets are the quantiles of 10, 30, 50,
    70 and 90 % of the Height over the pool; `design.seed` is 4000, 4001, ... The answer of each is poured with 96
    fresh seeds. It is right if their mean is within 1 % of the target.

Every campaign that was begun is in the table, with any result. The table's record of provenance names what the
campaigns' own files stand on; `--campaigns` without a number makes the table anew from finished campaigns.
"""

import argparse
import json
import time
from pathlib import Path

import pandas as pd

from repose.cli import main as repose
from repose.common import provenance
from repose.common.files import read_table, write_table
from repose.config import loader
from repose.config.pipeline import PipelineConfig

HEIGHT_ALONE = Path("results/published/height_alone")
QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
CHECKS = 96
CAMPAIGNS = 5


def verb(name, *arguments, **options):
    """Run a stage of the workflow; its options by name."""
    named = [
        text
        for key, value in options.items()
        for text in (f"--{key.replace('_', '-')}", str(value))
    ]
    if repose(["stage", name, *map(str, arguments), *named]):
        raise SystemExit(f"{name} failed")


class Campaign:
    """One campaign: a folder and a configuration."""

    def __init__(self, folder, changes):
        self.folder = folder
        self.config = folder / "config.json"
        config = PipelineConfig.load("config/config.yaml").config
        for section, keys in changes.items():
            config[section] = config[section] | keys if isinstance(keys, dict) else keys
        loader.write_resolved(config, self.config)
        self.berry = {
            name: HEIGHT_ALONE / f"berry/{name}.json" for name in ("berry", "particle")
        }

    def verb(self, name, *arguments, **options):
        """Run a verb with this configuration."""
        verb(name, *arguments, config=self.config, **options)

    def batches(self, strategy, folders=()):
        """Run a strategy to its answer and its check; the last proposal. `folders` hold batches that are poured."""
        folders = list(folders)
        proposal = {"answer": False}
        while not proposal["answer"]:
            batch = self.folder / f"batch_{len(folders)}"
            if not (batch / "proposal.json").exists():
                self.verb("propose", strategy, *folders, out=batch)
            proposal = json.loads((batch / "proposal.json").read_text())
            if not proposal.get("simulated"):
                self.pour(batch, strategy)
            folders.append(batch)
        self.verb("conclude", strategy, *folders, out=self.folder / "answer")
        return proposal

    def pour(self, folder, purpose):
        """Pour and measure the samples of a batch with their seeds; write their dataset."""
        jobs = []
        samples = folder / "samples.csv"
        for sample, seeds in pd.read_csv(samples)[["sample", "seeds"]].itertuples(
            index=False
        ):
            job = folder / f"heaps/{sample:03d}.json"
            jobs.append(job)
            if not job.exists():
                of_job = {
                    "samples": samples,
                    "sample": sample,
                    "purpose": purpose,
                    "seeds": seeds,
                }
                self.verb("pour", **of_job, **self.berry, out=job.parent)
                self.verb(
                    "measure_runs",
                    job.with_suffix(".pours.json"),
                    **self.berry,
                    out=job.parent,
                )
        self.verb("dataset", *jobs, samples=samples, out=folder)


def target(value):
    """The Height as the only target."""
    return [
        {
            "response": "height_mm",
            "apparatus": "funnel",
            "value": value,
            "sd": 4.1,
            "repetitions": 10,
            "range": [round(0.98 * value, 2), round(1.02 * value, 2)],
            "weight": 1.0,
        }
    ]


def sequential(folder, number):
    """A campaign of the sequential strategy; a row of the table."""
    heights = pd.read_csv(HEIGHT_ALONE / "pool/dataset.csv")["height_mm"]
    value = round(float(heights.quantile(QUANTILES[number])), 2)
    changes = {
        "targets": target(value),
        "design": {"seed": 4000 + number},
        "sequential": {"checks": CHECKS},
    }
    campaign = Campaign(folder, changes)
    advice = campaign.batches("sequential")
    found = pd.read_csv(folder / "answer/check.csv").iloc[0]
    at_rest = int(pd.read_csv(folder / "answer/representative.csv")["n_seeds"].iloc[0])
    advice |= advice["notes"]
    return {
        "campaign": number,
        "target_mm": value,
        "seed": 4000 + number,
        "pours": advice["pours"],
        "stop": advice["stop"],
        "probability": advice["probability"],
        "predicted_mm": found["predicted"],
        "predicted_se_mm": found["predicted_error"],
        "simulated_mm": found["simulated"],
        "simulated_se_mm": found["simulated_error"],
        "deviation_percent": found["deviation_percent"],
        "at_rest": at_rest,
        **advice["answer"],
    }


def collect(folder, kind):
    """Write one table of all campaigns, with the record of what their answers stand on."""
    tables = sorted(folder.glob(f"{kind}_?/campaign.csv"))
    answers = [path.parent / "answer/check.csv" for path in tables]
    with provenance.record_stage(
        f"{kind}_campaigns", answers, lambda config, _: config
    ):
        write_table(
            folder / f"{kind}.csv", pd.concat([read_table(path) for path in tables])
        )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kind", choices=("sequential",))
    parser.add_argument("--out", type=Path, default=Path("results/real"))
    parser.add_argument("--campaigns", type=int, nargs="*", default=range(CAMPAIGNS))
    args = parser.parse_args()
    for number in args.campaigns:
        folder = args.out / f"{args.kind}_{number}"
        folder.mkdir(parents=True, exist_ok=True)
        began = time.process_time()
        table = pd.DataFrame([sequential(folder, number)])
        write_table(folder / "campaign.csv", table, float_format="%.5g")
        print(
            table.to_string(),
            f"{time.process_time() - began:.0f} s of CPU",
            sep="\n",
            flush=True,
        )
    collect(args.out, args.kind)


if __name__ == "__main__":
    main()
