"""The settings of the studies: what lies over what, and every fault at once."""

import pytest

from repose.config import loader
from repose.core.errors import InputError
from repose.core.places import configs
from research import settings

LARGE, SMALL = {"small_run": False}, {"small_run": True}


def test_a_small_run_has_small_settings_and_the_working_folder_has_the_last_word(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert settings.of(LARGE)["pool"]["samples"] == 220
    (tmp_path / "research.yaml").write_text("pool: {seeds: 7}\ncompare_search: {tolerance: 1}\n")
    found = settings.of(SMALL)
    assert found["pool"] | {"seed": 0} == {
        "samples": 24,
        "seeds": 7,
        "fresh_samples": 6,
        "fresh_seeds": 2,
        "seed": 0,
    }
    assert found["compare_search"]["tolerance"] == 1


def test_unknown_keys_and_wrong_types_are_told_together(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "research.yaml").write_text(
        "poool: {seeds: 7}\npool: {seeds: 2.5, sead: 1}\ncompare_whole: {samples: [a]}\ncompare_search: 3\n"
    )
    with pytest.raises(InputError) as caught:
        settings.of(LARGE)
    told = str(caught.value).splitlines()
    assert len(told) == 5
    for words in (
        "research.yaml: poool is",
        "did you mean pool?",
        "pool.seeds is 2.5; allowed: an integer, such as 4",
        "pool.sead is 1; allowed: no such key; did you mean seed?",
        "compare_whole.samples is",
        "compare_search is 3; allowed: a section",
    ):
        assert words in str(caught.value), words


@pytest.mark.parametrize("section", settings.read(settings.HERE / "config.yaml"))
def test_a_configuration_that_still_has_a_section_is_told_where_it_went(section):
    with pytest.raises(InputError, match=f"{section} is .*; allowed: now .* research"):
        loader.resolve(configs(), {section: {"seed": 1}})
