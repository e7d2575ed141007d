"""Stochastic kriging and the probability of a box, compared with slow and obvious versions of them."""

from functools import partial

import numpy as np
import pytest
from refusals import value_error
from scipy.stats import multivariate_normal, norm

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.probability import compute_box_probability
from repose.calibrate.strategies.sequential.kriging import (
    FACTOR_MEDIAN,
    N_DRAWS,
    PRIOR_DEGREES_OF_FREEDOM,
    Kriging,
    ObservedSamples,
    SpaceKriging,
    _estimate_factor,
)
from repose.calibrate.surrogates.process import Process

NOISE = np.array([[2.0, 1.6], [1.6, 4.0]])


def poured(n=30, seeds=3, seed=1, noise=NOISE, d=2):
    """Samples of a plane and a bent surface with correlated noise."""
    random = np.random.default_rng(seed)
    unit = random.random((n, d))
    mean = np.column_stack(
        [30 + 8 * unit[:, 0], 60 + 12 * unit[:, 0] - 9 * unit[:, 1] ** 2]
    )
    return ObservedSamples(
        unit,
        mean[:, None] + random.multivariate_normal(np.zeros(2), noise, size=(n, seeds)),
    )


@pytest.mark.parametrize("k", [1, 2, 3])
def test_probability_of_a_box(k):
    random = np.random.default_rng(k)
    root = random.normal(size=(6, k, k))
    covariance = root @ root.transpose(0, 2, 1) + 0.3 * np.eye(k)
    mean = random.normal(size=(6, k))
    low = np.full(k, -1.0)
    high = np.linspace(0.8, 1.4, k)
    integral = partial(
        multivariate_normal.cdf, high, abseps=1e-6, lower_limit=low, rng=random
    )
    slow = [integral(m, c) for m, c in zip(mean, covariance, strict=True)]
    assert compute_box_probability(mean, covariance, low, high) == pytest.approx(
        slow, abs=1e-12 if k == 1 else 2e-3
    )


def test_errors_are_those_of_one_process_of_all_responses():
    # with the same numbers a process of samples times responses in one matrix says the same; the draws make a mixture
    observed = poured(n=12)
    model = Kriging(observed)
    points = np.random.default_rng(2).random((5, 2))
    slow = [
        one_process(model, observed, points, [process.kernel for process in processes])
        for processes in model.process_sets
    ]
    means = np.array([mean for mean, _ in slow])
    covariances = np.array([covariance for _, covariance in slow])
    found = model.predict(points)
    assert len(slow) == N_DRAWS
    assert found[0] == pytest.approx(means.mean(axis=0), rel=1e-8)
    for i in range(len(points)):
        mixture = model.factor * covariances[:, i].mean(axis=0) + np.cov(
            means[:, i].T, bias=True
        )
        assert found[1][i] == pytest.approx(mixture, rel=1e-6)


def test_errors_of_a_sample_are_those_of_processes_without_it():
    model = Kriging(poured(n=12))
    residuals, variances, others = model._predict_left_out()
    # values and errors of each combination of the responses
    columns = np.array([model.values.T, model.noise_variances.T]).transpose(1, 0, 2)
    for i in range(12):
        rest = np.arange(12) != i
        moments = []
        for processes in model.process_sets:
            without_i = [
                Process(
                    process.kernel,
                    model.centred_points[rest],
                    *column[:, rest],
                    optimizer=None,
                )
                for process, column in zip(processes, columns, strict=True)
            ]
            moments.append(
                [p.moments(model.centred_points[i : i + 1]) for p in without_i]
            )
        moments = np.array(moments)
        means, spreads = moments[..., 0].transpose(2, 0, 1)
        expected = model.values[i] - means.mean(axis=0)
        assert residuals[i] == pytest.approx(expected, rel=1e-6)
        assert variances[i] == pytest.approx(spreads.mean(axis=0), rel=1e-6)
        assert others[i] == pytest.approx(
            means.var(axis=0) + model.noise_variances[i], rel=1e-6
        )


