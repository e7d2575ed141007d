"""The inclined plane: a sled slides at atan(mu_s), a sphere rolls at atan(mu_r) or stays; how a run is judged."""

import math
from functools import partial

import numpy as np
import pytest
from goji import BEAD, PARTICLE, SPHERE, example, named
from refusals import input_error
from shared import target

from repose.bench import Scene, bench, inclined_plane
from repose.config.pipeline import PipelineConfig
from repose.stages.job import run_once

TEST = inclined_plane.InclinedPlaneTest()
ROLLS = target("roll_deg", 10.0, 1.0, 9.0, 11.0)
config = partial(example, "inclined_plane", steepest_deg=45.0)


def on_plane(friction, rolling, particle=SPHERE, settings=None, wall=None):
    """A sled and a body on a wall with these coefficients, or on a plate of their own material."""
    values = named((0.3, friction, rolling, 0.3, *(wall or (friction, rolling))))
    return run_once(
        bench("inclined_plane"),
        Scene.of(settings or config(), values, BEAD, particle, 1),
    )[0]


def check_angles(found, friction, rolling, within=0.01):
    angles = np.degrees(np.arctan([friction, rolling]))
    assert [found["slip_deg"], found["roll_deg"]] == pytest.approx(angles, abs=within)


@pytest.mark.parametrize(
    ("friction", "rolling"),
    [(0.2, 0.05), (0.5, 0.2), pytest.param(0.8, 0.4, marks=pytest.mark.slow)],
)
def test_a_sled_slides_and_a_sphere_rolls_at_the_angle_of_its_coefficient(
    friction, rolling
):
    found = on_plane(friction, rolling)
    assert found["status"] == "ok"
    check_angles(found, friction, rolling)


@pytest.mark.slow
def test_a_sled_of_another_shape_slides_at_the_same_angle():
    expected = math.degrees(math.atan(0.4))
    assert on_plane(0.4, 0.1, PARTICLE)["slip_deg"] == pytest.approx(expected, abs=0.01)


@pytest.mark.slow
def test_a_sphere_that_cannot_roll_slides_or_stays():
    slides = on_plane(0.3, 0.5)
    # the angle of rolling is no target
    assert slides["status"] == "ok"
    assert slides["roll_deg"] is None
    settings = config()
    settings["targets"].append(ROLLS)
    slides = on_plane(0.3, 0.5, settings=settings)
    assert slides["status"] == "no_roll"
    assert slides["slip_deg"] == pytest.approx(16.70, abs=0.1)
    assert "slides at 1" in slides["reason"]
    settings = config(steepest_deg=20.0, tilting_deg_s=4.0)
    settings["targets"].append(ROLLS)
    stays = on_plane(0.5, 0.5, settings=settings)
    assert stays["status"] == "no_slip"
    assert stays["slip_deg"] is None
    assert stays["roll_deg"] is None
    assert stays["reason"] == "the sled stays up to 20 degrees"


def test_the_other_surface_is_of_the_berries_own_material():
    check_angles(
        on_plane(
            0.3,
            0.1,
            settings=config(surface="berry", tilting_deg_s=2.0),
            wall=(0.6, 0.3),
        ),
        0.3,
        0.1,
        0.1,
    )


@pytest.mark.parametrize(
    "friction", [0.0, pytest.param(0.1, marks=pytest.mark.slow), 0.3]
)
def test_a_sphere_leaves_its_pocket_in_a_glued_layer_over_the_saddle(
    friction, monkeypatch
):
    """A sphere on three: over the saddle between two of them at 19.471 degrees + atan(2 mu / sqrt 3)."""
    monkeypatch.setattr(inclined_plane, "draw_azimuth", lambda seed: math.radians(90.0))
    values = named((0.2, friction, 0.0, 0.2, 0.9, 0.9))
    settings = config(surface="glued", tilting_deg_s=2.0)
    found = run_once(
        bench("inclined_plane"), Scene.of(settings, values, BEAD, SPHERE, 1)
    )[0]
    known = 19.4712 + math.degrees(math.atan(2.0 * friction / math.sqrt(3.0)))
    assert found["slip_deg"] == pytest.approx(known, abs=0.3)


def test_a_glued_layer_touches_and_does_not_overlap():
    for particle in (SPHERE, PARTICLE):
        places, _, half = inclined_plane.make_layer(particle)
        apart = np.sort(
            np.linalg.norm(places[:, None] - places, axis=2)
            + 1e9 * np.eye(len(places)),
            axis=None,
        )
        wide = 2.0 * sorted(particle.dem_shape("berry").half_extents_m)[1]
        expected = wide * 1.0001 if particle is SPHERE else apart[0]
        assert apart[0] == pytest.approx(expected)
        settings = config(surface="glued")
        values = named((0.2, 0.3, 0.0, 0.2, 0.9, 0.9))
        simulation = TEST.build(
            Scene.of(settings, values, BEAD, particle), 1.0, azimuth=0.4
        )
        simulation.run_steps(50)
        assert len(simulation.contacts()) == 0
        assert (
            np.ptp(simulation.positions[:, 2])
            == 0.0
            == np.abs(simulation.velocities).max()
        )
        assert half > 0.0


