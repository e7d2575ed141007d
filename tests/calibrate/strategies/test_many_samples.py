"""Many samples: the work grows with their number, not with its cube, and the numbers stay as good."""

import time

import numpy as np
import pytest
from scipy.stats import qmc

from repose.calibrate.strategies.sequential import kriging, noise
from repose.calibrate.strategies.sequential.kriging import (
    MAX_EXACT_SAMPLES,
    N_DRAWS,
    Kriging,
    ObservedSamples,
)
from repose.calibrate.strategies.sequential.noise import estimate_nugget
from repose.calibrate.strategies.sequential.reach import N_FUNCTIONS, Draws
from repose.calibrate.surrogates.process import (
    Process,
    SparseProcess,
    choose_centres,
    make_linear_kernel,
    make_smooth_kernel,
)

NOISE = np.diag([0.3**2, 0.5**2])
KERNEL = make_linear_kernel(1.7) + make_smooth_kernel(
    0.8, [0.5, 0.9, 0.7], smoothness=2.5
)


def curved(unit):
    """Means (n, 2) of a simulator whose responses are far from straight."""
    a, b, c, d = unit.T
    return np.column_stack(
        [
            18 + 22 * (1 - np.exp(-3 * a)) * (0.6 + 0.8 * b) - 4 * a * c,
            40 + 12 * np.sqrt(0.05 + b) - 10 * a * b + 6 / (1 + np.exp(5 - 10 * d)),
        ]
    )


def simulated(n, seed=1):
    """Single runs of n samples of `curved`."""
    random = np.random.default_rng(seed)
    unit = random.random((n, 4))
    runs = curved(unit) + random.standard_normal((n, 2)) @ np.sqrt(NOISE)
    return ObservedSamples(unit, runs[:, None])


def scattered(n, seed=1):
    """Points, values and variances of their errors."""
    random = np.random.default_rng(seed)
    x = random.random((n, 3)) - 0.5
    values = np.sin(3 * x[:, 0]) + x[:, 1] + 0.2 * random.standard_normal(n)
    return x, values, 0.04 * random.uniform(0.5, 2.0, n)


def test_a_sparse_process_is_the_matrices_of_its_definition():
    x, values, errors = scattered(40)
    centres = x[::4]
    points = np.random.default_rng(2).random((7, 3)) - 0.5
    sparse = SparseProcess(KERNEL, x, values, errors, centres)

    def explained(one, other):
        between = KERNEL(one, centres) @ np.linalg.inv(KERNEL(centres))
        return between @ KERNEL(centres, other)

    def predict(rows, at):
        """Condition on some values by the covariance as a whole."""
        K = explained(x[rows], x[rows])
        np.fill_diagonal(K, KERNEL.diag(x[rows]) + errors[rows])
        between = explained(at, x[rows])
        mean = between @ np.linalg.solve(K, values[rows])
        known = np.einsum("mi,im->m", between, np.linalg.solve(K, between.T))
        return mean, KERNEL.diag(at) - known

    mean, variance = sparse.moments(points)
    expected_mean, expected_variance = predict(np.full(40, True), points)
    assert mean == pytest.approx(expected_mean, rel=1e-6)
    assert sparse.mean(points) == pytest.approx(expected_mean, rel=1e-6)
    assert variance == pytest.approx(expected_variance, rel=1e-6)
    found = sparse.predict_left_out()
    for row in range(40):
        left = predict(np.arange(40) != row, x[row : row + 1])
        assert [one[row] for one in found] == pytest.approx(np.ravel(left), rel=1e-5)
    two = np.column_stack([values, 2 * values])
    assert sparse.compute_weights(two)[:, 1] == pytest.approx(2 * sparse.weights)


def test_with_all_points_as_centres_it_is_the_exact_process():
    x, values, errors = scattered(40)
    points = np.random.default_rng(2).random((7, 3)) - 0.5
    exact = Process(KERNEL, x, values, errors, optimizer=None)
    sparse = SparseProcess(KERNEL, x, values, errors, x)
    for one, other in (
        (sparse.moments(points), exact.moments(points)),
        (sparse.predict_left_out(), exact.predict_left_out()),
    ):
        assert np.array(one) == pytest.approx(np.array(other), rel=1e-5)
    assert exact.compute_weights(values) == pytest.approx(exact.weights, rel=1e-9)


