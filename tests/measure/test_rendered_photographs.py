"""The sheet, the camera and the pile in photographs whose scene is known."""

import math
from pathlib import Path

import cv2
import draw_piles
import numpy as np
import pytest
import thirty
from rendered import Scene
from thirty import BAD, SMALL, measured

from repose.cli import main
from repose.measure.photographs import camera, finding, sheet
from repose.measure.photographs import photograph as photographs
from repose.measure.photographs.perspective import Viewpoint, remove_perspective
from repose.measure.photographs.segmentation import Segmentation
from repose.measure.settings import MeasureSettings


def test_the_sheet_is_printed_in_its_size_and_found_by_its_corners(tmp_path):
    per_mm = 8
    picture = sheet.draw_sheet(20.0, per_mm)
    seen = sheet.find_sheet(
        cv2.copyMakeBorder(picture, 50, 50, 50, 50, cv2.BORDER_CONSTANT, value=200)
    )
    assert len(seen.positions_mm) == (sheet.COLUMNS - 1) * (sheet.ROWS - 1)
    x, z = seen.positions_mm.T
    drawn = np.column_stack([50 + x * per_mm, 50 + picture.shape[0] - z * per_mm]) - 0.5
    assert np.abs(seen.pixels - drawn).max() < 0.5
    assert main(["marker", "--out", str(tmp_path / "sheet.pdf")]) == 0
    content = (tmp_path / "sheet.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    width, height = (
        float(number)
        for number in content.split(b"/MediaBox [ 0 0 ")[1].split(b"]")[0].split()
    )
    assert width == pytest.approx(210 / 25.4 * 72, abs=0.01)
    assert height == pytest.approx(297 / 25.4 * 72, abs=0.01)
    assert sheet.compute_size_mm(20.0) == (140.0, 180.0)


def test_the_photographs_of_the_tutorial_show_the_simulated_grains():
    seed = draw_piles.FIRST_SEED
    positions = np.array([[0.0, 0.0, 0.02], [0.03, 0.0, 0.004], [0.2, 0.0, 0.004]])
    arrays = {
        f"position_{seed}": positions,
        f"quaternion_{seed}": np.eye(3, 4),
        f"in_pile_{seed}": np.array([True, True, False]),
    }
    shown = draw_piles.scene("pea", arrays, number=1)
    centres, quaternions, sizes = shown.grains
    assert centres == pytest.approx(1e3 * positions[:2])
    assert quaternions == pytest.approx(np.eye(3, 4)[:2])
    assert sizes.tolist() == [1.0, 1.0]
    # There are no loose grains beside them.
    assert len(shown.loose_grains[0]) == 0


def test_the_piles_of_the_tutorial_are_poured_in_silence(tmp_path, monkeypatch, capsys):
    """The file of the pour lies in a folder that is removed, so its path is no use."""
    (tmp_path / "config.yaml").write_text("label: pea\n")

    def pour(arguments):
        folder = Path(arguments[-1])
        (folder / "heap.pours.json").write_text('{"pours": []}')
        np.savez(folder / "heap.npz", position_2001=np.zeros((1, 3)))
        print(folder / "heap.pours.json")
        return 0

    monkeypatch.setattr(draw_piles, "repose", pour)
    record, arrays = draw_piles.pour(tmp_path / "config.yaml", count=1)
    assert record == {"pours": []}
    assert list(arrays) == ["position_2001"]
    assert capsys.readouterr().out == ""


def views_of(lens, count, rng):
    """The corners of the sheet as a known camera shows them, in all parts of its picture."""
    matrix = np.array([[1300.0, 0, 799.5], [0, 1300, 599.5], [0, 0, 1]])
    places = np.array(
        [(x, z) for x in np.arange(20, 130, 20.0) for z in np.arange(20, 180, 20.0)]
    )
    flat = np.column_stack(
        [places[:, 0] - 70, 90 - places[:, 1], np.zeros(len(places))]
    )
    seen = []
    for _ in range(count):
        turn = rng.uniform(-0.4, 0.4, 3)
        shift = np.array([*rng.uniform(-150, 150, 2), rng.uniform(400, 600)])
        pixels = cv2.projectPoints(
            flat, turn, shift, matrix, np.array([*lens, 0, 0, 0.0])
        )[0][:, 0]
        seen.append(
            sheet.SheetCorners(places, pixels + rng.normal(0, 0.1, pixels.shape))
        )
    return seen


def test_the_lens_and_the_angle_of_a_cone_seen_from_above():
    found = camera.calibrate_camera(
        views_of((-0.12, 0.03), 8, np.random.default_rng(1)), (1600, 1200)
    )
    assert found.note == ""
    assert found.matrix[0, 0] == pytest.approx(1300, rel=0.003)
    away = np.array([0.2, 0.4, 0.55]) ** 2
    assert found.distortion[0] * away + found.distortion[1] * away**2 == pytest.approx(
        -0.12 * away + 0.03 * away**2, abs=0.002
    )
    places = views_of((0, 0), 1, np.random.default_rng(1))[0].positions_mm
    pixels = (
        700
        + 2.0 * places * [1, -1]
        + np.random.default_rng(2).normal(0, 0.1, places.shape)
    )
    found = camera.calibrate_camera(
        [sheet.SheetCorners(places, pixels)], (1600, 1200), 1111.0
    )
    assert (
        "focal length as the camera states it: the sheet is seen in too few places"
        in found.note
    )
    assert found.matrix[0, 0] == 1111.0
    assert not found.distortion.any()


