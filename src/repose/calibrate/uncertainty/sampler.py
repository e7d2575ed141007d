"""Draw from a probability density in the unit cube, and measure convergence.

The draws come from emcee (Foreman-Mackey et al. 2013, PASP 125, 306). The walkers of an
ensemble depend on each other. Therefore several independent ensembles are drawn, and
R-hat compares them.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy import optimize, stats

from repose.calibrate.designs.allowed import take_allowed_points
from repose.calibrate.parameter_space import ParameterSpace

N_ENSEMBLES = 4
BURN_IN_FRACTION = 0.5  # fraction of the steps that is dropped
N_BINS = 40
N_PRIOR_DRAWS = 2**15
CHUNK_SIZE = 2048  # points at which the likelihood is computed together
# Settings of `_draw_starts`.
N_POPULATION = 2048  # number of points
N_MOVES = 8  # number of steps at each power of the density
MIN_EFFECTIVE_FRACTION = 0.5  # effective fraction of the points after the power rises

Density = Callable[[np.ndarray], np.ndarray]


class Chains(NamedTuple):
    """Draws from a density.

    Autocorrelation times: Goodman & Weare 2010, Comm. App. Math. Comp. Sci. 5, 65.
    """

    points: np.ndarray  # (ensembles, draws, d), in order of time
    log_density: np.ndarray  # (ensembles, draws), at the points
    times: np.ndarray  # (d,), autocorrelation times in steps, means over the ensembles
    density_time: float  # autocorrelation time of the log density


class Information(NamedTuple):
    """Information in bits."""

    bits: float
    error: float  # standard error


def draw_chains(
    log_density: Density, dimensions: int, walkers: int, steps: int, seed: int
) -> Chains:
    """Draw from a density in the unit cube with several ensembles of walkers.

    The walkers start from the points of `_draw_starts`, which are already distributed
    approximately like the density. From uniform starts, some walkers would get stuck in
    a mode of negligible weight.

    Parameters
    ----------
    log_density : callable
        It maps points (n, d) to the log (n,) of the density, up to a constant.
    dimensions : int
        Number of coordinates of a point.
    walkers : int
        Number of walkers in each ensemble; at most `N_POPULATION` are used.
    steps : int
        Number of steps of each walker, including the burn-in.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    Chains
        The draws after the burn-in.
    """
    import emcee

    density_in_cube = partial(_compute_density_in_cube, log_density=log_density)
    burn_in = int(BURN_IN_FRACTION * steps)
    draws_of_ensembles = []
    times_of_ensembles = []
    for k in range(N_ENSEMBLES):
        rng = np.random.RandomState([seed, k])
        start_points = _draw_starts(density_in_cube, dimensions, rng)[:walkers]
        ensemble = _make_ensemble(len(start_points), dimensions, density_in_cube, rng)
        ensemble.run_mcmc(start_points, steps)

        # Add the log density as a last column after the coordinates, because its
        # autocorrelation time is needed, too.
        points = ensemble.get_chain(discard=burn_in)
        log_densities = ensemble.get_log_prob(discard=burn_in)
        chain = np.dstack([points, log_densities])  # (steps, walkers, d + 1)
        draws_of_ensembles.append(chain.reshape(-1, dimensions + 1))

        # With tol=0, emcee also accepts a chain that is short compared with its
        # autocorrelation time. The time is NaN if no walker moved; then take the number
        # of steps, as if all draws of a walker were a single one.
        with np.errstate(invalid="ignore"):
            times = emcee.autocorr.integrated_time(chain, tol=0)
        times_of_ensembles.append(np.nan_to_num(times, nan=steps))

    # Separate the coordinates from the log density again.
    draws = np.array(draws_of_ensembles)
    mean_times = np.mean(times_of_ensembles, axis=0)
    return Chains(
        points=np.ascontiguousarray(draws[..., :-1]),
        log_density=draws[..., -1].copy(),
        times=mean_times[:-1],
        density_time=float(mean_times[-1]),
    )


def _compute_density_in_cube(points: np.ndarray, log_density: Density) -> np.ndarray:
    """Compute the log density (n,) of points (n, d); -inf outside the unit cube."""
    values = np.full(len(points), -np.inf)
    is_inside = ((points >= 0) & (points <= 1)).all(axis=1)
    if is_inside.any():
        values[is_inside] = log_density(points[is_inside])
    return values


def _make_ensemble(
    walkers: int, dimensions: int, log_density: Density, rng: np.random.RandomState
) -> Any:
    """Make emcee's ensemble of walkers, with the state of a random generator."""
    import emcee

    # Leave out the snooker move. In emcee 3.1.6 the exponent in its acceptance is half
    # of what it should be, which makes the draws too narrow.
    moves = [(emcee.moves.DEMove(), 0.5), (emcee.moves.StretchMove(), 0.5)]
    ensemble = emcee.EnsembleSampler(
        walkers, dimensions, log_density, moves=moves, vectorize=True
    )
    ensemble.random_state = rng.get_state()
    return ensemble


