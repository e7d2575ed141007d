"""Designs: true Latin hypercubes, the optimum where it is known, exchanges against a slow twin."""

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from shared import RANGES

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.designs import exchange_search
from repose.calibrate.designs import latin_hypercube as design
from repose.calibrate.designs.settings import DesignSettings
from repose.stages.design import write_design


def strata_are_filled_once(points):
    n = len(points)
    return all(
        sorted(np.floor(column * n).astype(int)) == list(range(n))
        for column in points.T
    )


def slow_minimum_distance(points):
    """Eq. 5 over every pair."""
    pairs = [(a, b) for i, a in enumerate(points) for b in points[:i]]
    return min(
        sum((x - y) ** 2 for x, y in zip(a, b, strict=True)) ** 0.5 for a, b in pairs
    )


def test_designs_are_latin_hypercubes():
    rng = np.random.default_rng(1)
    assert strata_are_filled_once(design.random_lhs(150, 6, rng))
    assert strata_are_filled_once(design.lhsdesign(150, 6, rng=rng))
    for n, d in ((2, 1), (2, 6), (3, 2), (7, 1)):
        assert strata_are_filled_once(design.optimal_lhs(n, d, seed=1))


def test_an_exchange_gains_what_it_says():
    """The criterion is the sum over all pairs of their distance to the power of -16, here by a slow loop."""
    rng = np.random.default_rng(4)
    points = design.random_lhs(25, 4, rng)
    doublings = 3
    pairs = exchange_search.Pairs(points, doublings)
    points = pairs.points

    def total(points):
        squares = [
            np.sum((a - b) ** 2) for i, a in enumerate(points) for b in points[:i]
        ]
        return sum(square ** -(2.0**doublings) for square in squares)

    assert pairs.sum_repulsions() == pytest.approx(total(points))
    assert pairs.squared_distances.min() == pytest.approx(
        design.minimum_distance(points) ** 2
    )
    for _ in range(20):
        column = rng.integers(4)
        i, j = rng.choice(25, 2, replace=False)
        (gain,) = pairs.compute_changes(column, np.array([i]), np.array([j]))
        before = total(points)
        pairs.exchange(column, i, j)
        after = total(points)
        rounding = 1e-9 * max(before, after)
        assert gain == pytest.approx(after - before, rel=1e-6, abs=rounding)
        assert pairs.sum_repulsions() == pytest.approx(after)


@pytest.mark.slow
def test_optimal_is_a_latin_hypercube_far_better_than_best_of_20():
    optimal = design.optimal_lhs(150, 6, seed=2026)
    assert optimal.shape == (150, 6)
    assert strata_are_filled_once(optimal)
    best_of_20 = design.lhsdesign(150, 6, rng=np.random.default_rng(2026))
    assert design.minimum_distance(optimal) > 0.53
    assert design.minimum_distance(best_of_20) < 0.35
    assert design.phi_p(optimal) < design.phi_p(best_of_20)


def test_the_best_of_20_designs_is_chosen():
    rng = np.random.default_rng(5)
    distances = [
        slow_minimum_distance(design.random_lhs(30, 3, rng)) for _ in range(20)
    ]
    chosen = design.lhsdesign(30, 3, rng=np.random.default_rng(5))
    assert slow_minimum_distance(chosen) == pytest.approx(max(distances))


def test_criteria_are_those_of_slow_twins():
    points = design.random_lhs(12, 3, np.random.default_rng(2))
    expected = slow_minimum_distance(points)
    assert design.minimum_distance(points) == pytest.approx(expected)
    pairs = [(a, b) for i, a in enumerate(points) for b in points[:i]]
    expected = sum(np.linalg.norm(a - b) ** -16.0 for a, b in pairs) ** (1 / 16)
    assert design.phi_p(points) == pytest.approx(expected)


def test_five_points_have_their_optimum():
    """In a square of 5 x 5 cells the best five points are a knight's move apart, sqrt(5) cells."""
    cells = np.floor(design.optimal_lhs(5, 2, seed=3) * 5)
    assert slow_minimum_distance(cells) == pytest.approx(np.sqrt(5))


def test_a_design_follows_from_its_seed():
    first = design.optimal_lhs(5, 2, seed=7)
    design._optimal_lhs.cache_clear()  # make the design again
    np.testing.assert_array_equal(first, design.optimal_lhs(5, 2, seed=7))
    assert not np.array_equal(first, design.optimal_lhs(5, 2, seed=8))
    # as published designs were made: a rounding that differs leads to another design
    published = design.optimal_lhs(16, 2, seed=1)
    assert design.minimum_distance(published) == 0.2312518711027318


@pytest.mark.parametrize("seed", [7, [7, 1]])
def test_a_kept_design_stays_as_it_was_made(seed):
    first = design.optimal_lhs(4, 2, seed)
    expected = first.copy()
    first[:] = 0.0
    np.testing.assert_array_equal(design.optimal_lhs(4, 2, seed), expected)


@pytest.mark.usefixtures("short_search")
@pytest.mark.parametrize("method", ["lhsdesign", "optimal"])
def test_written_samples_are_still_stratified(tmp_path, method):
    write_design(
        contact_space(RANGES),
        DesignSettings(samples=15, method=method, seed=2026),
        tmp_path,
    )
    table = pd.read_csv(tmp_path / "samples.csv")
    assert list(table.columns) == ["sample", *PARAMETERS]
    assert list(table["sample"]) == list(range(1, 16))
    unit = np.stack(
        [(table[p] - RANGES[p][0]) / (RANGES[p][1] - RANGES[p][0]) for p in PARAMETERS],
        axis=1,
    )
    assert strata_are_filled_once(unit)
    comparison = pd.read_csv(tmp_path / "comparison.csv").set_index("method")
    assert list(comparison.index) == ["random", "lhsdesign", "optimal"]
    expected = slow_minimum_distance(unit)
    assert comparison.loc[method, "min_distance"] == pytest.approx(expected, rel=1e-4)
    distances = comparison["min_distance"]
    assert distances["random"] <= distances["lhsdesign"] < distances["optimal"]


@pytest.mark.usefixtures("short_search")
def test_a_fixed_parameter_is_a_column():
    section = RANGES | {
        "e_gp": {"fixed": 0.4},
        "mus_gg": {"prior": {"mean": 0.5, "sd": 0.02}},
    }
    table, comparison = design.make_designs(
        contact_space(section), DesignSettings(samples=12, method="optimal", seed=1)
    )
    assert table["e_gp"].tolist() == 12 * [0.4]
    assert sorted(np.floor(12 * (table["mus_gg"] - 0.44) / 0.12)) == list(range(12))
    assert comparison["samples"].tolist() == [12, 12, 12]


@pytest.mark.parametrize(
    ("samples", "method", "seed", "key"),
    [
        (1, "optimal", 1, "samples"),
        (2.5, "optimal", 1, "samples"),
        (12, "best", 1, "method"),
        (12, "optimal", -1, "seed"),
    ],
)
def test_bad_settings_are_refused(samples, method, seed, key):
    with pytest.raises(ValidationError) as caught:
        DesignSettings(samples=samples, method=method, seed=seed)
    assert [error["loc"] for error in caught.value.errors()] == [(key,)]


def test_a_design_of_one_parameter_has_nothing_to_exchange():
    points = design.optimal_lhs(8, 1, seed=3)
    expected = design.lhsdesign(8, 1, rng=np.random.default_rng(3))
    np.testing.assert_array_equal(points, expected)
    strata = np.floor(8 * points[:, 0])
    assert sorted(strata) == list(range(8))
