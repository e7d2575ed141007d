"""The longest time step of a study: check, pour and engine accept and refuse alike."""

import copy

import numpy as np
import pytest
from random_pours.pour import SCENES, sized
from refusals import input_error
from shared import ROOT, put

from repose.bench import Scene, bench, names
from repose.bench.parameters import PARAMETERS
from repose.bench.scene import longest_time_step
from repose.common.errors import InputError
from repose.config import validation
from repose.config.pipeline import PipelineConfig
from repose.grain import build, size_distribution
from repose.grain.settings import GrainSettings

CONFIG = PipelineConfig.load(ROOT / "config/quick.yaml").config
AXES_MM = {"long_mm": 21.14, "major_mm": 11.37, "minor_mm": 9.88}
SPREAD = {"scale_sd": 0.08, "scale_low": 0.78, "scale_high": 1.16}
BERRY = AXES_MM | SPREAD | {"density_kg_m3": 840.47, "poisson_ratio": 0.32}
PARTICLES = {
    "ellipsoid": {"particle": "ellipsoid", "mass_g": None},
    "smooth": {"particle": "smooth", "mass_g": 1.25},
    "spheres": {"particle": "multisphere", "mass_g": 1.25, "spheres": 8},
    "rough": {
        "particle": "multisphere",
        "mass_g": 1.25,
        "spheres": 16,
        "surface": "rough",
    },
    "many": {"particle": "multisphere", "mass_g": 1.25, "spheres": 40},
}
MANY = {
    "berry.particle": "multisphere",
    "berry.spheres": 40,
    "simulation.tension": "release",
}
HARD = {
    "berry.shear_modulus_pa": 1e9,
    "berry.poisson_ratio": 0.3,
    "validation.published": None,
}
STIFF = {"parameters.e_gg": [0.5, 0.9], "parameters.e_gp": [0.5, 0.9]}


def particle_of(name):
    return build.make_configured_particle(
        BERRY,
        GrainSettings.model_construct(
            **CONFIG["berry"] | {"stl": None} | PARTICLES[name]
        ),
    )


def case(rng, particles):
    config = copy.deepcopy(CONFIG)
    name = str(rng.choice(list(particles)))
    factor = 10 ** rng.uniform(np.log10(0.5), np.log10(50.0)) / AXES_MM["long_mm"]
    config["wall"]["shear_modulus_pa"] = 10 ** rng.uniform(3.0, 11.0)
    config["simulation"]["tension"] = str(rng.choice(["keep", "release"]))
    config["berry"]["size_distribution"] = str(rng.choice(["none", "measured"]))
    for key in ("e_gg", "e_gp"):
        low = float(rng.uniform(0.05, 0.9))
        config["parameters"][key] = [low, float(rng.uniform(low + 0.01, 0.95))]
    config["validation"]["published"] = None
    berry = BERRY | {"shear_modulus_pa": float(10 ** rng.uniform(4.0, 9.0))}
    return config, berry, sized(particles[name], factor)


def refused_by_check(config, particle, berry):
    berry = berry | {
        "elastic_modulus_pa": 2
        * berry["shear_modulus_pa"]
        * (1 + berry["poisson_ratio"])
    }
    return [
        key for key, _ in validation.find_time_step_problems(config, particle, berry)
    ] == ["simulation.time_step_s"]


def refused_by_pours(config, parameters, particle, berry):
    refused = set()
    for name in names():
        if name in config:
            try:
                bench(name).build(Scene.of(config, parameters, berry, particle))
                refused.add("")
            except InputError as error:
                refused.add(error.key)
    assert refused in ({""}, {"simulation.time_step_s"})
    return refused != {""}


def test_every_bench_test_has_a_scene_in_the_random_pours():
    assert sorted(SCENES) == sorted(names())
    scene = SCENES["drop_test"](np.random.default_rng(1), 10.0, 1.0, 30)
    assert set(scene) <= set(bench("drop_test").settings.model_fields)


@pytest.mark.slow
def test_check_and_pour_and_engine_agree():
    particles = {name: particle_of(name) for name in PARTICLES}
    rng = np.random.default_rng(20)
    for _ in range(300):
        config, berry, particle = case(rng, particles)
        lowest = {name: float(config["parameters"][name][0]) for name in PARAMETERS}
        limit = longest_time_step(Scene.of(config, lowest, berry, particle)).time_step_s
        smallest = size_distribution.compute_smallest_scale(
            config["berry"]["size_distribution"], berry
        )
        config["simulation"]["time_step_s"] = 0.9999 * limit
        assert not refused_by_check(config, particle, berry)
        assert not refused_by_pours(config, lowest, particle, berry)
        simulation = bench("funnel").build(Scene.of(config, lowest, berry, particle))
        simulation.add("berry", (0.0, 0.0, 0.0), scale=smallest)  # what a pour would do
        least_damped = lowest | {
            name: config["parameters"][name][1] for name in ("e_gg", "e_gp")
        }
        assert not refused_by_pours(config, least_damped, particle, berry)
        config["simulation"]["time_step_s"] = 1.0001 * limit
        assert refused_by_check(config, particle, berry)
        assert refused_by_pours(config, lowest, particle, berry)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (
            {"simulation.time_step_s": 8.0e-4},
            "at most 0.00062, the largest stable time step of a grain between two others, at a restitution of 0.1",
        ),
        (
            {"simulation.time_step_s": 5.6e-4, "berry.size_distribution": "measured"},
            "smallest scale, 0.781",
        ),
        (
            MANY | {"simulation.time_step_s": 3.0e-4, "parameters.e_gg": [0.02, 0.3]},
            "restitution of 0.02 and with [0-9.]+ spheres of a clump in one contact",
        ),
        (HARD | STIFF, "at most [0-9.e-]+, 1/8 of the contact time"),
    ],
)
def test_the_check_of_a_configuration_refuses_what_a_pour_would(changes, reason):
    config = copy.deepcopy(CONFIG)
    for key, value in changes.items():
        put(config, key, value)
    input_error(
        rf"simulation\.time_step_s is .*{reason}",
        PipelineConfig.of(config).check_inputs,
    )


def test_a_published_set_of_low_restitution_counts_and_the_smallest_berry_is_one_that_can_be_drawn(
    tmp_path,
):
    config = copy.deepcopy(CONFIG)
    config["simulation"] |= {"time_step_s": 3.0e-4, "tension": "release"}
    config["validation"]["published"] = None
    berry = BERRY | {"shear_modulus_pa": 4.3e4}
    many = particle_of("many")
    assert not refused_by_check(config, many, berry)
    table = tmp_path / "published.csv"
    table.write_text(
        "solution,e_gg,mus_gg,mur_gg,e_gp,mus_gp,mur_gp\n1,0.02,0.5,0.05,0.02,0.5,0.2\n"
    )
    config["validation"]["published"] = str(table)
    assert refused_by_check(config, many, berry)
    spread = {"scale_sd": 0.1, "scale_low": 0.8, "scale_high": 1.2}
    least = size_distribution.compute_smallest_scale("measured", spread)
    assert (
        least
        <= size_distribution.draw_scales("measured", spread, 1, 2000)[0].min()
        < 1.02 * least
    )
    assert size_distribution.compute_smallest_scale("none", {}) == 1.0
