"""How many grains a pile needs, by the table of piles of the engine's own."""

import math
import subprocess
import sys

import pandas as pd
import pytest
import yaml

from repose.apparatus import funnel, scene_size
from repose.config.study import Study
from repose.core import places


@pytest.fixture(scope="module")
def config():
    return Study.load(places.root() / "config/config.yaml").config


def with_grains(config, grains, response="secant"):
    """The configuration with another number of grains and another angle."""
    measure = config["measure"] | {"response": response}
    return {**config, "funnel": config["funnel"] | {"berries": grains}, "measure": measure}


def test_a_change_is_that_of_the_table():
    """Between two numbers of the table the mean over its crops; there and back it vanishes."""
    own = pd.read_csv(scene_size.TABLE).set_index(["grains", "label"])
    for name in ("whole", "secant"):
        found = scene_size.change(500, 125, name)
        column = own[f"aor_{name}_deg"]
        assert found.angle_deg == pytest.approx((column[125] - column[500]).mean())
        back = scene_size.change(125, 500, name)
        assert back.angle_deg == pytest.approx(-found.angle_deg)
    heights = own["height_scaled_mm"]
    assert found.height == pytest.approx((heights[125] / heights[500]).mean())
    assert scene_size.change(300, 300, "flank") == (0.0, 1.0)


def test_a_scaled_scene_keeps_its_proportions_and_lets_grains_through(config):
    own = config["funnel"]
    smaller = scene_size.scaled(own, 4, 13.34)
    assert smaller["inlet_diameter_mm"] == pytest.approx(own["inlet_diameter_mm"] / 5)
    assert smaller["rate_per_s"] == pytest.approx(own["rate_per_s"] * 5**-2.5)
    assert smaller["outlet_diameter_mm"] == pytest.approx(min(own["outlet_diameter_mm"], 2.4 * 13.34))
    assert scene_size.scaled(own, own["berries"], 13.34) == own


def test_fewer_grains_are_enough_where_the_angle_stays(config):
    """And never a number below one whose angle is more than a degree off."""
    for name in ("whole", "flank", "secant", "steepest"):
        found = scene_size.enough(1000, name)
        between = [n for n in scene_size.numbers() if found is not None and found <= n < 1000]
        assert all(abs(scene_size.change(1000, n, name).angle_deg) <= 1 for n in between)
        below = [n for n in scene_size.numbers() if n < (found or 1000)]
        assert not below or abs(scene_size.change(1000, max(below), name).angle_deg) > 1


def test_a_large_scene_gets_a_smaller_one_as_keys_that_a_study_takes(config):
    small = list(scene_size.advice(with_grains(config, 500), 13.34, 65.0))
    assert len(small) == 1
    assert small[0].startswith("grains: the pile is 4.9 grains high.")
    _, smaller = scene_size.advice(with_grains(config, 1000), 13.34, 65.0)
    keys = yaml.safe_load(smaller[smaller.index("funnel:") :])["funnel"]
    assert keys["berries"] == scene_size.enough(1000, "secant")
    assert keys["inlet_diameter_mm"] == pytest.approx(
        config["funnel"]["inlet_diameter_mm"] * (keys["berries"] / 1000) ** (1 / 3), rel=1e-3
    )
    automatic = dict.fromkeys(("duration_s", "factory_diameter_mm", "factory_height_mm"), "auto")
    Study.of({**config, "funnel": config["funnel"] | keys | automatic})
    assert math.isfinite(funnel.last_berry_s(config["funnel"] | keys))


def test_beyond_the_table_nothing_is_promised(config):
    largest = max(scene_size.numbers())
    *_, smaller = scene_size.advice(with_grains(config, 25 * largest), 13.34, 65.0)
    assert "have not been compared" in smaller or "keeps the angle" in smaller


def test_a_process_that_pours_does_not_wait_for_a_table_library():
    """A study starts hundreds of them; pandas takes a third of a second."""
    code = "import sys, repose.apparatus, repose.config.study, repose.measure.pile; assert 'pandas' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
