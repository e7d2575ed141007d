"""Bounds of a pour: a good one keeps them, and one that breaks them is called unstable, with what helps."""

import copy

import numpy as np
import pytest
from goji import AXES_MM, BERRY, PARTICLE, ROOT
from refusals import raised
from shared import says

from repose import dem
from repose.bench import Scene, bench, scene
from repose.bench.bounds import CHECK_INTERVAL, Bounded, Unstable
from repose.bench.parameters import PARAMETERS
from repose.config.pipeline import PipelineConfig
from repose.dem import time_steps

CONFIG = PipelineConfig.load(ROOT / "config/quick.yaml").config
BERRY = BERRY | dict(zip(("long_mm", "major_mm", "minor_mm"), AXES_MM, strict=True))
CUBE = {"lower": (-0.1, -0.1, -0.1), "upper": (0.1, 0.1, 0.1)}
SET = dict.fromkeys(PARAMETERS, 0.3)
SMALL = {
    "funnel": {"berries": 12, "duration_s": 3.0},
    "drum": {
        "berries": 12,
        "length_mm": 40.0,
        "rotate_from_s": 1.0,
        "report_s": 2.0,
        "longest_rotation_s": 2.0,
    },
    "cylinder": {
        "berries": 12,
        "duration_s": 2.0,
        "diameter_mm": 60.0,
        "height_mm": 60.0,
    },
}


def config(step_s=2e-4):
    whole = copy.deepcopy(CONFIG)
    whole["simulation"]["time_step_s"] = step_s
    for name, changes in SMALL.items():
        whole.setdefault(name, {}).update(changes)
    return whole


def simulated(shape, step_s, capacity, **keywords):
    laws = {("berry", "berry"): dem.Contact(0.3, 0.5, 0.1)}
    materials = {"berry": dem.Material(4.3e4, 0.32)}
    return dem.Simulation(
        {"berry": shape}, materials, laws, step_s, capacity=capacity, **CUBE | keywords
    )


def three_berries(**of_second):
    """A plane with three berries that lie apart, bounded for a fall of 0.1 m."""
    radius = 5e-3
    mass = 5e-4
    ball = dem.Shape([[radius] * 3], mass, [0.4 * mass * radius**2] * 3, "berry")
    plate = {"plate": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "berry")}
    simulation = simulated(ball, 1e-4, 3, lower=(-0.1, -0.1, 0.0), walls=plate)
    simulation.add("berry", (0.0, 0.0, radius))
    simulation.add("berry", **({"position_m": (0.05, 0.0, radius)} | of_second))
    simulation.add("berry", (-0.05, 0.0, radius))
    return Bounded(simulation, 0.1)


@pytest.mark.slow
def test_what_a_fall_can_give_and_overlaps_of_clumps_stay_within_the_bounds():
    bounded = three_berries(position_m=(0.05, 0.0, 0.1))
    bounded.run_to(3 * CHECK_INTERVAL)
    bounded.check()
    assert bounded.simulation.steps == 3 * CHECK_INTERVAL
    mass = 1e-3
    pair = dem.Clump(
        [[-4e-3, 0, 0, 3e-3], [4e-3, 0, 0, 3e-3]], mass, [mass * 1e-5] * 3, "berry"
    )
    simulation = simulated(
        pair, 1e-5, 2, gravity_m_s2=(0.0, 0.0, 0.0), largest_scale=1.5
    )
    simulation.add("berry", (0.0, 0.0, 0.0))
    # the second is turned by a right angle and 1.5 times as large: its lower sphere, 4.5 mm, meets the right one
    simulation.add(
        "berry", (4e-3, 0.0, 13e-3), (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0), scale=1.5
    )
    simulation.run_steps(1)
    _, overlaps = simulation.overlaps()
    assert overlaps == pytest.approx([7.5e-3 - 7e-3], abs=1e-7)


