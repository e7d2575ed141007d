"""The check that an earlier run of the workflow made."""

import copy
import json
import shutil

import pytest
from shared import ROOT

from repose.config import earlier_check, loader
from repose.config.pipeline import PipelineConfig


@pytest.fixture
def config(tmp_path):
    """A configuration as its files have it; results and sizes lie in a folder of its own."""
    content = copy.deepcopy(loader.read_layers([ROOT / "config/quick.yaml"]).config)
    for key in ("sizes", "compression"):
        table = tmp_path / f"{key}.csv"
        shutil.copyfile(ROOT / content["berry"][key], table)
        content["berry"][key] = str(table)
    return content | {"results_dir": str(tmp_path / "results")}


def test_the_numbers_of_an_earlier_check_are_those_of_the_configuration(config):
    checked = earlier_check.fingerprint(config)
    assert earlier_check.numbers(config, checked) is None
    resolved = PipelineConfig.of(config).config
    earlier_check.write(config, checked, resolved)
    numbers = earlier_check.numbers(config, checked)
    assert "simulation.time_step_s" in numbers
    completed = earlier_check.with_numbers(config, numbers)
    # the same text, so the order of the keys is the same, too
    assert json.dumps(PipelineConfig.of(completed).config) == json.dumps(resolved)


def test_another_key_another_file_or_an_edit_of_the_check_needs_a_new_one(
    config, tmp_path
):
    checked = earlier_check.fingerprint(config)
    earlier_check.write({}, checked, config)
    assert earlier_check.numbers(config, checked) == {}

    other = config | {"wall": config["wall"] | {"poisson_ratio": 0.3}}
    assert earlier_check.fingerprint(other) != checked
    assert earlier_check.numbers(other, earlier_check.fingerprint(other)) is None

    sizes = tmp_path / "sizes.csv"
    sizes.write_text(sizes.read_text() + sizes.read_text().splitlines()[-1] + "\n")
    assert earlier_check.fingerprint(config) != checked

    kept = tmp_path / "results" / earlier_check.FILE
    kept.write_text(kept.read_text().replace("numbers", "numbers "))
    assert earlier_check.numbers(config, checked) is None
