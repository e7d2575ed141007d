"""Advice before a run, against answers that are known."""

import copy
import math

import pytest

from repose.config import advice, cost, loader
from repose.core import places
from repose.strategies import cost as strategies

SPHERE = {"long_mm": 4.0, "major_mm": 4.0, "minor_mm": 4.0, "density_kg_m3": 1300.0, "poisson_ratio": 0.25}
GRAIN_M3 = math.pi / 6 * 4e-3**3


@pytest.fixture
def config():
    found = copy.deepcopy(loader.load(places.root() / "config/config.yaml"))
    found["targets"] = [target("height_mm", 30.0), target("aor_deg", 30.0)]
    return found


def target(response, value):
    """A target of the funnel."""
    shared = {"sd": 1.0, "repetitions": 10, "range": [value - 1, value + 1], "apparatus": "funnel"}
    return {"response": response, "value": value} | shared


def column(modulus_pa, height_m, gravity, layers):
    """Share of its Height that a column of layers loses, added contact by contact."""
    d, young = 4e-3, modulus_pa / 0.75
    depths = [(k + 0.5) * height_m / layers for k in range(layers)]
    forces = [0.6 * 1300 * gravity * z * d**2 for z in depths]
    overlaps = [(3 * force / (4 * young * math.sqrt(d / 4))) ** (2 / 3) for force in forces]
    return sum(overlaps) / layers / d


def test_the_sinking_is_that_of_a_column_added_contact_by_contact(config):
    found = advice.softening(config, SPHERE | {"shear_modulus_pa": 1e6})
    assert found.sinking == pytest.approx(column(1e6, 0.03, 9.81, 2000), rel=1e-4)


def test_a_pile_of_the_softest_grain_sinks_by_what_is_allowed(config):
    softest = advice.softening(config, SPHERE | {"shear_modulus_pa": 7.7e7}).softest_pa
    assert softest < 7.7e7
    again = advice.softening(config, SPHERE | {"shear_modulus_pa": softest})
    assert again.sinking == pytest.approx(advice.LARGEST_SINKING)


def test_grains_of_the_cones_volume_fill_it(config):
    cone = math.pi * 0.03**3 / (3 * math.tan(math.radians(30)) ** 2)
    config["funnel"]["berries"] = round(0.6 * cone / GRAIN_M3)
    assert advice.filling(config, GRAIN_M3)[1]
    for factor in (0.5, 2.0):
        config["funnel"]["berries"] = round(factor * 0.6 * cone / GRAIN_M3)
        sentence, fits = advice.filling(config, GRAIN_M3)
        assert not fits
        assert f"funnel.berries would have to be {math.ceil(0.6 * cone / GRAIN_M3)}" in sentence


def test_a_height_alone_asks_for_a_slope(config):
    config["targets"] = config["targets"][:1]
    slope = math.radians(25)
    config["funnel"]["berries"] = round(0.6 * math.pi * 0.03**3 / (3 * math.tan(slope) ** 2) / GRAIN_M3)
    sentence, fits = advice.filling(config, GRAIN_M3)
    assert fits
    assert "a slope of 25 deg" in sentence
    config["funnel"]["berries"] = 50
    assert not advice.filling(config, GRAIN_M3)[1]


def test_an_angle_alone_tells_the_height_and_other_targets_nothing(config):
    config["targets"] = config["targets"][1:]
    assert "a cone of 30 deg" in advice.filling(config, GRAIN_M3)[0]
    config["targets"] = []
    assert advice.filling(config, GRAIN_M3)[1]


def test_the_response_surface_has_its_own_pours(config):
    config["response_surface"] |= {
        "screening_runs": 12,
        "steps": 5,
        "most_factors": 3,
        "centres": 5,
        "checks": 8,
    }
    config["response_surface"] |= {"surface": "box_behnken", "seeds": 3}
    assert strategies.pours(config) is None
    config["strategy"] = "response_surface"
    pours = strategies.pours(config)
    # 12 edges of the cube and 5 centres
    assert pours == (("screening", 12, 3), ("ascent", 6, 3), ("surface", 17, 3), ("check", 8, 3))
    work = cost.work(config, 1e-7, pours)
    assert work["total_s"] == pytest.approx(43 * cost.JOB_START_S + 129 * work["pour_s"])


def test_the_sequential_strategy_stops_at_its_budget(config):
    config["strategy"] = "sequential"
    config["sequential"] |= {"most_pours": 120, "seeds": 3}
    assert strategies.pours(config) == (("at most", 40, 3),)


def test_the_time_goes_with_what_was_measured(config):
    """Grains that appear over the whole pour are there for half of it."""
    config["funnel"] |= {"berries": 100, "rate_per_s": 10.0, "duration_s": 10.0}
    config["simulation"]["time_step_s"] = 1e-4
    assert cost.run_s(config, "funnel", 1e-7) == pytest.approx(100 * 5.0 / 1e-4 * 1e-7)
    assert cost.run_s(config, "funnel", 3e-7) == pytest.approx(3 * cost.run_s(config, "funnel", 1e-7))
