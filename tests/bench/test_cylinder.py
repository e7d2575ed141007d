"""The measuring cylinder: its density on lattices of known density, how a filling is judged, and a small filling."""

import copy
import dataclasses
import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from goji import BERRY, PARTICLE, ROOT, check_named_time, named, recommended
from refusals import input_error

from repose.bench import Scene, bench, cylinder
from repose.bench.bounds import Unstable
from repose.bench.settings import SceneSettings
from repose.config.pipeline import PipelineConfig
from repose.grain.build import ellipsoid_mesh, fit_particle
from repose.stages.job import run_once

TEST = cylinder.CylinderTest()
SET = named((0.25, 0.5, 0.03, 0.3, 0.6, 0.2))
SMALL = {
    "berries": 90,
    "rate_per_s": 150.0,
    "duration_s": 1.6,
    "diameter_mm": 60.0,
    "height_mm": 30.0,
    "collar_mm": 60.0,
    "core_margin_mm": 5.0,
}
config = partial(recommended, "cylinder")


def lattice(spacing_m, top_m):
    """Points of a simple cubic lattice that fills the default cylinder up to a height, off its planes of symmetry."""
    side = np.arange(-0.1, 0.1, spacing_m) + 0.3 * spacing_m
    height = np.arange(0.4 * spacing_m, top_m, spacing_m)
    points = np.stack(np.meshgrid(side, side, height, indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    return points[np.hypot(*points[:, :2].T) < 0.0835]


@pytest.mark.parametrize("margin_m", [0.0, 0.025])
def test_density_of_a_lattice_is_mass_over_cell(margin_m):
    centres = lattice(2e-3, 0.3)
    masses = np.full(len(centres), 4.8e-6)
    vessel = cylinder.Vessel.of(TEST.section(SceneSettings(config())))
    counted = vessel.contains(centres, margin_m)
    assert vessel.compute_density_kg_m3(masses, counted, margin_m) == pytest.approx(
        600.0, rel=0.01
    )
    assert centres[counted, 2].max() < 0.228 - margin_m
    assert np.hypot(*centres[counted, :2].T).max() < 0.0835 - margin_m


def test_a_grain_counts_by_its_mass_in_the_density():
    """The third grain lies outside of the core, the last one above the rim."""
    scales = np.array([1.0, 1.2, 0.8, 1.0])
    arrays = {
        "position": np.array(
            [[0, 0, 0.01], [0, 0, 0.1], [0.04, 0, 0.18], [0, 0, 0.24]]
        ),
        "scale": scales,
        "quaternion": np.tile([1.0, 0.0, 0.0, 0.0], (4, 1)),
    }
    found = TEST.measure(
        {"status": "ok"}, arrays, Scene.of(config(), {}, BERRY, PARTICLE)
    )
    mass = PARTICLE.mass_kg * (1.0 + 1.2**3 + 0.8**3)
    expected = mass / (math.pi * 0.0835**2 * 0.228)
    assert found["bulk_density_kg_m3"] == pytest.approx(expected)
    assert found["berries_in_cylinder"] == 3
    core = PARTICLE.mass_kg * (1.2**3 + 0.8**3) / (math.pi * 0.0585**2 * 0.178)
    assert found["core_density_kg_m3"] == pytest.approx(core)
    nothing = TEST.measure(
        {"status": "not_full"}, arrays, Scene.of(config(), {}, BERRY, PARTICLE)
    )
    assert nothing["bulk_density_kg_m3"] is None


def test_a_filling_is_judged():
    def judged(centres, energy_j=1e-12, unstable=""):
        filling = cylinder.Filling(
            centres_m=centres, energy_j=energy_j, length_m=0.021, unstable=unstable
        )
        return TEST.status_of(filling, SceneSettings(config()))

    full = lattice(5e-3, 0.26)
    low = lattice(5e-3, 0.24)
    assert judged(full) == ("ok", "")
    # 12 mm above the rim are less than the length of a grain
    status, reason = judged(low)
    assert status == "not_full"
    assert "above it" in reason
    status, reason = judged(full, 1e-6)
    assert status == "not_at_rest"
    check_named_time(TEST, reason)
    assert judged(full + np.array([0.02, 0, 0]))[0] == "lost"
    assert judged(full, unstable="why") == ("unstable", "why")


def test_a_tap_lifts_a_berry_by_its_height():
    settings = config(**SMALL)
    scene = Scene.of(settings, SET, BERRY, PARTICLE)
    simulation = TEST.build(scene)
    simulation.add("berry", (0.0, 0.0, 0.011))
    simulation.run(1.0, False)
    low = simulation.positions[0, 2]
    tops = []

    def run_to(step):
        while simulation.steps < step:
            simulation.run_steps(1)
            tops.append(simulation.positions[0, 2])

    trial = SimpleNamespace(simulation=simulation, scene=scene, run_to=run_to)
    cylinder.tap(trial, 0.003)
    assert max(tops) - low == pytest.approx(0.003, rel=0.05)
    assert simulation.positions[0, 2] == pytest.approx(low, abs=2e-4)


def cap_share(depth, radius):
    """Share of a sphere that lies below a plane `depth` above its lowest point."""
    depth = np.clip(depth, 0.0, 2.0 * radius)
    return depth**2 * (3.0 * radius - depth) / (4.0 * radius**3)


@pytest.mark.parametrize("kind", ["smooth", "clump"])
def test_the_core_counts_the_volume_of_layers_that_its_ends_cut(kind):
    """Layers of spheres whose centres lie just inside the core's ends: by their centres they count in full."""
    ball = fit_particle(ellipsoid_mesh(np.array([10.0, 10.0, 10.0])), 1000.0)
    if kind == "clump":
        ball = dataclasses.replace(
            ball, semi_axes_m=np.zeros((0, 3)), spheres_m=np.array([[0, 0, 0, 5e-3]])
        )
    vessel = cylinder.Vessel(0.0835, 0.228, 0.06)
    margin = 0.025
    side = np.arange(-0.04, 0.041, 0.01)
    x, y, z = np.meshgrid(
        side, side, np.array([0.026, 0.06, 0.1, 0.202]), indexing="ij"
    )
    centres = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    centres = centres[np.hypot(*centres[:, :2].T) < 0.05]
    quaternions = np.random.default_rng(3).normal(size=(len(centres), 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    arrays = {
        "position": centres,
        "quaternion": quaternions,
        "scale": np.ones(len(centres)),
    }
    shares = vessel.compute_core_shares(arrays, ball, margin)
    known = cap_share(centres[:, 2] + 0.005 - margin, 0.005)
    known = np.minimum(
        known, cap_share(0.228 - margin - (centres[:, 2] - 0.005), 0.005)
    )
    assert np.abs(shares - known).max() < 0.02
    assert np.sqrt(np.mean((shares - known) ** 2)) < 0.005
    found = vessel.compute_density_kg_m3(np.full(len(centres), 1.0), shares, margin)
    by_volume = vessel.compute_density_kg_m3(np.full(len(centres), 1.0), known, margin)
    by_centres = vessel.compute_density_kg_m3(
        np.full(len(centres), 1.0), vessel.contains(centres, margin), margin
    )
    assert found == pytest.approx(by_volume, rel=1e-3)
    assert by_centres > 1.2 * by_volume


def test_a_tapped_cylinder_holds_more():
    settings = config(**SMALL, taps=6)
    records = [
        run_once(bench("cylinder"), Scene.of(settings, SET, BERRY, PARTICLE, seed))[0]
        for seed in (2, 3, 4)
    ]
    record, run = run_once(
        bench("cylinder"), Scene.of(settings, SET, BERRY, PARTICLE, 1)
    )
    records.append(record)
    assert {filling["status"] for filling in records} == {"ok"}
    tapped = sum(filling["tapped_density_kg_m3"] for filling in records)
    bulk = sum(filling["bulk_density_kg_m3"] for filling in records)
    assert tapped > 1.02 * bulk
    poured, _ = run_once(
        bench("cylinder"), Scene.of(config(**SMALL), SET, BERRY, PARTICLE, 1)
    )
    assert poured["bulk_density_kg_m3"] == record["bulk_density_kg_m3"]
    assert poured["tapped_density_kg_m3"] is None
    assert run.arrays["tapped"].shape == run.arrays["position"].shape


def test_a_filling_that_breaks_a_bound_is_unstable(monkeypatch):
    def broken(trial, *_):
        trial.simulation.add("berry", (0.0, 0.0, 0.02))
        raise Unstable("a berry is too fast")

    monkeypatch.setattr(cylinder, "fill", broken)
    record, _ = run_once(
        bench("cylinder"), Scene.of(config(**SMALL, taps=2), SET, BERRY, PARTICLE, 1)
    )
    assert record["status"] == "unstable"
    assert record["reason"] == "a berry is too fast"


def test_taps_take_their_time_and_are_needed_for_the_tapped_density():
    """A tap rises and falls over its height, and then rests for 0.4 s."""
    settings = config(**SMALL)
    tapped = config(**SMALL, taps=100, tap_mm=20.0)
    longer = TEST.duration_s(SceneSettings(tapped)) - TEST.duration_s(
        SceneSettings(settings)
    )
    assert longer == pytest.approx(100 * (2 * math.sqrt(2 * 0.02 / 9.81) + 0.4))
    settings["targets"] = [
        settings["targets"][0]
        | {"response": "tapped_density_kg_m3", "apparatus": "cylinder"}
    ]
    needed = [("cylinder.taps", "1 or more, since tapped_density_kg_m3 is a target")]
    assert list(TEST.contradictions(SceneSettings(settings))) == needed


def test_a_study_may_leave_out_taps():
    study = PipelineConfig.load(
        ROOT / "config/config.yaml", ROOT / "examples/bench_tests/cylinder.yaml"
    )
    assert "cylinder.taps" not in study.definitions["tapped_density_kg_m3"]
    assert study.definitions["bulk_density_kg_m3"]["cylinder.height_mm"] == 150.0
    study.config["targets"][0] |= {"response": "tapped_density_kg_m3", "range": None}
    input_error(
        r"cylinder\.taps is null; expected 1 or more", PipelineConfig.of, study.config
    )


def test_a_small_filling_has_its_density():
    settings = config(**SMALL)
    record, run = run_once(
        bench("cylinder"), Scene.of(settings, SET, BERRY, PARTICLE, 1)
    )
    assert record["status"] == "ok"
    assert record["berries_poured"] == 90
    vessel = cylinder.Vessel.of(TEST.section(SceneSettings(settings)))
    assert (np.hypot(*run.arrays["position"][:, :2].T) < vessel.radius_m).all()
    assert 0.45 < record["bulk_density_kg_m3"] / 840.47 < 0.72
    again, _ = run_once(bench("cylinder"), Scene.of(settings, SET, BERRY, PARTICLE, 1))
    assert again["bulk_density_kg_m3"] == record["bulk_density_kg_m3"]
    few = copy.deepcopy(settings)
    few["cylinder"]["berries"] = 30
    short, _ = run_once(bench("cylinder"), Scene.of(few, SET, BERRY, PARTICLE, 1))
    assert short["status"] == "not_full"
    assert short["bulk_density_kg_m3"] is None