@pytest.mark.parametrize(("above", "lost"), [(-20.0, 0.8), (0.0, 0.2), (60.0, 0.4)])
def test_a_cone_seen_from_above_or_below_gets_its_angle_and_its_foot_back(above, lost):
    """The slow twin: the outline of a cone as the hull of its apex and its rim, seen from a point.

    From below, the rim lies under the row of the plate, so the foot loses a little.
    """
    height = 60.0
    slope = math.radians(31.0)
    eye = np.array([0.0, -500.0, 60.0 + above])
    turn = np.linspace(0, 2 * np.pi, 100001)
    radius = height / math.tan(slope)
    rim = radius * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    share = eye[1] / (eye[1] - rim[:, 1])  # where the ray meets y = 0
    seen = eye[[0, 2]] + share[:, None] * (rim[:, [0, 2]] - eye[[0, 2]])
    px = 0.1
    base = 700.5
    axis = 1500.0
    corners = np.concatenate([[[0, height]], seen])
    hull = cv2.convexHull((16 * (corners / [px, -px] + [axis, base])).astype(np.int32))
    mask = np.zeros((702, 3001), np.uint8)
    cv2.fillPoly(mask, [hull], 1, shift=4)
    mask[701:] = 0
    pile = Segmentation(
        255 * mask, mask.astype(np.float32), 0.5, mask, base, is_darker=False
    )
    photograph = photographs.Photograph(
        Path(), mask, pile, geometry={"mm_per_pixel": px}
    )
    settings = MeasureSettings.with_defaults(berry_height_mm=6.0)
    flat = photographs._measure_found_pile(photograph, settings)
    assert (flat.aor_deg < 30.9) == (above != 0)
    photograph.view, photograph.pile = remove_perspective(
        photograph.view,
        pile,
        Viewpoint(axis, 500 / px, eye[2] / px),
        (flat.angle.left_deg, flat.angle.right_deg),
        height / px,
    )
    level = photographs._measure_found_pile(photograph, settings)
    assert [level.angle.left_deg, level.angle.right_deg] == pytest.approx(
        [31.0, 31.0], abs=0.1
    )
    assert level.height_mm == pytest.approx(height, abs=px)
    columns = np.flatnonzero(photograph.pile.mask.any(axis=0)) - axis
    expected = [radius, radius]
    assert [-columns[0] * px, columns[-1] * px] == pytest.approx(expected, abs=lost)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        *BAD,
        ({"rotation": (0.0, 0.0, 40.0)}, "tilted by 40 degrees"),
        ({"rotation": (0.0, 0.0, 180.0)}, "upside down"),
        ({"with_sheet": False}, "the printed sheet is not seen"),
        ({"with_pile": False}, "nothing that stands on the plate"),
    ],
)
def test_what_cannot_be_measured_is_refused_with_its_reason(tmp_path, change, reason):
    photograph = measured(tmp_path, Scene(**SMALL | change))
    assert photograph.measurement is None
    assert reason in photograph.all_rejection_reasons[0]


def test_what_floats_over_the_plate_or_in_a_deep_shadow_is_left_out(tmp_path):
    light = measured(tmp_path, Scene(**SMALL | {"shadow": 0.0})).measurement
    deep = measured(tmp_path, Scene(**SMALL | {"shadow": 0.7})).measurement
    assert deep.height_mm == pytest.approx(light.height_mm, abs=0.1)
    assert deep.aor_deg == pytest.approx(light.aor_deg, abs=0.5)
    assert light.is_darker  # yellow peas before a white wall
    mask = np.zeros((100, 400), np.uint8)
    cv2.fillPoly(mask, [np.array([(100, 99), (200, 10), (300, 99)])], 1)
    pile = mask.copy()
    cv2.circle(mask, (105, 60), 12, 1, -1)  # behind the pile, on the plate
    assert np.array_equal(
        finding._keep_largest_part(finding._remove_floating_parts(mask, 6)), pile
    )
    cv2.circle(pile, (320, 88), 12, 1, -1)  # at the foot
    left = finding._keep_largest_part(finding._remove_grains_at_foot(pile, 7))
    assert left[:, 316:].sum() == 0
    assert left[:, :290].sum() == pile[:, :290].sum()
    # a post that hides what is behind it, and a speck of its shape
    mask[5:35, 20:24] = 1
    mask[40:52, 360:364] = 1
    standing, posts = finding._find_pile_and_objects(mask)
    assert standing[:, 100:301].sum() == standing.sum()
    assert posts[:, :30].sum() == 120
    assert posts[:, 30:].sum() == 0


@pytest.mark.slow
def test_all_thirty(tmp_path):
    found = thirty.report(0, thirty.errors(tmp_path))
    assert len(found) >= 26
    assert abs(found[:, 0].mean()) < 0.3
    assert abs(found[:, 1].mean()) < 0.5
    assert np.abs(found[:, 0]).max() < 1.5
