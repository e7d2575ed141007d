"""What a hit returns at the time step of a study: computed as the engine does it."""

import copy

import numpy as np
import pytest
from dem.common import GOJI, PVC
from shared import ROOT

from repose.bench import Scene
from repose.config import hits
from repose.config.pipeline import PipelineConfig
from repose.dem import Contact, Plane, Shape, Simulation
from repose.dem.laws import CONTACT_LAWS

STUDY = PipelineConfig.load(ROOT / "config/config.yaml")
RADIUS_M = 0.0067
SPEED_M_S = 2.0
STEP_S = 4.9e-4


def simulated(restitution, phase, tension):
    """The restitution of a sphere that hits a wall of the engine."""
    contact = Contact(restitution, 0.0, 0.0)
    s = Simulation(
        {"body": Shape.sphere(RADIUS_M, 840.0, "body")},
        {"body": GOJI, "wall": PVC},
        {("body", "body"): contact, ("body", "wall"): contact},
        STEP_S,
        capacity=1,
        walls={"plate": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall")},
        lower=(-0.1, -0.1, -0.1),
        upper=(0.1, 0.1, 0.2),
        gravity_m_s2=(0.0, 0.0, 0.0),
        tension=tension,
    )
    height_m = RADIUS_M + phase * SPEED_M_S * STEP_S
    s.add("body", (0.0, 0.0, height_m), velocity_m_s=(0.0, 0.0, -SPEED_M_S))
    s.run_steps(200)
    return s.velocities[0, 2] / SPEED_M_S


@pytest.mark.parametrize("tension", ["keep", "release"])
@pytest.mark.parametrize("restitution", [0.1, 0.2, 0.4, 0.9])
def test_a_hit_returns_what_the_engine_returns(restitution, tension):
    law = CONTACT_LAWS["hertz_mindlin"]
    mass_kg = Shape.sphere(RADIUS_M, 840.0, "body").mass_kg
    contact = Contact(restitution, 0.0, 0.0)
    duration_s = law.contact_time(GOJI, PVC, contact, mass_kg, RADIUS_M, SPEED_M_S)
    expected = np.mean([simulated(restitution, p, tension) for p in hits.PHASES])
    value = hits.compute_returned_restitution(restitution, tension, duration_s / STEP_S)
    assert value == pytest.approx(expected, abs=2e-3)
    if restitution < hits.LOW_RESTITUTION:
        assert value < 0.9 * restitution
    assert hits.compute_returned_restitution(
        restitution, tension, 1000.0
    ) == pytest.approx(restitution, abs=1e-3)


def test_check_names_low_restitutions_with_what_they_return():
    scene = STUDY.scene(STUDY.parameters.centre)
    (line,) = hits.describe_low_restitutions(scene, {"e_gg": 0.1, "e_gp": 0.2})
    assert line == (
        "restitution: at this time step a hit at 2 m/s returns 0.078 where e_gg is 0.1 "
        "and 0.175 where e_gp is 0.2"
    )
    (line,) = hits.describe_low_restitutions(scene, {"e_gg": 0.3, "e_gp": 0.2})
    assert "e_gg" not in line
    assert not list(hits.describe_low_restitutions(scene, {"e_gg": 0.3, "e_gp": 0.5}))
    config = copy.deepcopy(STUDY.config)
    config["simulation"]["contact_law"] = "linear_spring"
    other = Scene.of(config, scene.parameters, scene.grain, scene.particle)
    assert not list(hits.describe_low_restitutions(other, {"e_gg": 0.1, "e_gp": 0.2}))
