"""`repose new`: the folder of a crop, and what is left to do in it."""

import re
from pathlib import Path

import pytest
import yaml
from refusals import input_error
from shared import ROOT, run_python

from repose.common import places
from repose.common.reading import read_yaml
from repose.config.pipeline import PipelineConfig

SIZES = "6.4,3.1,2.8\n6.0,3.0,2.7\n6.8,3.3,2.9\n"
# A null of the template and what a user with wheat would write.
FILLED = {
    "density_kg_m3: null": "1350",
    "poisson_ratio: null # most": "0.3 # most",
    "berries: null": "400",
    "shear_modulus_pa: null # E": "1.0e+7 # E",
    "{poisson_ratio: null": "0.3",
    "shear_modulus_pa: null}": "1.0e+9}",
    "inlet_diameter_mm: null": "80.0",
    "outlet_diameter_mm: null": "25.0",
    "cone_angle_deg: null": "60.0",
    "outlet_height_mm: null": "30.0",
    "plate_diameter_mm: null": "300.0",
    "rate_per_s: null": "200.0",
    "value: null": "30.0",
    "sd: null": "1.0",
    "repetitions: null": "10",
}


@pytest.fixture
def folder(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    assert "README.md" in command("new", "wheat").out
    monkeypatch.chdir(tmp_path / "wheat")
    return tmp_path / "wheat"


@pytest.fixture
def refused(command):
    """What the check of the folder's configuration says against it."""
    return lambda: command("check", "--config", "config.yaml", status=2).err


def filled(folder):
    text = (folder / "config.yaml").read_text()
    for old, new in FILLED.items():
        assert text.count(old) == 1
        text = text.replace(old, f"{old.partition(':')[0]}: {new}")
    (folder / "config.yaml").write_text(text)
    (folder / "sizes.csv").write_text((folder / "sizes.csv").read_text() + SIZES)


def test_it_holds_what_a_user_needs_and_lists_studies_before_it_is_complete(
    folder, command
):
    found = {
        str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()
    }
    assert found == {"README.md", "config.yaml", "sizes.csv", "photographs/README.md"}
    assert not any(
        "NAME" in path.read_text() for path in folder.rglob("*.*") if path.is_file()
    )
    output = command("run", "--list")
    assert output.err == ""
    assert "once config.yaml is complete" in output.out
    named = {
        line.split()[0]
        for line in output.out.splitlines()
        if line.startswith("  ") and line[2] != " "
    }
    assert {"calibration", "sequential", "uncertainty"} <= named


def test_an_empty_folder_names_every_number_that_is_missing(folder, refused):
    """Nothing is made up: the template holds no measurement. All of it is reported at once, as YAML has it."""
    output = refused()
    for key in re.findall(r"(\w+): null", Path("config.yaml").read_text()):
        assert re.search(
            rf"^repose: error: config\.yaml: [a-z0-9.]+\.{key} is \[?null",
            output,
            re.MULTILINE,
        ), key
    moduli = "expected a number; or a table of compression tests in berry.compression"
    for key in ("berry.poisson_ratio", "berry.shear_modulus_pa"):
        assert f"config.yaml: {key} is null; {moduli}" in output
    assert "sizes.csv: rows is 0; expected at least 2 grains" in output
    assert not re.search("None|method.yaml", output)


def test_photographs_of_a_folder_without_sizes_ask_for_the_size_of_a_grain(
    folder, command
):
    picture = ROOT / "docs/figures/tutorial/photograph.jpg"
    fault = command("measure", picture, status=2).err
    assert "sizes.csv: rows is 0; " in fault
    assert fault.endswith("; or give the size of a grain by --grain-mm\n")


@pytest.mark.parametrize("key", ["poisson_ratio", "shear_modulus_pa"])
def test_a_modulus_that_is_left_out_is_missing_in_the_users_file(folder, refused, key):
    filled(folder)
    text = (folder / "config.yaml").read_text()
    (folder / "config.yaml").write_text(
        re.sub(rf"^  {key}:.*\n", "", text, count=1, flags=re.MULTILINE)
    )
    assert f"repose: error: config.yaml: berry.{key} is null" in refused()


def test_a_time_step_is_judged_while_other_keys_are_missing(folder, refused):
    filled(folder)
    text = (folder / "config.yaml").read_text().replace("berries: 400", "berries: null")
    (folder / "config.yaml").write_text(text + "\nsimulation: {time_step_s: 1.0e-3}\n")
    output = refused()
    assert "config.yaml: funnel.berries is null" in output
    assert "config.yaml: simulation.time_step_s is 0.001; expected at most" in output


def test_a_folder_that_exists_is_left_alone(folder, monkeypatch, command):
    (folder / "config.yaml").write_text("mine")
    monkeypatch.chdir(folder.parent)
    assert "does not exist yet" in command("new", "wheat", status=2).err
    assert (folder / "config.yaml").read_text() == "mine"


def test_inlet_and_outlet_the_other_way_round_are_named(folder):
    filled(folder)
    text = (
        (folder / "config.yaml")
        .read_text()
        .replace("inlet_diameter_mm: 80.0", "inlet_diameter_mm: 25.0")
    )
    text = text.replace("outlet_diameter_mm: 25.0", "outlet_diameter_mm: 80.0")
    (folder / "config.yaml").write_text(text)
    input_error(
        r"outlet_diameter_mm is 80\.0; expected .*below funnel\.inlet_diameter_mm",
        PipelineConfig.load,
        "config.yaml",
    )


@pytest.mark.parametrize("name", ["12", "null", "yes", "1e5", "MY_NAME", "2024-13-45"])
def test_a_name_that_yaml_takes_for_something_else_stays_a_name(
    tmp_path, monkeypatch, name, command
):
    monkeypatch.chdir(tmp_path)
    command("new", name)
    assert read_yaml(tmp_path / name / "config.yaml")["label"] == name


def test_its_configuration_is_one_of_wheat_alone_with_known_and_explained_keys(folder):
    filled(folder)
    config = PipelineConfig.load("config.yaml").config
    assert config["label"] == "wheat"
    assert config["berry"]["sizes"] == "sizes.csv"
    assert config["validation"]["published"] is None
    assert config["berry"]["compression"] is None
    assert not {"drum", "cylinder"} & set(config)
    assert [target["response"] for target in config["targets"]] == ["height_mm"]
    assert config["design"]["samples"] == 30
    assert config["network"]["split"] == [0.85, 0.0, 0.15]
    text = (folder / "config.yaml").read_text()
    assert (
        len([line for line in text.splitlines() if re.match(r"\s*[^#\s]", line)]) <= 31
    )
    assert set(yaml.safe_load(text)) <= set(
        PipelineConfig.load(places.find_program_folder() / places.DEFAULT_CONFIG).config
    )
    (folder / "more.yaml").write_text("funnel: {speed: 1}")
    input_error("a known key", PipelineConfig.load, "config.yaml", "more.yaml")


@pytest.mark.essential
@pytest.mark.slow
def test_a_dry_run_in_it_plans_the_whole_study_and_no_published_set(folder):
    filled(folder)
    plan = run_python("-m", "repose", "run", "-n", "--quiet", "rules")
    assert re.search(r"^pour +30$", plan, re.MULTILINE)
    assert re.search(r"^card +1$", plan, re.MULTILINE)
    assert "published_solutions" not in plan
    assert not (folder / "results").exists()
