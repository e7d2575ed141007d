"""The rule that chooses a line: its numbers in closed form, its steps on tables with a known verdict."""

import math

import numpy as np
import pandas as pd
import pytest
from test_saved_pours import AXES, CONFIG
from test_simulated_piles import BERRY as PARTICLE
from test_simulated_piles import cone_of_berries

from repose.calibrate.targets import Targets
from repose.measure import pile
from research.measurement import line_choice, loose_grain
from research.measurement.measurement_study import VARIANTS, noise_table

ANGLE, HEIGHT = Targets.of(
    [
        {
            "response": "aor_deg",
            "value": 32.0,
            "sd": 2.0,
            "repetitions": 16,
            "range": [31, 33],
        },
        {
            "response": "height_mm",
            "value": 60.0,
            "sd": 3.0,
            "repetitions": 16,
            "range": [58, 62],
        },
    ]
)


def test_a_cone_that_is_carried_to_another_height_keeps_its_volume():
    def volume(angle, height):
        return height**3 / math.tan(math.radians(angle)) ** 2

    at = line_choice.convert_to_height(
        np.array([25.0, 30.0]), np.array([60.0, 70.0]), 65.0
    )
    assert volume(at[0], 65.0) == pytest.approx(volume(25.0, 60.0))
    assert volume(at[1], 65.0) == pytest.approx(volume(30.0, 70.0))


def test_the_scatter_has_the_probability_of_a_drawn_table():
    rng = np.random.default_rng(2)
    drawn = rng.normal(0, 3.0, (20000, 10)).std(axis=1, ddof=1)
    share = 2 * min((drawn <= 2.2).mean(), (drawn >= 2.2).mean())
    assert line_choice.scatter_p(2.2, 10, 3.0) == pytest.approx(share, abs=0.01)


def design(mean, spread, scatter):
    """Piles of 200 samples, three each, all 60 mm high; every line has the same angle and scatter."""
    rng = np.random.default_rng(5)
    true = np.repeat(rng.normal(mean, spread, 200), 3)
    table = pd.DataFrame(
        {
            "sample": np.repeat(np.arange(200), 3),
            "seed": np.tile([1, 2, 3], 200),
            "Height": 60.0,
        }
    )
    table["Height"] += rng.normal(0, 1e-6, len(table))
    for name in VARIANTS:
        table[name] = true + rng.normal(0, scatter, len(table))
        table[f"{name} (view)"] = table[name]
    table["Height (view)"] = table["Height"]
    return table


def flat_bias():
    zero = np.zeros(len(VARIANTS))
    return pd.DataFrame(
        {"measured": list(VARIANTS), "filled_bias": zero, "strewn_bias": zero}
    )


def test_facts_of_a_drawn_design_are_those_it_was_drawn_with():
    piles = design(30.0, 1.5, 2.0)
    pairs = [{"aor_simulated_deg": 33.0, "height_simulated_mm": 60.0}]
    table = line_choice.facts(
        piles, noise_table(piles, piles), flat_bias(), ANGLE, HEIGHT, pairs
    ).iloc[0]
    assert table["carried"] == pytest.approx(30.0, abs=0.4)
    spread = math.hypot(1.5, 2.0 / math.sqrt(3))
    assert table["carried_sd"] == pytest.approx(spread, rel=0.15)
    expected = (32 - table["carried"]) / math.hypot(table["carried_sd"], 0.5)
    assert table["off_sd"] == pytest.approx(expected)
    assert table["scatter_view"] == pytest.approx(2.0, rel=0.1)
    assert table["ratio"] == pytest.approx(0.75, rel=0.2)
    assert table["other_simulator_less_band"] == pytest.approx(3.0, abs=0.4)


def rows(**columns):
    table = pd.DataFrame(
        {
            "line": list("abcd"),
            "off_sd": 1.0,
            "scatter_p": 0.5,
            "bias": 1.0,
            "ratio": 1.0,
        }
    )
    return table.assign(**columns)


def test_the_rule_takes_its_steps_in_their_order():
    impossible = [-2.1, 2.1, 1.0, 1.9]
    scattered = [0.5, 0.5, 0.04, 0.06]
    assert line_choice.chosen(rows(off_sd=impossible)) == ("c", ["c", "d"])
    assert line_choice.chosen(rows(off_sd=impossible, scatter_p=scattered)) == (
        "d",
        ["d"],
    )
    assert line_choice.chosen(rows(off_sd=9.0)) == (None, [])
    # a bias within half a degree of the least is alike, and there the ratio decides
    assert (
        line_choice.chosen(rows(bias=[1.0, 1.4, 1.6, 1.1], ratio=[1.0, 1.3, 2.0, 1.2]))[
            0
        ]
        == "b"
    )
    assert line_choice.best_told_apart(rows(ratio=[1.0, 1.3, 2.0, 1.2])) == "c"


def test_other_limits_let_other_lines_pass():
    table = line_choice.verdicts(
        rows(off_sd=[1.4, 1.9, 2.4, 3.0], scatter_p=[0.03, 0.07, 0.3, 0.5])
    )
    passed = table.set_index(["farthest_sd", "least_p"])["passed"]
    assert passed[1.5, 0.01] == "a"
    assert passed[2.0, 0.05] == "b"
    assert passed[2.5, 0.01] == "a; b; c"
    assert table.set_index(["farthest_sd", "least_p"])["chosen"][1.5, 0.1] == "none"


def test_a_loose_grain_touches_the_pile_where_it_is_put(tmp_path):
    centres, quaternions = cone_of_berries(28, np.random.default_rng(3), berries=250)
    poured = {
        "position": centres,
        "quaternion": quaternions,
        "in_pile": np.ones(len(centres), bool),
    }
    places = list(loose_grain.grains_beside(poured, PARTICLE))
    assert [(place, grain) for place, grain, _ in places].count(("foot", "stands")) == 4
    up = np.array([0.0, 0.0, 1.0])
    top = (centres[:, 2] + loose_grain.reach(PARTICLE, quaternions, np.eye(3)[2])).max()
    for place, grain, more in places:
        centre = more["position"][-1]
        quaternion = more["quaternion"][-1:]
        lowest = centre[2] - loose_grain.reach(PARTICLE, quaternion, up)[0]
        assert lowest == pytest.approx(0.0 if place == "foot" else top, abs=0.004)
        long = 2 * loose_grain.reach(PARTICLE, quaternion, up)[0]
        assert (long > 0.015) == (grain == "stands")
    settings = pile.MeasureSettings.with_defaults(
        **CONFIG["measure"] | {"views": 2, "mm_per_pixel": 0.5}
    ).for_grain(AXES)
    assert settings.views == 2