def _draw_starts(
    log_density: Density, dimensions: int, rng: np.random.RandomState
) -> np.ndarray:
    """Draw points approximately from a density, by sequential Monte Carlo.

    The density is tempered: the points are drawn from a sequence of its powers (Del
    Moral et al. 2006, J. R. Stat. Soc. B 68, 411). The sequence begins with the power
    0, which is a uniform density, and ends with the power 1, the density itself. Each
    power is chosen as large as possible, so that the effective sample size is at least
    the fraction `MIN_EFFECTIVE_FRACTION` of the number of points. Then the points are
    resampled by their weights, and moved by a few steps of the sampler.

    Parameters
    ----------
    log_density : callable
        It maps points (n, d) to the log (n,) of the density, up to a constant.
    dimensions : int
        Number of coordinates of a point.
    rng : numpy.random.RandomState
        Source of the random numbers. The seed fixes the results only with the present
        order of the draws from it.

    Returns
    -------
    array (N_POPULATION, d)
        The points in random order, so that the first of them also represent the
        density.
    """
    # Start with uniform points, which are draws from the power 0. Points that violate a
    # constraint have the log density -inf, so draw other points in their place. The
    # loop ends, because the configuration is rejected if hardly any point is allowed.
    points = rng.uniform(size=(N_POPULATION, dimensions))
    log_densities = log_density(points)
    while (is_excluded := np.isneginf(log_densities)).any():
        points[is_excluded] = rng.uniform(size=(is_excluded.sum(), dimensions))
        log_densities[is_excluded] = log_density(points[is_excluded])

    power = 0.0
    while power < 1.0:
        increment = _find_power_increment(log_densities, upper_limit=1.0 - power)
        weight = _compute_weights(log_densities, increment)
        power += increment

        # Resample the points by their weights, and move them with the sampler.
        rows = rng.choice(N_POPULATION, N_POPULATION, p=weight / weight.sum())
        tempered = partial(
            _compute_tempered_density, log_density=log_density, power=power
        )
        ensemble = _make_ensemble(N_POPULATION, dimensions, tempered, rng)
        last = ensemble.run_mcmc(points[rows], N_MOVES, skip_initial_state_check=True)
        points = last.coords
        # The sampler knows the log of the tempered density. Divide it by the power to
        # get the log of the density itself.
        log_densities = last.log_prob / power
    # Resampled copies of a point stand side by side, so mix the order.
    return points[rng.permutation(N_POPULATION)]


def _compute_tempered_density(
    points: np.ndarray, log_density: Density, power: float
) -> np.ndarray:
    """Compute the log of a power of a density."""
    return power * log_density(points)


def _compute_weights(log_densities: np.ndarray, increment: float) -> np.ndarray:
    """Compute the weights (n,) of points when the power of their density increases.

    The largest weight is 1.
    """
    return np.exp(increment * (log_densities - log_densities.max()))


def _find_power_increment(log_densities: np.ndarray, upper_limit: float) -> float:
    """Find the largest next increment of the power in `_draw_starts`.

    A larger increment makes the weights of the points less equal. The effective sample
    size, divided by the number of points, must stay at least `MIN_EFFECTIVE_FRACTION`.

    Parameters
    ----------
    log_densities : array (n,)
        Log densities of the points, without the power.
    upper_limit : float
        Upper limit of the increment.

    Returns
    -------
    float
        The increment.
    """

    def compute_excess(increment: float) -> float:
        """Compute by how much the effective fraction exceeds the smallest allowed one."""
        weight = _compute_weights(log_densities, increment)
        effective_sample_size = weight.sum() ** 2 / (weight**2).sum()
        return effective_sample_size / len(weight) - MIN_EFFECTIVE_FRACTION

    if compute_excess(upper_limit) >= 0.0:
        return upper_limit
    # The excess decreases with the increment, so its zero is the largest increment.
    return optimize.brentq(compute_excess, 0.0, upper_limit)


