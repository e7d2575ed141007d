"""Photographs of a drum, a box and a lifted cylinder's pile: drawn so that the answer is known."""

import json
import math
import re

import cv2
import numpy as np
import pandas as pd
import pytest
import yaml
from goji import example, recommended
from refusals import input_error

from repose.bench import drawdown, photographs
from repose.bench.drum import Drum
from repose.bench.settings import SceneSettings
from repose.bench.turning import TurningSettings
from repose.common.files import write_image
from repose.config.pipeline import PipelineConfig
from repose.dem import Shape
from repose.measure import bed
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains

# BGR
BED = (40, 60, 190)
EMPTY = (200, 205, 210)
RIM = (60, 60, 60)
WALL = (150, 140, 90)
HOW = MeasureSettings.with_defaults(berry_height_mm=2.0)


def noisy(picture):
    light = np.linspace(1.0, 0.85, picture.shape[1])[None, :, None]
    noise = np.random.default_rng(1).normal(0.0, 4.0, picture.shape)
    return np.clip(picture * light + noise, 0, 255).astype(np.uint8)


def grains(angle_deg, radius_m, count=60_000, seed=3):
    """Centres and turns of grains of 1 mm that fill a drum to 0.9 of its radius below a line of known angle."""
    x, y, z = np.random.default_rng(seed).uniform(
        -0.9 * radius_m, 0.9 * radius_m, (3, count)
    )
    inside = (np.hypot(x, z) < 0.9 * radius_m) & (
        z < math.tan(math.radians(angle_deg)) * x
    )
    centres = np.column_stack([x, y, z])[inside]
    return centres, np.tile([1.0, 0.0, 0.0, 0.0], (len(centres), 1))


def drum_picture(filled, radius_px=420, size=(1200, 1500), centre=(730, 610)):
    """A drum of a dark rim before a wall, the bed in it, and three points of its inner rim."""
    picture = np.full((*size, 3), WALL, np.uint8)
    cv2.circle(picture, centre, radius_px + 25, RIM, cv2.FILLED)
    cv2.circle(picture, centre, radius_px, EMPTY, cv2.FILLED)
    mask = cv2.resize(
        filled.astype(np.uint8),
        (2 * radius_px, 2 * radius_px),
        interpolation=cv2.INTER_AREA,
    )
    rows, columns = np.nonzero(mask)
    picture[rows + centre[1] - radius_px, columns + centre[0] - radius_px] = BED
    at = np.radians([20.0, 130.0, 255.0])
    points = (
        np.column_stack(
            [centre[0] + radius_px * np.cos(at), centre[1] - radius_px * np.sin(at)]
        )
        - 0.5
    )
    return noisy(picture), points.ravel().tolist()


@pytest.fixture(scope="module")
def simulated_drum():
    """A drum's section and radius [m], a pixel [mm], and a bed's surface and occupied share."""
    section = SceneSettings(recommended("turning")).section("turning", TurningSettings)
    radius_m = Drum.of(section).radius_m
    frame = Grains(*grains(31.0, radius_m), Shape.sphere(1e-3, 1500.0, "grain"))
    pixel = 2e3 * radius_m / 840
    view = bed.side_view(frame, radius_m, pixel)
    true = bed.surface_of(view, radius_m, pixel, section.fit_share)
    return section, radius_m, pixel, true, bed.occupied_share([frame], radius_m, pixel)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_drum_gives_the_angle_and_the_surface_of_the_simulation(
    tmp_path, simulated_drum, mirrored
):
    section, radius_m, pixel, true, occupied = simulated_drum
    picture, points = drum_picture(occupied > 0.5)
    if mirrored:
        picture = np.ascontiguousarray(picture[:, ::-1])
        points[::2] = [picture.shape[1] - 1 - x for x in points[::2]]
    write_image(tmp_path / "drum.png", picture)
    (seen,) = photographs.measure_all(
        [tmp_path / "drum.png"],
        points,
        SceneSettings(recommended("turning")),
        "turning",
        HOW,
    )
    assert not seen.refused
    assert seen.values["turning_deg"] == pytest.approx(true.angle_deg, abs=0.15)
    surface = photographs.find_median_profile([seen], section)
    expected = np.linspace(-800.0, 800.0, 33) * radius_m  # the middle 80 %
    np.testing.assert_allclose(surface["x_mm"], expected, atol=1e-3)
    middle = surface[surface["x_mm"].abs() < 0.6e3 * radius_m]
    heights = 1e3 * bed.surface_heights(
        occupied, 0.5, 1e-3 * middle["x_mm"], radius_m, pixel
    )
    assert np.abs(middle["z_mm"] - heights).max() < 2.5 * pixel


