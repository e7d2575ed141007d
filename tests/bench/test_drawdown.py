"""The drawdown box: wedges of known slope, how a run is judged, conserved mass, and the angles above and below."""

import math
from functools import partial

import numpy as np
import pytest
import trimesh
from goji import BEAD, SPHERE, check_statuses, example, named

from repose.bench import Scene, bench, drawdown
from repose.bench.settings import SceneSettings
from repose.stages.job import run_once

BOX = drawdown.DrawdownTest()
SET = named((0.3, 0.4, 0.05, 0.3, 0.4, 0.05))
SMALL = {
    "berries": 550,
    "rate_per_s": 600.0,
    "open_from_s": 1.5,
    "longest_s": 4.0,
    "width_mm": 160.0,
    "depth_mm": 60.0,
    "height_mm": 140.0,
    "slot_mm": 60.0,
    "lower_width_mm": 360.0,
    "drop_mm": 120.0,
}
GOOD = drawdown.DrainedBox(
    n_filled=600, n_early=0, all_inside=True, n_over_slot=0, energy_j=1e-12
)
config = partial(example, "drawdown")


def test_a_run_of_a_box_is_judged_and_both_of_its_slopes_are_measured():
    cases = [
        ("ok", {}),
        ("unstable", {"unstable": "why"}),
        ("not_filled", {"n_filled": 599}),
        ("lost", {"n_early": 1}),
        ("lost", {"all_inside": False}),
        ("not_at_rest", {"energy_j": 1e-6}),
        ("not_at_rest", {"energy_j": math.nan}),
        ("jammed", {"n_over_slot": 1}),
    ]
    check_statuses(BOX, config(), GOOD, cases)
    arrays = slopes(33.0, 24.0)
    berry = BEAD | {"long_mm": 1.0, "major_mm": 1.0, "minor_mm": 1.0}
    found = BOX.measure({"status": "ok"}, arrays, Scene.of(config(), {}, berry, SPHERE))
    assert found["drawdown_above_deg"] == pytest.approx(33.0, abs=0.5)
    assert found["drawdown_below_deg"] == pytest.approx(24.0, abs=0.5)
    below = int(arrays["in_pile"].sum())
    # 0.1^3 kg are g
    assert found["drawdown_mass_g"] == pytest.approx(below * SPHERE.mass_kg)
    few = SMALL | {
        "berries": 12,
        "rate_per_s": 200.0,
        "open_from_s": 0.4,
        "longest_s": 1.0,
    }
    settings = config(**few)
    # tests/dem has the kernels of this law and of meshes; the slow tests have the study's
    settings["simulation"]["contact_law"] = "hertz_mindlin"
    record, run = run_once(bench("drawdown"), Scene.of(settings, SET, BEAD, SPHERE, 1))
    assert record["status"] in ("ok", "no_flank"), record["reason"]
    assert np.isfinite(run.arrays["exit_s"]).any()


def slopes(above_deg, below_deg):
    """Centres of small spheres that fill two wedges above and a pile below, of these slopes, 0.5 mm apart."""
    box = drawdown.Box.of(BOX.section(SceneSettings(config())))
    x, z = np.meshgrid(
        np.arange(-0.13, 0.13, 5e-4), np.arange(5e-4, 0.1, 5e-4), indexing="ij"
    )
    x = x.ravel()
    z = z.ravel()
    beyond_slot = np.abs(x) - box.half_slot
    wedge = (beyond_slot > 0) & (z < math.tan(math.radians(above_deg)) * beyond_slot)
    pile = z < 0.04 - math.tan(math.radians(below_deg)) * np.abs(x)
    xs = np.concatenate([x[wedge], x[pile]])
    zs = np.concatenate([z[wedge] + box.floor_height, z[pile]])
    stays = np.arange(len(xs)) < wedge.sum()
    return {
        "position": np.column_stack([xs, np.zeros_like(xs), zs]),
        "quaternion": np.tile([1.0, 0.0, 0.0, 0.0], (len(xs), 1)),
        "scale": np.full(len(xs), 0.1),
        "exit_s": np.where(stays, np.nan, np.linspace(0.0, 2.0, len(xs))),
        "in_pile": ~stays,
    }


def test_the_blocks_of_a_box_are_closed_and_as_large_as_their_corners_say():
    box = drawdown.Box.of(BOX.section(SceneSettings(config())))
    blocks = [wall for wall in box.walls(1e-3, 0.1).values() if hasattr(wall, "faces")]
    assert len(blocks) == 5
    for block in blocks:
        solid = trimesh.Trimesh(block.vertices_m, block.faces)
        assert solid.is_watertight
        assert solid.volume == pytest.approx(np.ptp(block.vertices_m, axis=0).prod())


@pytest.mark.slow
def test_mass_is_conserved_and_the_slope_above_is_the_steeper():
    runs = [
        run_once(bench("drawdown"), Scene.of(config(**SMALL), SET, BEAD, SPHERE, seed))
        for seed in (1, 2, 3, 4)
    ]
    for record, run in runs:
        assert record["status"] == "ok", record["reason"]
        stays = ~np.isfinite(run.arrays["exit_s"])
        assert record["berries_below"] + stays.sum() == 550
        expected = 1e3 * SPHERE.mass_kg * (550 - stays.sum())
        assert record["drawdown_mass_g"] == pytest.approx(expected)
        floor_m = 1e-3 * SMALL["drop_mm"]
        assert (run.arrays["position"][stays, 2] > floor_m).all()
        assert (run.arrays["position"][~stays, 2] < floor_m).all()
        assert record["drawdown_flow_g_s"] > 0.0
    names = ("drawdown_above_deg", "drawdown_below_deg")
    angles = np.array([[record[name] for name in names] for record, _ in runs])
    more = angles[:, 0] - angles[:, 1]
    assert more.mean() > 3.0 * more.std(ddof=1) / 2.0


@pytest.mark.slow
def test_a_narrow_slot_jams():
    record, _ = run_once(
        bench("drawdown"),
        Scene.of(config(**SMALL | {"slot_mm": 18.0}), SET, BEAD, SPHERE, 1),
    )
    assert record["status"] == "jammed"
    assert record["drawdown_mass_g"] is None
