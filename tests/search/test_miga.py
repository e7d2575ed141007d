import json
import math

import numpy as np
import pandas as pd
import pytest

from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.search import miga
from repose.search.miga import MIGA, Archive, Objective, islands_ga
from repose.surrogate.bayesian_bp import ARRAYS
from repose.surrogate.support import Support

SETTINGS = {
    "islands": 5,
    "population": 40,
    "rounds": 40,
    "generations": 10,
    "tournament": 3,
    "mutation_probability": 0.05,
    "mutation_amplitude": 0.1,
    "solutions": 30,
    "distance": 0.05,
    "seed": 2026,
}
TARGET = {
    "aor_deg": 30.5,
    "height_mm": 65.0,
    "aor_range_deg": [29.0, 32.0],
    "height_range_mm": [63.0, 68.0],
}
RANGES = dict.fromkeys(PARAMETERS, (0.0, 2.0))


def minimise(function, dimensions, generations, **settings):
    search = MIGA(dimensions, **settings)
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
    a, b = 5 * x[:, 0], 5 * x[:, 1]
    return (a * a + b - 11) ** 2 + (a + b * b - 7) ** 2


def test_finds_the_minimum_of_the_sphere_in_six_dimensions():
    search, _ = minimise(sphere, 6, 600)
    assert search.best_fitness < 1e-5
    np.testing.assert_allclose(search.best, 0.3, atol=5e-3)


def test_finds_the_one_global_minimum_of_rastrigin_among_a_hundred():
    search, _ = minimise(rastrigin, 2, 500)
    np.testing.assert_allclose(search.best, 0.21, atol=2e-3)


def test_finds_the_corner_where_the_minimum_is_a_corner():
    search, _ = minimise(lambda x: -x.sum(axis=1), 6, 300)
    np.testing.assert_allclose(search.best, 1.0, atol=1e-12)


def test_seeds_together_find_all_four_minima_of_himmelblau():
    minima = np.array([[3, 2], [-2.805118, 3.131312], [-3.779310, -3.283186], [3.584428, -1.848126]]) / 5
    found = set()
    for seed in range(20):
        search, _ = minimise(himmelblau, 2, 200, seed=seed)
        distance = np.linalg.norm(minima - search.best, axis=1)
        assert distance.min() < 0.01
        found.add(int(distance.argmin()))
    assert found == {0, 1, 2, 3}


def test_best_never_worsens_and_stays_in_the_population():
    _, best = minimise(rastrigin, 6, 200)
    assert (np.diff(best) <= 0).all()
    search = MIGA(6)
    for _ in range(60):
        points = search.ask()
        fitness = rastrigin(points)
        tops = points.reshape(5, 40, 6)[np.arange(5), fitness.reshape(5, 40).argmin(axis=1)]
        search.tell(fitness)
        after = search.ask().reshape(5, 40, 6)[:, 0]
        if search.generation % 10:
            np.testing.assert_array_equal(after, tops)
    assert search.evaluations == 60 * 200


def test_first_population_fills_the_box_and_children_never_leave_it():
    search = MIGA(3, mutation_probability=1.0, mutation_amplitude=5.0)
    first = search.ask()
    assert first.shape == (200, 3)
    assert first.min() < -0.95
    assert first.max() > 0.95
    for _ in range(5):
        search.tell(sphere(search.ask()))
        assert np.abs(search.ask()).max() <= 1.0


def test_arithmetic_crossover_stays_on_the_segment_between_two_parents():
    search = MIGA(2, islands=1, population=30, mutation_probability=0.0)
    parents = search.ask().copy()
    search.tell(sphere(parents))
    for child in search.ask():
        segment = False
        for a in parents:
            ab, ac = parents - a, child - a
            cross = np.abs(ab[:, 0] * ac[1] - ab[:, 1] * ac[0])
            along = (ab @ ac) / np.maximum((ab**2).sum(axis=1), 1e-300)
            segment |= bool(((cross < 1e-12) & (along > -1e-9) & (along < 1 + 1e-9)).any())
        assert segment


def test_tournament_of_three_prefers_ranks_as_it_should():
    """The best of p by rank wins a draw of three with probability 1 - (1 - 1/p)^3."""
    search = MIGA(2, islands=50, population=10)
    search._draw()
    share = np.mean(search._winners == 0)
    assert share == pytest.approx(1 - 0.9**3, abs=0.01)


