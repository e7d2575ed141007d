"""The island genetic algorithm on functions with known minima."""

import numpy as np
import pytest
from refusals import value_error

from repose.calibrate.search.miga import MIGA, islands_ga, migrate
from repose.calibrate.search.settings import MigaSettings

BOX = np.array([(-5.0, 5.0), (100.0, 200.0), (-1e-3, 0.0)])
LOWEST = np.array([1.0, 130.0, -2e-4])


def search_of(dimensions, **settings):
    return MIGA(dimensions, MigaSettings.with_defaults(**settings))


def minimise(function, dimensions, generations, **settings):
    search = search_of(dimensions, **settings)
    best = []
    for _ in range(generations):
        search.tell(function(search.ask()))
        best.append(search.best_fitness)
    return search, best


def sphere(x):
    return ((x - 0.3) ** 2).sum(axis=1)


def rastrigin(x):
    z = 5.12 * (x - 0.21)
    return (z**2 - 10 * np.cos(2 * np.pi * z) + 10).sum(axis=1)


def himmelblau(x):
    a = 5 * x[:, 0]
    b = 5 * x[:, 1]
    return (a * a + b - 11) ** 2 + (a + b * b - 7) ** 2


def test_a_corner_is_found():
    search, _ = minimise(lambda x: -x.sum(axis=1), 6, 300)
    np.testing.assert_allclose(search.best, 1.0, atol=1e-12)


def test_all_minima_of_himmelblaus_function_are_found():
    minima = (
        np.array(
            [
                [3, 2],
                [-2.805118, 3.131312],
                [-3.779310, -3.283186],
                [3.584428, -1.848126],
            ]
        )
        / 5
    )
    found = set()
    for seed in range(20):
        search, _ = minimise(himmelblau, 2, 200, seed=seed)
        distance = np.linalg.norm(minima - search.best, axis=1)
        assert distance.min() < 0.01
        found.add(int(distance.argmin()))
    assert found == {0, 1, 2, 3}


def test_the_best_never_worsens():
    _, best = minimise(rastrigin, 6, 200)
    assert (np.diff(best) <= 0).all()
    search = MIGA(6)
    for _ in range(60):
        points = search.ask()
        fitness = rastrigin(points)
        tops = points.reshape(5, 40, 6)[
            np.arange(5), fitness.reshape(5, 40).argmin(axis=1)
        ]
        search.tell(fitness)
        after = search.ask().reshape(5, 40, 6)[:, 0]
        if search.generation % 10:
            np.testing.assert_array_equal(after, tops)
    assert search.evaluations == 60 * 200


def test_the_first_population_fills_the_box():
    search = search_of(3, mutation_probability=1.0, mutation_amplitude=1.0)
    first = search.ask()
    assert first.shape == (200, 3)
    assert first.min() < -0.95
    assert first.max() > 0.95
    for _ in range(5):
        search.tell(sphere(search.ask()))
        assert np.abs(search.ask()).max() <= 1.0


def test_children_lie_between_their_parents():
    search = search_of(2, islands=1, population=30, mutation_probability=0.0)
    parents = search.ask().copy()
    search.tell(sphere(parents))
    for child in search.ask():
        segment = False
        for a in parents:
            ab = parents - a
            ac = child - a
            cross = np.abs(ab[:, 0] * ac[1] - ab[:, 1] * ac[0])
            along = (ab @ ac) / np.maximum((ab**2).sum(axis=1), 1e-300)
            segment |= bool(
                ((cross < 1e-12) & (along > -1e-9) & (along < 1 + 1e-9)).any()
            )
        assert segment


def test_the_tournament_is_as_published():
    # The best of p by rank wins a draw of three with probability 1 - (1 - 1/p)^3.
    search = search_of(2, islands=50, population=10)
    search._draw_round()
    assert np.mean(search._winning_ranks == 0) == pytest.approx(1 - 0.9**3, abs=0.01)


def test_mutation_is_as_published():
    search = search_of(6, islands=50)
    search._draw_round()
    hit = search._mutation[search._mutation != 0]
    assert hit.size / search._mutation.size == pytest.approx(0.05, abs=0.003)
    assert hit.std() == pytest.approx(0.1, abs=0.005)


def test_migration_is_as_published():
    points = np.arange(12.0).reshape(12, 1)
    fitness = np.array([3.0, 1, 2, 9, 8, 7, 5, 4, 6, 0, 11, 10])
    search = search_of(1, islands=3, population=4)
    moved, its_fitness = migrate(points, fitness, search._rank(fitness))
    expected = points.copy()
    # worst of the next island, best of this one
    expected[[4, 10, 3]] = points[[1, 7, 9]]
    np.testing.assert_array_equal(moved, expected)
    np.testing.assert_array_equal(its_fitness, fitness[expected[:, 0].astype(int)])


