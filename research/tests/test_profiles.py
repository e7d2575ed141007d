"""The whole profile as a target: principal components, and piles whose profile adds information to two numbers."""

import numpy as np
import pandas as pd
import pytest

import repose.bench  # noqa: F401  (makes the responses known)
from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.targets import Targets
from research.responses import profiles

SPACE = contact_space(dict.fromkeys(PARAMETERS, (0.0, 1.0)))
TARGETS = Targets.of(
    [
        {
            "response": "height_mm",
            "value": 60.0,
            "sd": 1.0,
            "repetitions": 4,
            "range": [55.0, 65.0],
        }
    ]
)
SETTINGS = {
    "points": 2**13,
    "truths": 5,
    "folds": 2,
    "seed": 1,
    "surrogate": "quadratic",
    "discrepancy_percent": 2.0,
    "discrepancy_correlation": 0.9,
    "smallest_discrepancy": {"mm": 0.5},
}


def test_profiles_that_vary_in_two_ways_have_two_components():
    random = np.random.default_rng(3)
    first = np.array([3.0, 4.0, 0.0]) / 5.0
    second = np.array([0.0, 0.0, 1.0])
    scores = random.normal(size=(400, 2)) * (2.0, 1.0)
    scores -= scores.mean(axis=0)
    means = np.array([9.0, 5.0, 1.0]) + scores @ np.array([first, second])
    centre, directions, share = profiles.principal(means)
    assert centre == pytest.approx([9.0, 5.0, 1.0])
    assert np.abs(directions[:, 0] @ first) == pytest.approx(1.0, abs=0.01)
    assert np.abs(directions[:, 1] @ second) == pytest.approx(1.0, abs=0.01)
    assert share[0] == pytest.approx(0.8, abs=0.03)
    assert share[2] == pytest.approx(0.0, abs=1e-12)


def test_heights_end_below_the_crest():
    assert profiles.levels_mm(10.0) == pytest.approx([3.0, 6.0, 9.0])


def test_a_profile_adds_information_to_two_numbers(tmp_path):
    """Angle and Height follow e_gg, and so does the width of the lower half; that of the upper half follows mus_gg."""
    random = np.random.default_rng(5)
    levels = 10
    X = random.uniform(size=(80, 6))
    place = np.repeat(X, 3, axis=0)
    sample = np.repeat(np.arange(80), 3)

    def noise(size):
        return random.normal(0, size, 240)

    runs = pd.DataFrame(
        {"sample": sample, "aor_deg": 30 + 10 * place[:, 0] + noise(0.3)}
    )
    runs["height_mm"] = 50 + 20 * place[:, 0] + noise(0.6)
    for level in range(levels):
        which = 0 if level < levels // 2 else 1
        runs[level] = 60 - 5 * level + 8 * place[:, which] + noise(0.3)
    output = profiles.run(
        X, np.arange(80), runs, levels, TARGETS, SPACE, SETTINGS, tmp_path
    )
    assert "2 components of the profile have a surrogate" in output
    table = pd.read_csv(tmp_path / "information.csv").set_index(
        ["discrepancy_percent", "discrepancy_correlation", "set"]
    )
    exact = table.loc[0.0, 0.0]
    assert (
        exact.loc["profile", "width_mus_gg"]
        < 0.3
        < 0.9
        < exact.loc["both numbers", "width_mus_gg"]
    )
    assert exact.loc["profile and both numbers", "gain_bits"] > 1.0
    # a discrepancy takes bits away, and one that all heights share takes fewer of what differs between them
    for correlation in (0.0, 0.9):
        assert (table.loc[2.0, correlation]["bits"] < exact["bits"]).all()
    components = pd.read_csv(tmp_path / "components.csv").set_index("number")
    assert components["kept"].sum() == 4
    assert components.loc["component_1", "r2"] > 0.8
