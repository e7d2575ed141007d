"""The study: made once, typed, and trusted where it was checked before."""

import dataclasses
import json

import pytest
from pydantic import ValidationError

import repose
from repose.config import loader
from repose.config.study import Study
from repose.core import places
from repose.core.errors import InputError


@pytest.fixture(autouse=True)
def _in_the_project(monkeypatch):
    monkeypatch.chdir(places.root())


@pytest.fixture(scope="module")
def quick():
    return Study.load(places.root() / "config/quick.yaml")


def test_it_stands_beside_the_package_and_nothing_in_it_is_exchanged(quick):
    assert repose.Study is Study
    assert quick.settings.funnel.seeds == quick.config["funnel"]["seeds"] == 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        quick.config = {}
    with pytest.raises(ValidationError, match="frozen"):
        quick.settings.funnel.seeds = 3


def test_it_has_parameters_targets_and_folder(quick):
    assert quick.parameters.dimensions == 6
    assert quick.targets.names == ("aor_deg", "height_mm")
    assert quick.folder.as_posix() == "results/quick"


def test_it_is_shown_in_one_line(quick):
    words = "e_gg, mus_gg, mur_gg, e_gp, mus_gp, mur_gp by aor_deg, height_mm, strategy published"
    assert repr(quick) == f"<Study quick: {words}>"


def test_its_grain_is_made_once(quick):
    assert quick.grain is quick.grain
    assert quick.particle is quick.particle
    assert quick.grain["density_kg_m3"] == 840.47


def test_a_key_that_may_be_auto_may_be_left_out(quick):
    config = quick.config | {"network": {**quick.config["network"]}}
    del config["network"]["split"]
    assert Study.of(config).config["network"]["split"] == [0.70, 0.15, 0.15]


def test_a_job_reads_what_was_checked_and_checks_it_only_if_somebody_changed_it(quick, tmp_path):
    path = tmp_path / "config.json"
    wrong = quick.config | {"surrogate": "cubic"}
    loader.write_resolved(wrong, path)  # no study writes that: it shows that nothing is checked
    assert Study.load(path).config == wrong
    path.write_text(json.dumps(wrong))
    with pytest.raises(InputError, match=r"config\.json: surrogate is 'cubic'"):
        Study.load(path)


def test_what_stands_on_a_fault_is_not_reported_beside_it(quick):
    """Each rule and file is checked where the sections that it reads are good."""
    config = quick.config | {
        "funnel": quick.config["funnel"] | {"outlet_diameter_mm": 150.0, "seeds": 0},
        "berry": quick.config["berry"] | {"sizes": "nowhere.csv", "stl": "nowhere.stl"},
        "validation": quick.config["validation"] | {"published": "nowhere.csv"},
        "simulation": quick.config["simulation"] | {"time_step_s": "auto"},
        "miga": quick.config["miga"] | {"tournament": 900},
    }
    with pytest.raises(InputError) as caught:
        Study.of(config, "mine.yaml", inputs=True)
    found = {fault.key for fault in caught.value.faults}
    named = {"berry.sizes", "berry.stl", "validation.published"}
    assert found == {"funnel.seeds", "miga.tournament", *named}
