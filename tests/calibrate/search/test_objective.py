"""The objective for any number of targets, prior knowledge, and the archive of distinct points."""

import math
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.search.objective import (
    PRIOR_WEIGHT,
    Archive,
    Objective,
    Preference,
    select_distinct,
)


def objective_of(low, high, aim=None, weight=None, **more):
    """The objective of targets with these ranges; without an aim, with their centres (Eq. 12)."""
    low = np.array(low, float)
    high = np.array(high, float)
    aim = (low + high) / 2 if aim is None else aim
    weight = np.ones(len(low)) if weight is None else np.array(weight)
    return Objective(
        SimpleNamespace(low=low, high=high, aim=np.array(aim), weight=weight), **more
    )


def sphere(x):
    return ((x - 0.3) ** 2).sum(axis=1)


def test_objective_is_eq_11_and_its_target_eq_12_and_a_prior_counts_a_hundredth():
    F, V = objective_of((31, 64), (34, 69))(
        np.array([[32.5, 66.5], [31.0, 69.0], [30.0, 70.0]])
    )
    np.testing.assert_allclose(F, [0, 1, 2.5 / 3 + 3.5 / 5], atol=1e-12)
    np.testing.assert_allclose(V, [0, 0, 1 / 3 + 1 / 5], atol=1e-12)
    F, _ = objective_of((31, 64), (34, 69), (32.87, 65.57))(np.array([[31.87, 66.57]]))
    np.testing.assert_allclose(F, 1 / 3 + 1 / 5)
    assert PRIOR_WEIGHT == 0.01


def test_fitness_of_two_targets_and_of_one():
    objective = objective_of((0, 0), (1, 1), (0.0, 0.0))
    fitness = objective.fitness(
        *objective(np.array([[1.0, 1.0], [-1e-9, 0.0], [-1.0, 0.0]]))
    )
    assert fitness[0] < fitness[1] < fitness[2]
    F, V = objective_of((31,), (34,))(np.array([[32.5], [33.5], [35.0]]))
    np.testing.assert_allclose(F, [0, 1 / 3, 2.5 / 3])
    np.testing.assert_allclose(V, [0, 0, 1 / 3])


def test_fitness_of_four_targets_with_weights():
    weighted = objective_of(np.zeros(4), np.full(4, 2.0), weight=(1, 2, 0.5, 4))
    F, V = weighted(np.array([[1.5, 1.0, 0.0, 1.25], [1.0, 1.0, 3.0, 1.0]]))
    np.testing.assert_allclose(F, [0.25 + 0.25 + 0.5, 0.5])
    np.testing.assert_allclose(V, [0.0, 0.5])  # of whatever weight: a range is a range
    assert weighted.infeasible_offset == 7.5
    corner, just_outside = weighted.fitness(
        *weighted(np.array([[0.0, 2, 2, 0], [1, 1, 1, 2 + 1e-9]]))
    )
    assert corner < just_outside


def test_weights_of_one_change_nothing():
    random = np.random.default_rng(4)
    low = random.uniform(0, 50, 2)
    high = random.uniform(51, 100, 2)
    plain = objective_of(low, high)
    responses = random.uniform(-20, 120, (500, 2))
    scaled = responses / (high - low)
    F = np.abs(scaled - (low + high) / 2 / (high - low)).sum(axis=1)
    outside = np.maximum(
        np.maximum(low / (high - low) - scaled, scaled - high / (high - low)), 0.0
    )
    found = plain(responses)
    np.testing.assert_array_equal(found[0], F)
    V = outside[:, 0] + outside[:, 1]
    np.testing.assert_array_equal(found[1], V)
    np.testing.assert_array_equal(plain.fitness(*found), F + (V > 0) * 2.0 + 10.0 * V)


def test_a_prior_is_a_small_term_that_no_infeasible_point_makes_up_for():
    ranges = dict.fromkeys(PARAMETERS, (0.2, 0.4))
    assert Preference.from_priors(contact_space(ranges)) is None
    measured = {"prior": {"mean": 0.25, "sd": 0.01}, "range": [0.2, 0.4]}
    space = contact_space(ranges | {"mus_gg": measured, "e_gp": {"fixed": 0.3}})
    preference = Preference.from_priors(space)
    values = np.full((3, 6), 0.3)
    values[:, 1] = 0.25, 0.26, 0.4  # 0, 1 and 15 standard deviations off
    points = 2 * space.unit(values) - 1
    np.testing.assert_allclose(preference.distance(points), [0, 1, 15], atol=1e-9)
    expected = PRIOR_WEIGHT / 2 * np.array([0, 1, 225])
    np.testing.assert_allclose(preference(points), expected, atol=1e-12)
    assert preference.largest == pytest.approx(preference(points)[2])
    objective = objective_of((0.0,), (1.0,), largest_preference=preference.largest)
    F, V = objective(np.array([[0.0], [1.0 + 1e-9]]))
    feasible_far, infeasible_near = objective.fitness(F, V) + preference(points[[2, 0]])
    assert feasible_far < infeasible_near


def distinct_slowly(points, fitness, distance, most):
    kept = []
    for row in sorted(range(len(points)), key=lambda i: (fitness[i], i)):
        if len(kept) < most and all(
            math.dist(points[row], points[k]) >= distance for k in kept
        ):
            kept.append(row)
    return kept


@pytest.mark.parametrize(("distance", "most"), product((0.0, 0.1, 0.6), (5, 1000)))
def test_thinning_against_its_slow_twin(most, distance):
    random = np.random.RandomState(5)
    points = random.uniform(-1, 1, (300, 3))
    fitness = random.randint(0, 50, 300).astype(float)
    points[100:120] = points[:20]
    expected = distinct_slowly(points, fitness, distance, most)
    assert select_distinct(points, fitness, distance, most).tolist() == expected


def test_archive_is_bounded_distinct_sorted_and_holds_the_best():
    random = np.random.RandomState(6)
    archive = Archive(2, 0.1, 40, buffer=500)
    everything = []
    all_fitness = []
    for _ in range(60):
        points = random.uniform(-1, 1, (170, 2))
        fitness = sphere(points)
        archive.add(points, fitness)
        assert archive._n_waiting <= 500
        assert len(archive.points) <= 40
        everything.append(points)
        all_fitness.append(fitness)
    archive.thin()
    everything = np.concatenate(everything)
    all_fitness = np.concatenate(all_fitness)
    assert len(archive.points) >= 30
    assert (np.diff(archive.fitness) >= 0).all()
    np.testing.assert_array_equal(archive.points[0], everything[all_fitness.argmin()])
    gaps = np.linalg.norm(
        archive.points[:, None] - archive.points, axis=2
    ) + 9 * np.eye(len(archive.points))
    assert gaps.min() >= 0.1
    # no better point was passed over: each lies near one that is kept
    better = everything[all_fitness < archive.fitness[20]]
    assert (
        np.linalg.norm(better[:, None] - archive.points, axis=2).min(axis=1).max() < 0.2
    )


def test_archive_takes_more_than_its_buffer():
    points = np.random.RandomState(7).uniform(-1, 1, (1000, 2))
    archive = Archive(2, 0.0, 1000, buffer=64)
    archive.add(points, sphere(points))
    archive.thin()
    np.testing.assert_array_equal(archive.fitness, np.sort(sphere(points)))
