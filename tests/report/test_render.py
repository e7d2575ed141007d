"""The software renderer: known outlines, what hides what, shadows, the funnel, memory, animations."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from refusals import input_error

from repose.bench.funnel import Funnel
from repose.dem.rotations import rotation_matrices
from repose.dem.tessellation import tessellate
from repose.grain import build
from repose.report.renderer import film, raster, render, shading
from repose.report.renderer.scenery import (
    Frustum,
    find_frame_points,
    look_at,
    make_funnel_walls,
)

UPRIGHT = np.array([[1.0, 0.0, 0.0, 0.0]])
HEAP = Funnel(0.15, 0.032, 60.0, 0.02, 0.001, 0.1)


def particle_of(semi_axes_mm):
    axes = np.array(semi_axes_mm) * 1e-3
    return build.Particle(
        "test", axes, 840.0, 0.0, 0.0, np.zeros(3), axes.sum(axis=0).max(), 0.0, 0.0
    )


BERRY = particle_of([[10.57, 5.685, 4.94]])
BARREL = particle_of([[7.399, 0.940, 0.940], [3.171, 4.745, 4.000]])
BALL = particle_of([[6.0, 6.0, 6.0]])


SIZE = ("elevation_deg", "azimuth_deg", "width", "height")


def render_pile(*bodies, **view):
    """Three arguments of bodies, then `SIZE`; red, which nothing else in a picture is."""
    size = dict(zip(SIZE, bodies[3:], strict=False))
    return render.render_pile(*bodies[:3], **{"colour": "#c2200b"} | size | view)


def reddish(picture):
    """Mask of the pixels that show a berry."""
    picture = picture.astype(int)
    return picture[..., 0] > picture[..., 2] + 40


@pytest.mark.parametrize("particle", [BERRY, BARREL])
def test_tessellation_lies_on_the_body_with_its_normals(particle):
    points, normals, triangles = tessellate(particle)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    expected = particle.support(normals)
    np.testing.assert_allclose(np.sum(points * normals, axis=1), expected, atol=1e-12)
    # Each point is the farthest of the body in its own direction.
    assert (points @ normals.T <= particle.support(normals)[None] + 1e-12).all()
    a, b, c = points[triangles].transpose(1, 0, 2)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume > 0  # seen from outside, corners run anticlockwise
    if len(particle.semi_axes_m) == 1:
        expected = 4 / 3 * np.pi * np.prod(particle.semi_axes_m)
        assert volume == pytest.approx(expected, rel=0.02)


def test_the_camera_holds_all_points_and_fills_the_picture():
    points = np.random.default_rng(0).uniform(
        [-0.1, -0.1, 0], [0.1, 0.1, 0.06], (200, 3)
    )
    camera = look_at(points, 600, 400, elevation_deg=20, azimuth_deg=35, margin=1.0)
    x, y, near = camera.project(points)
    assert (near > 0).all()
    assert -0.5 <= x.min() < x.max() - 500 <= 100.5
    assert -0.5 <= y.min() <= y.max() <= 400.5
    column, row, _ = camera.project(camera.eye_m + 0.7 * camera.rays()[123, 456])
    assert column == pytest.approx(456.5)
    assert row == pytest.approx(123.5)


def test_the_kernels_have_the_places_of_the_camera():
    camera = look_at(np.eye(3), 60, 40, elevation_deg=20, azimuth_deg=35)
    place = np.empty(3)
    raster.write_point(
        (camera.eye_m, camera.axes, camera.focal_px),
        (camera.height, camera.width),
        7,
        31,
        0.7,
        place,
    )
    np.testing.assert_allclose(place, camera.eye_m + 0.7 * camera.rays()[7, 31])
    light = shading._compute_light_axes(camera)
    np.testing.assert_allclose(light @ light.T, np.eye(3), atol=1e-12)


def test_a_quaternion_turns_about_its_axis():
    half = np.sqrt(0.5)
    about_z = rotation_matrices(np.array([[half, 0, 0, half], [2.0, 0, 0, 0]]))
    np.testing.assert_allclose(about_z[0] @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(about_z[1], np.eye(3), atol=1e-12)


@pytest.mark.parametrize("multiple", [1, 2, 7])
def test_bands_hold_each_row_once(multiple):
    camera = look_at(np.eye(3), 5000, 210)
    bands = [np.arange(210)[rows] for rows in camera.bands(multiple)]
    np.testing.assert_array_equal(np.concatenate(bands), np.arange(210))
    assert len(bands) > 10
    assert all(len(band) % multiple == 0 for band in bands)
    np.testing.assert_array_equal(
        np.concatenate([camera.rays(rows) for rows in camera.bands()]), camera.rays()
    )


def test_a_ball_is_seen_in_perspective():
    """A ball of radius r at distance d is seen under asin(r / d), whatever the body's orientation."""
    # A ball of radius r at distance d is seen under asin(r / d), whatever the body's orientation.
    centre = np.array([[0.0, 0.0, 0.02]])
    frame = np.array([[-0.02, -0.02, 0.0], [0.02, 0.02, 0.04]])
    camera = look_at(frame, 400, 400, elevation_deg=0, azimuth_deg=0)
    picture = render_pile(centre, UPRIGHT, BALL, 0, 0, 400, 400, frame_m=frame)
    radius_px = camera.focal_px * np.tan(
        np.arcsin(0.006 / np.linalg.norm(camera.eye_m - centre[0]))
    )
    assert np.sqrt(reddish(picture).sum() / np.pi) == pytest.approx(radius_px, rel=0.02)