def test_mutation_has_the_published_probability_and_amplitude():
    search = MIGA(6, islands=50)
    search._draw()
    hit = search._mutation[search._mutation != 0]
    assert hit.size / search._mutation.size == pytest.approx(0.05, abs=0.003)
    assert hit.std() == pytest.approx(0.1, abs=0.005)


def test_migration_sends_each_best_to_the_next_island_in_the_ring():
    points = np.arange(12.0).reshape(12, 1)
    fitness = np.array([3.0, 1, 2, 9, 8, 7, 5, 4, 6, 0, 11, 10])
    search = MIGA(1, islands=4, population=3)
    moved, its_fitness = miga.migrate(points, fitness, search._ranked(fitness))
    expected = points.copy()
    expected[[3, 8, 10, 0]] = points[[1, 5, 7, 9]]  # worst of the next island, best of this one
    np.testing.assert_array_equal(moved, expected)
    np.testing.assert_array_equal(its_fitness, fitness[expected[:, 0].astype(int)])


def test_islands_do_not_mix_between_migrations():
    """With no mutation an island cannot leave the convex hull of its own first individuals."""
    search = MIGA(1, islands=3, population=10, generations=10, mutation_probability=0.0)
    search._points = (
        np.repeat([-0.9, 0.0, 0.9], 10)[:, None] + np.tile(np.linspace(-0.05, 0.05, 10), 3)[:, None]
    )
    for generation in range(1, 12):
        search.tell(np.abs(search.ask()[:, 0] - 1.0))
        spread = np.ptp(search.ask().reshape(3, 10), axis=1)
        assert (spread <= 0.1 + 1e-12).all() == (generation < 10)


def test_the_same_seed_gives_the_same_search_and_another_does_not():
    one, two = minimise(rastrigin, 4, 50)[0], minimise(rastrigin, 4, 50)[0]
    np.testing.assert_array_equal(one.ask(), two.ask())
    assert not np.array_equal(one.ask(), minimise(rastrigin, 4, 50, seed=1)[0].ask())


@pytest.mark.parametrize(
    ("setting", "value", "allowed"),
    [
        ("population", 1, "at least 2"),
        ("tournament", 0, "at least 1"),
        ("mutation_amplitude", -0.1, "at least 0"),
        ("mutation_probability", 1.5, "0 to 1"),
    ],
)
def test_a_bad_setting_is_named(setting, value, allowed):
    with pytest.raises(ValueError, match=f"{setting} is {value}; allowed: {allowed}"):
        MIGA(6, **{setting: value})


BOX = np.array([(-5.0, 5.0), (100.0, 200.0), (-1e-3, 0.0)])
LOWEST = np.array([1.0, 130.0, -2e-4])


def bowl(x):
    return (((x - LOWEST) / np.ptp(BOX, axis=1)) ** 2).sum(axis=1)


def test_islands_ga_finds_the_minimum_in_the_units_of_its_bounds():
    asked = []

    def watched(x):
        asked.append(x)
        return bowl(x)

    result = islands_ga(watched, BOX, rounds=40, seed=1)
    np.testing.assert_allclose((result.x - LOWEST) / np.ptp(BOX, axis=1), 0.0, atol=3e-3)
    assert result.fun == bowl(result.x[None])[0] < 1e-5
    assert (result.nfev, result.nit, result.success) == (80_000, 400, None)
    asked = np.concatenate(asked)
    assert (asked >= BOX[:, 0]).all()
    assert (asked <= BOX[:, 1]).all()
    assert bowl(asked).min() == result.fun
    assert (np.diff(result.history) <= 0).all()
    assert len(result.history) == 400


def test_islands_ga_ends_at_its_target():
    result = islands_ga(bowl, BOX, target=1e-3)
    assert result.success is True
    assert result.nfev == 200 * result.nit < 100_000
    assert result.history[-1] == result.fun <= 1e-3 < result.history[-2]
    assert islands_ga(bowl, BOX, rounds=1, target=-1.0).success is False


def test_islands_ga_walks_past_points_that_are_infinite():
    result = islands_ga(lambda x: np.where(x[:, 0] > 0.2, x[:, 0], np.inf), [(-1, 1)], rounds=20)
    assert result.fun == pytest.approx(0.2, abs=5e-3)


