"""Saved pours measured: nothing is poured here."""

import copy
import json
import math

import cv2
import numpy as np
import pytest
from refusals import input_error, not_refused
from shared import ROOT, check_all, target
from test_simulated_piles import BERRY as PARTICLE
from test_simulated_piles import cone_of_berries

from repose.bench import Scene, funnel
from repose.bench.parameters import PARAMETERS
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.grain.build import ellipsoid_mesh, fit_particle
from repose.measure import further_responses, pile, saved_piles, saved_pours
from repose.measure.angles import DEFINITIONS, MEAN_KEYS, VIEW_KEYS
from repose.stages.job import measure_job

CONFIG = PipelineConfig.load(ROOT / "config/quick.yaml").config
AXES = {"long_mm": 21.14, "major_mm": 11.37, "minor_mm": 9.88}
BERRY_MM = math.prod(AXES.values()) ** (1 / 3)


def config(**keys):
    changed = copy.deepcopy(CONFIG)
    changed["measure"].update(keys)
    return changed


def one_pour(seed, status="ok", reason=""):
    return {
        "seed": seed,
        "status": status,
        "reason": reason,
        "discharge_s": 16.0,
        "berries_on_plate": 500,
    }


@pytest.fixture
def saved(tmp_path):
    """Two cones of berries of 30 degrees and a pour that jammed, as the verb pour leaves them."""
    arrays = {}
    for seed in (1, 2, 3):
        centres, q = cone_of_berries(30, np.random.default_rng(seed))
        arrays |= {
            f"position_{seed}": centres.astype(np.float32),
            f"quaternion_{seed}": q.astype(np.float32),
        }
        arrays[f"in_pile_{seed}"] = np.ones(len(centres), bool)
    np.savez(tmp_path / "007.npz", **arrays)
    job = {
        "sample": 7,
        "parameters": dict.fromkeys(PARAMETERS, 0.2),
        "time_step_s": 2e-4,
    }
    job["pours"] = [
        one_pour(1),
        one_pour(2),
        one_pour(3, "jammed", "9 berries in the funnel"),
    ]
    (tmp_path / "007.pours.json").write_text(json.dumps(job))
    return tmp_path / "007.pours.json"


def test_a_job_holds_every_response_of_every_run(saved):
    result = measure_job(Scene.of(config(response="flank"), {}, AXES, PARTICLE), saved)
    assert json.loads(saved.with_name("007.json").read_text()) == result
    assert result["sample"] == 7
    assert result["time_step_s"] == 2e-4
    assert "pours" not in result
    first, second, jammed = result["runs"]
    for run in (first, second):
        assert set(funnel.BASIC_NUMBERS) <= set(run)
        assert run["aor_deg"] == run["aor_flank_deg"] == pytest.approx(30, abs=4)
        assert run["height_view_mm"] == pytest.approx(run["height_mm"], abs=0.5)
        assert run["discharge_s"] == 16.0
        assert 0 <= run["doubtful_views"] <= run["measured_views"] <= 18
    assert jammed["status"] == "jammed"
    assert jammed["reason"] == "9 berries in the funnel"
    expected = [None] * len(funnel.BASIC_NUMBERS)
    assert [jammed[key] for key in funnel.BASIC_NUMBERS] == expected
    summary = result["summary"]
    for key in ("aor_secant_deg", "aor_steepest_view_deg", "height_view_mm"):
        mean = (first[key] + second[key]) / 2
        half = abs(first[key] - second[key]) / 2
        name, unit = key.rsplit("_", 1)
        assert summary[key] == pytest.approx(mean)
        assert summary[f"{name}_se_{unit}"] == pytest.approx(half)


@pytest.mark.parametrize("name", DEFINITIONS)
def test_another_response_measures_the_same_piles_again(saved, name):
    before = measure_job(Scene.of(config(), {}, AXES, PARTICLE), saved)["runs"][0]
    after = measure_job(Scene.of(config(response=name), {}, AXES, PARTICLE), saved)[
        "runs"
    ][0]
    assert after["aor_deg"] == before[MEAN_KEYS[name]]
    # The sides of a view are those of the response's line.
    of_response = ("aor_deg", "measured_views", "doubtful_views")
    expected = {k: v for k, v in before.items() if k not in of_response}
    assert {k: v for k, v in after.items() if k not in of_response} == expected


