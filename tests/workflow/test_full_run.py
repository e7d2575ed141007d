"""A tiny study made whole, and what a user of Snakemake does with a finished one."""

import shutil
import subprocess
import tarfile

import pytest
from plans import ROOT, snakemake

WORDS = (
    "--cores",
    "2",
    "--quiet",
    "rules",
    "--configfile",
    "config/quick.yaml",
    "tiny.yaml",
)
NOTHING = "Nothing to be done"


@pytest.mark.slow
def test_a_finished_study_is_reported_archived_planned_anew_and_forced(project):
    shutil.copy(ROOT / "tests/faults/tiny.yaml", project)
    snakemake(project, *WORDS, "--notemp", status=0)
    before = {
        path: path.read_bytes()
        for path in (project / "results").rglob("*.csv")
        if "timings" not in path.name
    }
    before = {
        path: content
        for path, content in before.items()
        if "benchmarks" not in path.parts
    }
    assert {"dataset.csv", "table4.csv", "feasible.csv"} <= {
        path.name for path in before
    }
    for arguments in (
        ("--rerun-triggers", "mtime"),
        ("--profile", "profiles/default"),
        ("--cores", "64"),
    ):
        done = snakemake(project, *WORDS, *arguments, status=0)
        assert NOTHING in done.stdout + done.stderr, arguments
    done = snakemake(project, *WORDS, "--report", "report.html", status=0)
    assert "figure13" in (project / "report.html").read_text()
    assert "Traceback" not in done.stderr
    # an archive has what git knows
    for arguments in (
        ("init", "-q"),
        ("add", "-A"),
        ("-c", "user.name=a", "-c", "user.email=a@b.c", "commit", "-q", "-m", "a"),
    ):
        subprocess.run(["git", *arguments], cwd=project, check=True)
    snakemake(project, *WORDS, "--archive", "study.tar.gz", status=0)
    with tarfile.open(project / "study.tar.gz") as archive:
        expected = {
            "Snakefile",
            "workflow/Snakefile",
            "config/quick.yaml",
            "resources/berries.csv",
        }
        assert expected <= set(archive.getnames())
    for stage in ("pour", "dataset", "network", "miga", "validate", "drum"):
        done = snakemake(project, *WORDS, "--forcerun", stage, status=0)
        assert NOTHING not in done.stdout + done.stderr
    assert {path: path.read_bytes() for path in before} == before