@pytest.mark.parametrize("dimensions", [2, 6])
def test_islands_ga_succeeds_from_every_seed_on_easy_functions(dimensions):
    for seed in range(5):
        for function in (sphere, rastrigin):
            assert islands_ga(function, [(-1, 1)] * dimensions, target=0.01, seed=seed).success


@pytest.mark.parametrize(
    ("function", "bounds", "settings", "fault"),
    [
        (bowl, [0, 1], {}, r"bounds has shape \(2,\)"),
        (bowl, [(0, np.inf)], {}, "all finite"),
        (bowl, [(0, 1), (2, 2)], {}, r"\[2.0, 2.0\]\]; allowed: each lowest below its highest"),
        (bowl, BOX, {"rounds": 0}, "rounds is 0"),
        (bowl, BOX, {"islands": 0}, "islands is 0"),
        (lambda x: x, BOX, {}, r"objective returned shape \(200, 3\)"),
        (lambda x: np.full(len(x), np.nan), BOX, {}, "with 200 NaN"),
        (lambda x: np.full(len(x), np.inf), BOX, {"rounds": 1}, "infinite at all 2000 points"),
    ],
)
def test_islands_ga_names_what_is_wrong(function, bounds, settings, fault):
    with pytest.raises(ValueError, match=fault):
        islands_ga(function, bounds, **settings)


def test_objective_is_eq_11_and_its_target_eq_12():
    objective = Objective((31, 64), (34, 69))
    F, V = objective(np.array([[32.5, 66.5], [31.0, 69.0], [30.0, 70.0]]))
    np.testing.assert_allclose(F, [0, 1, 2.5 / 3 + 3.5 / 5], atol=1e-12)
    np.testing.assert_allclose(V, [0, 0, 1 / 3 + 1 / 5], atol=1e-12)
    F, _ = Objective((31, 64), (34, 69), (32.87, 65.57))(np.array([[31.87, 66.57]]))
    np.testing.assert_allclose(F, 1 / 3 + 1 / 5)


def test_any_feasible_point_is_fitter_than_any_other():
    objective = Objective((0, 0), (1, 1), (0.0, 0.0))
    fitness = objective.fitness(*objective(np.array([[1.0, 1.0], [-1e-9, 0.0], [-1.0, 0.0]])))
    assert fitness[0] < fitness[1] < fitness[2]


def distinct_slowly(points, fitness, distance, most):
    kept = []
    for row in sorted(range(len(points)), key=lambda i: (fitness[i], i)):
        if len(kept) < most and all(math.dist(points[row], points[k]) >= distance for k in kept):
            kept.append(row)
    return kept


@pytest.mark.parametrize("most", [5, 1000])
@pytest.mark.parametrize("distance", [0.0, 0.1, 0.6])
def test_thinning_against_its_slow_twin(most, distance):
    random = np.random.RandomState(5)
    points, fitness = random.uniform(-1, 1, (300, 3)), random.randint(0, 50, 300).astype(float)
    points[100:120] = points[:20]
    fast = miga.distinct(points, fitness, distance, most)
    assert fast.tolist() == distinct_slowly(points, fitness, distance, most)


def test_archive_is_bounded_distinct_sorted_and_holds_the_best():
    random = np.random.RandomState(6)
    archive = Archive(2, 0.1, 40, buffer=500)
    everything, all_fitness = [], []
    for _ in range(60):
        points = random.uniform(-1, 1, (170, 2))
        fitness = sphere(points)
        archive.add(points, fitness)
        assert archive._n_waiting <= 500
        assert len(archive.points) <= 40
        everything.append(points)
        all_fitness.append(fitness)
    archive.thin()
    everything, all_fitness = np.concatenate(everything), np.concatenate(all_fitness)
    assert len(archive.points) >= 30
    assert (np.diff(archive.fitness) >= 0).all()
    np.testing.assert_array_equal(archive.points[0], everything[all_fitness.argmin()])
    gaps = np.linalg.norm(archive.points[:, None] - archive.points, axis=2) + 9 * np.eye(len(archive.points))
    assert gaps.min() >= 0.1
    # no better point was passed over: each lies near one that is kept
    better = everything[all_fitness < archive.fitness[20]]
    assert np.linalg.norm(better[:, None] - archive.points, axis=2).min(axis=1).max() < 0.2


