"""Comparisons: scores and designs with known answers, each comparison once on a small study."""

import numpy as np
import pandas as pd
import pytest
from refusals import input_error, value_error
from scipy import stats

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.designs import latin_hypercube
from repose.calibrate.surrogates.support import compute_quadratic_terms
from repose.config.pipeline import PipelineConfig
from repose.report import figures
from research.comparison import (
    accuracy,
    emulator,
    models,
    points,
    sampling,
    scores,
    surrogates,
)
from research.comparison.early_stopping import EarlyStoppingBP
from research.figures import FIGURES

RESPONSES = ("aor_deg", "height_mm")
SPACE = contact_space(dict.fromkeys(PARAMETERS, (0.0, 1.0)))
NETWORK = {
    "hidden": 3,
    "epochs": 60,
    "goal": 0.0,
    "split": [0.7, 0.15, 0.15],
    "starts": 2,
    "seed": 1,
    "surrogate": "network_ensemble",
    "prior": "inputs",
    "replicates": True,
}


def truth(X):
    """A quadratic of two inputs and a straight line."""
    return np.column_stack(
        [30 + 8 * X[:, 0] - 6 * X[:, 1] ** 2, 60 + 10 * X[:, 0] + 5 * X[:, 2]]
    )


def poured(count, seeds, seed, correlation=0.9):
    """Points with correlated noise of 1 and 2, three times as large at one end of the first input."""
    rng = np.random.default_rng(seed)
    X = rng.uniform(size=(count, 6))
    noise = rng.multivariate_normal(
        [0, 0], [[1, 2 * correlation], [2 * correlation, 4]], (count, seeds)
    )
    return points.Points(
        X, truth(X)[:, None] + noise * np.exp(np.log(3) * X[:, 0])[:, None, None]
    )


def test_explainable_share_and_rmse_are_those_of_the_means_without_noise():
    rng = np.random.default_rng(1)
    y = rng.normal(0, 2, 40)
    predicted = y + rng.normal(0, 0.7, 40)
    share = 1 - np.sum((y - predicted) ** 2) / np.sum((y - y.mean()) ** 2)
    sd = rng.uniform(0.3, 0.9, 40)
    found = []
    for _ in range(1500):
        runs = y[:, None] + sd[:, None] * rng.standard_normal((40, 6))
        se = runs.std(axis=1, ddof=1) / np.sqrt(6)
        found.append(scores.accuracy(runs.mean(axis=1), se, predicted))
    table = pd.DataFrame(found).mean()
    assert table["explainable"] == pytest.approx(share, abs=0.002)
    assert table["r2"] < share - 0.005
    expected = np.sqrt(np.mean((y - predicted) ** 2))
    assert table["rmse"] == pytest.approx(expected, rel=0.01)
    expected = np.var(y) / (np.var(y) + np.mean(sd**2) / 6)
    assert table["reachable_r2"] == pytest.approx(expected, abs=0.002)


def test_bootstrap_intervals_hold_the_true_r2():
    """y = p + noise of the same variance: R2 is 1 - 1 / 2 over all points."""
    rng = np.random.default_rng(2)
    held = 0
    for k in range(150):
        p = rng.standard_normal(80)
        low, high = scores.bootstrap(
            p + rng.standard_normal(80), np.zeros(80), p, 300, k
        )["r2"]
        held += low < 0.5 < high
    assert 0.88 < held / 150 < 0.99
    y = np.arange(9.0)
    assert scores.bootstrap(y, np.zeros(9), y)["explainable"] == (1, 1)
    value_error("at least 3", scores.bootstrap, y[:2], y[:2], y[:2])


def test_calibration_of_right_and_of_too_small_error_bars():
    rng = np.random.default_rng(3)
    y = rng.standard_normal(20_000) * 0.5
    errors = np.full(20_000, 0.3)
    right = scores.calibration(y, errors, np.zeros(20_000), np.full(20_000, 0.4))
    assert right["coverage_50"] == pytest.approx(0.5, abs=0.015)
    assert right["coverage_90"] == pytest.approx(0.9, abs=0.015)
    assert right["standardised_square"] == pytest.approx(1, abs=0.03)
    bold = scores.calibration(y, 0 * errors, np.zeros(20_000), np.full(20_000, 0.25))
    assert bold["standardised_square"] == pytest.approx(4, rel=0.03)
    expected = 2 * stats.norm.cdf(1.645 / 2) - 1
    assert bold["coverage_90"] == pytest.approx(expected, abs=0.01)


