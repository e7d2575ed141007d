"""The sampler and its diagnostics, on densities with closed forms."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from refusals import value_error
from scipy import stats
from scipy.special import logsumexp

from repose.core.parameter_space import ParameterSpace
from repose.studies import sampler
from repose.studies.likelihood import log_likelihood

CUBE = ParameterSpace.of({name: [0.0, 1.0] for name in "ab"}, names=tuple("ab"))


@pytest.fixture(scope="module")
def linear():
    A, c = np.array([[8.0, 3.0], [-2.0, 10.0]]), np.array([20.0, 50.0])
    truth = np.array([0.45, 0.55])
    mean, covariance = A @ truth + c, np.array([[0.3, 0.1], [0.1, 0.4]])
    known = np.linalg.inv(A.T @ np.linalg.solve(covariance, A))

    def log_density(theta):
        return log_likelihood(theta @ A.T + c, np.zeros((len(theta), 2, 2)), mean, covariance)

    return log_density, sampler.sample(log_density, 2, 24, 1200, 3), truth, known


def test_linear_model_has_its_closed_form_posterior_and_information(linear):
    log_density, chains, truth, known = linear
    draws, effective = chains.points.reshape(-1, 2), chains.log_density.size / chains.times.max()
    assert chains.log_density.ravel() == pytest.approx(log_density(draws))
    assert effective > 1000
    error = np.sqrt(np.diag(known) / effective)
    assert draws.mean(axis=0) == pytest.approx(truth, abs=4 * error.max())
    assert np.cov(draws.T) == pytest.approx(known, abs=5 * known.max() * math.sqrt(2 / effective))
    assert (sampler.split_r_hat(chains.points) < 1.01).all()
    # KL(normal || uniform on the cube) = -entropy, since the uniform density is one
    joint = -0.5 * np.log2((2 * math.pi * math.e) ** 2 * np.linalg.det(known))
    effective = chains.log_density.size / chains.density_time
    found, error = sampler.joint_information_bits(log_density, chains.log_density.ravel(), effective, CUBE, 1)
    assert found == pytest.approx(joint, abs=0.03)
    assert error < 0.05
    for k in range(2):
        marginal = -0.5 * math.log2(2 * math.pi * math.e * known[k, k])
        effective = draws[:, k].size / chains.times[k]
        assert sampler.information_bits(draws[:, k], effective) == pytest.approx(marginal, abs=0.06)


def test_chains_end_at_their_bounds_repeat_by_seed_and_take_all_steps_where_nothing_changes():
    chains = sampler.sample(lambda u: 3 * u[:, 0], 1, 16, 1500, 1).points
    assert chains.min() >= 0
    assert chains.max() <= 1
    assert chains.mean() == pytest.approx(1 / (1 - math.exp(-3)) - 1 / 3, abs=0.01)
    first, second, other = (sampler.sample(lambda u: -u[:, 0], 2, 16, 100, seed).points for seed in (1, 1, 2))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)
    chains = sampler.sample(lambda theta: np.zeros(len(theta)), 2, 16, 50, 1)
    assert chains.density_time == 50
    assert np.isfinite(chains.times).all()


def test_a_mode_of_no_weight_holds_no_walkers():
    """A normal of sd 0.01 beside one of sd 0.05 that lies lower: it holds 5e-4 of the draws.

    Walkers that start anywhere stay on the lower hill: a fifth of the draws.
    """
    heights, sds = np.array([0.0, -12.0]), np.array([0.01, 0.05])
    centres = np.array([[0.2, 0.3, 0.3], [0.75, 0.7, 0.6]])

    def log_density(theta):
        distance = ((theta[:, None] - centres) ** 2).sum(axis=2)
        return logsumexp(heights - 0.5 * distance / sds**2, axis=1)

    mass = np.exp(heights) * sds**3
    chains = sampler.sample(log_density, 3, 32, 1500, 5)
    draws = chains.points.reshape(-1, 3)
    assert mass[1] / mass.sum() < 1e-3
    assert (draws[:, 0] > 0.5).mean() < 0.02
    assert draws.std(axis=0) == pytest.approx(0.01, rel=0.1)


def test_r_hat_of_known_chains():
    random = np.random.default_rng(1)
    good = random.normal(size=(4, 2000, 1))
    assert sampler.split_r_hat(good) == pytest.approx(1, abs=0.005)
    apart = good + np.array([0, 0, 0, 3.0])[:, None, None]
    # means 0, 0, 0, 3 twice each: variance 18 - 9 * 8 / 16 over 7 beside one within
    assert sampler.split_r_hat(apart) == pytest.approx(math.sqrt(1 + (18 - 4.5) / 7), rel=0.02)
    drifting = good + np.linspace(0, 3, 2000)[None, :, None]
    # halves' means 0.75 and 2.25 four times each, and a ramp of 1.5 within each
    assert sampler.split_r_hat(drifting) == pytest.approx(math.sqrt(1 + 4.5 / 7 / (1 + 1.5**2 / 12)), rel=0.02)
    value_error(r"shape \(4, 3, 1\)", sampler.split_r_hat, good[:, :3])


def test_information_of_known_draws():
    """Uniform: none. Density 2u: 1 - 1 / (2 ln 2) bits. A quarter of the range: two."""
    random = np.random.default_rng(2)
    u = random.uniform(size=40_000)
    assert sampler.information_bits(u, 40_000) < 0.002
    assert sampler.information_bits(np.sqrt(u), 40_000) == pytest.approx(1 - 1 / (2 * math.log(2)), abs=0.01)
    assert sampler.information_bits(u / 4, 40_000) == pytest.approx(2, abs=0.01)
    few = [sampler.information_bits(random.uniform(size=400), 400) for _ in range(200)]
    assert np.mean(few) < 0.02  # 0.07 without the correction


def test_information_beyond_an_informative_prior():
    """Prior N(0.5, 0.1), likelihood N(0.6; u, 0.1): posterior N(0.55, 0.1 / sqrt 2)."""
    random = np.random.default_rng(3)
    draws = random.normal(0.55, 0.1 / math.sqrt(2), (20_000, 1))

    def likelihood(u):
        return -0.5 * ((u[:, 0] - 0.6) / 0.1) ** 2

    def from_prior(share):
        return stats.norm(0.5, 0.1).ppf(np.clip(share, 1e-9, 1 - 1e-9))

    space = SimpleNamespace(dimensions=1, from_prior=from_prior)
    found, _ = sampler.joint_information_bits(likelihood, likelihood(draws), 20_000, space, 1)
    # between normals: ln(sd / sd') + (sd'^2 + shift^2) / (2 sd^2) - 1 / 2
    known = 0.5 * math.log(2) + (0.5 + 0.25) / 2 - 0.5
    assert found == pytest.approx(known / math.log(2), abs=0.02)
