"""The drop test: a stiff sphere returns the restitution that was asked; known flights; how a run is judged."""

import math
from functools import partial

import numpy as np
import pytest
from goji import BEAD, PARTICLE, SPHERE, example, named
from refusals import input_error
from shared import says

from repose.bench import Scene, bench, drop_test
from repose.bench.scene import longest_time_step
from repose.calibrate.runs import describe_run
from repose.stages.job import run_once

TEST = drop_test.DropTest()
STIFF = BEAD | {"shear_modulus_pa": 1e10}
config = partial(example, "drop_test", time_step_s=2.5e-4)


def dropped(
    e_wall, e_berry=0.5, particle=SPHERE, berry=STIFF, step_share=0.25, seed=1, **keys
):
    settings = config(**keys)
    values = named((e_berry, 0.5, 0.1, e_wall, 0.5, 0.1))
    longest = longest_time_step(Scene.of(settings, values, berry, particle))
    settings["simulation"]["time_step_s"] = step_share * longest.time_step_s
    return run_once(
        bench("drop_test"), Scene.of(settings, values, berry, particle, seed)
    )


@pytest.mark.parametrize(
    ("asked", "surface"),
    [
        (0.2, "wall"),
        pytest.param(0.5, "wall", marks=pytest.mark.slow),
        (0.9, "wall"),
        (0.7, "berry"),
    ],
)
def test_a_stiff_sphere_returns_what_was_asked_of_either_plate(asked, surface):
    of_wall, of_berry = (asked, 0.5) if surface == "wall" else (0.2, asked)
    found, _ = dropped(of_wall, of_berry, height_mm=100.0, surface=surface)
    assert found["height_restitution"] == pytest.approx(asked, abs=0.002)
    assert found["sound_restitution"] == pytest.approx(asked, abs=0.002)


def test_the_longest_time_step_is_allowed_and_no_longer_one():
    found, _ = dropped(0.5, height_mm=100.0, step_share=1.0)
    assert found["height_restitution"] == pytest.approx(0.5, abs=0.05)
    input_error("simulation.time_step_s", dropped, 0.5, step_share=1.0001)


def test_a_flight_of_known_height_and_duration():
    """The grain leaves the floor at 0.5 g T and has fallen from 50 mm."""
    time_s = np.linspace(0.0, 0.1, 201)
    heights = 0.005 + 0.5 * 9.81 * time_s * (0.1 - time_s)
    arrays = {"time_s": time_s, "height_m": heights, "drop_m": np.array([0.05])}
    found = TEST.measure(
        {"status": "ok"}, arrays, Scene.of(config(), {}, STIFF, SPHERE)
    )
    asked = 0.5 * 9.81 * 0.1 / math.sqrt(2.0 * 9.81 * 0.05)
    assert found["height_restitution"] == pytest.approx(asked, rel=1e-6)
    assert found["sound_restitution"] == pytest.approx(asked, rel=1e-6)
    assert found["rebound_height_mm"] == pytest.approx(1e3 * 9.81 * 0.1**2 / 8)
    failed = TEST.measure(
        {"status": "no_rebound"}, arrays, Scene.of(config(), {}, STIFF, SPHERE)
    )
    assert failed["height_restitution"] is None


def test_a_long_berry_loses_height_to_its_rotation():
    soft = STIFF | {"shear_modulus_pa": 1e6}
    options = {"particle": PARTICLE, "berry": soft, "step_share": 0.5}
    fall = partial(dropped, 0.8, height_mm=50.0, **options)
    falls = [fall(seed=seed) for seed in (1, 2, 3)]
    found = [record["height_restitution"] for record, _ in falls]
    assert max(found) < 0.8
    assert np.ptp(found) > 0.02
    again, _ = fall(seed=3)
    assert again == falls[2][0]


def test_a_hit_of_a_soft_grain_notes_its_overlap():
    stiff, _ = dropped(0.5, height_mm=20.0, berry=STIFF | {"shear_modulus_pa": 1e6})
    assert "overlap_share" not in stiff
    soft, _ = dropped(0.5, height_mm=20.0, berry=STIFF | {"shear_modulus_pa": 1e4})
    assert stiff["status"] == "ok"
    assert soft["status"] == "ok"
    # Hertz: m v^2 / 2 = 8/15 E* sqrt(R) overlap^2.5; damping lessens it
    speed_squared = 2.0 * 9.81 * 0.02
    modulus_pa = 2e4 / (1.0 - BEAD["poisson_ratio"])
    stiffness = 16.0 / 15.0 * modulus_pa * math.sqrt(5e-3)
    elastic_m = (SPHERE.mass_kg * speed_squared / stiffness) ** 0.4
    assert 0.6 * elastic_m / 0.01 < soft["overlap_share"] < 1.05 * elastic_m / 0.01
    line = describe_run(soft, TEST.summary)
    says(line, "WARNING: bodies overlap by up to", "berry.shear_modulus_pa")
    assert "WARNING" not in describe_run(stiff, TEST.summary)


@pytest.mark.parametrize("orientation", ["lying", "upright"])
def test_a_grain_that_loses_nothing_is_a_good_run(orientation):
    """It lands lower than it left, or is heard a time step later: up to some percent above 1."""
    for seed in (1, 2, 3):
        record, _ = dropped(
            1.0,
            particle=PARTICLE,
            berry=STIFF | {"shear_modulus_pa": 1e6},
            step_share=0.5,
            seed=seed,
            orientation=orientation,
            height_mm=50.0,
        )
        assert record["status"] == "ok"
        assert 0.5 < record["sound_restitution"] < 1.1


STICKY = {
    # laws of two random pours, which share their kernels
    "eepa": {"contact_law": "eepa", "rolling_law": "constant_torque"},
    "jkr": {"contact_law": "jkr"},
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [pytest.param("eepa", marks=pytest.mark.essential), "jkr"]
)
def test_a_berry_that_sticks_is_no_rebound_and_is_not_looked_at_in_every_step(
    law, monkeypatch
):
    looks = []
    check_contact = drop_test._GrainTracker.check_contact
    monkeypatch.setattr(
        drop_test._GrainTracker,
        "check_contact",
        lambda self: looks.append(1) or check_contact(self),
    )
    monkeypatch.setattr(drop_test, "DENSE_STEPS", 100)
    settings = config(height_mm=20.0)
    settings["simulation"] |= STICKY[law] | {"time_step_s": 1e-5}
    values = named((0.5, 0.5, 0.1, 0.05, 0.5, 0.1))
    values |= {"gamma_gg": 0.0, "gamma_gp": 5.0}
    if law == "eepa":
        values |= {"plas_gg": 0.5, "plas_gp": 0.5}
    record, _ = run_once(
        bench("drop_test"),
        Scene.of(settings, values, STIFF | {"shear_modulus_pa": 1e6}, SPHERE, 1),
    )
    assert record["status"] == "no_rebound"
    assert record["height_restitution"] is None
    assert 100 * np.log(1000) < len(looks) < 1000  # 100,000 time steps touch the plate
