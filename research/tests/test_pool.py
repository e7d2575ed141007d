"""The pool: its points, and its tables under names of their own."""

import numpy as np
import pytest

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from research import pool

RANGES = dict.fromkeys(PARAMETERS, (0.1, 0.4)) | {"mur_gp": (0.2, 0.3)}
SPACE = contact_space(RANGES)
SETTINGS = {"samples": 40, "seeds": 2, "fresh_samples": 8, "fresh_seeds": 2, "seed": 5}


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pool")
    return folder, pool.run(SPACE, SETTINGS, folder)


def test_both_sets_lie_in_the_ranges_and_are_numbered_from_one(tables):
    folder, sets = tables
    assert sorted(path.name for path in folder.glob("*.csv")) == [
        "fresh_samples.csv",
        "samples.csv",
    ]
    for name, count in (("pool", 40), ("fresh", 8)):
        assert sets[name]["sample"].tolist() == list(range(1, count + 1))
        for parameter, (low, high) in RANGES.items():
            assert sets[name][parameter].between(low, high).all()


def test_a_larger_pool_begins_with_the_smaller_one(tables, tmp_path):
    larger = pool.run(SPACE, SETTINGS | {"samples": 70}, tmp_path)["pool"]
    assert larger.head(40).equals(tables[1]["pool"])
    assert not pool.run(SPACE, SETTINGS | {"seed": 6}, tmp_path)["pool"].equals(
        tables[1]["pool"]
    )


def test_no_fresh_point_is_one_of_the_pool(tables):
    pool_points = tables[1]["pool"][list(PARAMETERS)].to_numpy()
    other = tables[1]["fresh"][list(PARAMETERS)].to_numpy()
    assert np.abs(pool_points[:, None] - other).max(axis=2).min() > 1e-3


def test_leading_points_are_spread_more_evenly_than_random_ones():
    """The first 2^k points of a Sobol sequence have one in each of 2^k equal strata of every column."""
    points = pool.sobol(100, 6, 3)[:32]
    assert all(
        sorted(np.floor(32 * column).astype(int)) == list(range(32))
        for column in points.T
    )


def test_a_fixed_parameter_has_its_value_everywhere(tmp_path):
    space = contact_space(RANGES | {"e_gp": {"fixed": 0.35}})
    table = pool.run(space, SETTINGS, tmp_path)["pool"]
    assert (table["e_gp"] == 0.35).all()
    assert table["mus_gp"].nunique() == 40