def test_a_definition_may_fail_where_it_is_not_the_response(saved):
    # the cone is some 55 mm high: berry to 60 % is too thin a band for half
    tall = {"berry_height_mm": 30.0}
    keys = {"fit_from": "berry", "fit_to": 0.6, **tall}
    kept = measure_job(
        Scene.of(config(response="secant", **keys), {}, AXES, PARTICLE), saved
    )["runs"][0]
    assert kept["status"] == "ok"
    assert kept["aor_steepest_deg"] is None
    assert kept["aor_steepest_view_deg"] is None
    assert kept["aor_deg"] == kept["aor_secant_deg"]
    failed = measure_job(
        Scene.of(config(response="steepest", **keys), {}, AXES, PARTICLE), saved
    )
    run = failed["runs"][0]
    assert run["status"] == "no_flank"
    assert run["aor_deg"] is None
    assert "12 are needed" in run["reason"]
    assert run["aor_secant_deg"] == kept["aor_secant_deg"]
    assert failed["summary"]["status"] == "no_flank"


def test_a_layer_fails_where_the_angle_is_a_target(saved):
    path = saved.with_name("007.npz")
    arrays = dict(np.load(path))
    arrays["position_1"][:, 2] = 0.005  # a layer and no pile
    np.savez(path, **arrays)
    flat = measure_job(Scene.of(targeted("aor_deg"), {}, AXES, PARTICLE), saved)[
        "runs"
    ][0]
    assert flat["status"] == "no_flank"
    assert flat["aor_deg"] is None
    assert "mm high" in flat["reason"]
    timed = measure_job(Scene.of(targeted("discharge_s"), {}, AXES, PARTICLE), saved)[
        "runs"
    ][0]
    assert timed["status"] == "ok"
    assert timed["aor_deg"] is None
    assert timed["discharge_s"] == 16.0


FURTHER = (
    "radius_90_mm",
    "base_radius_mm",
    "packing_percent",
    "loose_percent",
    "lower_deg",
    "upper_deg",
)


def targeted(*names):
    return config() | {"targets": [target(name, 1, 1, 0, 2, 1) for name in names]}


def test_further_responses_are_measured_where_they_are_targets(saved):
    whole_berry = fit_particle(
        ellipsoid_mesh([0.95 * axis for axis in AXES.values()]), 840.0
    )
    without = measure_job(Scene.of(config(), {}, AXES, whole_berry), saved)
    assert not set(FURTHER) & set(without["runs"][0])
    assert not set(FURTHER) & set(without["summary"])
    whole = targeted("aor_deg", "height_mm", *FURTHER, "discharge_s")
    result = measure_job(Scene.of(whole, {}, AXES, whole_berry), saved)
    settings = pile.MeasureSettings.with_defaults(**whole["measure"]).for_grain(AXES)
    plate = whole["funnel"]["plate_diameter_mm"]
    poured = saved_pours.read_first_pour(saved.with_name("007.npz"))
    expected = further_responses.measure_pour(poured, whole_berry, settings, plate)
    first, _, jammed = result["runs"]
    assert {name: first[name] for name in FURTHER} == {
        name: expected[name] for name in FURTHER
    }
    assert [jammed[name] for name in FURTHER] == [None] * len(FURTHER)
    for name in ("packing_percent", "discharge_s"):
        unit = name.rsplit("_", 1)
        assert result["summary"][f"{unit[0]}_se_{unit[1]}"] is not None
    assert {key: first[key] for key in without["runs"][0]} == without["runs"][0]


@pytest.mark.parametrize("fit_from", [0.1, "berry"])
def test_a_picture_of_a_simulated_pile_is_measured_as_its_first_view(
    saved, tmp_path, fit_from
):
    settings = pile.MeasureSettings.with_defaults(
        **config(fit_from=fit_from)["measure"]
    ).for_grain(AXES)
    assert settings.berry_height_mm == pytest.approx(BERRY_MM)
    poured = saved_pours.read_first_pour(saved.with_name("007.npz"))
    run = funnel.FunnelTest().measure(
        one_pour(1), poured, Scene.of(config(fit_from=fit_from), {}, AXES, PARTICLE)
    )
    view = saved_piles.draw_side_view(poured, PARTICLE, settings)
    cv2.imwrite(
        str(tmp_path / "photo.png"),
        np.vstack([view, np.full((30, view.shape[1]), view.min(), np.uint8)]),
    )
    seen = pile.measure_image(
        pile.read_image(tmp_path / "photo.png"), settings.mm_per_pixel, settings
    )
    assert seen.height_mm == pytest.approx(run["height_view_mm"], abs=1e-9)
    for name in DEFINITIONS:
        assert seen.angles[name].aor_deg == pytest.approx(
            run[VIEW_KEYS[name]], abs=1e-9
        ), name


