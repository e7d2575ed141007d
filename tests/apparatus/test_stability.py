"""Limits of the time step: those of the check are those of the engine."""

import copy
from pathlib import Path

import numpy as np
import pytest
import yaml

from repose.apparatus import funnel, stability
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.particle import size_distribution
from repose.particle.build import ellipsoid_mesh, fit_particle

AXES_MM = (21.14, 11.37, 9.88)
MODULI = {"poisson_ratio": 0.32, "shear_modulus_pa": 4.3e4}
BERRY = (
    dict(zip(("long_mm", "major_mm", "minor_mm"), AXES_MM, strict=True)) | MODULI | {"density_kg_m3": 840.47}
)
CONFIG = yaml.safe_load((Path(__file__).parents[2] / "config" / "quick.yaml").read_text())
SET = dict.fromkeys(PARAMETERS, 0.3)


def config(step_s):
    whole = copy.deepcopy(CONFIG)
    whole["simulation"]["time_step_s"] = step_s
    whole["funnel"]["berries"] = 2
    return whole


def test_the_check_has_the_limit_of_the_engine():
    particle = fit_particle(ellipsoid_mesh(np.array(AXES_MM)), 840.47)
    engine = funnel.build(config(1e-4), SET, particle, BERRY).longest_time_step()
    assert stability.longest_time_step(BERRY, particle.mass_kg).time_step_s == pytest.approx(engine, rel=1e-6)
    assert stability.longest_time_step(BERRY, None).time_step_s == pytest.approx(engine, rel=1e-6)


def test_a_step_that_only_the_engine_refuses_is_told_as_a_fault_of_the_configuration():
    particle = fit_particle(ellipsoid_mesh(np.array(AXES_MM)), 840.47)
    with pytest.raises(
        InputError, match=r"simulation\.time_step_s is 0\.0009; allowed: above 0, at most 0\.000"
    ):
        funnel.build(config(9e-4), SET, particle, BERRY)


def test_the_nearer_limit_counts_and_smaller_berries_lower_it():
    soft = stability.longest_time_step(BERRY, 1e-3)
    assert "contact time" in soft.reason
    heavy = stability.longest_time_step(BERRY, 1.0)
    assert "Rayleigh" in heavy.reason
    assert stability.longest_time_step(BERRY, 1e-3, 0.5).time_step_s == pytest.approx(0.5 * soft.time_step_s)


def test_the_smallest_berry_is_one_that_can_be_drawn():
    spread = {"scale_sd": 0.1, "scale_low": 0.8, "scale_high": 1.2}
    least = size_distribution.smallest("measured", spread)
    drawn = size_distribution.of_pour("measured", spread, 1, 2000)[0]
    assert least <= drawn.min() < 1.02 * least
    assert size_distribution.smallest("none", spread) == 1.0