def box_picture(
    section, above_deg, below_deg, level_deg=0.0, scale=0.4, size=(1000, 1400)
):
    """A box with two wedges above and a pile below, and its lower inner corners; `scale` in mm a pixel."""
    box = drawdown.Box.of(drawdown.DrawdownSettings(**section))
    picture = np.full((*size, 3), EMPTY, np.uint8)
    middle = np.array([700.0, 850.0])
    floor = 1e3 / scale

    def draw(corners, colour):
        corners = np.array(corners) * [floor, -floor] + middle
        cv2.fillPoly(
            picture, [np.round(corners * 16).astype(np.int32)], colour, cv2.LINE_AA, 4
        )

    slot = box.half_slot
    half = box.half_width
    lower = box.half_lower_width
    t = box.thickness
    high = math.tan(math.radians(above_deg)) * (half - slot)
    for side in (-1, 1):
        for x, z in (
            ((lower, lower + t), (-t, box.gate_height)),
            ((half, half + t), (box.gate_height, box.top_height)),
        ):
            draw(
                [
                    (side * x[0], z[0]),
                    (side * x[1], z[0]),
                    (side * x[1], z[1]),
                    (side * x[0], z[1]),
                ],
                WALL,
            )
        corners = [
            (slot, box.gate_height),
            (half + t, box.gate_height),
            (half + t, box.floor_height),
            (slot, box.floor_height),
        ]
        draw([(side * x, z) for x, z in corners], WALL)
        wedge = [
            (slot, box.floor_height),
            (half, box.floor_height),
            (half, box.floor_height + high),
        ]
        draw([(side * x, z) for x, z in wedge], BED)
    draw([(-lower - t, 0.0), (lower + t, 0.0), (lower + t, -t), (-lower - t, -t)], WALL)
    foot = 0.7 * lower
    draw(
        [(-foot, 0.0), (foot, 0.0), (0.0, math.tan(math.radians(below_deg)) * foot)],
        BED,
    )
    turn = cv2.getRotationMatrix2D((700, 500), level_deg, 1.0)
    picture = cv2.warpAffine(picture, turn, size[::-1], borderMode=cv2.BORDER_REPLICATE)
    corners = np.array([[-lower, 0.0], [lower, 0.0]]) * [floor, -floor] + middle
    corners = np.column_stack([corners, np.ones(2)]) @ turn.T
    return noisy(picture), corners.ravel().tolist()


@pytest.mark.parametrize("level_deg", [0.0, 3.0])
def test_a_box_gives_both_slopes(tmp_path, level_deg):
    config = example("drawdown")
    picture, corners = box_picture(config["drawdown"], 33.0, 24.0, level_deg)
    write_image(tmp_path / "box.png", picture)
    (seen,) = photographs.measure_all(
        [tmp_path / "box.png"], corners, SceneSettings(config), "drawdown", HOW
    )
    assert not seen.refused
    assert seen.values["drawdown_above_deg"] == pytest.approx(33.0, abs=0.5)
    assert seen.values["drawdown_below_deg"] == pytest.approx(24.0, abs=0.5)


def test_what_cannot_be_measured_is_refused(tmp_path):
    config = recommended("turning")
    file = tmp_path / "drum.png"
    write_image(file, np.full((1200, 1500, 3), EMPTY, np.uint8))
    inside = [1150.0, 610.0, 730.0, 190.0, 310.0, 610.0]
    cases = [
        (inside, "nothing in the picture differs"),
        ([*inside[:4], 1000.0, 1190.0], "runs out of the picture"),
        ([730.0, 610.0, 785.0, 610.0, 757.0, 662.0], "pixels wide"),
    ]
    for points, message in cases:
        (seen,) = photographs.measure_all(
            [file], points, SceneSettings(config), "turning", HOW
        )
        assert message in seen.refused, points
    rim = "three points of the drum's inner rim"
    cases = [
        (inside[:4], rim),
        ([*inside[:5], math.nan], rim),
        ([0, 0, 100, 0, 200, 0], "not on a line"),
    ]
    for points, message in [*cases, ([0, 0, 10, 0, 0, 10], "at least 50 pixels apart")]:
        input_error(
            message,
            photographs.measure_all,
            [file],
            points,
            SceneSettings(config),
            "turning",
            HOW,
        )
    box = [file], [900, 0, 100, 0], SceneSettings(example("drawdown")), "drawdown", HOW
    input_error(
        "left and of the right lower inner corner", photographs.measure_all, *box
    )


def test_the_targets_are_those_of_the_bench_test(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    config = example("drawdown")
    (tmp_path / "mine.json").write_text(json.dumps(config))
    for k, angle in enumerate((32.0, 33.0, 34.0)):
        picture, corners = box_picture(config["drawdown"], angle, 24.0)
        write_image(f"box{k}.png", picture)
    points = [f"{value:.2f}" for value in corners]
    arguments = [
        "measure",
        *(f"box{k}.png" for k in range(3)),
        "--bench",
        "drawdown",
        "--config",
        "mine.json",
    ]
    assert "--points" in command(*arguments, "--out", "measured", status=2).err
    command(*arguments, "--points", *points, "--out", "measured")
    text = (tmp_path / "measured/targets.yaml").read_text()
    targets = yaml.safe_load(text)["targets"]
    assert [target["response"] for target in targets] == [
        "drawdown_above_deg",
        "drawdown_below_deg",
    ]
    assert {target["apparatus"] for target in targets} == {"drawdown"}
    assert targets[0]["value"] == pytest.approx(33.0, abs=0.5)
    assert targets[0]["sd"] == pytest.approx(1.0, abs=0.2)
    assert len(pd.read_csv(tmp_path / "measured/photographs.csv")) == 3
    assert PipelineConfig.of(config | {"targets": targets}).targets.names == (
        "drawdown_above_deg",
        "drawdown_below_deg",
    )
    wrong = {
        "--lens box0.png": "--lens is .*nothing with --bench drawdown",
        "--mm-per-pixel 0.2": "--mm-per-pixel is 0.2; expected nothing with",
    }
    call = [*arguments, "--points", *points, "--out", "other"]
    for more, message in wrong.items():
        assert re.search(message, command(*call, *more.split(), status=2).err)
    # a configuration without the section of the bench test
    del config["drawdown"]
    (tmp_path / "without.json").write_text(json.dumps(config))
    without = [word.replace("mine.json", "without.json") for word in call]
    assert "Traceback" not in command(*without, status=2).err
    allowed = "one of funnel, lifted_cylinder, turning, drawdown"
    assert allowed in command("measure", "box0.png", "--bench", "hopper", status=2).err
