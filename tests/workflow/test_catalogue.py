"""What the Snakemake catalogue asks of a workflow: files by their names, a test study, deployment as a module."""

import json
import shutil

import pytest
import yaml
from plans import ROOT, snakemake

# As `snakedeploy deploy-workflow` writes it, with the workflow of this checkout.
DEPLOYED = f"""
from snakemake.utils import min_version

min_version("6.10.0")

configfile: "config/config.yaml"

module repose:
    snakefile:
        "{ROOT / "workflow" / "Snakefile"}"
    config:
        config

use rule * from repose
"""


def test_files_that_the_catalogue_reads():
    assert yaml.safe_load((ROOT / ".snakemake-workflow-catalog.yml").read_text())["usage"]["report"] is True
    for name in ("workflow/Snakefile", "config/README.md", "config/config.yaml", "LICENSE", "README.md"):
        assert (ROOT / name).is_file()


@pytest.mark.slow
def test_the_test_study_is_whole(tmp_path):
    shutil.copytree(ROOT / ".test" / "config", tmp_path / "config")
    done = snakemake(tmp_path, "-n", "--cores", "1", "-s", str(ROOT / "Snakefile"))
    assert done.returncode == 0, done.stderr
    assert "Pouring sample 014" in done.stdout + done.stderr
    assert "Pouring sample 015" not in done.stdout + done.stderr


@pytest.mark.slow
def test_a_deployed_module_runs_and_says_what_it_runs_with(tmp_path):
    shutil.copytree(ROOT / "config", tmp_path / "config")
    (tmp_path / "workflow").mkdir()
    (tmp_path / "workflow" / "Snakefile").write_text(DEPLOYED)
    done = snakemake(tmp_path, "--cores", "1", "results/berry/berry.json", "--config", "label=deployed")
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "results/config.json").read_text())["label"] == "deployed"
    assert (tmp_path / "results/berry/berry.json").is_file()
