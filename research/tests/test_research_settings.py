"""The settings of the studies: what lies over what, and every fault at once."""

import pytest

from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from research import settings

LARGE = {"small_run": False}
SMALL = {"small_run": True}


def test_a_small_run_has_small_settings_and_the_working_folder_has_the_last_word(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert settings.read_settings(LARGE)["pool"]["samples"] == 220
    (tmp_path / "research.yaml").write_text(
        "pool: {seeds: 7}\ncompare_search: {tolerance: 1}\n"
    )
    found = settings.read_settings(SMALL)
    assert found["pool"] | {"seed": 0} == {
        "samples": 24,
        "seeds": 7,
        "fresh_samples": 6,
        "fresh_seeds": 2,
        "seed": 0,
    }
    assert found["compare_search"]["tolerance"] == 1


def test_unknown_keys_and_wrong_types_are_reported_together(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "research.yaml").write_text(
        "poool: {seeds: 7}\npool: {seeds: 2.5, sead: 1}\ncompare_whole: {samples: [a]}\ncompare_search: 3\n"
    )
    with pytest.raises(InputError) as caught:
        settings.read_settings(LARGE)
    messages = str(caught.value).splitlines()
    assert len(messages) == 5
    for phrase in (
        "research.yaml: poool is",
        "did you mean pool?",
        "pool.seeds is 2.5; expected an integer, such as 4",
        "pool.sead is 1; expected a known key; did you mean seed?",
        "compare_whole.samples is",
        "compare_search is 3; expected a section",
    ):
        assert phrase in str(caught.value), phrase


def test_the_effective_model_is_the_reference_of_no_berry(monkeypatch):
    """The changes of matched.yaml are a cell of the shape study."""
    monkeypatch.chdir(settings.HERE.parent)
    config = PipelineConfig.load("config/matched.yaml").config
    study = settings.read_settings(config)["shape_study"]
    assert config["berry"] == config["berry"] | study["particles"]["rough_spheres"]
    assert config["funnel"] == config["funnel"] | study["fillings"]["open_cone"]
    assert config["simulation"]["tension"] == "keep"


def test_named_parts_of_the_shape_study_replace_those_of_the_default(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "research.yaml").write_text(
        "shape_study: {sensitivities: {slow: {rate_per_s: 20.0}}}"
    )
    study = settings.read_settings(LARGE)["shape_study"]
    assert study["sensitivities"] == {"slow": {"rate_per_s": 20.0}}
    assert len(study["fillings"]) > 1


def test_free_names_have_values_of_the_same_type(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settings_file = tmp_path / "research.yaml"
    settings_file.write_text(
        "second_responses: {minutes: {plate: 7.5, drum: ten}}\nshape_study: {fillings: {here: 3}}"
    )
    with pytest.raises(InputError) as caught:
        settings.read_settings(LARGE)
    keys = [fault.key for fault in caught.value.faults]
    assert keys == ["second_responses.minutes.drum", "shape_study.fillings.here"]