@pytest.mark.slow
def test_the_resistance_against_the_other_body_rolls_at_the_same_angle():
    settings = config()
    settings["simulation"]["rolling_law"] = "epsd"
    check_angles(on_plane(0.5, 0.2, settings=settings), 0.5, 0.2)


def test_the_beginning_is_where_the_root_of_the_speed_meets_zero_inside_the_bounds():
    angle = np.arange(0.0, 22.0, 0.01)
    speed = 3.0 * np.maximum(angle - 20.0, 0.0) ** 2 + 1e-9
    assert inclined_plane.fit_onset_angle_deg(angle, speed) == pytest.approx(
        20.0, abs=1e-3
    )
    angle = np.linspace(0.0, 20.0, 200)
    columns = {
        "angle_deg": angle,
        "speed_m_s": (angle + 5.0) ** 2,
        "slide_m_s": 0.0 * angle,
    }
    bodies = (inclined_plane.SLED, inclined_plane.GRAIN)
    arrays = {
        f"{body}_{name}": values for body in bodies for name, values in columns.items()
    }
    found = TEST.result(
        {"seed": 1, "status": "ok", "reason": ""},
        arrays,
        Scene.of(config(), {}, BEAD, SPHERE),
    )
    assert found["status"] == "out_of_bounds"
    assert found["reason"] == "angle of slip is -5, outside 0 to 89 deg"
    assert found["status"] in TEST.statuses


@pytest.mark.parametrize(
    "speed",
    [
        np.zeros(200),  # at rest to the last
        np.r_[np.zeros(100), np.linspace(0.2, 0.01, 100)],  # it tips and comes to rest
        np.r_[np.full(199, 0.01), 1.0],  # one look at the motion
    ],
)
def test_a_berry_that_tips_and_stops_has_no_angle(speed):
    angle = np.linspace(0.0, 20.0, 200)
    assert inclined_plane.fit_onset_angle_deg(angle, speed) is None
    arrays = {
        f"{body}_angle_deg": angle
        for body in (inclined_plane.SLED, inclined_plane.GRAIN)
    }
    arrays |= {
        f"{inclined_plane.GRAIN}_speed_m_s": speed,
        f"{inclined_plane.GRAIN}_slide_m_s": 0.0 * speed,
    }
    slides = 3.0 * np.maximum(angle - 10.0, 0.0) ** 2
    arrays |= {
        f"{inclined_plane.SLED}_speed_m_s": slides,
        f"{inclined_plane.SLED}_slide_m_s": slides,
    }
    settings = config()
    settings["targets"].append(ROLLS)
    found = TEST.measure(
        {"seed": 1, "status": "ok", "reason": ""},
        arrays,
        Scene.of(settings, {}, BEAD, SPHERE),
    )
    assert found["status"] == "no_roll"
    assert found["roll_deg"] is None
    assert "moves and stops" in found["reason"]
    assert found["slip_deg"] == pytest.approx(10.0, abs=0.01)


def test_a_film_shows_the_plane_tilting_and_the_berry_on_it_and_a_plane_that_tilts_too_fast_or_creeps_is_refused():
    values = named((0.3, 0.5, 0.3, 0.3, 0.5, 0.3))
    settings = config(tilting_deg_s=10.0, steepest_deg=45.0)
    frames = (
        bench("inclined_plane")
        .run(Scene.of(settings, values, BEAD, SPHERE, 1), interval_s=0.05)
        .frames
    )
    normal = -frames["planes"][:, 0, 3:6]
    assert np.ptp((frames["position"][:, 0] * normal).sum(axis=1)) < 1e-4
    expected = frames["tilt_deg"]
    assert np.degrees(np.arctan2(normal[:, 0], normal[:, 2])) == pytest.approx(expected)
    assert frames["tilt_deg"][0] < 1.0
    assert frames["tilt_deg"][-1] > 16.0
    for keys, allowed in (
        ({"tilting_deg_s": 20.0, "steepest_deg": 5.0}, r"tilting_deg_s.*at most 10"),
    ):
        # The looks follow from the grain, which is made with the inputs.
        input_error(
            rf"inclined_plane\.{allowed}",
            PipelineConfig.of,
            config(**keys),
            check_inputs=True,
        )
    creeping = config()
    creeping["simulation"]["rolling_law"] = "constant_torque"
    input_error(r"simulation\.rolling_law.*lets it creep", PipelineConfig.of, creeping)
