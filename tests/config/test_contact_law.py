"""The contact law that a study may choose."""

import copy

import pytest

from repose.apparatus.settings import SimulationSettings
from repose.config import checks, loader, stands_on
from repose.config.schema import subschema
from repose.core import places
from repose.core.errors import InputError
from repose.core.provenance import hash_of
from repose.dem.laws import CONTACT_LAWS


@pytest.fixture
def config(monkeypatch):
    monkeypatch.chdir(places.root())
    return copy.deepcopy(loader.load("config/config.yaml"))


def test_the_schema_names_the_laws_of_the_engine():
    assert subschema(["simulation", "contact_law"])["enum"] == list(CONTACT_LAWS)


def test_no_shipped_study_names_it_and_all_have_hertz_and_mindlin(config):
    assert "contact_law" not in config["simulation"]
    assert SimulationSettings.of(config).contact_law == "hertz_mindlin"


def test_pours_of_another_law_stand_on_other_settings(config):
    before = hash_of(stands_on.settings_of(config, "pour"))
    config["simulation"]["contact_law"] = "linear_spring"
    checks.check(config, "mine.yaml")
    assert hash_of(stands_on.settings_of(config, "pour")) != before


def test_a_law_that_is_none_is_refused(config):
    config["simulation"]["contact_law"] = "hooke"
    with pytest.raises(InputError, match="contact_law is 'hooke'; allowed: hertz_mindlin or linear_spring"):
        checks.check(config, "mine.yaml")