def test_archive_takes_more_than_its_buffer_at_once():
    points = np.random.RandomState(7).uniform(-1, 1, (1000, 2))
    archive = Archive(2, 0.0, 1000, buffer=64)
    archive.add(points, sphere(points))
    archive.thin()
    np.testing.assert_array_equal(archive.fitness, np.sort(sphere(points)))


def write_inputs(folder, reach):
    """A network that is nearly linear: AoR 28 + reach x mean(x), Height 64 + mean(x), x in 0 to 2."""
    small = 1e-3
    W1 = np.zeros((2, 6))
    W1[0], W1[1, 4] = small, small
    network = {
        "inputs": list(PARAMETERS),
        "outputs": ["aor_deg", "height_mm"],
        "scaled_range": [0.0, 1.0],
        "input_min": [0.0] * 6,
        "input_max": [1.0] * 6,
        "output_min": [0.0, 0.0],
        "output_max": [1.0, 1.0],
        "W1": W1.tolist(),
        "b1": [0.0, 0.0],
        "W2": [[reach / 6 / small, 0.0], [0.0, 1.0 / small]],
        "b2": [28.0, 64.0],
    }
    assert set(ARRAYS) < set(network)
    (folder / "network.json").write_text(json.dumps(network))
    rows = [(name, 0.1, 0.2, 5.0) for name in PARAMETERS]
    columns = ["parameter", "low", "high", "dispersion_percent"]
    pd.DataFrame(rows, columns=columns).to_csv(folder / "table3.csv", index=False)
    return folder / "network.json", folder / "table3.csv"


