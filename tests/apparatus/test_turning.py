"""The drum in steady turning: how a run is judged, the mean of the steady part, and beds with and without friction."""

from functools import partial

import numpy as np
import pytest
from goji import BERRY, PARTICLE, named, recommended

from repose.apparatus import bench, turning
from repose.apparatus.job import run_once

ROUGH = named((0.2, 0.6, 0.04, 0.25, 0.6, 0.2))
SMOOTH = ROUGH | {"mus_gg": 0.0, "mur_gg": 0.0, "mus_gp": 0.0, "mur_gp": 0.0}
SMALL = {"berries": 60, "length_mm": 60.0, "outer_diameter_mm": 120.0, "factory_height_mm": 20.0}
SMALL |= {"rate_per_s": 150.0, "rotate_from_s": 0.6, "measure_from_s": 1.2, "measure_until_s": 1.8}


config = partial(recommended, "turning")


def bed(angle_deg, count=400):
    """Centres and orientations of berries below a line of known angle through the axis."""
    rng = np.random.default_rng(4)
    places = rng.uniform(-0.08, 0.08, (8 * count, 3))
    below = places[:, 2] < np.tan(np.radians(angle_deg)) * places[:, 0]
    inside = np.hypot(places[:, 0], places[:, 2]) < 0.08
    return places[below & inside][:count], rng.normal(size=(count, 4))


def test_the_angle_is_the_mean_over_the_frames_that_were_kept():
    frames = [bed(angle) for angle in (20.0, 30.0)]
    position, quaternion = (np.array([frame[k] for frame in frames], np.float32) for k in (0, 1))
    arrays = {"position": position, "quaternion": quaternion, "scale": np.ones(400)}
    single = [
        turning.measure({"status": "ok"}, arrays | part, config(), PARTICLE, BERRY)["turning_deg"]
        for part in ({"position": position[[k]], "quaternion": quaternion[[k]]} for k in (0, 1))
    ]
    assert single == pytest.approx([20.0, 30.0], abs=3.0)
    both = turning.measure({"status": "ok"}, arrays, config(), PARTICLE, BERRY)
    assert both["turning_deg"] == pytest.approx(np.mean(single), abs=1e-12)
    assert turning.measure({"status": "lost"}, arrays, config(), PARTICLE, BERRY)["turning_deg"] is None
    coarse = turning.measure(
        {"status": "ok"}, arrays, config() | {"measure": {"mm_per_pixel": 60.0}}, PARTICLE, BERRY
    )
    assert (coarse["status"], coarse["turning_deg"]) == ("no_surface", None)
    assert "60 mm a pixel" in coarse["reason"]


def test_a_run_is_judged():
    assert turning.status_of(True) == ("ok", "")
    assert turning.status_of(True, "why") == ("unstable", "why")
    assert turning.status_of(False)[0] == "lost"


def test_friction_lifts_the_bed_and_without_it_the_bed_stays_level():
    rough, level = (
        run_once(bench("turning"), config(**SMALL), wall, 1, PARTICLE, BERRY)[0] for wall in (ROUGH, SMOOTH)
    )
    assert (rough["status"], level["status"]) == ("ok", "ok")
    assert abs(level["turning_deg"]) < 8.0  # a surface of 60 berries is lumpy
    assert rough["turning_deg"] > 15.0
