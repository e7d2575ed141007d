"""Limits of rest and times to rest follow from the grain, where they are `auto`."""

import copy
import dataclasses
import math

import pytest
import yaml
from shared import ROOT

from repose.bench import Scene, bench
from repose.bench.grain_scale import GrainScale, round_to_digits
from repose.bench.inclined_plane import GRAIN, Tilting
from repose.bench.settings import SceneSettings
from repose.config.computed import REST_TIME
from repose.config.pipeline import PipelineConfig

LIMITS = {
    "simulation": ("rest_energy_j",),
    "funnel": ("rest_motion_mm", "rest_window_s", "duration_s"),
}
POTATOES = """
label: potato
berry:
  sizes: sizes.csv
  density_kg_m3: 1080
  poisson_ratio: 0.3
  shear_modulus_pa: 1.0e+6
  particle: ellipsoid
wall: {poisson_ratio: 0.3, shear_modulus_pa: 1.0e+9}
parameters:
  mus_gg: [0.2, 0.9]
  mur_gg: [0.005, 0.1]
  e_gg: {fixed: 0.5}
  mus_gp: {fixed: 0.8}
  mur_gp: {fixed: 0.3}
  e_gp: {fixed: 0.5}
funnel:
  berries: 100
  rate_per_s: 30
  inlet_diameter_mm: 600
  outlet_diameter_mm: 280
  cone_angle_deg: 60
  outlet_height_mm: 300
  plate_diameter_mm: 2000
measure: {response: whole}
targets: [{response: aor_deg, value: 22, sd: 1, repetitions: 10}]
surrogate: gaussian_process
"""
SIZES_MM = ((129, 66, 50), (128, 66, 51), (131, 65, 50), (129, 66, 50))
# Keys of the funnel that are lengths
LENGTHS = (
    "inlet_diameter_mm",
    "outlet_diameter_mm",
    "outlet_height_mm",
    "plate_diameter_mm",
)


