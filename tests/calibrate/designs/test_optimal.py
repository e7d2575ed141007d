"""Runs at allowed places by D-optimality, beside known designs and an exhaustive search."""

from itertools import combinations

import numpy as np
import pytest
from refusals import value_error

from repose.calibrate.designs.box_behnken import box_behnken
from repose.calibrate.designs.model import fit_model, list_terms
from repose.calibrate.designs.optimal import (
    LEVELS,
    RIDGE,
    choose_added_runs,
    compute_log_determinant,
    replace_forbidden,
)
from repose.calibrate.designs.optimum import find_optimum
from repose.calibrate.designs.region import Region


def region(*excesses, factors=2):
    """A region of functions of a point that are above 0 where it is forbidden."""
    return Region(
        lambda coded: np.column_stack([excess(*coded.T) for excess in excesses]),
        factors,
    )


# x <= y is a triangle, a simplex with three corners.
TRIANGLE = region(lambda x, y: x - y)
WHOLE = region(lambda x, y: 0 * x - 1)
SLANTED = region(lambda x, y: x - 0.4 * y - 0.3)
LINE = region(lambda x: 0 * x - 1, factors=1)
NOTHING = np.empty((0, 2))


def rows_of(points):
    return sorted(map(tuple, np.round(points, 9).tolist()))


def test_on_a_triangle_the_runs_are_its_corners_and_the_middles_of_its_sides():
    # The D-optimal design of a quadratic on a simplex is Scheffe's lattice (Kiefer 1961).
    runs = choose_added_runs(NOTHING, 6, TRIANGLE, list_terms(2, "quadratic"))
    lattice = [(-1, -1), (-1, 0), (-1, 1), (0, 0), (0, 1), (1, 1)]
    assert rows_of(runs) == lattice


def test_on_a_square_the_runs_are_the_factorial_of_three_levels():
    runs = choose_added_runs(NOTHING, 9, WHOLE, list_terms(2, "quadratic"))
    levels = (-1.0, 0.0, 1.0)
    assert rows_of(runs) == [(x, y) for x in levels for y in levels]


@pytest.mark.parametrize(("order", "runs"), [
    ("linear", [-1, -1, 1, 1]), ("quadratic", [-1, 0, 1]),
])  # fmt: skip
def test_on_a_line_the_runs_are_those_of_de_la_garza(order, runs):
    found = choose_added_runs(np.empty((0, 1)), len(runs), LINE, list_terms(1, order))
    assert sorted(found.ravel().tolist()) == runs


def test_no_pair_of_runs_is_better_than_the_one_that_is_added():
    terms = list_terms(2, "quadratic")
    kept = np.array([[-1, -1], [-1, 1], [-0.5, 0.0], [0, 0], [-0.2, -1.0]])
    found = choose_added_runs(kept, 2, SLANTED, terms)
    assert SLANTED.is_allowed(found).all()
    # The twin: all pairs of levels.
    grid = np.stack(np.meshgrid(LEVELS, LEVELS), axis=-1).reshape(-1, 2)
    grid = grid[SLANTED.is_allowed(grid)][::2]

    def determinant(runs):
        x, y = np.vstack([kept, runs]).T
        X = np.column_stack([np.ones(len(x)), x, y, x * y, x**2, y**2])
        return np.linalg.slogdet(X.T @ X + RIDGE * np.eye(6)).logabsdet

    value = compute_log_determinant(np.vstack([kept, found]), terms)
    assert value == pytest.approx(determinant(found), abs=1e-6)
    assert value >= max(map(determinant, map(list, combinations(grid, 2)))) - 1e-6


def test_allowed_runs_stay_and_all_coefficients_are_found():
    design = box_behnken(3, 3)
    slanted = region(lambda x, y, z: x + y - 0.5, factors=3)
    found = replace_forbidden(design, slanted, "quadratic")
    is_forbidden = design[:, 0] + design[:, 1] > 0.5
    assert 0 < is_forbidden.sum() < len(design)
    assert (found.is_new == is_forbidden).all()
    assert (found.coded[~is_forbidden] == design[~is_forbidden]).all()
    assert (found.coded[:, 0] + found.coded[:, 1] <= 0.5).all()
    coefficients = np.arange(1.0, 11.0)
    terms = list_terms(3, "quadratic")
    columns = [found.coded[:, list(term)].prod(axis=1) for term in terms]
    response = np.column_stack([np.ones(len(design)), *columns]) @ coefficients
    model = fit_model(found.coded, response, "ABC", "quadratic")
    assert model.all_coefficients == pytest.approx(coefficients)


def test_without_constraints_or_forbidden_runs_the_design_is_as_it_was():
    design = box_behnken(3, 3)
    for place in (None, region(lambda x, y, z: x - 2, factors=3)):
        found = replace_forbidden(design, place, "quadratic")
        assert (found.coded == design).all()
        assert not found.is_new.any()


def test_a_region_that_leaves_the_model_open_is_refused():
    square = np.array([[-1.0, -1], [-1, 1], [1, -1], [1, 1], [0, 0]])
    words = "5 allowed runs determine 5 coefficients; expected all 6"
    value_error(words, replace_forbidden, square, TRIANGLE, "quadratic")
    line = region(lambda x, y: x - y, lambda x, y: y - x)
    words = "none of 8192 points of the cube is allowed"
    value_error(words, replace_forbidden, square[:4], line, "linear")


def test_the_nearest_allowed_point_is_the_foot_of_the_perpendicular():
    assert TRIANGLE.find_nearest(np.array([1.0, -1])) == pytest.approx([0, 0], abs=1e-6)
    assert TRIANGLE.find_nearest(np.array([0.5, 0.1])) == pytest.approx([0.3, 0.3])
    allowed = np.array([-0.2, 0.4])
    assert (TRIANGLE.find_nearest(allowed) == allowed).all()
    for point in np.random.default_rng(1).uniform(-1, 1, (20, 2)):
        assert SLANTED.is_allowed(SLANTED.find_nearest(point)[None])[0]


def test_the_centre_of_a_region_is_that_of_the_cube_or_the_centroid():
    assert (TRIANGLE.centre == 0).all()
    corner = region(lambda x, y: x - y + 1)  # its corners: (-1, 0), (-1, 1), (0, 1)
    assert corner.centre == pytest.approx([-2 / 3, 2 / 3], abs=2e-3)
    hollow = region(lambda x, y: 0.8 - np.hypot(x, y))
    assert hollow.is_allowed(hollow.centre[None])[0]


def flat(function):
    runs = box_behnken(3, 3)
    return fit_model(runs, function(*runs.T), "ABC", "quadratic")


def test_an_optimum_stays_where_it_is_allowed():
    model = [flat(lambda a, b, c: 10 + 3 * a + 4 * b)]
    # Without a constraint the nearest point that meets 12 is (0.24, 0.32, 0).
    half = region(lambda a, b, c: a, factors=3)
    found = find_optimum(model, [12], [12], [9], [15], half)
    assert found.met
    assert found.coded == pytest.approx([0, 0.5, 0], abs=1e-6)
    assert half.is_allowed(found.coded[None])[0]
    # The largest 3 A + 4 B with A + B <= 1 is 4.
    slope = region(lambda a, b, c: a + b - 1, factors=3)
    found = find_optimum(model, [30], [30], [20], [40], slope)
    assert not found.met
    assert found.coded[:2] == pytest.approx([0, 1], abs=1e-4)
    assert slope.is_allowed(found.coded[None])[0]
