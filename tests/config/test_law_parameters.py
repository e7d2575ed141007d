"""The parameters that a contact law adds: in the configuration, the design, the tables and the simulation."""

import copy
from itertools import product

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from shared import says

from repose.bench.parameters import (
    LABELS,
    PARAMETERS,
    parameters_among,
    parameters_of_law,
)
from repose.bench.scene import contacts_of
from repose.bench.settings import SimulationSettings
from repose.calibrate.designs.latin_hypercube import make_designs
from repose.calibrate.designs.settings import DesignSettings
from repose.common import faults
from repose.common.provenance import hash_content
from repose.config import dependencies
from repose.config.models import make_settings_type
from repose.config.pipeline import PipelineConfig
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
from repose.stages.card_study import describe_laws as described_laws
from repose.stages.parameter_sets import read_sample

GRAINS = {"gamma_gg": [0.0, 0.1]}
COHESION = {"gamma_gg": [0.0, 0.1], "gamma_gp": {"fixed": 0.02}}
OF_SJKR = {"k_gg": [0.0, 1e4], "k_gp": {"fixed": 0.0}}


def study(contact_law, rolling_law="budget", **parameters):
    laws = {"contact_law": contact_law, "rolling_law": rolling_law}
    return PipelineConfig.load(
        "config/config.yaml", overrides={"simulation": laws, "parameters": parameters}
    )


def test_the_configuration_knows_the_laws():
    for key, laws in (("contact_law", CONTACT_LAWS), ("rolling_law", ROLLING_LAWS)):
        assert faults.find_schema(["simulation", key], make_settings_type())[
            "enum"
        ] == list(laws)
        config = copy.deepcopy(study("hertz_mindlin").config)
        before = hash_content(dependencies.select_stage_settings(config, "pour"))
        config["simulation"][key] = "linear_spring" if key == "contact_law" else "epsd"
        assert (
            hash_content(dependencies.select_stage_settings(config, "pour")) != before
        )


def test_the_card_tells_the_conventions_of_a_law():
    described = described_laws(study("jkr", **COHESION).settings.simulation)
    says(described["normal"], "w = 2 gamma", "3 pi gamma R*")
    for direction in ("tangential", "rolling"):
        assert (
            "times the sum of the damped normal force and twice the pull-off force"
            in described[direction]
        )
    assert "by more than the pull-off force" in described["end of an impact"]
    described = described_laws(study("sjkr", **OF_SJKR).settings.simulation)
    assert (
        "mu_s times the size of the damped normal force without cohesion"
        in described["tangential"]
    )
    assert described["end of an impact"].startswith(
        "the force without cohesion never pulls"
    )


def test_twisting_belongs_to_its_laws():
    space = study("hertz_mindlin", "epsd", mut_gp=[0.0, 0.5]).parameters
    assert space.free == (*PARAMETERS, "mut_gp")
    contacts = contacts_of(space.centre)
    assert contacts["berry", "berry"].twisting_friction is None
    assert contacts["berry", "wall"].twisting_friction == 0.25
    assert LABELS["mut_gp"] == "twisting friction, grain-wall"
    twisting = [law for law in ROLLING_LAWS if ROLLING_LAWS.entry(law).twists]
    message = f"simulation.rolling_law {' or '.join(twisting)}, not budget"
    message = f"mut_gp is .* belongs to {message}"
    input_error(message, study, "hertz_mindlin", mut_gp=[0.0, 0.5])


def test_a_card_tells_all_laws_apart_by_their_sentences():
    """`rebuild_configuration` finds the laws of a card by its sentences alone."""
    tensions = ("keep", "release")
    combinations = list(product(CONTACT_LAWS, ROLLING_LAWS, tensions))
    sentences = set()
    for contact, rolling, tension in combinations:
        laws = {"contact_law": contact, "rolling_law": rolling, "tension": tension}
        settings = SimulationSettings.model_construct(None, **laws)
        sentences.add(tuple(sorted(described_laws(settings).items())))
    assert len(sentences) == len(combinations)


@pytest.mark.usefixtures("short_search")
def test_a_law_adds_its_parameters_to_the_six_whose_tables_stay_as_they_were(tmp_path):
    space = study("jkr", **COHESION).parameters
    assert space.names == (*PARAMETERS, "gamma_gg", "gamma_gp")
    assert space.free == (*PARAMETERS, "gamma_gg")
    table = make_designs(space, DesignSettings(samples=12, method="lhsdesign", seed=1))[
        0
    ]
    assert list(table) == ["sample", *space.names]
    assert set(table["gamma_gp"]) == {0.02}
    assert len(set(np.ceil(120.0 * table["gamma_gg"]))) == 12
    table.to_csv(tmp_path / "samples.csv", index=False)
    assert tuple(read_sample(tmp_path / "samples.csv", 3)) == space.names
    np.testing.assert_allclose(
        space.values(space.unit(table[list(space.names)])), table[list(space.names)]
    )
    contacts = contacts_of(space.centre)
    assert contacts["berry", "berry"].constants == {"surface_energy_j_m2": 0.05}
    assert contacts["berry", "wall"].constants == {"surface_energy_j_m2": 0.02}
    assert LABELS["gamma_gp"] == "surface energy (J/m2), grain-wall"
    assert (
        parameters_among(pd.DataFrame(columns=["sample", *PARAMETERS, "aor_deg"]))
        == PARAMETERS
    )
    assert parameters_of_law("hertz_mindlin_rescaled") == ()
    assert study("hertz_mindlin").parameters.names == PARAMETERS


@pytest.mark.parametrize(
    ("law", "parameters", "message"),
    [
        (
            "jkr",
            {},
            r"contact_law is 'jkr'; expected jkr with parameters.gamma_gg .* and parameters.gamma_gp",
        ),
        ("jkr", GRAINS, r"expected jkr with parameters.gamma_gp \(surface energy"),
        (
            "sjkr",
            COHESION,
            r"expected sjkr with parameters.k_gg \(cohesion energy density \(J/m3\), grain-grain\)",
        ),
        (
            "hertz_mindlin",
            GRAINS,
            "gamma_gg is .*; expected absent: it belongs to .* jkr or eepa, not hertz",
        ),
        (
            "jkr",
            COHESION | {"gamma_gg": [-0.1, 0.1]},
            "gamma_gg is .*; expected a pair .* from 0 to",
        ),
    ],
)
def test_parameters_and_law_belong_together(law, parameters, message):
    input_error(message, study, law, **parameters)


@pytest.mark.parametrize("rolling", ["constant_torque", "epsd", "epsd2"])
@pytest.mark.parametrize(("law", "parameters"), [("jkr", COHESION), ("sjkr", OF_SJKR)])
def test_cohesion_goes_with_every_rolling_law(law, parameters, rolling):
    assert study(law, rolling, **parameters).parameters.free