def compute_split_r_hat(chains: np.ndarray) -> np.ndarray:
    """Compute R-hat (d,) of chains (m, n, d), each cut in two.

    Let W be the mean variance within the halves, each of n draws, and B / n the
    variance of their means. Then R-hat is sqrt(((n - 1) / n W + B / n) / W) (Gelman et
    al. 2013, Bayesian Data Analysis, 11.4).
    """
    n = chains.shape[1] // 2
    halves = np.concatenate([chains[:, :n], chains[:, -n:]])
    W = halves.var(axis=1, ddof=1).mean(axis=0)
    B = n * halves.mean(axis=1).var(axis=0, ddof=1)
    return np.sqrt(((n - 1) / n * W + B / n) / W)


def compute_information_bits(draws: np.ndarray, effective_draws: float) -> float:
    """Compute how much information the posterior of a parameter adds to its prior.

    The result, in bits, is the Kullback-Leibler divergence of a histogram. For m
    independent draws its expected excess is (bins - 1) / (2 m ln 2), which is
    subtracted (Miller 1955, Note on the bias of information estimates). The result is
    at least 0.

    Parameters
    ----------
    draws : array (n,)
        The cumulative distribution function of the prior at the draws, from 0 to 1.
    effective_draws : float
        Number m of independent draws that would be as informative.
    """
    counts, _ = np.histogram(draws, bins=N_BINS, range=(0, 1))
    return compute_bits_of_fractions(counts / len(draws), effective_draws)


def compute_bits_of_fractions(fractions: np.ndarray, effective_draws: float) -> float:
    """Compute the information in bits from the fraction of the draws in each of the bins.

    See `compute_information_bits`, of which this is the second half. The prior has the
    same probability in each of the `N_BINS` bins.
    """
    filled = fractions[fractions > 0]
    excess = (len(filled) - 1) / (2 * effective_draws * math.log(2))
    return max(0.0, float(filled @ np.log2(filled * N_BINS)) - excess)


def compute_joint_information(
    log_likelihood: Density,
    posterior_log_likelihoods: np.ndarray,
    effective_draws: float,
    space: ParameterSpace,
    seed: int,
) -> Information:
    """Compute the information that the joint posterior adds to the prior, in bits.

    With the likelihood L, the information is the Kullback-Leibler divergence
    E_posterior[log L] - log E_prior[L]. The mean over the prior uses a scrambled Sobol
    sequence. The standard error of this mean is computed as for independent points,
    which gives an upper limit.

    Parameters
    ----------
    log_likelihood : callable
        It maps points (n, d) of the unit cube to log L (n,).
    posterior_log_likelihoods : array (draws,)
        log L at draws of the posterior.
    effective_draws : float
        Effective number of independent draws.
    space : ParameterSpace
        The parameters with their priors.
    seed : int
        Seed of the Sobol sequence.

    Returns
    -------
    Information
        The information and its standard error, both in bits.
    """
    sequence = stats.qmc.Sobol(space.dimensions, rng=seed)
    points = take_allowed_points(sequence, N_PRIOR_DRAWS, space)
    parts = np.array_split(points, N_PRIOR_DRAWS // CHUNK_SIZE)
    log_likelihoods = np.concatenate([log_likelihood(part) for part in parts])
    # Divide the likelihoods by the largest one, because they may be too small for a
    # float.
    relative_likelihoods = np.exp(log_likelihoods - log_likelihoods.max())
    mean_likelihood = relative_likelihoods.mean()
    log_evidence = log_likelihoods.max() + math.log(mean_likelihood)
    # The error of the logarithm of a mean is, to first order, the relative error of the
    # mean. The errors of both terms are independent.
    prior_error = (
        relative_likelihoods.std() / mean_likelihood / math.sqrt(N_PRIOR_DRAWS)
    )
    posterior_error = posterior_log_likelihoods.std() / math.sqrt(effective_draws)
    # The division by ln 2 converts from nats to bits.
    information = posterior_log_likelihoods.mean() - log_evidence
    return Information(
        bits=float(information / math.log(2)),
        error=float(math.hypot(prior_error, posterior_error) / math.log(2)),
    )