def test_centres_are_the_points_of_the_largest_variance_left():
    x, _, _ = scattered(30)
    rows = choose_centres(KERNEL, x, 8)
    for k, row in enumerate(rows):
        left = KERNEL.diag(x)
        if k:
            before = x[rows[:k]]
            between = KERNEL(x, before)
            known = between @ np.linalg.inv(KERNEL(before)) @ between.T
            left = left - np.diagonal(known)
        assert left[row] == pytest.approx(left.max(), rel=1e-6)
    # Points that are there twice explain each other.
    twice = np.vstack([x, x])
    assert len(choose_centres(KERNEL, twice, 60)) == 30


def test_up_to_the_limit_nothing_is_sparse(monkeypatch):
    def refuse(*arguments):
        raise AssertionError

    monkeypatch.setattr(kriging, "MAX_EXACT_SAMPLES", 20)
    monkeypatch.setattr(noise, "MAX_EXACT_SAMPLES", 20)
    many = Kriging(simulated(21), NOISE)
    assert [type(one) for one in many.process_sets[0]] == [SparseProcess] * 2
    assert len(many.process_sets) == 1
    functions = Draws(many, 0, np.random.default_rng(1))(np.zeros((3, 4)))
    assert functions.shape == (N_FUNCTIONS, 3, 2)

    monkeypatch.setattr(kriging, "_make_sparse_process", refuse)
    monkeypatch.setattr(noise, "_interpolate_evidence", refuse)
    few = simulated(20)
    model = Kriging(few, NOISE)
    assert [type(one) for one in model.process_sets[0]] == [Process] * 2
    assert len(model.process_sets) == N_DRAWS
    assert estimate_nugget(few.unit_points, few.means[:, 0], np.ones(20)) > 0
    with pytest.raises(AssertionError):
        Kriging(simulated(21), NOISE)


def test_functions_drawn_from_a_sparse_process_have_its_moments():
    model = Kriging(simulated(MAX_EXACT_SAMPLES + 44), NOISE)
    points = np.random.default_rng(5).random((6, 4))
    mean, covariance = model.predict(points)
    random = np.random.default_rng(6)
    functions = np.concatenate([Draws(model, 0, random)(points) for _ in range(4)])
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    z = (functions.mean(axis=0) - mean) / sd * np.sqrt(len(functions))
    assert np.abs(z).max() < 4.5
    assert functions.std(axis=0) == pytest.approx(sd, rel=0.25)


def test_the_work_grows_with_the_number_of_samples_and_not_with_its_cube():
    def seconds(n):
        x, values, errors = scattered(n)
        best = np.inf
        for _ in range(3):
            start = time.process_time()
            SparseProcess(
                KERNEL, x, values, errors, x[:MAX_EXACT_SAMPLES]
            ).predict_left_out()
            best = min(best, time.process_time() - start)
        return best

    # 4 times as many: 4 by the number, 64 by its cube.
    assert seconds(4800) < 12 * seconds(1200)


@pytest.mark.slow
def test_the_noise_of_many_single_runs_is_known_better_than_to_a_step_of_the_shares():
    factors = []
    for seed in range(3):
        observed = simulated(600, seed)
        shares = np.ones(600)
        for values, variance in zip(observed.means.T, NOISE.diagonal(), strict=True):
            factors.append(
                estimate_nugget(observed.unit_points, values, shares) / variance
            )
    # The best of `NOISE_FRACTIONS` alone may be wrong by half a step.
    half_step = np.sqrt(noise.NOISE_FRACTIONS[1] / noise.NOISE_FRACTIONS[0])
    assert np.abs(np.log(factors)).max() < np.log(half_step)


@pytest.mark.slow
def test_predictions_and_errors_are_as_good_as_those_of_the_exact_processes(
    monkeypatch,
):
    points = qmc.Sobol(4, rng=1).random(1024)
    truth = curved(points)
    errors = {}
    shares = {}
    for limit in (MAX_EXACT_SAMPLES, 10**9):
        monkeypatch.setattr(kriging, "MAX_EXACT_SAMPLES", limit)
        squares = []
        inside = []
        for seed in range(3):
            mean, covariance = Kriging(simulated(360, seed), NOISE).predict(points)
            sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
            squares.append(((mean - truth) ** 2 / NOISE.diagonal()).mean())
            inside.append((np.abs(mean - truth) < 1.96 * sd).mean())
        errors[limit] = np.sqrt(np.mean(squares))
        shares[limit] = np.mean(inside)
    # The ratio of single seeds scatters by 15 %, as lengths of 256 samples are uncertain.
    # These bounds are three standard errors of three seeds.
    assert errors[MAX_EXACT_SAMPLES] < 1.25 * errors[10**9]
    assert shares[MAX_EXACT_SAMPLES] > shares[10**9] - 0.05
