"""Searches beside each other: the log that counts them, and what is said of what they find, on closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
from refusals import value_error

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.inversion import restrict_to_free_parameters
from repose.calibrate.search.objective import Objective
from research.comparison import search
from research.comparison.region import Region
from research.comparison.searches import Log, Spent, logged, searches

SECTION = {
    "islands": 2,
    "population": 10,
    "generations": 5,
    "rounds": 20,
    "tournament": 3,
    "mutation_probability": 0.05,
    "mutation_amplitude": 0.1,
}


def objective_of(k, high):
    return Objective(
        SimpleNamespace(
            low=np.full(k, -high),
            high=np.full(k, high),
            aim=np.zeros(k),
            weight=np.ones(k),
        )
    )


OBJECTIVE = objective_of(2, 1.0)


def respond(points):
    """Two responses of six parameters; the target is met on a plane of four dimensions."""
    return np.column_stack(
        [3 * points[:, 0] + points[:, 1], 3 * points[:, 2] - points[:, 3]]
    )


def test_log_counts_every_point_and_ends_when_they_are_used_up():
    log = Log(respond, OBJECTIVE, 5, 6)
    points = np.zeros((4, 6))
    points[:, 0] = [0, 0.1, 0.2, 1]
    # F = |3 x| / 2 inside the box; at x = 1 it is 1.5, outside by 1
    expected = [0, 0.15, 0.3, 1.5 + OBJECTIVE.infeasible_offset + 10 * 1.0]
    assert log(points) == pytest.approx(expected)
    with pytest.raises(Spent):
        log(points)
    assert log.used == 5
    assert np.array_equal(log.points[4], points[0])
    with pytest.raises(Spent):
        log.of_one(points[0])


def test_derivatives_are_those_of_the_responses_and_are_counted():
    log = Log(respond, OBJECTIVE, 100, 6)
    x = np.array([1.0, -1.0, 0.2, 0.3, 0, 0])
    # over the box's width
    known = np.array([[3, 1, 0, 0, 0, 0], [0, 0, 3, -1, 0, 0]]) / 2
    assert log.jacobian(x) == pytest.approx(known, abs=1e-6)
    assert log.used == 6
    assert (np.abs(log.points) <= 1).all()


@pytest.mark.parametrize("name", [*searches(SECTION)])
def test_every_search_uses_its_evaluations_inside_the_box_and_is_repeatable(name):
    run, budget = searches(SECTION)[name]
    assert budget == (2000 if name == "miga_whole" else None)
    first = logged(run, respond, OBJECTIVE, 600, 6, 1)[0]
    again = logged(run, respond, OBJECTIVE, 600, 6, 1)[0]
    other = logged(run, respond, OBJECTIVE, 600, 6, 2)[0]
    assert first.used == 600
    assert np.abs(first.points).max() <= 1
    assert np.array_equal(first.points, again.points)
    assert not np.array_equal(first.points, other.points)
    assert first.fitness.min() < 0.15


def test_least_squares_solves_a_linear_problem_at_once():
    run, _ = searches(SECTION)["least_squares"]
    log, _ = logged(run, respond, OBJECTIVE, 2000, 6, 3)
    assert np.flatnonzero(log.fitness <= 1e-6)[0] < 100
    assert (log.fitness <= 1e-6).sum() > 20  # and again from other points


def test_region_has_its_share_and_random_points_cover_half_of_it():
    """Feasible is |3 a + b| <= 1 and |3 c - d| <= 1: each has probability 1 / 3 (the band of slope 3)."""
    region = Region(respond, OBJECTIVE, 2**14, 90, 6, 1)
    assert region.share == pytest.approx((1 / 3) ** 2, abs=0.005)
    spread = region.spread(region.lists[3])
    assert spread["coverage"] == pytest.approx(0.5, abs=0.06)
    assert spread["volume"] == pytest.approx(1, abs=0.35)
    assert spread["width"] > 0.85
    bunched = region.spread(
        region.points[0] + np.random.default_rng(1).normal(0, 0.01, (90, 6))
    )
    assert bunched["coverage"] < 0.02
    # sqrt(2) times the mean of chi_6
    assert bunched["pairwise_distance"] == pytest.approx(0.0332, rel=0.15)
    assert bunched["volume"] < 1e-6
    value_error(
        "0 of 1024 points are feasible",
        Region,
        lambda x: respond(x) + 99,
        OBJECTIVE,
        1024,
        90,
        6,
        1,
    )


def test_evaluations_are_counted_to_the_first_that_meets_it():
    log = Log(respond, OBJECTIVE, 3, 6)
    log(np.array([[1.0, 0, 0, 0, 0, 0], [0.2, 0, 0, 0, 0, 0], [0.001, 0, 0, 0, 0, 0]]))
    region = Region(respond, OBJECTIVE, 2**13, 90, 6, 1)
    row, best = search.judged(log, region, 0.01, 90, 0.02, 1)
    assert row["evaluations_to_feasible"] == 2
    assert row["evaluations_to_tolerance"] == 3
    assert row["listed"] == 2
    assert best[0] == 0.001
    assert search.curve(log.fitness, np.array([1, 2, 3])) == pytest.approx(
        [13.5, 0.3, 0.0015]
    )
    assert search.checkpoints(1000).tolist()[0] == 10
    assert search.checkpoints(1000).tolist()[-1] == 1000


def test_a_fixed_parameter_stays_where_it_is():
    ranges = dict.fromkeys(PARAMETERS, (0.0, 2.0)) | {"mus_gg": {"fixed": 0.3}}

    class Model:
        def response_function(self, low, high):
            return lambda points: (low + high) / 2 + points * (high - low) / 2

    respond = restrict_to_free_parameters(Model(), contact_space(ranges))
    assert respond(np.array([[-1.0, 0, 0, 0, 1]])).tolist() == [[0, 0.3, 1, 1, 1, 2]]


@pytest.mark.parametrize("k", [1, 4])
def test_searches_are_compared_for_any_number_of_targets(k):
    """Responses that each follow a parameter of their own, and two parameters left open."""
    objective = objective_of(k, 0.8)
    settings = {
        "evaluations": 300,
        "repetitions": 2,
        "tolerance": 0.05,
        "region_points": 4096,
        "seed": 1,
    }
    section = SECTION | {"rounds": 3, "solutions": 20, "distance": 0.02}
    tables = search.compared(lambda x: x[:, :k], k + 2, objective, settings, section)
    methods = tables["search_methods"].set_index("method")
    assert methods.loc[search.REFERENCE, "feasible_share"] == pytest.approx(
        0.8**k, abs=0.01
    )
    assert methods.loc["least_squares", "reached"] == 2
    assert set(tables["search"]["method"]) == set(searches(SECTION))
