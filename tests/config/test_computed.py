"""Keys that are `auto`: their numbers, and where they stand afterwards."""

import copy
import json
import re

import pytest
from refusals import input_error
from shared import at, check_all, put

from repose.common import places
from repose.config import computed
from repose.config.pipeline import PipelineConfig

CROPS = places.find_program_folder() / "crops"
KEYS = [setting.key for setting in computed.COMPUTED_SETTINGS]


@pytest.fixture(scope="module")
def by_hand():
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(CROPS / "soybean")
        # The crop states the limits of its kept runs, which are those of a goji berry.
        overrides = {
            "simulation": {"rest_energy_j": "auto"},
            "funnel": {"rest_motion_mm": "auto", "rest_window_s": "auto"},
        }
        return PipelineConfig.load("config.yaml", overrides=overrides).config


@pytest.fixture
def folder(tmp_path, monkeypatch, by_hand):
    """A study of soybeans without the keys that can be computed."""
    config = copy.deepcopy(by_hand)
    config["validation"]["published"] = None
    for key in KEYS:
        section, _, name = key.partition(".")
        del config[section][name]
    (tmp_path / "config.yaml").write_text(json.dumps(config))
    (tmp_path / "sizes.csv").write_bytes((CROPS / "soybean/sizes.csv").read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_what_is_left_out_is_computed(folder, by_hand):
    config = PipelineConfig.load(check_inputs=True).config
    assert PipelineConfig.load("config.yaml").config == config
    assert json.loads(json.dumps(config)) == config
    assert not computed.find_settings_to_compute(config)
    for key in KEYS:
        if key == "network.split":
            assert at(config, key) == at(by_hand, key)
        else:
            assert at(config, key) == pytest.approx(at(by_hand, key), rel=0.35), key


def test_what_is_given_stays(folder):
    (folder / "more.yaml").write_text(
        "measure: {mm_per_pixel: 0.3}\nnetwork: {split: [0.7, 0.1, 0.2]}\n"
    )
    config = PipelineConfig.load("more.yaml").config
    assert config["measure"]["mm_per_pixel"] == 0.3
    assert config["network"]["split"] == [0.7, 0.1, 0.2]


def test_the_articles_network_stops_by_samples_of_its_own(folder):
    (folder / "more.yaml").write_text("surrogate: network\n")
    config = PipelineConfig.load("more.yaml").config
    assert config["network"]["split"] == [0.70, 0.15, 0.15]


def test_the_time_step_is_eight_tenths_of_the_longest(folder):
    step = PipelineConfig.load("config.yaml").config["simulation"]["time_step_s"]
    (folder / "more.yaml").write_text("simulation: {time_step_s: 1.0e-2}")
    fault = input_error(
        r"simulation\.time_step_s is 0\.01",
        PipelineConfig.load,
        "more.yaml",
        check_inputs=True,
    )
    longest = float(fault.allowed.removeprefix("at most ").split(",")[0])
    assert 0.75 * longest < step <= 0.8 * longest
    assert step == float(f"{step:.2g}")


@pytest.mark.parametrize(
    ("rate_per_s", "lasts_s"),
    [
        # 300 grains at 100 a second; a fall of 80 mm, and 40 sqrt(d / g) to rest
        (100.0, 3.0 + 0.13 + 0.95),
        # poured at once, grains of 5.48 mm and 0.108 g run out: 0.58 * 750 kg/m3 * sqrt(g) * (25 mm - 1.4 d)^2.5
        (1e4, 0.60 + 0.13 + 0.95),
    ],
)
def test_a_pour_lasts_until_the_grains_lie(folder, rate_per_s, lasts_s):
    config = PipelineConfig.load(
        "config.yaml", overrides={"funnel": {"rate_per_s": rate_per_s}}
    ).config
    assert config["funnel"]["duration_s"] == pytest.approx(lasts_s + 0.05, abs=0.06)


def test_another_word_or_number_is_refused(by_hand):
    def refused(key, value):
        config = put(copy.deepcopy(by_hand), key, value)
        fault = input_error(
            "expected auto, or ", PipelineConfig.of, config, "mine.yaml"
        )
        assert fault.key == key

    values = (-1, "automatic", None, True, [], float("inf"))
    cases = [(f"{key} {value!r}", key, value) for key in KEYS for value in values]
    check_all(refused, cases)


def test_a_study_has_numbers_in_place_of_auto(by_hand, monkeypatch):
    monkeypatch.chdir(CROPS / "soybean")
    for key in KEYS:
        config = PipelineConfig.of(put(copy.deepcopy(by_hand), key, "auto")).config
        assert at(config, key) == pytest.approx(at(by_hand, key), rel=0.35), key


def test_a_number_that_cannot_be_computed_is_reported_with_its_cause(folder):
    (folder / "sizes.csv").unlink()
    message = "sizes.csv: file is 'No such file or directory'; expected a CSV file"
    input_error(f"^{re.escape(message)}$", PipelineConfig.load, "config.yaml")


def test_a_number_of_auto_is_no_cause_of_a_fault_elsewhere(folder):
    """Numbers are computed beside a fault in another section, which is none of theirs."""
    error = input_error(
        "miga.islands is -1",
        PipelineConfig.load,
        folder / "config.yaml",
        overrides={"miga": {"islands": -1}},
    )
    assert "`auto` gave this number" not in str(error)