def one_process(model, observed, points, kernels):
    """Means (m, 2) and covariances (m, 2, 2) of two responses at points, by one Gaussian process of all values.

    Its matrices have two rows for each of n samples and then of m points; A: known values, B: those to predict.
    """
    n = len(observed.unit_points)
    m = len(points)
    known = slice(0, 2 * n)
    unknown = slice(2 * n, 2 * (n + m))
    # the kernels are of combinations of the responses; `back` turns these into responses
    to_responses = np.linalg.inv(model._mixing).T @ np.diag(model._scale)
    back = np.kron(np.eye(n + m), to_responses)
    of_combinations = np.zeros((2 * (n + m), 2 * (n + m)))
    everywhere = np.vstack([observed.unit_points, points]) - 0.5
    for j, kernel in enumerate(kernels):
        of_combinations[j::2, j::2] = kernel(everywhere)
    prior = back @ of_combinations @ back.T
    errors = (
        back[known, known]
        @ np.diag(model.noise_variances.ravel())
        @ back[known, known].T
    )
    # mean and covariance of B given A: K_BA (K_AA + errors)^-1
    gain = prior[unknown, known] @ np.linalg.inv(prior[known, known] + errors)
    middle = model._middle @ np.linalg.inv(model._mixing)
    mean = middle + (gain @ (observed.means - middle).ravel()).reshape(m, 2)
    covariance = prior[unknown, unknown] - gain @ prior[known, unknown]
    return mean, [covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] for i in range(m)]


def test_the_factor_is_that_of_the_residuals():
    random = np.random.default_rng(3)
    variances, errors = random.uniform(0.5, 2.0, (2, 5000, 1))
    for factor in (0.4, 1.0, 3.0):
        residuals = np.sqrt(factor * variances + errors) * random.standard_normal(
            (5000, 1)
        )
        assert _estimate_factor(residuals, variances, errors) == pytest.approx(
            factor, rel=0.15
        )
    residuals = np.random.default_rng(4).standard_normal((20, 1))
    assert _estimate_factor(
        residuals, 1e-4 * np.ones((20, 1)), np.ones((20, 1))
    ) == pytest.approx(FACTOR_MEDIAN, rel=0.01)


def test_variances_are_right_at_large_noise():
    # variances were once three times too large there, at any noise: the mean square was 0.33, now it is 0.6
    places = 0.3 + 0.4 * np.random.default_rng(5).random((20, 6))
    truth = np.column_stack(
        [30 + 8 * places[:, 0], 60 + 12 * places[:, 0] - 9 * places[:, 1] ** 2]
    )
    squares = []
    for seed in range(10):
        mean, covariance = Kriging(poured(seed=seed, noise=9 * NOISE, d=6)).predict(
            places
        )
        squares.append((mean - truth) ** 2 / np.diagonal(covariance, axis1=1, axis2=2))
    assert 0.45 < np.mean(squares) < 1.5


def test_the_noise_of_samples():
    observed = poured(n=3000, seeds=2)
    assert observed.estimate_noise() == pytest.approx(NOISE, rel=0.08)
    assert observed.degrees_of_freedom == 3000
    observed = poured(n=40, seeds=4)
    mixed = observed.residuals @ Kriging(observed)._mixing
    sample_variances = (mixed**2).sum(axis=1) / 3
    moderated = Kriging(observed).noise_variances * Kriging(observed)._scale ** 2 * 4
    expected = (PRIOR_DEGREES_OF_FREEDOM + 3 * sample_variances) / (
        PRIOR_DEGREES_OF_FREEDOM + 3
    )
    assert moderated == pytest.approx(expected)
    assert (np.minimum(sample_variances, 1) <= moderated + 1e-9).all()
    assert (moderated <= np.maximum(sample_variances, 1) + 1e-9).all()
    observed = poured(n=40, seeds=3)
    observed.values[7, 1:] = np.nan
    model = Kriging(observed)
    assert observed.counts[7] == 1
    assert model.noise_variances[7] * model._scale**2 == pytest.approx(1.0)


