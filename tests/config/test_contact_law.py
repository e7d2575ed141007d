"""The contact law that a study may choose."""

import copy

import pytest

from repose.apparatus.settings import SimulationSettings
from repose.config import faults, stands_on
from repose.config.study import Study
from repose.core import places
from repose.core.errors import InputError
from repose.core.provenance import hash_of
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS


@pytest.fixture
def config(monkeypatch):
    monkeypatch.chdir(places.root())
    return copy.deepcopy(Study.load("config/config.yaml").config)


def test_the_configuration_knows_the_laws_of_the_engine():
    assert faults.subschema(["simulation", "contact_law"])["enum"] == list(CONTACT_LAWS)
    assert faults.subschema(["simulation", "rolling_law"])["enum"] == list(ROLLING_LAWS)


def test_a_configuration_without_it_has_hertz_and_mindlin_and_the_budget(config):
    for key in ("contact_law", "rolling_law"):
        config["simulation"].pop(key)
    settings = SimulationSettings.of(config)
    assert (settings.contact_law, settings.rolling_law) == ("hertz_mindlin", "budget")


def test_a_friction_limit_of_an_earlier_version_is_reported_with_its_replacement(config):
    config["simulation"]["friction_limit"] = "elastic"
    with pytest.raises(
        InputError, match=r"friction_limit is 'elastic'; .*the tension decides.*delete this line"
    ):
        Study.of(config, "mine.yaml")


def test_pours_of_another_law_stand_on_other_settings(config):
    before = hash_of(stands_on.settings_of(config, "pour"))
    config["simulation"]["contact_law"] = "linear_spring"
    Study.of(config, "mine.yaml")
    assert hash_of(stands_on.settings_of(config, "pour")) != before


def test_an_unknown_law_is_refused(config):
    config["simulation"]["contact_law"] = "hooke"
    with pytest.raises(
        InputError,
        match=f"contact_law is 'hooke'; allowed: {' or '.join(CONTACT_LAWS)}",
    ):
        Study.of(config, "mine.yaml")