def test_r2_on_means_of_few_seeds_lies_between_single_runs_and_all():
    data = poured(60, 8, 4)
    p = truth(data.X)[:, 0]
    single = scores.on_runs(data.values[:, :, 0], p)
    few = scores.on_few_seeds(data.values[:, :, 0], p, 4)
    assert (
        single < few < scores.accuracy(data.means()[:, 0], data.errors()[:, 0], p)["r2"]
    )
    assert scores.on_few_seeds(data.values[:, :, 0], p, 9) is None


def write(folder, name, points_written):
    """Tables of points as the verb dataset writes them; one run and one sample have failed."""
    folder.mkdir(exist_ok=True)
    table = pd.DataFrame(points_written.X, columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(1, len(table) + 1))
    table["status"] = "ok"
    table.loc[1, "status"] = "jammed"
    rows = []
    for (i, j), aor in np.ndenumerate(points_written.values[:, :, 0]):
        ok = i != 1 and (i, j) != (2, 0)
        responses = (aor, points_written.values[i, j, 1]) if ok else (None, None)
        rows.append((i + 1, j, "ok" if ok else "jammed", *responses))
    table.to_csv(folder / f"{name}dataset.csv", index=False)
    columns = ["sample", "seed", "status", *RESPONSES]
    pd.DataFrame(rows, columns=columns).to_csv(folder / f"{name}runs.csv", index=False)


def test_points_read_back_without_what_failed(tmp_path):
    data = poured(6, 3, 5)
    write(tmp_path, "", data)
    found = points.read(tmp_path / "dataset.csv", tmp_path / "runs.csv", RESPONSES)
    np.testing.assert_allclose(found.X, data.X[[0, 2, 3, 4, 5]])
    assert found.counts().tolist() == [3, 2, 3, 3, 3]
    assert found.simulations() == 15
    np.testing.assert_allclose(found.means()[1], data.values[2, 1:].mean(axis=0))
    # of the third point the first run failed: with one seed it is gone
    assert len(found.take([0, 1, 2], seeds=1).X) == 2
    input_error(
        PARAMETERS[0],
        points.read,
        tmp_path / "runs.csv",
        tmp_path / "runs.csv",
        RESPONSES,
    )


def test_points_of_one_response_read_back_as_those_of_two(tmp_path):
    # a single column of a table is given as an array that must not be written to
    write(tmp_path, "", poured(12, 3, 1))
    files = tmp_path / "dataset.csv", tmp_path / "runs.csv"
    both = points.read(*files, RESPONSES)
    expected = both.values[:, :, 1:]
    np.testing.assert_array_equal(points.read(*files, RESPONSES[1:]).values, expected)


def test_runs_drawn_are_runs_of_the_same_point():
    data = poured(20, 5, 6)
    drawn = data.with_seeds_drawn(2, np.random.default_rng(1))
    assert drawn.values.shape == (20, 2, 2)
    for mine, all_of_it in zip(drawn.values, data.values, strict=True):
        assert {tuple(run) for run in mine} < {tuple(run) for run in all_of_it}


@pytest.mark.parametrize("name", sampling.DESIGNS)
def test_designs_have_the_points_asked_for_inside_the_cube(name, monkeypatch):
    # How far apart they are says tests/stages/test_design.py.
    monkeypatch.setattr(latin_hypercube, "ROUNDS_PER_POWER", 5)
    unit = sampling.DESIGNS[name](30, 6, [1, 2])
    latin_hypercube._optimal_lhs.cache_clear()
    assert unit.shape == (30, 6)
    assert unit.min() >= 0
    assert unit.max() <= 1


