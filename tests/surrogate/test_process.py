"""The Gaussian process beside the equations in plain numpy."""

import numpy as np
import pytest

from repose.surrogate.process import Process, SampleNoise, smooth, straight

KERNEL = smooth(2.0, [0.4, 0.9])


def covariance(a, b):
    """2 exp(-r^2 / 2), r in lengths."""
    return 2 * np.exp(-0.5 * (((a[:, None] - b) / [0.4, 0.9]) ** 2).sum(axis=2))


@pytest.fixture(params=["errors", "noise of the kernel"])
def noise_of(request):
    """Noise of variance 0.3 over the precision of a value, in either form."""
    if request.param == "errors":
        return lambda precision: {"errors": 0.3 / precision}
    return lambda precision: {"noise": SampleNoise(0.3, "fixed", precision)}


def test_moments_are_those_of_the_conditional_distribution(noise_of):
    random = np.random.default_rng(1)
    x, new, precision = random.random((9, 2)), random.random((5, 2)), random.uniform(1, 4, 9)
    values = random.normal(size=9)
    process = Process(KERNEL, x, values, **noise_of(precision))
    gain = covariance(new, x) @ np.linalg.inv(covariance(x, x) + np.diag(0.3 / precision))
    mean, variance = process.moments(new)
    assert mean == pytest.approx(gain @ values)
    assert process.mean(new) == pytest.approx(mean)
    assert variance == pytest.approx(2 - (gain * covariance(new, x)).sum(axis=1))


def test_a_value_is_left_out_as_if_the_others_were_all(noise_of):
    random = np.random.default_rng(2)
    x, precision, values = random.random((9, 2)), random.uniform(1, 4, 9), random.normal(size=9)
    means, variances = Process(KERNEL, x, values, **noise_of(precision)).left_out()
    for i in range(9):
        rest = np.arange(9) != i
        others = Process(KERNEL, x[rest], values[rest], **noise_of(precision[rest]))
        mean, variance = others.moments(x[i : i + 1])
        assert means[i] == pytest.approx(mean[0], rel=1e-6)
        assert variances[i] == pytest.approx(variance[0], rel=1e-6)


def test_covariances_are_those_of_the_textbook():
    random = np.random.default_rng(3)
    a, b = random.random((4, 2)), random.random((5, 2))
    r = np.sqrt(5 * (((a[:, None] - b) / [0.4, 0.9]) ** 2).sum(axis=2))
    assert KERNEL(a, b) == pytest.approx(covariance(a, b))
    assert smooth(2.0, [0.4, 0.9], smoothness=2.5)(a, b) == pytest.approx(2 * (1 + r + r**2 / 3) * np.exp(-r))
    assert straight(3.0)(a, b) == pytest.approx(1 + 9 * a @ b.T)
