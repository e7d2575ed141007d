"""The workflow uses snakemake's language alone; what its insides once gave is asked of the calls themselves."""

import re

import pandas as pd
import pytest
from plans import ROOT, snakemake

from repose.config.call import Call, configfiles
from repose.core import usage

FILES = [
    *(path for folder in ("workflow", "research") for path in (ROOT / folder).rglob("*.smk")),
    *(ROOT / name for name in ("Snakefile", "workflow/Snakefile", "research/Snakefile")),
]
# Names that Snakemake documents: https://snakemake.readthedocs.io, Writing Workflows.
DOCUMENTED = {"basedir"}
# Of all rules, so that no user's file is taken for a result and removed; a list by hand would need each name again.
KEPT = {"rules"}
QUICK = ("--cores", "1", "--configfile", "config/quick.yaml")
NAPS = """
rule all:
    input: expand("{i}.txt", i=range(9))

rule one:
    output: "{i}.txt"
    shell: "sleep 0.6; touch {output}"
"""


def test_no_file_of_the_workflow_uses_an_inside():
    used, imported = set(), set()
    for path in FILES:
        text = path.read_text()
        used |= set(re.findall(r"(?<![\w/])workflow\.(\w+)", text)) - {"rst", "smk"}
        imported |= set(re.findall(r"(?:from|import) (snakemake[\w.]*)", text))
    assert used - DOCUMENTED == KEPT
    assert imported == {"snakemake.utils"}


def test_the_workflow_has_fewer_functions_than_rules_and_no_program():
    own = [path for path in FILES if "research" not in path.parts]
    functions, rules = (
        sum(len(re.findall(pattern, path.read_text(), re.MULTILINE)) for path in own)
        for pattern in (r"^ *def ", r"^ *(?:rule|checkpoint|use rule)\b.*:$")
    )
    assert functions <= 25 < rules


RUN = ("--cores 2", "-c2 -F --configfile mine.yaml", "-sSnakefile -c1", "--touch -c1")
LOOK = ("-n", "-np", "--dry-run -c1", "--summary", "--rulegraph", "--mode remote -c1")


def test_a_call_that_only_looks_takes_no_folder_and_configurations_are_no_targets(monkeypatch):
    for words in (*RUN, *LOOK):
        monkeypatch.setattr("sys.argv", ["snakemake", *words.split()])
        assert Call().runs == (words in RUN), words
    words = ["results/card.json", "--configfile", "mine.yaml", "more.json", "page", "--cores", "2"]
    assert configfiles(words) == ["mine.yaml", "more.json"]
    assert configfiles(["--configfile=mine.yaml", "-n"]) == ["mine.yaml"]


@pytest.mark.slow
def test_the_profile_lets_the_scheduler_look_seldom(tmp_path):
    """Not once a second more for each job that has ended."""
    (line,) = (ROOT / "profiles/default/config.yaml").read_text().split("max-jobs-per-timespan: ")[1:]
    (tmp_path / "Snakefile").write_text(NAPS)
    looks = []
    for words in ((), ("--max-jobs-per-timespan", line.split()[0])):
        done = snakemake(tmp_path, "--cores", "1", "--verbose", "--forceall", *words)
        assert done.returncode == 0, done.stderr
        looks.append(done.stderr.count("Resources before job selection"))
    assert 9 <= looks[1] < 0.7 * looks[0]


@pytest.mark.slow
def test_a_benchmark_has_the_processor_time_of_the_whole_job(project):
    done = snakemake(project, "results/quick/design/samples.csv", *QUICK, "--forceall")
    assert done.returncode == 0, done.stderr
    (process,) = usage.since(project / "results/quick", 0)
    table = pd.read_csv(project / "results/quick/benchmarks/design.tsv", sep="\t")
    assert process.log == "results/quick/logs/design.log"
    assert 0.3 < table["cpu_time"].item() == pytest.approx(process.cpu_s, abs=0.01)
    assert table["cpu_time"].item() <= done.used_s
