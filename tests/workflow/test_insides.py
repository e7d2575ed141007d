"""What workflow/rules/snakemake.smk takes of Snakemake's insides: the installed version still has it."""

import re
import sys

import pandas as pd
import pytest
from plans import ROOT, snakemake

FILE = ROOT / "workflow/rules/snakemake.smk"
# Names that Snakemake documents: https://snakemake.readthedocs.io, Writing Workflows.
DOCUMENTED = {"basedir"}
STUDY = """
import os
RESULTS = "results"
stage_hash = "hash of {{}}".format

include: {file!r}

rule all:
    default_target: True
    input: "results/{name}.txt", expand("results/{{i}}.txt", i=range(8))

rule one:
    output: "results/{{i}}.txt"
    log: "results/logs/one/{{i}}.log"
    shell: "sleep 0.{nap}; test {{wildcards.i}} != {fail}; true python -m repose stage miga ; touch {{output}}"

complete_rules()
NAME = {name!r}

onstart:
    if {at_once}:
        start_jobs_at_once()

onsuccess:
    print("planned", *sorted(planned_rules()))
    print("recorded", recorded(f"results/{{NAME}}.txt"), recorded("results/other.txt"))
    print("named", is_output("results/5.txt"), is_output("5.txt"), has_name_of_ours("logs"), has_name_of_ours("src"))
    for rule_ in workflow.rules:
        print(rule_.name, rule_.benchmark, rule_.params.get("code"))

onerror:
    print("failed", *FAILED_LOGS)
"""


def run(folder, *words, name="9", at_once=True, fail="none", nap=0):
    """A run of a workflow of nine naps that takes the file."""
    folder.mkdir(exist_ok=True)
    text = STUDY.format(file=str(FILE), name=name, at_once=at_once, fail=fail, nap=nap)
    (folder / "Snakefile").write_text(text)
    return snakemake(folder, "--cores", "1", *words)


def test_no_other_file_of_the_workflow_uses_an_inside():
    used = {}
    for path in [*(ROOT / "workflow").rglob("*.smk"), ROOT / "Snakefile", ROOT / "workflow/Snakefile"]:
        names = set(re.findall(r"(?<![\w/])workflow\.(\w+)", path.read_text())) - {"rst", *DOCUMENTED}
        if path != FILE and names:
            used[path.name] = names
    assert used == {}


@pytest.mark.slow
def test_rules_records_and_failures_are_as_the_file_takes_them(tmp_path):
    done = run(tmp_path / "good")
    assert done.returncode == 0, done.stderr
    assert "planned all one\n" in done.stdout
    assert "recorded True False\n" in done.stdout
    assert "named True False True False\n" in done.stdout
    assert "one results/benchmarks/one/{i}.tsv ['hash of miga']\n" in done.stdout
    assert (tmp_path / "good/results/benchmarks/one/3.tsv").is_file()
    failed = run(tmp_path / "bad", fail="9")
    assert failed.returncode == 1
    assert "failed results/logs/one/9.log\n" in failed.stdout


@pytest.mark.slow
def test_the_scheduler_looks_at_the_jobs_when_one_ends(tmp_path):
    """And not once a second more for each job that has ended."""
    looks = []
    for at_once in (False, True):
        done = run(tmp_path / str(at_once), "--verbose", at_once=at_once, nap=6)
        assert done.returncode == 0, done.stderr
        looks.append(done.stderr.count("Resources before job selection"))
    assert looks[1] <= 10 < looks[0]


@pytest.mark.slow
def test_a_benchmark_has_the_processor_time_of_the_whole_job(tmp_path):
    """Snakemake looks at a job each half second, and after 15 s each half minute."""
    (tmp_path / "busy.py").write_text("import time\nwhile time.process_time() < 0.4: pass\n")
    (tmp_path / "Snakefile").write_text(
        f"import os\nRESULTS = 'results'\nstage_hash = str\n\ninclude: {str(FILE)!r}\n\n"
        "rule one:\n    output: 'one.txt'\n    log: 'results/logs/one.log'\n"
        f"    shell: '{sys.executable} busy.py; touch {{output}}'\n\ncomplete_rules()\n"
    )
    done = snakemake(tmp_path, "--cores", "1")
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(tmp_path / "results/benchmarks/one.tsv", sep="\t")
    assert 0.39 <= table["cpu_time"].item() <= done.used_s


@pytest.mark.slow
def test_the_handlers_of_a_module_are_called(tmp_path):
    (tmp_path / "inner.smk").write_text(
        f"import os\nRESULTS = 'results'\nstage_hash = str\n\ninclude: {str(FILE)!r}\n\n"
        "onstart:\n    print('it starts')\n\nonsuccess:\n    print('it ends')\n\n"
        "onerror:\n    print('it fails')\n\nregister_handlers(onstart, onsuccess, onerror)\n\n"
        "rule one:\n    output: 'one.txt'\n    shell: 'touch {output}'\n"
    )
    (tmp_path / "Snakefile").write_text(
        "module inner:\n    snakefile: 'inner.smk'\n\nuse rule * from inner\n"
    )
    done = snakemake(tmp_path, "--cores", "1", "one")
    assert done.returncode == 0, done.stderr
    assert "it starts" in done.stdout
    assert "it ends" in done.stdout