@pytest.mark.parametrize(
    ("n", "corners"), [(30, 16), (45, 32), (60, 32), (77, 64), (100, 64)]
)
def test_central_composite_designs_are_balanced_and_orthogonal(n, corners):
    unit = sampling.central_composite(n)
    size = corners + 13
    assert len(unit) == n
    assert len(np.unique(unit[:size], axis=0)) == min(size, n)
    x = 2 * unit[:size] - 1
    assert (np.abs(x).sum(axis=1) == 6).sum() == corners
    np.testing.assert_array_equal(x.T @ x, (corners + 2) * np.eye(6))
    # a fraction of 16 corners cannot separate all products of two, the others can
    expected = 28 if corners > 16 else 20
    assert np.linalg.matrix_rank(compute_quadratic_terms(unit[:size])) == expected
    np.testing.assert_array_equal(unit[size:], unit[: n - size])


def test_too_few_points_for_a_central_composite_design():
    value_error("at least 29", sampling.central_composite, 28)


def test_quadratic_surface_meets_a_quadratic_and_needs_more_points_than_terms():
    X = np.random.default_rng(7).uniform(size=(40, 6))
    exact = points.Points(X, truth(X)[:, None])
    mean, std = models.quadratic_surface(exact, NETWORK, 1)(X[:5] * 0.9)
    np.testing.assert_allclose(mean, truth(X[:5] * 0.9), rtol=1e-9)
    assert std.max() < 1e-8
    assert models.quadratic_surface(exact.take(np.arange(28)), NETWORK, 1) is None


@pytest.mark.parametrize("name", ["network", "quadratic surface", "Gaussian process"])
def test_error_bars_are_those_of_the_mean_without_the_noise_of_a_pour(name):
    data = poured(120, 4, 8)
    fresh = np.random.default_rng(9).uniform(size=(300, 6))
    mean, std = models.MODELS[name](data, NETWORK | {"epochs": 200}, 1)(fresh)
    noise = np.sqrt(np.diagonal(data.covariance()) / 4)
    assert (std < 1.2 * noise).all(axis=1).mean() > 0.9
    z = (mean - truth(fresh)) / std
    assert 0.3 < np.mean(z**2) < 2.5


def test_early_stopping_learns_and_stops_before_the_noise():
    data = poured(150, 4, 10)
    network = EarlyStoppingBP(hidden=12, starts=3).fit(data.X, data.means())
    assert network.epochs_ < 100
    fresh = np.random.default_rng(11).uniform(size=(200, 6))
    error = np.mean((network.predict(fresh) - truth(fresh)) ** 2, axis=0)
    assert (1 - error / truth(fresh).var(axis=0) > 0.8).all()
    with pytest.raises(ValueError, match="at least 4"):
        EarlyStoppingBP().fit(data.X[:3], data.means()[:3])


def test_emulator_has_the_mean_and_the_noise_that_it_was_fitted_to(monkeypatch):
    monkeypatch.setattr(emulator, "CANDIDATES", {"quadratic": models.quadratic_surface})
    fitted = emulator.chosen_by_cross_validation(poured(200, 6, 12), NETWORK, 1)
    assert fitted.noise.correlation == pytest.approx(
        np.array([[1, 0.9], [0.9, 1]]), abs=0.02
    )
    X = np.random.default_rng(13).uniform(size=(100, 6))
    expected = np.array([1, 2]) * np.exp(np.log(3) * X[:, :1])
    np.testing.assert_allclose(fitted.noise.std(X), expected, rtol=0.35)
    again = fitted.pour(X, 400, np.random.default_rng(14))
    error = (again.means() - fitted.mean(X)) / (fitted.noise.std(X) / 20)
    assert np.abs(error).max() < 4.5
    np.testing.assert_allclose(again.values.std(axis=1), fitted.noise.std(X), rtol=0.15)
    assert (fitted.explainable > 0.9).all()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    for name, piles in (
        ("main_", poured(30, 4, 1)),
        ("pool_", poured(40, 2, 2)),
        ("fresh_", poured(10, 8, 3)),
    ):
        write(folder, name, piles)
    return {
        f"{a}_{b}": folder / f"{a}_{b}.csv"
        for a in ("main", "pool", "fresh")
        for b in ("dataset", "runs")
    }


