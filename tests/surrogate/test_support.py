"""Solutions at a bound or beyond the samples carry a warning."""

import numpy as np
import pandas as pd
import pytest

from repose.core.errors import InputError
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.surrogate.support import Support, quadratic_terms

NAMES = ("a", "b")


def grid():
    """A grid of 6 x 6 samples, 0.1 apart, from 0.2 to 0.7."""
    side = np.linspace(0.2, 0.7, 6)
    return np.array([(x, y) for x in side for y in side])


def test_distance_is_beyond_when_farther_than_samples_are_from_each_other():
    support = Support(grid(), [0, 0], [1, 1], NAMES)
    assert support.farthest == pytest.approx(0.1)
    assert support.distance([[0.2, 0.25], [0.7, 0.85]]) == pytest.approx([0.05, 0.15])
    assert support.is_thin([[0.45, 0.45], [0.7, 0.85]]).tolist() == [False, True]


def test_distances_are_in_ranges():
    support = Support(grid() * [1, 10], [0, 0], [1, 10], NAMES)
    assert support.distance([[0.2, 2.5]]) == pytest.approx([0.05])


def test_leverage_is_that_of_a_quadratic_model():
    points = np.random.default_rng(1).uniform(size=(40, 2))
    support = Support(points, [0, 0], [1, 1], NAMES)
    X = np.column_stack([np.ones(40), points, points**2, points[:, 0] * points[:, 1]])
    hat = np.diag(X @ np.linalg.inv(X.T @ X) @ X.T)
    assert support.leverage(points) == pytest.approx(hat)
    assert hat.sum() == pytest.approx(6)
    assert support.largest_leverage == pytest.approx(hat.max())
    assert support.is_thin([[1.6, 1.6]]).all()


def test_few_samples_bear_no_quadratic_model():
    points = np.random.default_rng(1).uniform(size=(20, 6))
    support = Support(points, np.zeros(6), np.ones(6))
    assert quadratic_terms(points).shape == (20, 28)
    assert support.leverage(points).tolist() == [0.0] * 20


def test_warnings_in_words():
    support = Support(grid(), [0, 0], [1, 1], NAMES)
    inside, bound, near, far = support.warnings([[0.45, 0.5], [0.005, 0.995], [0.012, 0.5], [0.45, 0.9]])
    assert inside == ""
    assert bound.startswith("at a bound: a low, b high; nearest sample")
    assert "bound" not in near
    assert "nearest sample 0.21 of a range away, usual up to 0.10" in far
    assert "leverage" in far


def test_support_of_a_dataset_takes_usable_samples(tmp_path):
    table = pd.DataFrame(np.random.default_rng(1).uniform(size=(40, 6)), columns=list(PARAMETERS))
    table["sample"], table["status"] = np.arange(40), "ok"
    table.loc[0, "status"] = "jammed"
    table.to_csv(tmp_path / "dataset.csv", index=False)
    space = ParameterSpace.of(dict.fromkeys(PARAMETERS, (0.0, 1.0)))
    support = Support.of_dataset(tmp_path / "dataset.csv", space)
    first = table.loc[[0, 1], list(PARAMETERS)].to_numpy()
    assert support.distance(first)[0] > 0
    assert support.distance(first)[1] == 0
    cohesive = ParameterSpace.of(dict.fromkeys([*PARAMETERS, "gamma_gg"], (0.0, 1.0)))
    with pytest.raises(InputError, match="column gamma_gg is 'missing'"):
        Support.of_dataset(tmp_path / "dataset.csv", cohesive)
    table["status"] = "jammed"
    table.to_csv(tmp_path / "dataset.csv", index=False)
    with pytest.raises(InputError, match="usable samples is 0"):
        Support.of_dataset(tmp_path / "dataset.csv", space)


def test_a_fixed_parameter_plays_no_part():
    points = np.insert(grid(), 1, 0.3, axis=1)
    fixed = Support(points, [0, 0.3, 0], [1, 0.3, 1], ("a", "fixed", "b"))
    free = Support(grid(), [0, 0], [1, 1], NAMES)
    asked = np.array([[0.45, 0.5], [0.005, 0.995], [0.45, 0.9]])
    assert fixed.warnings(np.insert(asked, 1, 0.3, axis=1)) == free.warnings(asked)
    assert fixed.at_bounds(np.insert(asked, 1, 0.3, axis=1))[:, 1].tolist() == [False] * 3
    assert fixed.largest_leverage == free.largest_leverage


def test_points_of_another_shape_are_refused():
    with pytest.raises(ValueError, match=r"points has shape \(3, 2\); expected at least two rows of 6"):
        Support(np.zeros((3, 2)), np.zeros(6), np.ones(6))
