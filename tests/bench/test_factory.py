"""Where a new berry appears: the first free one of the random places, found for all of them at once; how it lies."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from repose.bench.factory import (
    MOST_POINTS,
    Disc,
    Strip,
    add_above,
    draw_orientation,
    find_free_point,
)
from repose.dem.rotations import random_quaternion, rotation_matrices

AREAS = [Disc(0.03, 0.2), Strip(0.04, 0.02, 0.2)]
RADIUS = 0.01


def crowd(rng, n):
    places = rng.uniform((-0.05, -0.05, 0.17), (0.05, 0.05, 0.24), (n, 3))
    return SimpleNamespace(positions=places, present=rng.random(n) < 0.9, radius=RADIUS)


def slow_point(rng, simulation, area):
    for _ in range(MOST_POINTS):
        point = np.array(area.point(*rng.random(2)))
        others = simulation.positions[simulation.present]
        if all(np.linalg.norm(point - other) > 2.0 * RADIUS for other in others):
            return point
    return None


@pytest.mark.parametrize("area", AREAS)
@pytest.mark.parametrize("berries", [0, 5, 15, 30, 60, 300])
def test_the_place_is_the_first_free_one_and_no_other_is_drawn(area, berries):
    found = 0
    for seed in range(30):
        simulation = crowd(np.random.default_rng([seed, berries]), berries)
        slow = np.random.default_rng(seed)
        fast = np.random.default_rng(seed)
        expected = slow_point(slow, simulation, area)
        point = find_free_point(fast, simulation, area)
        assert np.array_equal(point, expected)
        assert slow.random() == fast.random()
        found += point is not None
    assert found == {0: 30, 300: 0}.get(berries, found)


@pytest.mark.parametrize("area", AREAS)
def test_all_points_at_once_are_the_single_ones(area):
    numbers = np.random.default_rng(3).random((50, 2))
    single = [area.point(*pair) for pair in numbers]
    assert area.points(numbers) == pytest.approx(np.array(single), rel=1e-12, abs=1e-15)


def test_a_blocked_factory_looks_at_all_places_and_random_berries_draw_as_ever():
    class Counting(Disc):
        single = at_once = 0

        def point(self, first, second):
            Counting.single += 1
            return super().point(first, second)

        def points(self, numbers):
            Counting.at_once += 1
            return super().points(numbers)

    assert (
        find_free_point(
            np.random.default_rng(2),
            crowd(np.random.default_rng(1), 300),
            Counting(0.03, 0.2),
        )
        is None
    )
    assert Counting.single == 1
    assert Counting.at_once == 1
    rng = np.random.default_rng(7)
    same_rng = np.random.default_rng(7)
    assert np.array_equal(draw_orientation("random", rng), random_quaternion(same_rng))


@pytest.mark.parametrize(("orientation", "level"), [("lying", 0.0), ("upright", 1.0)])
def test_new_berries_lie_or_stand_as_configured(orientation, level):
    rng = np.random.default_rng(6)
    quaternions = np.array([draw_orientation(orientation, rng) for _ in range(300)])
    assert np.allclose(np.linalg.norm(quaternions, axis=1), 1.0)
    rotations = rotation_matrices(quaternions)
    assert np.allclose(np.abs(rotations[:, 2, 0]), level, atol=1e-12)
    # what is left free is uniform: no direction is preferred
    other = rotations[:, :2, 0] if orientation == "lying" else rotations[:, :2, 1]
    assert np.all(np.abs(other.mean(axis=0)) < 4 * math.sqrt(0.5 / 300))
    assert np.var(rotations[:, 2, 1]) == pytest.approx(0.5 * (1 - level), abs=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_the_lowest_point_of_a_grain_is_at_the_height_asked_for(seed):
    """An ellipsoid's centre is above its lowest point by the root of (R A A R')_zz."""
    semi_axes = np.array([0.010, 0.006, 0.004])
    scale = 1.3
    height_m = 0.05

    def support_point(directions):
        lengths = np.linalg.norm(directions * semi_axes, axis=1, keepdims=True)
        return directions * semi_axes**2 / lengths

    added = []
    trial = SimpleNamespace(
        scene=SimpleNamespace(
            seed=seed, particle=SimpleNamespace(support_point=support_point)
        ),
        scales=[scale],
        simulation=SimpleNamespace(
            add=lambda name, centre, quaternion, scale: added.append(
                (name, centre, quaternion, scale)
            )
        ),
    )
    add_above(trial, "random", height_m)
    [(name, centre, quaternion, added_scale)] = added
    assert name == "berry"
    assert added_scale == scale
    assert centre[:2] == (0.0, 0.0)
    vertical = rotation_matrices(quaternion[None])[0][2]
    depth_m = scale * np.linalg.norm(vertical * semi_axes)
    assert centre[2] - depth_m == pytest.approx(height_m, abs=1e-12)