@pytest.fixture(scope="module")
def tables(files, tmp_path_factory):
    folder = tmp_path_factory.mktemp("comparison")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(surrogates, "BUDGETS", (15,))
        patch.setattr(surrogates, "REPETITIONS", 2)
        patch.setattr(sampling, "SAMPLES", (30,))
        patch.setattr(sampling, "REPETITIONS", 2)
        patch.setattr(sampling, "TRADES", (1, 2))
        patch.setattr(models, "TREES", 10)
        patch.setattr(models, "ROUNDS", 10)
        sets = points.read_sets(files, RESPONSES)
        return folder, {
            "accuracy": accuracy.run(sets, RESPONSES, NETWORK, folder),
            "surrogates": surrogates.run(sets, RESPONSES, NETWORK, 1, folder),
            "sampling": sampling.run(sets, RESPONSES, SPACE, NETWORK, 2, 1, folder),
        }


@pytest.mark.slow
def test_accuracy_has_every_training_set_with_intervals(tables):
    table = tables[1]["accuracy"]
    trained = table[table["response"] == "aor_deg"]
    assert trained["training"].value_counts().to_dict() == {
        "pool": 6,
        "main design": 3,
        "main design, training samples": 1,
        "main design and pool": 1,
    }
    assert (table["r2_low"] <= table["r2"]).all()
    assert (table["explainable"] <= table["explainable_high"]).all()
    assert (table["test_points"] == 9).all()
    assert "explainable" in accuracy.message(table)


@pytest.mark.slow
def test_surrogates_are_compared_at_equal_budgets(tables):
    table = tables[1]["surrogates"]
    assert set(table["model"]) == set(models.MODELS)
    drawn = table[(table["training"] == "pool") & (table["repetitions"] == 2)]
    # 15 points are too few for a quadratic surface
    assert set(drawn["model"]) == set(models.MODELS) - {"quadratic surface"}
    assert drawn["explainable_se"].notna().all()
    assert table[table["model"] == "random forest"]["coverage_90"].isna().all()


@pytest.mark.slow
def test_sampling_says_what_is_emulated_and_what_is_real(tables):
    table = tables[1]["sampling"]
    assert set(table["data"]) == {"emulated", "real"}
    designs = table[(table["comparison"] == "designs") & (table["data"] == "emulated")]
    assert set(designs["design"]) == set(sampling.DESIGNS)
    assert (designs["simulations"] == 60).all()
    trades = table[
        (table["comparison"] == "points against seeds") & (table["data"] == "emulated")
    ]
    assert set(trades["simulations"]) == {60}
    assert (tables[0] / "emulator.json").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["accuracy", "surrogates", "sampling"])
def test_each_comparison_can_be_drawn(tables, name, tmp_path):
    config = PipelineConfig.load("config/quick.yaml").config
    figures.draw(
        name,
        {name: str(tables[0] / f"{name}.csv")},
        tmp_path / "a.png",
        config,
        FIGURES,
    )
    assert (tmp_path / "a.png").stat().st_size > 10_000


def of_many(count, seeds, k, seed):
    """Points of k responses, each of two parameters, with noise of correlation 0.5."""
    rng = np.random.default_rng(seed)
    X = rng.uniform(size=(count, 6))
    root = np.linalg.cholesky(0.5 + 0.5 * np.eye(k))
    noise = rng.normal(size=(count, seeds, k)) @ root.T
    return points.Points(
        X, 50 + 10 * (X[:, :k] - X[:, 1 : k + 1] ** 2)[:, None] + noise
    )


