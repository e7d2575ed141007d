"""The drum: its walls, the measurement on beds of known angle and motion, and a small drum that turns."""

import dataclasses
import json
import math
from functools import partial

import numpy as np
import pytest
from goji import BERRY, PARTICLE, named, recommended
from PIL import Image
from refusals import input_error, value_error

from repose.bench import Scene, bench, drum
from repose.bench.settings import SceneSettings
from repose.measure import bed
from repose.measure.silhouette import Grains
from repose.report.renderer import film
from repose.stages import drum_tables
from repose.stages.job import measure_job, run_job

TEST = drum.DrumTest()
REPRESENTATIVE = named((0.203, 0.642, 0.037, 0.244, 0.483, 0.185))
RADIUS_M = 0.095
SMALL = {
    "berries": 60,
    "length_mm": 60.0,
    "outer_diameter_mm": 120.0,
    "factory_height_mm": 20.0,
    "rate_per_s": 150.0,
    "rotate_from_s": 1.4,
    "report_s": 2.0,
    "longest_rotation_s": 1.0,
}
config = partial(recommended, "drum")


def half_filled(angle_deg, count=1500, seed=4):
    rng = np.random.default_rng(seed)
    places = rng.uniform(-1, 1, (12 * count, 3)) * (RADIUS_M, 0.15, RADIUS_M)
    slope = math.tan(math.radians(angle_deg))
    inside = (
        np.hypot(places[:, 0], places[:, 2]) < RADIUS_M - PARTICLE.bounding_radius_m
    )
    places = places[inside & (places[:, 2] < slope * places[:, 0] - 0.02)][:count]
    return places, rng.normal(size=(len(places), 4))


def surface(centres, quaternions, mm_per_pixel=0.25):
    filled = bed.side_view(
        Grains(centres, quaternions, PARTICLE), RADIUS_M, mm_per_pixel
    )
    return bed.surface_of(filled, RADIUS_M, mm_per_pixel, 0.6)


def turned(centres, angle_rad):
    cos = math.cos(angle_rad)
    sin = math.sin(angle_rad)
    x, y, z = centres.T
    return np.column_stack([cos * x - sin * z, y, sin * x + cos * z])


def test_the_drum_has_the_dimensions_asked_for():
    whole = drum.Drum.of(TEST.section(SceneSettings(config())))
    assert whole.radius_m == pytest.approx(0.095)
    assert whole.length_m == pytest.approx(0.34)
    walls = whole.walls("wall")
    assert tuple(walls) == drum.WALLS
    m_r, m_z, offset, first, last, *_ = walls["shell"].row()
    assert m_r == pytest.approx(1.0)
    assert m_z == pytest.approx(0.0)
    assert offset == pytest.approx(0.095)
    assert last - first == pytest.approx(0.34)
    assert walls["shell"].origin_m == pytest.approx((0.0, -0.17, 0.0))
    for name, sign in (("near_cap", -1), ("far_cap", 1)):
        assert walls[name].point_m == pytest.approx((0.0, 0.17 * sign, 0.0))
        assert walls[name].normal == pytest.approx((0.0, -sign, 0.0))


def test_berries_appear_clear_of_the_walls():
    whole = drum.Drum(0.095, 0.34)
    radius = PARTICLE.bounding_radius_m
    strip = whole.make_factory_area(0.04, radius)
    assert math.hypot(strip.half_x_m, strip.height_m) == pytest.approx(0.095 - radius)
    places = strip.points(np.random.default_rng(0).random((200, 2)))
    assert (np.hypot(places[:, 0], places[:, 2]) <= 0.095 - radius + 1e-12).all()
    assert np.abs(places[:, 1]).max() <= 0.17 - radius
    value_error(r"height_m is 0\.09", whole.make_factory_area, 0.09, radius)
    just_as_long = drum.Drum(0.095, 2.0 * radius)
    value_error("longer than a grain", just_as_long.make_factory_area, 0.0, radius)


@pytest.mark.parametrize("angle_deg", [0.0, 25.0, 45.0])
def test_the_surface_of_a_bed_of_known_angle(angle_deg):
    seen = [surface(*half_filled(angle_deg, seed=s)) for s in range(4)]
    assert np.mean([surface.angle_deg for surface in seen]) == pytest.approx(
        angle_deg, abs=1.0
    )
    expected = 0.6 * np.ptp(seen[0].profile_m[:, 0])
    assert np.ptp(seen[0].line_m[:, 0]) == pytest.approx(expected, abs=1e-3)
    x, z = seen[0].profile_m.T
    expected = z[np.abs(x - x.mean()) < 0.2 * np.ptp(x)].mean()
    assert seen[0].line_m[:, 1].mean() == pytest.approx(expected, abs=1e-3)


