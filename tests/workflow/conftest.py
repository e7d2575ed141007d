import shutil

import pytest
from forked import copied
from plans import snakemake

from repose.common.ledger import LEDGER


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return copied(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="module")
def finished(project):
    """The small study with twelve samples as if it were finished: every file is there, empty."""
    arguments = (
        "--configfile",
        "config/quick.yaml",
        "--config",
        "design={samples: 12}",
    )
    shutil.rmtree(project / "results", ignore_errors=True)  # of other settings
    for line in snakemake(
        project, "-n", "--summary", *arguments, "--", "everything", "films"
    ).stdout.splitlines()[1:]:
        path = project / line.split("\t")[0]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (project / "results/quick" / LEDGER).touch()  # the folder of a study
    snakemake(
        project,
        "--touch",
        "--forceall",
        "--cores",
        "1",
        *arguments,
        "--",
        "everything",
        "films",
        status=0,
    )
    return project, arguments
