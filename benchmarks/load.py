"""A study of 10,000 samples: its dry run and the table of all its jobs, in CPU time and memory.

    python benchmarks/load.py

The jobs are made up. The limits are 60 s and 2 GB for the dry run, 30 s for the table.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS
from repose.calibrate.targets import Targets
from repose.config.pipeline import PipelineConfig
from repose.stages import dataset

ROOT = Path(__file__).parents[1]
SAMPLES = 10_000
LIMITS = {"dry run": (60.0, 2000.0), "table of all jobs": (30.0, 2000.0)}  # s, MB


def made_up(folder: Path) -> None:
    """A table of samples, a file of two runs for each of them, and a configuration."""
    config = PipelineConfig.load(ROOT / "config/quick.yaml").config
    rng = np.random.default_rng(1)
    samples = pd.DataFrame(
        rng.uniform(0.1, 0.4, (SAMPLES, len(PARAMETERS))), columns=list(PARAMETERS)
    )
    samples.insert(0, "sample", range(1, SAMPLES + 1))
    samples.to_csv(folder / "samples.csv", index=False)
    (folder / "config.json").write_text(json.dumps(config))
    (folder / "heaps").mkdir()
    record = {
        name: 30.0
        for name in dataset.list_recorded_columns(
            "funnel", Targets.of(config["targets"])
        ).single
    }
    for row in samples.to_dict("records"):
        number = row.pop("sample")
        runs = [
            record | {"seed": seed, "status": "ok", "reason": ""} for seed in (1, 2)
        ]
        job = {
            "sample": number,
            "parameters": row,
            "time_step_s": 2e-4,
            "summary": {},
            "runs": runs,
        }
        (folder / "heaps" / f"{number:03d}.json").write_text(json.dumps(job, indent=1))


def measured(name: str, arguments: list[str], folder: Path) -> bool:
    """Run a command, print what it took, and tell whether that is within its limits."""
    began = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-m", *arguments],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as command:
        _, status, used = os.wait4(command.pid, 0)
        command.returncode = os.waitstatus_to_exitcode(status)
    cpu_s = used.ru_utime + used.ru_stime
    memory_mb = used.ru_maxrss / 1000
    most_s, most_mb = LIMITS[name]
    wall_s = time.perf_counter() - began
    print(
        f"{name}: {cpu_s:.1f} s of CPU (limit {most_s:.0f}), {wall_s:.1f} s by the clock, {memory_mb:.0f} MB"
    )
    return command.returncode == 0 and cpu_s < most_s and memory_mb < most_mb


def main() -> int:
    """Measure both."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made_up(folder)
        table = [
            "repose",
            "stage",
            "dataset",
            "heaps",
            "--samples",
            "samples.csv",
            "--config",
            "config.json",
        ]
        dry = [
            "snakemake",
            "-n",
            "--cores",
            "1",
            "--quiet",
            "all",
            "--snakefile",
            str(ROOT / "Snakefile"),
            "--configfile",
            str(ROOT / "config/quick.yaml"),
            "--config",
            f"design={{samples: {SAMPLES}}}",
            "results_dir=results",
        ]
        good = measured("table of all jobs", [*table, "--out", "tables"], folder)
        return 0 if measured("dry run", dry, folder) and good else 1


if __name__ == "__main__":
    sys.exit(main())
