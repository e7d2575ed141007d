import shutil

import pytest
from plans import ROOT, snakemake

from repose.core.ledger import LEDGER

PARTS = ("Snakefile", "config", "profiles", "resources", "workflow")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("project")
    for part in PARTS:
        source = ROOT / part
        shutil.copytree(source, folder / part) if source.is_dir() else shutil.copy(source, folder / part)
    return folder


@pytest.fixture(scope="module")
def finished(project):
    """The small study with twelve samples as if it were finished: every file is there, empty."""
    words = ("--configfile", "config/quick.yaml", "--config", "design={samples: 12}")
    listed = snakemake(project, "-n", "--summary", *words, "--", "everything", "films")
    for line in listed.stdout.splitlines()[1:]:
        path = project / line.split("\t")[0]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (project / "results/quick" / LEDGER).touch()  # the folder of a study
    done = snakemake(project, "--touch", "--forceall", "--cores", "1", *words, "--", "everything", "films")
    assert done.returncode == 0, done.stderr
    return project, words
