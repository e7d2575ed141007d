"""Posteriors of other engines' piles: levels, bits and errors with known answers."""

import math

import numpy as np
import pytest

from research.answers import known_truth
from research.answers.known_truth import HIGH, LOW, Results

SLOPE_DEG, NOISE_DEG = 30.0, 1.0  # over the range of the static friction


def line(places):
    """A response that depends on the static friction alone."""
    return SLOPE_DEG * (places[:, 0] - LOW[0]) / (HIGH - LOW)[0]


def log_likelihood(places, there):
    return -0.5 * ((there - line(places)) / NOISE_DEG) ** 2


def drawn(rng, count):
    return LOW + rng.random((count, 3)) * (HIGH - LOW)


def judged(truths, rng, cells=(400, 1, 1)):
    points = known_truth.grid(cells)
    for truth in truths:
        there = float(line(truth[np.newaxis])[0] + rng.normal(0.0, NOISE_DEG))
        at_truth = log_likelihood(truth[np.newaxis], there)[0]
        yield known_truth.judged(log_likelihood(points, there), at_truth, truth, cells)


def test_levels_are_uniform_where_the_model_is_right():
    rng = np.random.default_rng(1)
    levels = np.array([one["level"] for one in judged(drawn(rng, 2000), rng)])
    for share in (0.5, 0.9):
        error = math.sqrt(share * (1.0 - share) / len(levels))
        assert np.mean(levels <= share) == pytest.approx(share, abs=4.0 * error)


def test_bits_are_those_of_a_normal_distribution():
    """Far from the ends the posterior of the line is normal, with an entropy that is known."""
    truth = 0.5 * (LOW + HIGH)
    found = next(judged([truth], np.random.default_rng(1), cells=(4000, 3, 2)))
    entropy_bits = 0.5 * math.log2(
        2.0 * math.pi * math.e * (NOISE_DEG / SLOPE_DEG) ** 2
    )
    assert found["bits"] == pytest.approx(-entropy_bits, abs=1e-3)
    assert found["bits_fric"] == pytest.approx(-entropy_bits, abs=1e-3)
    assert found["bits_rollfric"] == pytest.approx(0.0, abs=1e-9)


def test_distance_of_the_prior_from_the_middle():
    cells = (20, 20, 20)
    even = np.full(math.prod(cells), 1.0 / math.prod(cells))
    found = known_truth.distance(even, 0.5 * (LOW + HIGH), cells)
    assert found == pytest.approx(math.sqrt(3.0 / 12.0), rel=2e-3)


def results(rng, count, discrepancy):
    """Results of both engines on a line, with noise of the seeds and a discrepancy."""
    places = drawn(rng, count)
    here, there = (
        line(places)[:, np.newaxis] + rng.normal(0.0, noise, (count, 2))
        for noise in (0.9, 0.7)
    )
    return Results(
        places=places,
        here=here.mean(axis=1),
        there=there.mean(axis=1) + rng.normal(0.0, discrepancy, count),
        here_sd=here.std(axis=1, ddof=1),
        there_sd=there.std(axis=1, ddof=1),
        seeds=np.full(count, 2.0),
    )


@pytest.mark.parametrize("discrepancy", [0.0, 2.0])
def test_errors_are_found(discrepancy):
    """Noise of both engines and the discrepancy, each within four standard errors."""
    count = 150
    found = known_truth.Model.of(results(np.random.default_rng(2), count, discrepancy))
    assert found.noise_here == pytest.approx(0.9, rel=4.0 / math.sqrt(2 * count))
    assert found.noise_there == pytest.approx(0.7, rel=4.0 / math.sqrt(2 * count))
    equal = (0.9**2 + 0.7**2) / 2.0
    error = 4.0 * math.sqrt(2.0 / count) * (equal + discrepancy**2)
    assert found.discrepancy**2 == pytest.approx(discrepancy**2, abs=error)
    assert 1.0 <= found.factor < 3.0


def test_factor_of_errors():
    """Errors of twice the stated size, with noise that is known."""
    variances = np.array([1.0, 4.0, 9.0])
    noise = np.full(3, 0.5)
    errors = np.sqrt(4.0 * variances + noise)
    factor = known_truth.factor_of_errors(errors, variances, noise)
    assert factor == pytest.approx(2.0, rel=1e-6)
    assert known_truth.factor_of_errors(0.1 * errors, variances, noise) == 1.0


def test_left_out_is_the_prediction_of_a_fit_to_the_others():
    """The closed form beside a fit to the others with the same hyperparameters."""
    rng = np.random.default_rng(3)
    data = results(rng, 12, 0.0)
    model = known_truth.Model.of(data).surrogate
    means, variances = known_truth.left_out(model)
    x = known_truth.inputs(data.places)
    process = model.processes_[0]
    scaled = (x - model.low_) / model.width_
    noise = process.noise_level / data.seeds
    covariance = process.kernel(scaled) + np.diag(noise)
    i = 4
    others = np.arange(12) != i
    solved = np.linalg.solve(covariance[np.ix_(others, others)], covariance[others, i])
    mean = model.unmix((solved @ process.values[others]).reshape(1, 1))[0, 0]
    assert means[i] == pytest.approx(mean, rel=1e-6)
    variance = process.kernel(scaled)[i, i] - solved @ covariance[others, i]
    assert variances[i] == pytest.approx(variance * model._scale[0] ** 2, rel=1e-4)


def test_the_judged_pile_has_no_part_in_its_posterior():
    """Another result of ours at the judged place, or another scatter there, changes nothing."""
    data = results(np.random.default_rng(4), 12, 0.5)
    first = np.arange(len(data.here)) == 0
    changed = Results(
        places=data.places,
        here=data.here + 20.0 * first,
        there=data.there,
        here_sd=data.here_sd + 9.0 * first,
        there_sd=data.there_sd + 9.0 * first,
        seeds=data.seeds,
    )
    one, other = (
        known_truth.Model.of(each.where(~first)).log_likelihood(
            data.places, data.there[0]
        )
        for each in (data, changed)
    )
    np.testing.assert_array_equal(one, other)