def test_the_edge_of_one_berry_is_its_outline():
    centres = np.array([[0.01, 0.0, -0.03]])
    flat = np.array([[1.0, 0.0, 0.0, 0.0]])
    edge = surface(centres, flat, 0.1).profile_m
    a = PARTICLE.support(np.eye(3)[0])
    c = PARTICLE.support(np.eye(3)[2])
    x = edge[:, 0] - 0.01
    inside = np.abs(x) < 0.8 * a
    expected = -0.03 + c * np.sqrt(1 - (x[inside] / a) ** 2)
    np.testing.assert_allclose(edge[inside, 1], expected, atol=1e-4)
    value_error("pixels wide", surface, np.zeros((0, 3)), np.zeros((0, 4)), 0.1)


def test_a_bed_that_is_carried_along_rests_in_the_drums_frame():
    centres, quaternions = half_filled(0.0, 200)
    carried = turned(centres, 0.4)
    np.testing.assert_allclose(bed.to_drum_frame(carried, 0.4), centres, atol=1e-15)
    expected = math.degrees(0.4)
    assert bed.bed_angle(carried) - bed.bed_angle(centres) == pytest.approx(expected)
    frame = np.array([0.0, -0.0873, 0.0])
    velocities = np.cross(frame, centres)
    spin = np.tile(frame, (len(centres), 1))
    state = Grains(centres, quaternions, PARTICLE), velocities, spin
    assert bed.relative_energy(*state, frame) == pytest.approx(0.0, abs=1e-30)
    still = 0.5 * PARTICLE.mass_kg * np.mean(np.sum(velocities**2, axis=1))
    assert still < bed.relative_energy(*state, np.zeros(3)) < 1.05 * still


def test_a_slip_has_its_beginning_and_end():
    angle = np.concatenate(
        [np.arange(0.0, 40.0), [40.5, 40.2, 40.4, 39.9, 39.4, 38.0, 36.0, 35.9, 35.9]]
    )
    energy = np.concatenate(
        [np.full(40, 1e-8), [1e-8, 1e-7, 1e-7, 1e-6, 1e-5, 1e-5, 1e-6, 1e-10, 1e-12]]
    )
    expected = bed.Slip(begins=40, detection=44, ends=47)
    assert bed.find_slip(angle, energy, 1.0, 1e-9) == expected
    expected = bed.Slip(begins=40, detection=46, ends=47)
    assert bed.find_slip(angle, energy, 4.0, 1e-9) == expected
    assert bed.find_slip(angle, energy, 5.0, 1e-9) is None
    assert bed.find_slip(angle, np.full(49, 1e-3), 1.0, 1e-9).ends == 48
    assert bed.find_slip([], [], 1.0, 1e-9) is None


def test_the_motion_of_a_slip_by_depth():
    """Grains less than 15 mm below a surface of 30 degrees move 20 mm down it."""
    nothing = np.full(3, np.nan)
    assert bed.depth_profile(nothing, nothing, 0.005).shape == (0, 4)
    slope = math.radians(30.0)
    turn_rad = math.radians(3.0)
    down = np.array([-math.cos(slope), 0.0, -math.sin(slope)])
    inward = np.array([math.sin(slope), 0, -math.cos(slope)])
    rng = np.random.default_rng(1)
    depth = rng.uniform(0, 0.04, 400)
    reach = rng.uniform(0.0, 0.05, 400)
    before = (
        depth[:, None] * inward
        - reach[:, None] * down
        + rng.uniform(-0.1, 0.1, (400, 1)) * [0, 1, 0]
    )
    after = turned(
        before + np.where(depth < 0.015, 0.02, 0.0)[:, None] * down, turn_rad
    )
    line = np.array([0.01 * -down[::2], 0.04 * -down[::2]])
    found, moved = bed.slip_displacement(
        before, after, turn_rad, bed.Surface(30.0, line, line)
    )
    measured = (reach > 0.01) & (reach < 0.04)
    np.testing.assert_array_equal(np.isfinite(found), measured)
    np.testing.assert_allclose(found[measured], depth[measured], atol=1e-12)
    profile = bed.depth_profile(found, moved, 0.005)
    np.testing.assert_allclose(profile[:, 0], np.arange(0.0025, 0.04, 0.005))
    expected = np.where(profile[:, 0] < 0.015, 0.02, 0.0)
    np.testing.assert_allclose(profile[:, 1], expected, atol=1e-12)
    assert profile[:, 3].sum() == measured.sum()
    expected = np.mean(depth[measured] < 0.015)
    assert bed.moved_share(moved, PARTICLE) == pytest.approx(expected)