def test_the_lines_of_the_overlay_are_those_of_the_response_and_a_given_height_of_the_berry_wins(
    saved,
):
    assert (
        pile.MeasureSettings.with_defaults(**config(berry_height_mm=20.0)["measure"])
        .for_grain(AXES)
        .berry_height_mm
        == 20.0
    )
    assert (
        pile.MeasureSettings.with_defaults(**config()["measure"])
        .for_grain({})
        .berry_height_mm
        is None
    )
    poured = saved_pours.read_first_pour(saved.with_name("007.npz"))
    lines = set()
    for name in DEFINITIONS:
        settings = pile.MeasureSettings.with_defaults(
            **config(response=name)["measure"]
        ).for_grain(AXES)
        seen = pile.measure_image(
            saved_piles.draw_side_view(poured, PARTICLE, settings), 0.25, settings
        ).angle
        lines.add(seen.lines)
        for line, sign, angle in zip(
            seen.lines, (1, -1), (seen.left_deg, seen.right_deg), strict=True
        ):
            (u0, row0), (u1, row1) = line
            assert math.degrees(
                math.atan2(row0 - row1, sign * (u1 - u0))
            ) == pytest.approx(angle)
    assert len(lines) == len(DEFINITIONS)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("008.pours.json", None, "008.pours.json: file is "),
        ("007.json", "{}", "007.json: file name is .007.json"),
        ("009.pours.json", '{"pours": []}', r"009.pours.json: pours is \[\]"),
        (
            "009.pours.json",
            '{"pours": [{"seed": 1, "status": "fine"}]}',
            "status is 'fine'",
        ),
        (
            "009.pours.json",
            '{"pours": [{"seed": 1, "status": "ok"}]}',
            r"009.npz: arrays",
        ),
        ("007.pours.json", '{"pours": [{"seed": 4, "status": "ok"}]}', "position_4"),
    ],
)
def test_files_that_are_no_pours_are_named(saved, name, content, message):
    path = saved.with_name(name)
    if content is not None:
        path.write_text(content)
    input_error(message, measure_job, Scene.of(config(), {}, AXES, PARTICLE), path)


def of_grains(name, change):
    return (
        f"{name}_1",
        lambda arrays: arrays | {f"{name}_1": change(arrays[f"{name}_1"])},
    )


IMPOSSIBLE = (
    (
        *of_grains(
            "position",
            lambda values: np.where(
                np.arange(len(values))[:, None] == 3, np.nan, values
            ),
        ),
        "finite",
    ),
    (
        *of_grains("position", lambda values: values[:10]),
        "for as many grains as in the other arrays",
    ),
    (*of_grains("position", lambda values: values[:, :2]), r"numbers \(\d+, 3\)"),
    (*of_grains("position", lambda values: values.astype(str)), "numbers"),
    (*of_grains("quaternion", np.zeros_like), "a rotation of each grain"),
    (*of_grains("in_pile", lambda values: values[:-1]), "for as many grains"),
    (
        "scale_1",
        lambda arrays: arrays | {"scale_1": np.full(len(arrays["in_pile_1"]), -1.0)},
        "sizes above 0",
    ),
    (
        "position_1 in mm",
        lambda arrays: arrays | {"position_1": 1e6 * arrays["position_1"]},
        "positions are in m",
    ),
)


def test_impossible_records_are_refused(saved):
    job = json.loads(saved.read_text())

    def change(**keys):
        saved.write_text(
            json.dumps(job | {"pours": [job["pours"][0] | keys, *job["pours"][1:]]})
        )

    def measure(keys):
        change(**keys)
        measure_job(Scene.of(config(), {}, AXES, PARTICLE), saved)

    cases = [
        (
            {"discharge_s": "long"},
            "discharge_s is 'long'; expected a finite number, or null",
        ),
        ({"discharge_s": math.nan}, "discharge_s is nan"),
        ({"reason": 3}, "reason is 3; expected text"),
        ({"seed": 2}, "each seed once"),
    ]
    assert not_refused(measure, cases, InputError) == []
    del job["pours"][2]["reason"]
    measure({})


def test_arrays_of_a_spoiled_run_are_not_read_and_impossible_ones_refused(saved):
    path = saved.with_name("007.npz")
    whole = dict(np.load(path))
    # the run that jammed
    np.savez(path, **whole | {"position_3": np.nan * whole["position_3"]})
    measure_job(Scene.of(config(), {}, AXES, PARTICLE), saved)

    def check(change, message):
        np.savez(path, **change(whole))
        input_error(message, measure_job, Scene.of(config(), {}, AXES, PARTICLE), saved)

    check_all(check, IMPOSSIBLE)
