"""Sobol indices and main effects with closed forms."""

import json

import numpy as np
import pandas as pd
import pytest

from repose.core.parameters import PARAMETERS
from repose.studies import sensitivity
from repose.surrogate.bayesian_bp import PlainBayesianBP

LOW, HIGH = [-np.pi] * 3, [np.pi] * 3


def ishigami(X, a=7.0, b=0.1):
    return np.sin(X[:, 0]) + a * np.sin(X[:, 1]) ** 2 + b * X[:, 2] ** 4 * np.sin(X[:, 0])


def ishigami_indices(a=7.0, b=0.1):
    """First-order and total (Ishigami & Homma 1990)."""
    first, second = 0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8
    both = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    total = first + second + both
    return np.array([first, second, 0]) / total, np.array([first + both, second, both]) / total


def test_ishigami():
    found = sensitivity.indices(ishigami, LOW, HIGH, 4096, 100, 7)
    for name, known in zip(("first", "total"), ishigami_indices(), strict=True):
        assert found[name][0] == pytest.approx(known, abs=0.015)
        width = found[f"{name}_high"] - found[f"{name}_low"]
        assert ((width[0] > 0.005) & (width[0] < 0.15)).all()
        assert (found[f"{name}_low"][0] <= known + 0.01).all()
        assert (known - 0.01 <= found[f"{name}_high"][0]).all()


def test_two_outputs_with_large_means_and_another_spread():
    """A sum of a_i x_i has first = total = a_i^2 / sum a^2, whatever is added."""

    def weigh(X):
        return np.column_stack([1000 + X @ [1, 2, 0], -50 + X @ [0, 3, 4]])

    found = sensitivity.indices(weigh, [0, 0, 0], [1, 1, 1], 2048, 20, 1)
    known = np.array([[1, 4, 0], [0, 9, 16]]) / np.array([[5], [25]])
    assert found["first"] == pytest.approx(known, abs=0.01)
    assert found["total"] == pytest.approx(known, abs=0.01)


def test_main_effect_is_the_mean_over_the_other_inputs():
    """E[Ishigami | x_2] = a sin^2 x_2, E[. | x_1] = sin x_1 (1 + b pi^4 / 5) + a / 2."""
    grid, means = sensitivity.main_effects(ishigami, LOW, HIGH, 3, points=9)
    assert grid.shape == (3, 9)
    assert means[1] == pytest.approx(7 * np.sin(grid[1]) ** 2, abs=0.05)
    assert means[0] == pytest.approx(np.sin(grid[0]) * (1 + 0.1 * np.pi**4 / 5) + 3.5, abs=0.05)


def test_bad_arguments_are_told():
    with pytest.raises(ValueError, match="samples is 100; allowed: a power of two"):
        sensitivity.indices(ishigami, LOW, HIGH, 100, 20, 1)
    with pytest.raises(ValueError, match="does not vary"):
        sensitivity.indices(lambda X: np.ones(len(X)), LOW, HIGH, 64, 20, 1)


def test_tables_of_a_network(tmp_path):
    random = np.random.RandomState(1)
    X = random.uniform(size=(60, 6))
    model = PlainBayesianBP(hidden=3, starts=1, epochs=100).fit(X, X @ random.uniform(size=(6, 2)))
    model.save(tmp_path / "network.json")
    ranges = dict.fromkeys(PARAMETERS, (0.0, 1.0))
    settings = {"samples": 256, "resamples": 20, "seed": 1}
    table = sensitivity.run(tmp_path / "network.json", ranges, settings, tmp_path / "out")
    again = sensitivity.run(tmp_path / "network.json", ranges, settings, tmp_path / "again")
    pd.testing.assert_frame_equal(table, again)
    assert len(table) == 12
    assert table.groupby("response")["first"].sum().to_numpy() == pytest.approx([1, 1], abs=0.05)
    effects = pd.read_csv(tmp_path / "out/main_effects.csv")
    assert effects.columns.tolist() == ["parameter", "value", "aor_deg", "height_mm"]
    assert "aor_deg: first-order (total)" in sensitivity.message(table)
    assert json.loads((tmp_path / "network.json").read_text())["inputs"] == list(PARAMETERS)