@pytest.fixture(scope="module")
def small_rotation():
    return TEST.rotate(Scene.of(config(**SMALL), REPRESENTATIVE, BERRY, PARTICLE, 3))


def test_a_slip_without_a_surface_is_no_result(small_rotation, monkeypatch):
    slipped = dataclasses.replace(small_rotation, slip=bed.Slip(0, 0, 1))
    assert TEST.status_of(slipped, SceneSettings(config(**SMALL))) == ("ok", "")
    monkeypatch.setattr(drum.DrumTest, "rotate", lambda *_: slipped)
    run = TEST.run(Scene.of(config(**SMALL), REPRESENTATIVE, BERRY, PARTICLE, 3))
    scenes = (config(**SMALL), config(**SMALL) | {"measure": {"mm_per_pixel": 50.0}})
    measured = [
        TEST.measure(run.record, run.arrays, Scene.of(seen, {}, BERRY, PARTICLE))
        for seen in scenes
    ]
    assert [value["status"] for value in measured] == ["ok", "no_surface"]
    assert "50 mm per pixel (measure.mm_per_pixel)" in measured[1]["reason"]
    _, profile = TEST.measure_with_profile(
        run.record, run.arrays, Scene.of(scenes[0], {}, BERRY, PARTICLE)
    )
    # mm, middles of drum.depth_bin_mm
    np.testing.assert_allclose(profile[:2, 0], [2.5, 7.5])
    np.testing.assert_allclose(profile[0, 1], measured[0]["surface_moved_mm"])
    assert measured[1]["drum_slip_deg"] is None
    assert "before_surface_deg" not in measured[1]


def test_a_small_bed_turns_with_the_drum_whose_walls_hold_every_point(small_rotation):
    record = small_rotation.record
    whole = drum.Drum.of(TEST.section(SceneSettings(config(**SMALL))))
    assert (
        TEST.status_of(small_rotation, SceneSettings(config(**SMALL)))[0] == "no_slip"
    )
    assert small_rotation.rest_energy_j < 1e-9
    # ten intervals of whole steps
    assert record["time_s"][-1] == pytest.approx(1.0, abs=2e-3)
    expected = math.degrees(0.0873 * record["time_s"][-1])
    assert record["turned_deg"][-1] == pytest.approx(expected, rel=1e-6)
    assert record["bed_deg"][-1] - record["bed_deg"][0] == pytest.approx(
        record["turned_deg"][-1], abs=0.3
    )
    # against the drum berries hardly move, though the wall has gone 5 mm
    last = bed.to_drum_frame(small_rotation.centres_m[-1], 0.0873)
    assert np.median(np.linalg.norm(last - small_rotation.centres_m[0], axis=1)) < 2e-4
    assert whole.contains(small_rotation.centres_m[-1]).all()
    assert small_rotation.all_inside
    from repose.dem.rotations import rotation_matrices

    directions = np.random.default_rng(0).normal(size=(400, 3))
    surface = PARTICLE.support_point(
        directions / np.linalg.norm(directions, axis=1, keepdims=True)
    )
    turn = rotation_matrices(small_rotation.quaternions[-1])
    points = small_rotation.centres_m[-1][:, None, :] + np.einsum(
        "nij,mj->nmi", turn, surface
    )
    overlap = 3e-4
    assert np.hypot(points[..., 0], points[..., 2]).max() == pytest.approx(
        0.055, abs=overlap
    )
    assert np.abs(points[..., 1]).max() == pytest.approx(0.030, abs=overlap)


