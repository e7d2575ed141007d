"""What the hash of a scene stands for."""

import pytest

from repose.config import dependencies
from repose.config.pipeline import PipelineConfig

DEFAULT = "config/config.yaml"
CYLINDER = "examples/bench_tests/cylinder.yaml"


def scene_of(**overrides):
    """The scene of the cylinder's example with other values."""
    study = PipelineConfig.load(DEFAULT, CYLINDER, overrides=overrides)
    return dependencies.hash_scene(study.config)


@pytest.mark.parametrize(("key", "value"), [("core_margin_mm", 15), ("height_mm", 140)])
def test_keys_that_measure_or_make_a_run_change_the_scene(key, value):
    assert scene_of(cylinder={key: value}) != scene_of()


def test_the_number_of_seeds_leaves_the_scene():
    assert scene_of(cylinder={"seeds": 3}) == scene_of()
