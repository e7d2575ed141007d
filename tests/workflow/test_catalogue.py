"""What the Snakemake catalogue asks of a workflow: files by their names, a test study, deployment as a module."""

import json
import pathlib
import shutil
import subprocess

import pytest
import yaml
from plans import ROOT, planned, snakemake
from shared import says

from repose.config.pipeline import PipelineConfig

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
    assert (
        yaml.safe_load((ROOT / ".snakemake-workflow-catalog.yml").read_text())["usage"][
            "report"
        ]
        is True
    )
    for name in (
        "workflow/Snakefile",
        "config/README.md",
        "config/config.yaml",
        "LICENSE",
        "README.md",
    ):
        assert (ROOT / name).is_file()


@pytest.mark.slow
def test_the_test_study_is_whole(tmp_path):
    shutil.copytree(ROOT / ".test" / "config", tmp_path / "config")
    done = snakemake(
        tmp_path, "-n", "--cores", "1", "-s", str(ROOT / "Snakefile"), status=0
    )
    assert "Pouring sample 014" in done.stdout + done.stderr
    assert "Pouring sample 015" not in done.stdout + done.stderr


@pytest.mark.slow
def test_a_deployed_module_runs_and_says_what_it_runs_with(tmp_path):
    shutil.copytree(ROOT / "config", tmp_path / "config")
    (tmp_path / "workflow").mkdir()
    (tmp_path / "workflow" / "Snakefile").write_text(DEPLOYED)
    snakemake(
        tmp_path,
        "--cores",
        "1",
        "results/berry/berry.json",
        "--config",
        "label=deployed",
        status=0,
    )
    assert (
        json.loads((tmp_path / "results/config.json").read_text())["label"]
        == "deployed"
    )
    assert (tmp_path / "results/berry/berry.json").is_file()


# As a part of another workflow, which has a section for it and handlers of its own.
OUTER = DEPLOYED.replace("module repose", "module wheat").replace(
    "        config\n", '        config["wheat"]\n'
)
OUTER = OUTER.replace("from repose", "from wheat as wheat_*")
OUTER += OUTER.partition("module")[1] + OUTER.partition("module")[2].replace(
    "wheat", "soybean"
)
OUTER += """
onstart:
    print("the outer workflow starts")

onsuccess:
    print("the outer workflow ends")
"""


@pytest.mark.slow
@pytest.mark.essential
def test_a_module_computes_the_study_of_its_config_and_leaves_the_handlers_to_the_outer_workflow(
    tmp_path, monkeypatch
):
    crops = {
        name: yaml.safe_load((ROOT / f"crops/{name}/config.yaml").read_text())
        for name in ("wheat", "soybean")
    }
    for name, crop in crops.items():
        crop["berry"]["sizes"] = str(ROOT / f"crops/{name}/sizes.csv")
        crop |= {"validation": {"published": None}, "results_dir": name}
    crop = crops["wheat"]
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text(
        yaml.safe_dump(crops | {"other": {"threads": 2}})
    )
    (tmp_path / "workflow").mkdir()
    (tmp_path / "workflow/Snakefile").write_text(OUTER)
    done = snakemake(tmp_path, "-n", "wheat_all", "soybean_all", status=0)
    assert "soybean_miga" in done.stdout + done.stderr
    assert not (tmp_path / "wheat").exists()
    assert "wheat_drum_run" not in done.stdout + done.stderr, "the goji berry's"
    done = snakemake(
        tmp_path,
        "--cores",
        "1",
        "wheat/berry/berry.json",
        "soybean/berry/berry.json",
        status=0,
    )
    assert (
        json.loads((tmp_path / "soybean/config.json").read_text())["label"] == "soybean"
    )
    says(done.stdout, "the outer workflow starts", "the outer workflow ends")
    resolved = json.loads((tmp_path / "wheat/config.json").read_text())
    (tmp_path / "alone").mkdir()
    monkeypatch.chdir(tmp_path / "alone")
    pathlib.Path("config.yaml").write_text(yaml.safe_dump(crop))
    assert resolved == PipelineConfig.load("config.yaml").config
    assert (
        "Nothing to be done"
        in snakemake(tmp_path, "--cores", "1", "wheat/berry/berry.json").stderr
    )
    # a fault names the configuration, as no file of the command line has it
    crop["funnel"] = {"seads": 3}
    (tmp_path / "config/config.yaml").write_text(yaml.safe_dump(crops))
    wrong = snakemake(tmp_path, "-n", "wheat_all", status=2)
    assert (
        "repose: error: configuration: funnel.seads is 3; expected a known key; did you mean seeds?"
        in wrong.stderr
    )


@pytest.mark.slow
@pytest.mark.skipif(
    not shutil.which("snakedeploy"), reason="needs snakedeploy: pip install snakedeploy"
)
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="needs the repository")
def test_the_real_snakedeploy_brings_a_workflow_that_plans_the_whole_study(
    tmp_path, monkeypatch
):
    """From an empty folder, as the catalogue says it. Git takes a clone of this repository for the one on the net."""
    hosted = tmp_path / "hosted" / "owner" / "repose"
    subprocess.run(["git", "clone", "-q", "--bare", str(ROOT), str(hosted)], check=True)
    head = subprocess.run(
        ["git", "rev-parse", "HEAD"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    subprocess.run(["git", "tag", "tested", head.strip()], cwd=hosted, check=True)
    monkeypatch.setenv("GIT_CONFIG_COUNT", "1")
    monkeypatch.setenv("GIT_CONFIG_KEY_0", f"url.file://{tmp_path}/hosted/.insteadOf")
    monkeypatch.setenv("GIT_CONFIG_VALUE_0", "https://github.com/")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    arguments = [
        "snakedeploy",
        "deploy-workflow",
        "https://github.com/owner/repose",
        "study",
        "--tag",
        "tested",
    ]
    subprocess.run(arguments, cwd=tmp_path, check=True)
    study = tmp_path / "study"
    expected = (ROOT / "config/config.yaml").read_bytes()
    assert (study / "config/config.yaml").read_bytes() == expected
    deployed = (study / "workflow/Snakefile").read_text()
    assert 'github("owner/repose", path="workflow/Snakefile", tag="tested")' in deployed
    assert planned(study, "--cores", "1")["pour"] == 150
