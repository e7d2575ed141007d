"""The drum in steady turning: how a run is judged, the mean of the steady part, and beds with and without friction."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from goji import BERRY, PARTICLE, check_statuses, named, recommended

from repose.bench import Scene, bench, drum, turning
from repose.bench.settings import SceneSettings
from repose.calibrate.responses import name_derived_column
from repose.dem import Shape
from repose.measure import bed as measure_bed
from repose.measure.silhouette import Grains
from repose.stages.job import run_once

TEST = turning.TurningTest()
ROUGH = named((0.2, 0.6, 0.04, 0.25, 0.6, 0.2))
SMOOTH = ROUGH | {"mus_gg": 0.0, "mur_gg": 0.0, "mus_gp": 0.0, "mur_gp": 0.0}
SMALL = {
    "berries": 60,
    "length_mm": 60.0,
    "outer_diameter_mm": 120.0,
    "factory_height_mm": 20.0,
    "rate_per_s": 150.0,
    "rotate_from_s": 0.6,
    "measure_from_s": 1.2,
    "measure_until_s": 1.8,
}
config = partial(recommended, "turning")


def bed(angle_deg, count=400):
    rng = np.random.default_rng(4)
    places = rng.uniform(-0.08, 0.08, (8 * count, 3))
    below = places[:, 2] < np.tan(np.radians(angle_deg)) * places[:, 0]
    inside = np.hypot(places[:, 0], places[:, 2]) < 0.08
    return places[below & inside][:count], rng.normal(size=(count, 4))


def measured(arrays, status="ok", settings=None):
    return TEST.measure(
        {"status": status}, arrays, Scene.of(settings or config(), {}, BERRY, PARTICLE)
    )


def test_the_angle_of_a_turning_drum_is_the_mean_of_its_frames():
    position, quaternion = zip(bed(20.0), bed(30.0), strict=True)
    position = np.array(position, np.float32)
    quaternion = np.array(quaternion, np.float32)
    arrays = {"position": position, "quaternion": quaternion, "scale": np.ones(400)}
    single = []
    for k in (0, 1):
        frame = {"position": position[[k]], "quaternion": quaternion[[k]]}
        single.append(measured(arrays | frame)["turning_deg"])
    assert single == pytest.approx([20.0, 30.0], abs=3.0)
    assert measured(arrays)["turning_deg"] == pytest.approx(np.mean(single), abs=1e-12)
    assert measured(arrays, "lost")["turning_deg"] is None
    assert TEST.response_of_name("turning_2_deg").label == "drum, turning, speed 2"
    # the surface of so coarse a picture is not found
    coarse = measured(arrays, settings=config() | {"measure": {"mm_per_pixel": 60.0}})
    assert coarse["status"] == "no_surface"
    assert coarse["turning_deg"] is None
    assert "60 mm per pixel" in coarse["reason"]


def test_a_profile_lies_where_a_bed_covers_enough_of_a_column():
    """Rows 80 to 90 of 1 mm are covered by a third, those below wholly; the third column is empty."""
    occupied = np.zeros((100, 100))
    occupied[80:] = 1 / 3
    occupied[90:] = 1.0
    occupied[:, 70:] = 0.0
    x_m = np.array([-0.02, 0.0, 0.03])
    for covered, rows in ((0.3, 19.6), (2 / 3, 10.0)):
        heights = measure_bed.surface_heights(occupied, covered, x_m, 0.05, 1.0)
        assert heights[:2] == pytest.approx(1e-3 * rows - 0.05, abs=1e-4)
        assert heights[2] == pytest.approx(-0.04, abs=1e-3)


def inclined(angle_deg, seed, count=10_000, radius_m=1e-3):
    """Centres of spheres, as dense as they please, in a layer that they fill up to a line of known angle."""
    rng = np.random.default_rng(seed)
    slope = np.tan(np.radians(angle_deg))
    x, y, depth = rng.uniform((-0.06, -0.01, 0.0), (0.06, 0.01, radius_m), (count, 3)).T
    return np.column_stack(
        [x, y, slope * x - (radius_m + depth) * np.hypot(1.0, slope)]
    )


@pytest.mark.parametrize("angle_deg", [0.0, -40.0])
def test_the_profile_of_a_flat_bed_is_straight_within_a_tenth_of_a_grain(angle_deg):
    grain = Shape.sphere(1e-3, 1500.0, "grain")
    x = np.linspace(-0.05, 0.05, 26)
    centres = np.array([inclined(angle_deg, seed) for seed in range(3)])
    turns = np.broadcast_to((1.0, 0.0, 0.0, 0.0), (*centres.shape[1:2], 4))
    occupied = measure_bed.occupied_share(
        [Grains(frame, turns, grain) for frame in centres], 0.095, 0.1
    )
    heights = measure_bed.surface_heights(occupied, 0.5, x, 0.095, 0.1)
    assert np.abs(heights - np.tan(np.radians(angle_deg)) * x).max() < 0.1 * 2e-3


def profile_target(name, slope):
    """A target of the configuration as it stands there for the first score of a profile."""
    x = list(range(-40, 41, 10))
    kept = {
        "name": name,
        "x": x,
        "z": [slope * distance for distance in x],
        "functions": 2,
        "covered": 0.5,
    }
    return {
        "response": name_derived_column(name, "2"),
        "apparatus": "turning",
        "profile": kept,
    }


def test_speeds_have_their_angles_and_profiles():
    frames = [bed(angle) for angle in (20.0, 30.0, 40.0)]
    position = np.array([frame[0] for frame in frames], np.float32)
    quaternion = np.array([frame[1] for frame in frames], np.float32)
    arrays = {"position": position, "quaternion": quaternion, "scale": np.ones(400)}
    names = ("turning_profile_mm", "turning_2_profile_mm")
    both = config(angular_velocity_rad_s=[0.8, 1.6]) | {
        "targets": [profile_target(name, 0.5) for name in names]
    }
    found = measured(arrays | {"speed": np.array([0, 1, 1])}, settings=both)
    for drum_name, k in (("turning", slice(0, 1)), ("turning_2", slice(1, 3))):
        name = f"{drum_name}_deg"
        score = f"{drum_name}_profile_2_mm"
        part = {
            "position": position[k],
            "quaternion": quaternion[k],
            "scale": np.ones(400),
        }
        once = measured(
            part,
            settings=config()
            | {"targets": [profile_target("turning_profile_mm", 0.5)]},
        )
        assert found[name] == once["turning_deg"]
        assert found[score] == once["turning_profile_2_mm"]
    lost = measured(arrays, "lost", both)
    assert {
        lost[name] for name in ("turning_deg", "turning_2_deg", "turning_profile_2_mm")
    } == {None}


def test_speeds_have_their_times():
    configuration = config(measure_from_s=2.5)
    assert TEST.section(SceneSettings(configuration)).list_speeds() == [(0.8, 2.5, 8.5)]
    two = config(
        angular_velocity_rad_s=[0.8, 1.6],
        measure_from_s=[2.0, 1.0],
        measure_until_s=3.0,
    )
    assert TEST.section(SceneSettings(two)).list_speeds() == [
        (0.8, 2.0, 3.0),
        (1.6, 1.0, 3.0),
    ]
    assert bench("turning").duration_s(SceneSettings(two)) == pytest.approx(2.5 + 6.0)
    three = config(measure_from_s=[1.0, 2.0, 3.0])
    assert [key for key, _ in TEST.contradictions(SceneSettings(three))] == [
        "turning.measure_from_s"
    ]


def test_a_run_is_judged():
    configuration = config(measure_from_s=2.5)
    settings = SceneSettings(configuration)
    held = drum.DrumOutcome(all_inside=True)
    assert TEST.status_of(held, settings) == ("ok", "")
    check_statuses(
        TEST,
        configuration,
        held,
        [
            ("unstable", {"unstable": "why"}),
            ("lost", {"all_inside": False}),
            ("lost", {"n_unplaced": 3}),
        ],
    )
    outside = TEST.status_of(replace(held, all_inside=False), settings)
    assert outside.reason == "a grain is outside the drum"
    unplaced = TEST.status_of(replace(held, n_unplaced=3), settings)
    n_grains = TEST.section(settings).berries
    expected = f"3 of {n_grains} grains found no place in the drum before it turned"
    assert unplaced.reason == expected


def test_a_drum_goes_on_from_its_first_speed():
    short = SMALL | {"measure_from_s": 0.2, "measure_until_s": 0.4, "record_s": 0.1}

    def ran(settings, values):
        return TEST.run(Scene.of(settings, values, BERRY, PARTICLE, 1))

    once = ran(config(**short), ROUGH)
    twice = ran(config(**short, angular_velocity_rad_s=[0.8, 3.2]), ROUGH)
    assert once.record["status"] == "ok"
    assert twice.record["status"] == "ok"
    assert "speed" not in once.arrays
    expected = [0] * len(once.arrays["time_s"]) + [1] * len(once.arrays["time_s"])
    assert twice.arrays["speed"].tolist() == expected
    np.testing.assert_array_equal(
        twice.arrays["position"][: len(once.arrays["time_s"])], once.arrays["position"]
    )
    faster = np.abs(np.diff(twice.arrays["position"], axis=0)).mean(axis=(1, 2))
    assert faster[-1] > 1.5 * faster[0]


def test_friction_lifts_the_bed():
    scenes = (
        Scene.of(config(**SMALL), wall, BERRY, PARTICLE, 1) for wall in (ROUGH, SMOOTH)
    )
    rough, level = (run_once(bench("turning"), scene)[0] for scene in scenes)
    assert rough["status"] == "ok"
    assert level["status"] == "ok"
    assert abs(level["turning_deg"]) < 8.0  # a surface of 60 berries is lumpy
    assert rough["turning_deg"] > 15.0


def test_tilting_lowers_an_end():
    def ran(settings, values):
        return TEST.run(Scene.of(settings, values, BERRY, PARTICLE, 1))

    tilted = config(**SMALL, tilt_deg=20.0)
    simulation = TEST.build(Scene.of(tilted, SMOOTH, BERRY, PARTICLE))
    simulation.add("berry", (0.0, 0.0, 0.0))
    simulation.run(0.05, progress=False)
    fall = 9.81 * simulation.time_s
    lean = np.radians(20.0)
    expected = [0.0, fall * np.sin(lean), -fall * np.cos(lean)]
    assert simulation.velocities[0] == pytest.approx(expected, abs=1e-9)
    level = ran(config(**SMALL, tilt_deg=0.0), SMOOTH)
    leaning = ran(tilted, SMOOTH)
    assert level.record["status"] == "ok"
    assert leaning.record["status"] == "ok"
    across = [run.arrays["position"][..., 1].mean() for run in (level, leaning)]
    # of a liquid of the bed's depth h in a drum of length L the centre lies tan(20) L^2 / (12 h) off, some 5 mm
    assert abs(across[0]) < 2e-3
    assert 3e-3 < across[1] < 8e-3