def test_a_body_has_its_colour():
    centre = np.array([[0.0, 0.0, 0.006]])
    frame = np.array([[-0.01, -0.01, 0.0], [0.01, 0.01, 0.012]])
    for colour, strongest in (("#20c020", 1), ("#2020c0", 2)):
        picture = render_pile(
            centre, UPRIGHT, BALL, 0, 0, 60, 60, frame_m=frame, colour=colour
        )
        assert picture[25:35, 25:35].reshape(-1, 3).mean(axis=0).argmax() == strongest


def test_a_long_axis_is_seen_as_long():
    half = np.sqrt(0.5)
    frame = np.array([[-0.015, -0.015, 0.0], [0.015, 0.015, 0.03]])
    for quaternion, width_mm in (([1.0, 0, 0, 0], 5.685), ([half, 0, 0, half], 10.57)):
        picture = render_pile(
            np.array([[0, 0, 0.015]]),
            np.array([quaternion]),
            BERRY,
            0,
            0,
            300,
            300,
            frame_m=frame,
        )
        width = reddish(picture).any(axis=0).sum()
        height = reddish(picture).any(axis=1).sum()
        assert width / height == pytest.approx(width_mm / 4.94, rel=0.05)


def test_the_nearer_body_hides_the_farther():
    centres = np.array([[0.03, 0.0, 0.006], [-0.03, 0.0, 0.006]])
    turns = np.repeat(UPRIGHT, 2, axis=0)
    both = render_pile(centres, turns, BALL, 0, 0, 300, 180)
    frame = find_frame_points(centres, BALL.bounding_radius_m, [])
    ghost = np.where([[False], [True]], np.nan, centres)
    expected = reddish(
        render_pile(ghost, turns, BALL, 0, 0, 300, 180, frame_m=frame)
    ).sum()
    assert reddish(both).sum() == expected


def test_a_body_behind_the_camera_is_not_seen():
    frame = np.array([[-0.02, -0.02, 0.0], [0.02, 0.02, 0.02]])
    eye = look_at(frame, 120, 80, elevation_deg=14, azimuth_deg=0).eye_m
    behind = np.array([[2 * eye[0], 0.0, 2 * eye[2]]])
    bare = render_pile(
        np.full((1, 3), np.nan), UPRIGHT, BALL, 14, 0, 120, 80, frame_m=frame
    )
    shown = render_pile(behind, UPRIGHT, BALL, 14, 0, 120, 80, frame_m=frame)
    assert not reddish(shown).any()
    assert np.abs(shown.astype(int) - bare).max() < 10


def test_the_plate_has_shadows():
    frame = np.array([[-0.04, -0.04, 0.0], [0.04, 0.04, 0.02]])
    centres = np.array([[[np.nan] * 3], [[0.0, 0.0, 0.006]]])
    seen = (
        render_pile(centre, UPRIGHT, BALL, 30, 0, 240, 160, frame_m=frame)
        for centre in centres
    )
    bare, shown = (picture.astype(int) for picture in seen)
    darker = (bare - shown).sum(axis=-1) * ~reddish(shown)
    assert (darker > 60).sum() > 50
    assert (darker[:20] == 0).all()
    assert not reddish(bare).any()