def test_a_job_writes_what_tables_and_film_read(tmp_path):
    keys = SMALL | {
        "slip_drop_deg": 0.05,
        "angular_velocity_rad_s": 1.0,
        "longest_rotation_s": 2.0,
        "settle_s": 1.0,
    }
    run = drum_tables.run_job(
        Scene.of(config(**keys), REPRESENTATIVE, BERRY, PARTICLE), [3], tmp_path
    )[0]["run"]
    kept = json.loads((tmp_path / "drum_3.json").read_text())["run"]
    assert kept == {key: run[key] for key in kept}
    assert not any("surface" in key for key in kept)
    # the job of all bench tests gives the same, and its responses
    pours = run_job(
        bench("drum"),
        Scene.of(config(**keys), REPRESENTATIVE, BERRY, PARTICLE),
        "004",
        [3],
        tmp_path,
    )
    job = measure_job(Scene.of(config(**keys), {}, BERRY, PARTICLE), pours)
    (measured,) = job["runs"]
    assert measured == run
    for name, state in (("slip", "before"), ("rest", "after")):
        assert measured[f"drum_{name}_deg"] == run[f"{state}_surface_deg"]
    assert job["apparatus"] == "drum"
    assert job["summary"]["drum_slip_deg"] == measured["drum_slip_deg"]
    assert run["status"] == "ok", run["reason"]
    assert run["after_time_s"] > run["before_time_s"] > 0
    tables = drum_tables.write_tables(
        [tmp_path / "drum_3.json"], config(**keys), PARTICLE, tmp_path
    )
    record = tables["record"].set_index("time_s")["surface_deg"]
    for state in drum.STATES:
        assert record[run[f"{state}_time_s"]] == run[f"{state}_surface_deg"]
    summary = tables["summary"].set_index("key")
    assert summary.loc["before_turned_deg", "mean"] == run["before_turned_deg"]
    assert np.isnan(summary.loc["before_turned_deg", "standard_error"])
    assert tables["profile"]["berries"].sum() > 20
    with np.load(tmp_path / "drum_3.npz") as arrays:
        for state in drum.STATES:
            assert arrays[f"position_{state}"].shape == (60, 3)
        with np.load(tmp_path / "median.npz") as median:
            np.testing.assert_array_equal(median["position"], arrays["position"])
    out = tmp_path / "drum.gif"
    section = drum.DrumSettings(**config(**keys)["drum"])
    film.animate_drum(
        tmp_path / "drum_3.npz", PARTICLE, out, section, frames=2, width=60
    )
    with Image.open(out) as shown:
        assert shown.n_frames == 2
        assert shown.size == (60, 60)


def saved(folder, seed, angle_deg, **record):
    centres, quaternions = half_filled(angle_deg, 300, seed)
    frames = {
        "position": np.array([centres] * 2),
        "quaternion": np.array([quaternions] * 2),
    }
    states = {
        f"{key}_{state}": frames[key][0]
        for key in frames
        for state in ("start", "report")
    }
    columns = {key: np.arange(2.0) for key in drum.RECORD_COLUMNS}
    np.savez(
        folder / f"drum_{seed}.npz", **frames, **states, **columns, scale=np.ones(300)
    )
    run = {"seed": seed, "status": "no_slip", "reason": ""} | record
    (folder / f"drum_{seed}.json").write_text(json.dumps({"run": run}))
    return folder / f"drum_{seed}.json"


def test_means_have_errors(tmp_path):
    paths = [
        saved(tmp_path, seed, 30.0, report_bed_deg=angle)
        for seed, angle in ((1, 40.0), (2, 44.0))
    ]
    whole = config()
    row = (
        drum_tables.write_tables(paths, whole, PARTICLE, tmp_path)["summary"]
        .set_index("key")
        .loc["report_bed_deg"]
    )
    assert row["mean"] == 42.0
    assert row["standard_error"] == 2.0
    assert row["runs"] == 2
    input_error(
        "each seed once",
        drum_tables.write_tables,
        [paths[0], paths[0]],
        whole,
        PARTICLE,
        tmp_path,
    )
    input_error(
        "repose stage drum",
        drum_tables.write_tables,
        [tmp_path / "nothing.json"],
        whole,
        PARTICLE,
        tmp_path,
    )


def test_a_changed_definition_measures_the_kept_frames(tmp_path):
    path = saved(tmp_path, 1, 30.0)
    wide = drum_tables.write_tables([path], config(fit_share=0.9), PARTICLE, tmp_path)
    narrow = drum_tables.write_tables([path], config(fit_share=0.5), PARTICLE, tmp_path)
    for tables in (wide, narrow):
        angle = tables["runs"].loc[0, "start_surface_deg"]
        assert angle == pytest.approx(30.0, abs=3.0)
        assert (tables["record"]["surface_deg"] == angle).all()
    assert (
        wide["runs"].loc[0, "start_surface_deg"]
        != narrow["runs"].loc[0, "start_surface_deg"]
    )
