"""Results of one study are never taken for those of another, however a run is started."""

import json
import shutil

import pytest
from plans import planned, snakemake

from repose.common import attached

pytestmark = pytest.mark.slow

TARGET = "results/quick/design/samples.csv"
QUICK = ("--cores", "1", "--configfile", "config/quick.yaml")
OTHER = ("--config", "design={seed: 5}")
# Options by which Snakemake keeps results whose settings have changed.
KEEPING = {
    "touch": ("--touch",),
    "triggers": ("--rerun-triggers", "mtime"),
    "dry run": ("--rerun-triggers", "mtime", "-n"),
    "touch of all": ("--touch", "--forceall"),
}


@pytest.fixture(scope="module")
def made(project):
    """A folder with the design of the small study."""
    snakemake(project, TARGET, *QUICK, status=0)
    return project


@pytest.mark.essential
@pytest.mark.parametrize("name", KEEPING)
def test_results_that_a_run_would_keep_are_those_of_its_study(made, name):
    config = made / "results/quick/config.json"
    before = config.read_text()
    arguments = (TARGET, *QUICK, *KEEPING[name])
    done = snakemake(made, *arguments, *OTHER, status=2)
    seed = json.loads(before)["design"]["seed"]
    faults = [line for line in done.stderr.splitlines() if "repose: error" in line]
    assert len(faults) == 1
    path = "results/quick/design/comparison.csv"
    assert faults[0].startswith(
        f"repose: error: {path}: design.seed is {seed}; expected 5, as in this study: "
    )
    assert "--forceall" in faults[0]
    assert config.read_text() == before


@pytest.mark.essential
def test_a_changed_setting_plans_the_stages_that_depend_on_it(made):
    arguments = (TARGET, *QUICK)
    assert planned(made, *arguments, *OTHER)["design"] == 1
    assert planned(made, *arguments, "--config", "funnel={seeds: 3}") == {}


def test_results_of_a_run_without_records_of_snakemake_are_those_of_its_study(made):
    arguments = (TARGET, *QUICK)
    shutil.rmtree(made / ".snakemake")
    assert planned(made, *arguments) == {}
    snakemake(made, *arguments, *OTHER, status=2)
    before = (made / TARGET).read_text()
    snakemake(made, *arguments, *OTHER, "--forceall", status=0)
    assert planned(made, *arguments, *OTHER) == {}
    assert attached.read_record(made / TARGET)["settings"]["design"]["seed"] == 5
    assert (made / TARGET).read_text() != before