@pytest.mark.slow
@pytest.mark.parametrize("k", [1, 4])
def test_comparisons_take_any_number_of_responses(k, monkeypatch, tmp_path):
    names = ("drum_slip_deg", "packing_percent", "height_mm", "discharge_s")[:k]
    sets = [of_many(30, 4, k, 1), of_many(40, 4, k, 2), of_many(10, 8, k, 3)]
    names_of_quick = (
        "quadratic surface",
        "network",
        "random forest",
        "gradient boosting",
    )
    quick = {name: models.MODELS[name] for name in names_of_quick}
    monkeypatch.setattr(models, "TREES", 5)
    monkeypatch.setattr(models, "ROUNDS", 5)
    monkeypatch.setattr(surrogates, "MODELS", quick)
    monkeypatch.setattr(surrogates, "BUDGETS", ())
    monkeypatch.setattr(sampling, "FITS", {"network": models.quadratic_surface})
    monkeypatch.setattr(emulator, "CANDIDATES", {"quadratic": models.quadratic_surface})
    monkeypatch.setattr(sampling, "SAMPLES", (40,))
    monkeypatch.setattr(sampling, "REPETITIONS", 2)
    monkeypatch.setattr(sampling, "TRADES", (1,))
    tables = {
        "accuracy": accuracy.run(sets, names, NETWORK, tmp_path),
        "surrogates": surrogates.run(sets, names, NETWORK, 1, tmp_path),
        "sampling": sampling.run(sets, names, SPACE, NETWORK, 2, 1, tmp_path),
    }
    config = {
        "targets": [
            {
                "response": name,
                "value": 50,
                "sd": 1,
                "repetitions": 4,
                "range": [45, 55],
            }
            for name in names
        ]
    }
    for name, table in tables.items():
        assert tuple(dict.fromkeys(table["response"])) == names
        figures.draw(
            name,
            {name: str(tmp_path / f"{name}.csv")},
            tmp_path / f"{name}.png",
            config,
            FIGURES,
        )


@pytest.mark.parametrize("k", [1, 3])
def test_noise_that_scales_has_its_correlation_and_size(k):
    correlation = 0.6 + 0.4 * np.eye(k)
    # each response's variance grows with a parameter of its own
    slopes = np.log(4) * np.eye(7, k, -1)
    noise = emulator.ScalingNoise(slopes, correlation, np.zeros(6), np.ones(6))
    X = np.zeros((1, 6))
    X[0, 0] = 1.0
    drawn = noise.draw(X, 100_000, np.random.default_rng(1))[0]
    assert drawn.std(axis=0) == pytest.approx([2.0, 1, 1][:k], rel=0.02)
    assert np.atleast_2d(np.corrcoef(drawn.T)) == pytest.approx(correlation, abs=0.01)


def test_joined_points_keep_their_runs():
    both = points.joined([poured(3, 2, 1), poured(2, 4, 2)])
    assert both.counts().tolist() == [2, 2, 2, 4, 4]
    assert both.means()[:3] == pytest.approx(poured(3, 2, 1).means(), abs=0)


def test_designs_in_five_dimensions_leave_out_the_composite():
    found = sampling.designs_for(5)
    assert "central composite" not in found
    assert found["Sobol sequence"](30, 5, [1, 2]).shape == (30, 5)


def test_runs_of_several_bench_tests_make_one_point(tmp_path):
    table = pd.DataFrame(
        [dict.fromkeys(PARAMETERS, 0.5) | {"sample": 1, "status": "ok"}]
    )
    table.to_csv(tmp_path / "dataset.csv", index=False)
    rows = [
        ("funnel", "ok", 30.0, None),
        ("funnel", "ok", 32.0, None),
        ("funnel", "jammed", None, None),
        ("drum", "ok", None, 45.0),
        ("drum", "ok", None, 47.0),
        ("drum", "ok", None, 46.0),
    ]
    runs = pd.DataFrame(
        rows, columns=["apparatus", "status", "aor_deg", "drum_slip_deg"]
    ).assign(sample=1)
    runs.to_csv(tmp_path / "runs.csv", index=False)
    found = points.read(
        tmp_path / "dataset.csv", tmp_path / "runs.csv", ("aor_deg", "drum_slip_deg")
    )
    assert found.counts().tolist() == [2]
    assert found.means().tolist() == [[31.0, 46.0]]
    assert found.values[0, :2].tolist() == [[30.0, 45.0], [32.0, 47.0]]
