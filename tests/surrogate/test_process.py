"""The Gaussian process beside the equations in plain numpy."""

import numpy as np
import pytest
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from repose.surrogate.process import Process, SampleNoise

KERNEL = ConstantKernel(2.0, "fixed") * RBF([0.4, 0.9], "fixed")


def covariance(a, b):
    """2 exp(-r^2 / 2), r in lengths."""
    return 2 * np.exp(-0.5 * (((a[:, None] - b) / [0.4, 0.9]) ** 2).sum(axis=2))


@pytest.mark.parametrize("known", [True, False], ids=["errors", "noise of the kernel"])
def test_moments_are_those_of_the_conditional_distribution(known):
    random = np.random.default_rng(1)
    x, new, precision = random.random((9, 2)), random.random((5, 2)), random.uniform(1, 4, 9)
    values = random.normal(size=9)
    noise = {"errors": 0.3 / precision} if known else {"noise": SampleNoise(0.3, "fixed", precision)}
    process = Process(KERNEL, x, values, **noise)
    gain = covariance(new, x) @ np.linalg.inv(covariance(x, x) + np.diag(0.3 / precision))
    mean, variance = process.moments(new)
    assert mean == pytest.approx(gain @ values)
    assert process.mean(new) == pytest.approx(mean)
    assert variance == pytest.approx(2 - (gain * covariance(new, x)).sum(axis=1))