@pytest.fixture
def potatoes(tmp_path, monkeypatch):
    """Make the study of potatoes, or of grains that are smaller by a factor."""
    monkeypatch.chdir(tmp_path)

    def load(factor=1.0, **funnel):
        rows = [",".join(f"{factor * axis:g}" for axis in row) for row in SIZES_MM]
        text = "\n".join(["long_mm,major_mm,minor_mm", *rows])
        (tmp_path / "sizes.csv").write_text(text + "\n")
        config = yaml.safe_load(POTATOES)
        for key in LENGTHS:
            config["funnel"][key] *= factor
        # The same overlap in grain diameters, for stress goes with the size
        config["berry"]["shear_modulus_pa"] *= factor
        config["wall"]["shear_modulus_pa"] *= factor
        config["funnel"]["rate_per_s"] /= math.sqrt(factor)
        config["funnel"]["rim_radius_mm"] = 4 * factor
        config["funnel"] |= funnel
        (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
        return PipelineConfig.load("config.yaml")

    return load


def limits(study):
    return {key: study.config[part][key] for part in LIMITS for key in LIMITS[part]}


def least_friction(study, seed):
    """The scene whose grains roll longest."""
    parameters = {**study.parameters.centre, "mus_gg": 0.2, "mur_gg": 0.005}
    return Scene.of(study.config, parameters, study.grain, study.particle, seed)


def test_units_of_a_sphere_by_hand():
    # 1 g, 10 mm and 10 m/s2: 31.6 ms, 0.1 mJ
    scale = GrainScale(diameter_m=0.01, mass_kg=1e-3, gravity_m_s2=10.0)
    assert scale.time_s == pytest.approx(0.0316228)
    assert scale.energy_j == pytest.approx(1e-4)
    assert scale.interval_s(1.35) == 0.04
    assert GrainScale.of_axes((20.0, 10.0, 5.0), 10.0).time_s == scale.time_s


def test_the_rule_gives_the_limits_of_the_goji_berry(monkeypatch):
    monkeypatch.chdir(ROOT)
    stated = PipelineConfig.load("config/config.yaml")
    overrides = {part: dict.fromkeys(keys, "auto") for part, keys in LIMITS.items()}
    computed = PipelineConfig.load("config/config.yaml", overrides=overrides)
    known = {"rest_energy_j": 1e-9, "rest_motion_mm": 1.0, "rest_window_s": 0.2}
    for study in (stated, computed):
        found = limits(study)
        found.pop("duration_s")
        assert found == known
    rest_s = REST_TIME * GrainScale.of(stated.particle, 9.81).time_s
    assert round_to_digits(rest_s, digits=2) == 1.5
    # Looks at the grains, which no key states, for the article's ellipsoid, too
    paper = PipelineConfig.load("config/config.yaml", "config/paper.yaml")
    for study in (stated, paper):
        scale = GrainScale.of(study.particle, 9.81)
        looks = [scale.interval_s(times) for times in (1.35, 0.135, 0.27, 0.027, 10.8)]
        assert looks == [0.05, 0.005, 0.01, 0.001, 0.4]
        assert limits(study)["rest_energy_j"] == 1e-9


@pytest.mark.parametrize("factor", [1 / 16, 1 / 64])
def test_limits_go_with_the_powers_of_the_size(potatoes, factor):
    large = limits(potatoes())
    small = limits(potatoes(factor))
    # Both are rounded to two digits.
    near = {"rel": 0.06}
    expected = factor**4 * large["rest_energy_j"]
    assert small["rest_energy_j"] == pytest.approx(expected, **near)
    expected = factor * large["rest_motion_mm"]
    assert small["rest_motion_mm"] == pytest.approx(expected, **near)
    for key in ("rest_window_s", "duration_s"):
        assert small[key] == pytest.approx(math.sqrt(factor) * large[key], **near)


def smaller(particle, factor):
    """The same body, smaller by a power of two, so that no digit is rounded."""
    return dataclasses.replace(
        particle,
        semi_axes_m=factor * particle.semi_axes_m,
        volume_m3=factor**3 * particle.volume_m3,
        mass_kg=factor**3 * particle.mass_kg,
        inertia_kg_m2=factor**5 * particle.inertia_kg_m2,
        bounding_radius_m=factor * particle.bounding_radius_m,
    )


def test_smaller_grains_make_the_same_pile_in_their_units(potatoes):
    """These powers of the size are the right ones: the pours are alike to the end."""
    piles = []
    for factor in (1.0, 1 / 16):
        study = potatoes()
        powers = {"m": factor, "s": math.sqrt(factor), "J": factor**4, "Pa": factor}
        config = copy.deepcopy(study.config)
        config["simulation"]["time_step_s"] = 4e-4 * powers["s"]
        config["simulation"]["rest_energy_j"] *= powers["J"]
        config["wall"]["shear_modulus_pa"] *= powers["Pa"]
        for key in config["funnel"]:
            if key.endswith("_mm"):
                config["funnel"][key] *= powers["m"]
            elif key.endswith("_per_s"):
                config["funnel"][key] /= powers["s"]
            elif key.endswith("_s"):
                config["funnel"][key] *= powers["s"]
        grain = study.grain
        grain = grain | {"shear_modulus_pa": powers["Pa"] * grain["shear_modulus_pa"]}
        scene = dataclasses.replace(
            least_friction(study, 1),
            settings=SceneSettings(config),
            grain=grain,
            particle=smaller(study.particle, factor),
        )
        times_s = []
        pour = bench("funnel").pour(scene, progress=times_s.append)
        assert bench("funnel").judge(pour, scene.settings).status == "ok"
        piles.append((pour.centres_m / factor, times_s[-1] / powers["s"]))
    (large_m, large_s), (small_m, small_s) = piles
    assert small_s == pytest.approx(large_s, rel=1e-9)
    assert small_m == pytest.approx(large_m, abs=1e-6)


def test_potatoes_of_low_friction_come_to_rest(potatoes):
    study = potatoes()
    statuses = []
    for seed in range(1, 11):
        scene = least_friction(study, seed)
        pour = bench("funnel").pour(scene)
        statuses.append(bench("funnel").judge(pour, scene.settings).status)
    assert statuses == ["ok"] * 10


def test_a_moving_pile_names_the_key_to_change(potatoes):
    scene = least_friction(potatoes(duration_s=4.5), 3)
    funnel = bench("funnel")
    verdict = funnel.judge(funnel.pour(scene), scene.settings)
    assert verdict.status == "not_at_rest"
    assert "more time by funnel.duration_s" in verdict.reason


def test_a_grain_that_moves_on_the_plane_names_the_key_to_change(monkeypatch):
    monkeypatch.chdir(ROOT)
    settings = SceneSettings(
        {"inclined_plane": bench("inclined_plane").example["inclined_plane"]}
    )
    verdict = bench("inclined_plane").judge(Tilting(restless_body=GRAIN), settings)
    assert verdict.status == "not_at_rest"
    assert verdict.reason.endswith("by inclined_plane.settle_s")
