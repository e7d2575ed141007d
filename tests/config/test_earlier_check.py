"""The check that an earlier run of the workflow made."""

import copy
import shutil

import pytest
from shared import ROOT

from repose.config import earlier_check, loader
from repose.config.pipeline import PipelineConfig


@pytest.fixture
def config(tmp_path):
    """A configuration as its files have it; results and sizes lie in a folder of its own."""
    content = copy.deepcopy(
        loader.merge_with_defaults([ROOT / "config/quick.yaml"]).config
    )
    for key in ("sizes", "compression"):
        table = tmp_path / f"{key}.csv"
        shutil.copyfile(ROOT / content["berry"][key], table)
        content["berry"][key] = str(table)
    return content | {"results_dir": str(tmp_path / "results")}


def test_the_configuration_of_an_earlier_check_is_that_of_a_new_one(config):
    checked = earlier_check.compute_fingerprint(config)
    assert earlier_check.read_checked_config(config, checked) is None
    resolved = PipelineConfig.of(config).config
    earlier_check.write_checked_config(checked, resolved)
    # The same text: Snakemake compares the settings of a rule by it.
    assert repr(earlier_check.read_checked_config(config, checked)) == repr(resolved)


def test_another_key_another_file_or_an_edit_of_the_check_needs_a_new_one(
    config, tmp_path
):
    checked = earlier_check.compute_fingerprint(config)
    earlier_check.write_checked_config(checked, config)
    assert earlier_check.read_checked_config(config, checked) == config

    other = config | {"wall": config["wall"] | {"poisson_ratio": 0.3}}
    assert earlier_check.compute_fingerprint(other) != checked
    assert (
        earlier_check.read_checked_config(
            other, earlier_check.compute_fingerprint(other)
        )
        is None
    )

    sizes = tmp_path / "sizes.csv"
    sizes.write_text(sizes.read_text() + sizes.read_text().splitlines()[-1] + "\n")
    assert earlier_check.compute_fingerprint(config) != checked

    kept = tmp_path / "results" / earlier_check.FILE_NAME
    kept.write_text(kept.read_text().replace("config", "config "))
    assert earlier_check.read_checked_config(config, checked) is None