def test_walls_are_seen_as_glass():
    centre = np.array([[0.0, 0.0, 0.03]])
    frame = np.array([[-0.04, -0.04, 0.0], [0.04, 0.04, 0.08]])
    scenes = ([], [Frustum(0.0, 0.03, 0.06, 0.03)])
    seen = (
        render_pile(centre, UPRIGHT, BALL, 5, 0, 200, 200, walls=walls, frame_m=frame)
        for walls in scenes
    )
    bare, dressed = seen
    assert (bare != dressed).any(axis=-1).sum() > 5000
    # The berry behind the glass is still seen, a little paler.
    middle = tuple(np.argwhere(reddish(bare)).mean(axis=0).astype(int))
    assert reddish(dressed)[middle]
    assert not np.array_equal(dressed[middle], bare[middle])


def test_the_same_input_gives_the_same_picture():
    rng = np.random.default_rng(5)
    centres = rng.uniform([-0.03, -0.03, 0.01], [0.03, 0.03, 0.07], (30, 3))
    turns = rng.normal(size=(30, 4))
    first = render_pile(centres, turns, BARREL, width=120)
    assert first.shape == (72, 120, 3)
    assert first.dtype == np.uint8
    np.testing.assert_array_equal(first, render_pile(centres, turns, BARREL, width=120))


def test_the_walls_of_a_funnel_are_drawn_where_they_are():
    tube, cone = make_funnel_walls(HEAP)
    assert tube.z_low_m == pytest.approx(0.1)
    assert tube.z_high_m == pytest.approx(0.12)
    assert tube.r_low_m == tube.r_high_m == 0.016
    assert cone.r_high_m == pytest.approx(0.075)
    assert cone.z_low_m == pytest.approx(0.12)
    slope = (cone.z_high_m - cone.z_low_m) / (cone.r_high_m - cone.r_low_m)
    assert np.degrees(np.arctan(slope)) == pytest.approx(60)
    assert abs(cone.r_low_m - 0.016) < 0.001
    assert len(make_funnel_walls(replace(HEAP, tube_length_m=0.0))) == 1


@pytest.mark.slow
def test_a_large_picture_takes_few_bytes_for_each_ray():
    rng = np.random.default_rng(5)
    centres = rng.uniform(-0.03, 0.03, (200, 3))
    turns = rng.normal(size=(200, 4))
    frame = np.array([[-0.015, -0.015, -0.01], [0.015, 0.015, 0.02]])
    # compiles, which takes memory of its own
    render_pile(centres, turns, BERRY, 14, 0, 60, 60, frame_m=frame)
    tracemalloc.start()
    walls = [Frustum(-0.01, 0.01, 0.02, 0.012)]
    picture = render_pile(
        centres, turns, BERRY, 14, 0, 700, 700, walls=walls, frame_m=frame
    )
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert reddish(picture).mean() > 0.9
    assert peak < 80 * (2 * 700) ** 2


@pytest.fixture(scope="module")
def trajectory(tmp_path_factory):
    position = np.full((6, 3, 3), np.nan, np.float32)
    for k in range(6):
        for berry in range(min(3, k + 1)):
            position[k, berry] = (
                0.02 * berry - 0.02,
                0.0,
                max(0.006, 0.08 - 0.02 * (k - berry)),
            )
    path = tmp_path_factory.mktemp("pour") / "trajectory.npz"
    quaternion = np.tile(np.float32([1, 0, 0, 0]), (6, 3, 1))
    np.savez(
        path, time_s=np.linspace(0, 0.5, 6), position=position, quaternion=quaternion
    )
    return path


@pytest.mark.parametrize("ending", ["gif", "webp"])
def test_animation_has_its_frames_and_its_size(
    trajectory, tmp_path, monkeypatch, ending
):
    out = tmp_path / f"pour.{ending}"
    film.animate_pour(
        trajectory, BALL, out, make_funnel_walls(HEAP), frames=6, width=80, height=100
    )
    with Image.open(out) as shown:
        assert shown.n_frames == 6
        assert shown.size == (80, 100)
        assert shown.info["loop"] == 0
    monkeypatch.setattr(film, "MAX_BYTES", 200)
    input_error(
        "max_bytes",
        film.animate_pour,
        trajectory,
        BALL,
        out,
        frames=2,
        width=80,
        height=100,
    )
    input_error(
        r"\.gif or \.webp", film.animate_pour, trajectory, BALL, tmp_path / "pour.mp4"
    )