def test_islands_keep_apart_and_bad_settings_are_named():
    # With no mutation an island cannot leave the convex hull of its own first individuals.
    search = search_of(
        1, islands=3, population=10, generations=10, mutation_probability=0.0
    )
    search._points = (
        np.repeat([-0.9, 0.0, 0.9], 10)[:, None]
        + np.tile(np.linspace(-0.05, 0.05, 10), 3)[:, None]
    )
    for generation in range(1, 12):
        search.tell(np.abs(search.ask()[:, 0] - 1.0))
        assert (np.ptp(search.ask().reshape(3, 10), axis=1) <= 0.1 + 1e-12).all() == (
            generation < 10
        )
    run = minimise(rastrigin, 4, 50)[0]
    same_search = minimise(rastrigin, 4, 50)[0]
    np.testing.assert_array_equal(run.ask(), same_search.ask())
    assert not np.array_equal(run.ask(), minimise(rastrigin, 4, 50, seed=1)[0].ask())
    wrong = [
        ("population", 1, "an integer from 4 to 10000"),
        ("tournament", 0, "an integer from 1 to 1000"),
        ("mutation_amplitude", -0.1, "a number from 0 to 1"),
        ("mutation_probability", 1.5, "a number from 0 to 1"),
    ]
    for setting, value, allowed in wrong:
        value_error(
            f"{setting} is {value}; expected {allowed}",
            search_of,
            6,
            **{setting: value},
        )


def bowl(x):
    return (((x - LOWEST) / np.ptp(BOX, axis=1)) ** 2).sum(axis=1)


def test_islands_ga_finds_the_minimum():
    points = []

    def watched(x):
        points.append(x)
        return bowl(x)

    result = islands_ga(watched, BOX, rounds=40, seed=1)
    np.testing.assert_allclose(
        (result.x - LOWEST) / np.ptp(BOX, axis=1), 0.0, atol=3e-3
    )
    assert result.fun == bowl(result.x[None])[0] < 1e-5
    assert result.nfev == 80_000
    assert result.nit == 400
    assert result.success is None
    points = np.concatenate(points)
    assert (points >= BOX[:, 0]).all()
    assert (points <= BOX[:, 1]).all()
    assert bowl(points).min() == result.fun
    assert (np.diff(result.history) <= 0).all()
    assert len(result.history) == 400


def test_islands_ga_ends_at_its_target():
    result = islands_ga(bowl, BOX, target=1e-3)
    assert result.success is True
    assert result.nfev == 200 * result.nit < 100_000
    assert result.history[-1] == result.fun <= 1e-3 < result.history[-2]
    assert islands_ga(bowl, BOX, rounds=1, target=-1.0).success is False


def test_islands_ga_takes_infinite_values():
    result = islands_ga(
        lambda x: np.where(x[:, 0] > 0.2, x[:, 0], np.inf), [(-1, 1)], rounds=20
    )
    assert result.fun == pytest.approx(0.2, abs=5e-3)


@pytest.mark.parametrize("dimensions", [2, 6])
def test_islands_ga_succeeds_from_every_seed_on_easy_functions(dimensions):
    for seed in range(5):
        for function, target in (
            (sphere, 1e-5),
            (rastrigin, 1e-4 if dimensions == 2 else 0.01),
        ):
            assert islands_ga(
                function, [(-1, 1)] * dimensions, target=target, seed=seed
            ).success


@pytest.mark.parametrize(
    ("function", "bounds", "settings", "fault"),
    [
        (bowl, [0, 1], {}, r"bounds has shape \(2,\)"),
        (bowl, [(0, np.inf)], {}, "all finite"),
        (
            bowl,
            [(0, 1), (2, 2)],
            {},
            r"\[2.0, 2.0\]\]; expected low < high in each row",
        ),
        (bowl, BOX, {"rounds": 0}, "rounds is 0"),
        (bowl, BOX, {"islands": 0}, "islands is 0"),
        (lambda x: x, BOX, {}, r"objective returned shape \(200, 3\)"),
        (lambda x: np.full(len(x), np.nan), BOX, {}, "with 200 NaN"),
        (
            lambda x: np.full(len(x), np.inf),
            BOX,
            {"rounds": 1},
            "infinite at all 2000 points",
        ),
    ],
)
def test_islands_ga_names_what_is_wrong(function, bounds, settings, fault):
    value_error(fault, islands_ga, function, bounds, **settings)