def test_a_berry_beyond_its_bounds_and_energy_beyond_what_was_given_are_reported():
    fast = three_berries(velocity_m_s=(0.0, 0.0, 900.0))
    lost = three_berries()
    raised(
        Unstable,
        r"grain 1 moves at 900 m/s, after 0 s: a shorter simulation\.time_step_s than",
        fast.check,
    )
    lost.simulation.positions[2] = np.nan
    raised(Unstable, "grain 2 has no finite position", lost.check)
    bounded = three_berries()
    bounded.simulation.velocities[:] = (0.0, 0.0, np.sqrt(2 * 9.81 * 0.1 * 1.3))
    raised(Unstable, r"all grains together have .* J and were given", bounded.check)


def check_overlaps(bounded, broken, message):
    """Half of a ball's diameter, 10 mm, is the bound."""
    if broken:
        raised(Unstable, message, bounded._check_overlaps)
    else:
        bounded._check_overlaps()


@pytest.mark.parametrize(("apart_mm", "broken"), [(5.5, False), (4.5, True)])
def test_berries_that_pass_through_each_other_are_named(apart_mm, broken):
    bounded = three_berries(position_m=(0.0, 1e-3 * apart_mm, 5e-3))
    bounded.simulation.run_steps(1)
    pairs, overlaps = bounded.simulation.overlaps()
    assert pairs.tolist() == [[0, 1]]
    between = np.linalg.norm(
        bounded.simulation.positions[1] - bounded.simulation.positions[0]
    )
    assert overlaps[0] == pytest.approx(1e-2 - between, abs=1e-12)
    check_overlaps(
        bounded,
        broken,
        r"grains 0 and 1 overlap by 5\.43 mm.*a higher berry\.shear_modulus_pa",
    )


@pytest.mark.parametrize(("height_mm", "broken"), [(0.5, False), (-0.5, True)])
def test_a_berry_that_passes_through_a_wall_is_named(height_mm, broken):
    bounded = three_berries(position_m=(0.05, 0.0, 5e-4))
    bounded.simulation.run_steps(1)
    # pressed on, in contact as before
    bounded.simulation.positions[1, 2] = 1e-3 * height_mm
    check_overlaps(
        bounded,
        broken,
        r"grain 1 and the wall 'plate' overlap by 5\.[345]\d* mm.*after 0\.0001 s",
    )


@pytest.mark.parametrize("name", ["funnel", "drum", "cylinder"])
def test_a_run_that_explodes_is_unstable_and_says_what_to_do(name, monkeypatch):
    monkeypatch.setattr(
        scene, "longest_time_step", lambda *_: time_steps.Limit(1.0, "")
    )
    monkeypatch.setattr(
        time_steps, "compute_longest", lambda *_: time_steps.Limit(1.0, "")
    )
    whole = config(3e-3)
    run = bench(name).run(Scene.of(whole, SET, BERRY, PARTICLE, 1))
    assert run.record["status"] == "unstable"
    says(run.record["reason"], "after", "a shorter simulation.time_step_s than 0.003")
    assert (
        bench(name).measure(
            run.record, run.arrays, Scene.of(whole, {}, BERRY, PARTICLE)
        )["status"]
        == "unstable"
    )


@pytest.mark.parametrize(("modulus_pa", "is_noted"), [(4.3e4, False), (2e3, True)])
def test_a_run_whose_grains_overlap_deeply_at_its_end_notes_it(modulus_pa, is_noted):
    soft = BERRY | {"shear_modulus_pa": modulus_pa}
    scene = Scene.of(config(), SET, soft, PARTICLE, 1)
    run = bench("cylinder").run(scene)
    assert run.record["status"] != "unstable"
    assert ("overlap_share" in run.record) == is_noted
    if is_noted:
        assert 0.1 < run.record["overlap_share"] < 0.5


@pytest.mark.parametrize("name", ["funnel", "drum", "cylinder"])
def test_looking_moves_no_bit(name, monkeypatch):
    def final(every):
        monkeypatch.setattr("repose.bench.bounds.CHECK_INTERVAL", every)
        run = bench(name).run(Scene.of(config(), SET, BERRY, PARTICLE, 1))
        assert run.record["status"] != "unstable"
        return run.arrays

    seldom = final(10**9)
    often = final(37)
    assert seldom.keys() == often.keys()
    for key, values in seldom.items():
        np.testing.assert_array_equal(values, often[key])