@pytest.fixture(scope="module", params=[2.0, 0.2], ids=["reachable", "out of reach"])
def outcome(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("miga")
    network_json, table3 = write_inputs(folder, request.param)
    summary = miga.run(network_json, RANGES, TARGET, SETTINGS, table3, folder / "out")
    return request.param == 2.0, summary, folder / "out"


def test_run_says_whether_the_box_was_reached(outcome):
    reachable, summary, out = outcome
    assert json.loads((out / "summary.json").read_text()) == summary
    solutions = pd.read_csv(out / "feasible.csv")
    assert summary["feasible"] is reachable
    assert (solutions["feasible"] == reachable).all()
    assert len(solutions) == 30
    assert solutions["representative"].tolist() == [True] + [False] * 29
    assert (summary["n_feasible_met"] > 0) is reachable
    if reachable:
        assert summary["box_distance"] == {"aor_deg": 0.0, "height_mm": 0.0}
        assert solutions["aor_predicted_deg"].between(29, 32).all()
        assert "distinct feasible solutions" in summary["message"]
    else:  # five inputs at 2, and mus_gp at 1, where the last 0.03 deg would cost a mm of Height
        assert summary["box_distance"]["aor_deg"] == pytest.approx(0.6 + 0.2 / 6, abs=1e-3)
        assert summary["target_distance"]["aor_deg"] == pytest.approx(2.1 + 0.2 / 6, abs=1e-3)
        assert "No feasible solution" in summary["message"]
        assert "0.63 deg and 0.00 mm outside the box" in summary["message"]


def test_run_solutions_are_sorted_distinct_and_inside_the_ranges(outcome):
    reachable, _, out = outcome
    solutions = pd.read_csv(out / "feasible.csv")
    X = solutions[list(PARAMETERS)].to_numpy()
    assert ((X >= 0) & (X <= 2)).all()
    if reachable:
        assert (np.diff(solutions["objective"]) >= 0).all()
        F = (solutions["aor_predicted_deg"] - 30.5).abs() / 3 + (
            solutions["height_predicted_mm"] - 65
        ).abs() / 5
        np.testing.assert_allclose(solutions["objective"], F, atol=1e-12)
    else:
        assert (np.diff(solutions["violation"]) >= -1e-6).sum() > 0
    gaps = np.linalg.norm(X[:, None] - X, axis=2) + 9 * np.eye(
        len(X)
    )  # ranges of width 2: already normalised
    assert gaps.min() >= 0.05 - 1e-12


def test_run_tables_beside_the_published(outcome):
    _, _, out = outcome
    solutions, intervals = pd.read_csv(out / "feasible.csv"), pd.read_csv(out / "intervals.csv")
    assert intervals["variable"].tolist() == list(PARAMETERS)
    width = solutions["mus_gp"].max() - solutions["mus_gp"].min()
    row = intervals.set_index("variable").loc["mus_gp"]
    assert row["dispersion_percent"] == pytest.approx(100 * width / 2)
    assert row["published_dispersion_percent"] == 5.0
    history = pd.read_csv(out / "history.csv")
    assert history["evaluations"].tolist() == [2000 * k for k in range(1, 41)]
    assert (np.diff(history["best_objective"]) <= 0).all()


def test_run_is_deterministic(outcome, tmp_path):
    reachable, _, out = outcome
    network_json, table3 = write_inputs(tmp_path, 2.0 if reachable else 0.2)
    miga.run(network_json, RANGES, TARGET, SETTINGS, table3, tmp_path)
    assert (tmp_path / "feasible.csv").read_bytes() == (out / "feasible.csv").read_bytes()


def test_few_feasible_solutions_are_followed_by_the_nearest(tmp_path):
    network_json, table3 = write_inputs(tmp_path, 2.0)
    narrow = TARGET | {"aor_deg": 32.0, "aor_range_deg": [31.999, 34.0], "height_range_mm": [65, 68.0]}
    summary = miga.run(network_json, RANGES, narrow, SETTINGS, table3, tmp_path)
    solutions = pd.read_csv(tmp_path / "feasible.csv")
    assert len(solutions) == 10
    assert 0 < summary["n_solutions"] == solutions["feasible"].sum() < 10
    assert solutions["feasible"].is_monotonic_decreasing


def test_solutions_at_the_bounds_carry_a_warning(tmp_path):
    """Out of reach: every solution sits in a corner, with samples in the middle of the ranges alone."""
    network_json, table3 = write_inputs(tmp_path, 0.2)
    support = Support(np.random.RandomState(1).uniform(0.5, 1.5, (60, 6)), np.zeros(6), np.full(6, 2.0))
    brief = SETTINGS | {"rounds": 5}
    summary = miga.run(network_json, RANGES, TARGET, brief, table3, tmp_path, support)
    table = pd.read_csv(tmp_path / "feasible.csv")
    assert table.columns[-1] == "warning"
    assert table["warning"].str.contains("nearest sample").all()
    assert "mur_gg high" in table["warning"].iloc[0]
    assert summary["message"].endswith(f"Beyond the samples: {table['warning'].iloc[0]}.")


def test_a_target_outside_its_box_and_a_bad_table_are_named(tmp_path):
    network_json, table3 = write_inputs(tmp_path, 2.0)
    with pytest.raises(InputError, match=r"aor_deg is 40.*\[29.0, 32.0\]"):
        miga.run(network_json, RANGES, TARGET | {"aor_deg": 40}, SETTINGS, table3, tmp_path)
    table3.write_text("variable,low\n")
    with pytest.raises(InputError, match=r"table3.csv: parameter"):
        miga.run(network_json, RANGES, TARGET, SETTINGS, table3, tmp_path)


def cloud(feasible):
    x = np.linspace(0, 2, len(feasible))
    table = pd.DataFrame({name: np.ones(len(x)) for name in PARAMETERS})
    table["e_gg"], table["feasible"] = x, feasible
    table["solution"], table["representative"] = np.arange(1, len(x) + 1), np.arange(len(x)) == 2
    return table


def test_validation_takes_the_representative_and_the_farthest_of_the_rest():
    picked = miga.select_for_validation(cloud([True] * 11), 3, RANGES)
    # positions 0.4; then 2.0 (1.6 away), then 1.2 (0.8 from both), then 0.0 (0.4) before 0.8 and 1.6 (0.4)
    assert picked["e_gg"].tolist() == pytest.approx([0.4, 2.0, 1.2, 0.0])
    assert picked["role"].tolist() == ["representative", "spread", "spread", "spread"]


def test_validation_prefers_feasible_solutions_while_there_are_enough():
    table = cloud([True] * 6 + [False] * 5)
    assert miga.select_for_validation(table, 5, RANGES)["feasible"].all()
    assert not miga.select_for_validation(table, 6, RANGES)["feasible"].all()
