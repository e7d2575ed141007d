"""The funnel with a lid: rates of known discharges, how a run is judged, conserved mass, and Beverloo's law."""

from functools import partial

import numpy as np
import pytest
from goji import BERRY, PARTICLE, check_statuses, named, particle, recommended

from repose.bench import Scene, bench, discharge
from repose.stages.job import run_once

TEST = discharge.DischargeTest()
SPHERE_MM = 12.0
SPHERE = particle((SPHERE_MM, SPHERE_MM, SPHERE_MM))
SET = named((0.25, 0.5, 0.03, 0.3, 0.6, 0.2))
SPHERES = named((0.3, 0.3, 0.01, 0.3, 0.3, 0.01))  # smooth enough not to jam
SMALL = {
    "berries": 40,
    "rate_per_s": 150.0,
    "open_from_s": 0.8,
    "longest_s": 2.0,
    "collar_mm": 60.0,
}
config = partial(recommended, "discharge")


def measured(exit_s, scale):
    arrays = {"exit_s": np.asarray(exit_s, float), "scale": np.asarray(scale, float)}
    return TEST.measure(
        {"status": "ok"}, arrays, Scene.of(config(), {}, BERRY, PARTICLE)
    )


def test_the_rate_is_that_of_the_middle():
    times = 0.5 + np.arange(200) / 80.0  # 80 berries a second
    found = measured(np.random.default_rng(1).permutation(times), np.ones(200))
    assert found["emptying_s"] == pytest.approx(times[-1])
    assert found["flow_g_s"] == pytest.approx(80.0 * 1e3 * PARTICLE.mass_kg)
    # a slow beginning and a slow end; in the middle large berries, 8 times as heavy
    times = np.concatenate(
        [
            np.linspace(0, 10, 16),
            10.0 + np.arange(1, 31) / 30.0,
            np.linspace(12, 40, 16),
        ]
    )
    scale = np.concatenate([np.ones(16), np.full(30, 2.0), np.ones(16)])
    expected = 8.0 * 30.0 * 1e3 * PARTICLE.mass_kg
    assert measured(times, scale)["flow_g_s"] == pytest.approx(expected)
    found = TEST.measure(
        {"status": "jammed"}, {}, Scene.of(config(), {}, BERRY, PARTICLE)
    )
    assert found["emptying_s"] is None
    assert found["flow_g_s"] is None


def test_a_run_is_judged():
    good = discharge.Discharge(n_filled=500, rest_energy_j=1e-12, n_early=0, n_late=500)
    cases = [
        ("ok", {}),
        ("unstable", {"unstable": "why"}),
        ("not_filled", {"n_filled": 499}),
        ("lost", {"n_early": 1}),
        ("not_at_rest", {"rest_energy_j": 1e-6}),
        ("jammed", {"n_late": 480}),
    ]
    check_statuses(TEST, config(), good, cases)


def test_what_is_filled_in_comes_out():
    record, run = run_once(
        bench("discharge"), Scene.of(config(**SMALL), SET, BERRY, PARTICLE, 1)
    )
    assert record["status"] == "ok"
    assert record["berries_out"] == 40
    assert (run.arrays["exit_s"] > 0.0).all()  # nothing leaves the closed funnel
    assert (run.arrays["position"][:, 2] > 0.0).all()
    assert record["emptying_s"] == run.arrays["exit_s"].max()
    # the last berry falls no faster than freely, from the top of the filling
    assert record["emptying_s"] > np.sqrt(
        2.0 * run.arrays["position"][:, 2].max() / 9.81
    )


def test_a_narrow_outlet_jams():
    narrow = config(**SMALL | {"outlet_diameter_mm": 22.0, "longest_s": 1.0})
    record, _ = run_once(bench("discharge"), Scene.of(narrow, SET, BERRY, PARTICLE, 1))
    assert record["status"] == "jammed"
    assert record["flow_g_s"] is None


def flow_g_s(seed=1, **keys):
    defaults = {
        "berries": 700,
        "inlet_diameter_mm": 130.0,
        "cone_angle_deg": 20.0,
        "collar_mm": 200.0,
        "rate_per_s": 700.0,
        "open_from_s": 1.5,
        "longest_s": 4.0,
    }
    record, _ = run_once(
        bench("discharge"),
        Scene.of(config(**defaults | keys), SPHERES, BERRY, SPHERE, seed),
    )
    assert record["status"] == "ok", record["reason"]
    return record["flow_g_s"]


@pytest.mark.slow
def test_the_rate_grows_with_the_outlet_as_beverloo_says_and_the_rate_hardly_depends_on_the_filling():
    # k is 0.70 with an error of 0.07 on an AMD EPYC (Zen 4); three single discharges scatter by 0.18.
    outlets = np.array([60.0, 70.0, 80.0])
    flows = [
        [flow_g_s(seed, outlet_diameter_mm=outlet) for outlet in outlets]
        for seed in range(1, 7)
    ]
    root = np.mean(np.power(flows, 0.4), axis=0)
    slope, shift = np.polyfit(outlets, root, 1)
    assert np.abs(slope * outlets + shift - root).max() < 0.03 * root.mean()
    assert 0.5 < -shift / slope / SPHERE_MM < 3.0  # k, 1.4 for spheres
    # Single discharges scatter, so compare means over the same seeds.
    few = [flow_g_s(seed, berries=450, outlet_diameter_mm=60.0) for seed in range(1, 7)]
    many = [row[0] for row in flows]
    assert np.mean(many) == pytest.approx(np.mean(few), rel=0.1)
