"""The grains and the configurations that the tests of the bench tests share."""

import copy
import functools
from dataclasses import replace

from shared import ROOT

from repose.bench import bench
from repose.bench.parameters import PARAMETERS
from repose.bench.settings import SceneSettings
from repose.config.pipeline import PipelineConfig
from repose.grain.build import ellipsoid_mesh, fit_particle

AXES_MM = (21.14, 11.37, 9.88)
DENSITY_KG_M3 = 840.47
BERRY = {
    "shear_modulus_pa": 4.3e4,
    "poisson_ratio": 0.32,
    "density_kg_m3": DENSITY_KG_M3,
}


def particle(axes_mm=AXES_MM, density_kg_m3=DENSITY_KG_M3):
    return fit_particle(ellipsoid_mesh(axes_mm), density_kg_m3)


PARTICLE = particle()
BEAD = {"shear_modulus_pa": 1e5, "poisson_ratio": 0.3, "density_kg_m3": 1200.0}
SPHERE = particle((10.0, 10.0, 10.0), BEAD["density_kg_m3"])


@functools.cache
def loaded(*over):
    """The program's configuration with files over it, which no test may change."""
    return PipelineConfig.load(ROOT / "config/config.yaml", *over).config


def recommended(section, *over, **keys):
    whole = copy.deepcopy(loaded(*over))
    whole[section].update(keys)
    return whole


def example(name, time_step_s=1.5e-4, **keys):
    whole = recommended(name, ROOT / f"examples/bench_tests/{name}.yaml", **keys)
    whole["simulation"]["time_step_s"] = time_step_s
    return whole


@functools.cache
def checked_example(name):
    config = copy.deepcopy(loaded())
    for key, part in bench(name).example.items():
        config[key] = part if key == "targets" else config.get(key, {}) | part
    # The goji berry's shape study is of other responses.
    config["posterior"]["shape_study"] = None
    return PipelineConfig.of(config).config


def own_example(name):
    """The program's configuration with the example that a bench test brings."""
    return copy.deepcopy(checked_example(name))


def check_statuses(test, config, good, cases):
    """Hold the statuses of changed runs, by the changes, against those expected."""
    verdicts = [
        test.status_of(replace(good, **changes), SceneSettings(config))
        for _, changes in cases
    ]
    assert [verdict.status for verdict in verdicts] == [status for status, _ in cases]
    for verdict in verdicts:
        if verdict.status == "not_at_rest":
            check_named_time(test, verdict.reason)


def check_named_time(test, reason):
    """Hold a reason to end with a key of the bench test, a time that may be longer."""
    section, key = reason.rpartition(" by ")[2].split(".")
    assert section == test.name
    assert key in test.settings.model_fields
    assert key.endswith("_s")


def named(values):
    return dict(zip(PARAMETERS, values, strict=True))