def test_95_percent_intervals_of_predictions_hold_95_percent_of_the_means():
    """Over 20 places and 40 data sets: within 6 standard errors of independent places, since they are not independent."""
    places = np.random.default_rng(5).random((20, 2))
    truth = np.column_stack(
        [30 + 8 * places[:, 0], 60 + 12 * places[:, 0] - 9 * places[:, 1] ** 2]
    )
    inside = []
    for seed in range(40):
        mean, covariance = Kriging(poured(seed=seed)).predict(places)
        sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        inside.append(np.abs(mean - truth) < norm.ppf(0.975) * sd)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.033)


def test_too_few_pours_are_refused():
    value_error("at least 3", Kriging, poured(seeds=1))
    value_error("at least 2", Kriging, poured(n=1, seeds=9))
    observed = poured()
    observed.values[:] = observed.values[:, :1]
    value_error("the same responses", Kriging, observed)


@pytest.mark.parametrize(
    ("point", "avoids"),
    [
        (0.125, True),  # 0.125 from a good sample, 0.375 from a failed one
        (0.375, True),  # as near to a good sample as to a failed one
        (0.4375, False),
        (0.625, True),  # as near to a good sample as to a failed one
        (0.8125, True),
        (0.9375, False),
    ],
)
def test_a_point_avoids_failures_if_no_failed_sample_is_nearer_than_a_good_one(
    point, avoids
):
    observed = ObservedSamples(
        unit_points=np.array([[0.25], [0.75]]),
        values=np.zeros((2, 1, 1)),
        failed=np.array([[0.5], [1.0]]),
    )
    assert observed.avoids_failures(np.array([[point]])).tolist() == [avoids]
    many = np.full((5, 1), point)
    assert observed.avoids_failures(many).tolist() == [avoids] * 5


def test_a_mean_alone_has_the_bits_of_a_prediction():
    random = np.random.default_rng(1)
    unit = random.random((12, 2))
    means = np.column_stack([unit.sum(axis=1), unit[:, 0] ** 2])
    values = means[:, None] + 0.1 * random.normal(size=(12, 2, 2))
    model = Kriging(ObservedSamples(unit, values))
    points = random.random((20, 2))
    mean, covariance = model.predict(points)
    np.testing.assert_array_equal(model.mean(points), mean)
    # The posterior takes both at once, and other code one after the other.
    space = ParameterSpace.of({"a": [0.0, 1.0], "b": [0.0, 1.0]})
    surrogate = SpaceKriging(model, space)
    for found in (
        surrogate.moments(points),
        (surrogate.predict(points), surrogate.covariance(points)),
    ):
        np.testing.assert_array_equal(found[0], mean)
        np.testing.assert_array_equal(found[1], covariance)


def test_a_nugget_is_estimated_once(monkeypatch):
    from repose.calibrate.strategies.sequential import noise
    from repose.calibrate.surrogates import process

    random = np.random.default_rng(2)
    unit = random.random((12, 2))
    means = unit[:, 0] + 0.1 * random.normal(size=12)
    shares = np.ones(12)
    first = noise.estimate_nugget(unit, means, shares)
    monkeypatch.setattr(process, "Process", None)
    assert noise.estimate_nugget(unit.copy(), means.copy(), shares) == first


def test_a_refit_to_other_means_keeps_the_model_of_the_first_fit():
    random = np.random.default_rng(2)
    points = random.random((12, 2))
    values = (points @ [[3.0, 1.0], [1.0, 2.0]])[:, None] + random.normal(
        0, 0.1, (12, 3, 2)
    )
    model = Kriging(ObservedSamples(points, values))
    places = random.random((5, 2))
    mean, covariance = model.predict(places)
    same, same_covariance = model.refit(values.mean(axis=1)).predict(places)
    np.testing.assert_allclose(same, mean, rtol=1e-9)
    np.testing.assert_allclose(same_covariance, covariance, rtol=1e-6)
    # The model is linear in the means: opposite changes move it by opposite amounts.
    change = random.normal(0, 0.1, (12, 2))
    up = model.refit(values.mean(axis=1) + change).mean(places)
    down = model.refit(values.mean(axis=1) - change).mean(places)
    np.testing.assert_allclose(up - mean, mean - down, rtol=1e-6)
    assert np.abs(up - mean).max() > 0.01
    np.testing.assert_array_equal(model.predict(places)[0], mean)
