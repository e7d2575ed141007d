"""Snakemake called by the tests of the workflow: what it would do, and what it did."""

import importlib
import json
import os
import re
import time
from tempfile import TemporaryFile
from types import SimpleNamespace
from typing import NamedTuple

import forked
from shared import ROOT, target

from repose.common import ledger

# Targets from two bench tests.
MIXED = [target(name, 40, 2, 38, 42, 5) for name in ("height_mm", "drum_slip_deg")]
PROBE = """
include: {snakefile!r}
import json
for rule in workflow.rules:
    if rule.benchmark:
        made = [rule.resources[name] for name in ("mem_mb", "runtime")]
        memory_mb, minutes = ([one.evaluate(None, attempt=attempt).value for attempt in (1, 2)] for one in made)
        benchmarks = rule.benchmark.regex().pattern
        print(json.dumps(dict(rule=rule.name, benchmarks=benchmarks, memory_mb=memory_mb, minutes=minutes)))
"""


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str
    took_s: float
    # processor time of snakemake and all its children, which it waits for
    used_s: float


def as_ours(folder):
    """Note made-up results in the folder as written by repose, as they are where a study wrote them."""
    for path in folder.rglob("*"):
        if path.is_file() and path.name != ledger.LEDGER:
            content = path.read_bytes()
            times = path.stat()
            path.unlink()
            ledger.write_listed_file(
                path, lambda handle, content=content: handle.write(content)
            )
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def snakemake(project, *arguments, status=None):
    """Run snakemake in a fork, so that its imports are loaded once for all calls; `status` is what it must end with."""
    for module in ("snakemake.cli", "repose.calibrate.strategies.refined.strategy"):
        importlib.import_module(module)
    began_s = time.perf_counter()
    with TemporaryFile() as out, TemporaryFile() as err:
        _, ended, used = os.wait4(
            forked.start(project, arguments, out.fileno(), err.fileno()), 0
        )
        took_s = time.perf_counter() - began_s
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read().decode())
    done = Done(
        os.waitstatus_to_exitcode(ended), *texts, took_s, used.ru_utime + used.ru_stime
    )
    assert status in (None, done.returncode), done.stderr
    return done


def planned(project, *arguments):
    done = snakemake(project, "--quiet", "rules", "-n", *arguments, status=0)
    counts = re.findall(r"^(\w+)\s+(\d+)$", done.stdout + done.stderr, re.MULTILINE)
    return {rule: int(count) for rule, count in counts}


def declared(tmp_path):
    """What rules declare: the paths of their benchmarks, and memory [MB] and time [min] of the first two attempts."""
    probe = tmp_path / "probe.smk"
    probe.write_text(PROBE.format(snakefile=str(ROOT / "workflow/Snakefile")))
    done = snakemake(
        ROOT,
        "--list-rules",
        "-s",
        str(probe),
        "--configfile",
        "config/quick.yaml",
        status=0,
    )
    return [
        SimpleNamespace(**json.loads(line))
        for line in done.stdout.splitlines()
        if line.startswith("{")
    ]
