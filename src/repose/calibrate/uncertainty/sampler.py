"""Draws of a probability density in the unit cube, with their convergence and information.

Draws come from emcee (Foreman-Mackey et al. 2013, PASP 125, 306). Walkers of one ensemble depend on each other, so
several independent ensembles are drawn, and R-hat compares these.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import optimize, stats

from repose.calibrate.parameter_space import ParameterSpace

ENSEMBLES = 4
BURN_IN = 0.5  # share of the steps that is dropped
BINS = 40
PRIOR_DRAWS = 2**15
POPULATION, MOVES = 2048, 8  # of `_start`: points, and steps at each temperature

Density = Callable[[np.ndarray], np.ndarray]


class Chains(NamedTuple):
    """Draws of a density.

    Autocorrelation times: Goodman & Weare 2010, Comm. App. Math. Comp. Sci. 5, 65.
    """

    points: np.ndarray  # (ensembles, draws, d), in order of time
    log_density: np.ndarray  # (ensembles, draws), at the points
    times: np.ndarray  # (d,), autocorrelation times in steps, means over the ensembles
    density_time: float  # autocorrelation time of the log density


def sample(
    log_density: Density, dimensions: int, walkers: int, steps: int, seed: int
) -> Chains:
    """Draw from a density in the unit cube.

    Walkers start at draws of a tempered population: from anywhere, some would never leave a mode of no weight.
    """
    import emcee

    def inside(points: np.ndarray) -> np.ndarray:
        value = np.full(len(points), -np.inf)
        allowed = ((points >= 0) & (points <= 1)).all(axis=1)
        if allowed.any():
            value[allowed] = log_density(points[allowed])
        return value

    chains, times = [], []
    for k in range(ENSEMBLES):
        random = np.random.RandomState([seed, k])
        first = _start(inside, dimensions, random)[:walkers]
        sampler = _ensemble(len(first), dimensions, inside, random)
        sampler.run_mcmc(first, steps)
        dropped = int(BURN_IN * steps)
        chain = np.dstack(
            [sampler.get_chain(discard=dropped), sampler.get_log_prob(discard=dropped)]
        )
        with np.errstate(invalid="ignore"):
            time = emcee.autocorr.integrated_time(chain, tol=0)
        times.append(
            np.nan_to_num(time, nan=steps)
        )  # not a number if a walker never moved
        chains.append(chain.reshape(-1, dimensions + 1))
    whole, time = np.array(chains), np.mean(times, axis=0)
    return Chains(
        np.ascontiguousarray(whole[..., :-1]),
        whole[..., -1].copy(),
        time[:-1],
        float(time[-1]),
    )


def _ensemble(
    walkers: int, dimensions: int, log_density: Density, random: np.random.RandomState
) -> Any:
    """Make emcee's ensemble of walkers, drawn with the state of a random generator."""
    import emcee

    # not the snooker move: as of emcee 3.1.6 its acceptance has half the exponent, and draws are too narrow
    moves = [(emcee.moves.DEMove(), 0.5), (emcee.moves.StretchMove(), 0.5)]
    sampler = emcee.EnsembleSampler(
        walkers, dimensions, log_density, moves=moves, vectorize=True
    )
    sampler.random_state = random.get_state()
    return sampler


def _start(
    log_density: Density, dimensions: int, random: np.random.RandomState
) -> np.ndarray:
    """Draw (POPULATION, d) from a density, approximately (Del Moral et al. 2006, J. R. Stat. Soc. B 68, 411).

    Powers of the density lead from the cube to the whole density; each halves the effective number of points.
    """
    points, power = random.uniform(size=(POPULATION, dimensions)), 0.0
    value = log_density(points)

    def kept(step: float) -> float:
        weight = np.exp(step * (value - value.max()))
        return weight.sum() ** 2 / (weight**2).sum() / POPULATION - 0.5

    def tempered(places: np.ndarray) -> np.ndarray:
        return power * log_density(places)

    while power < 1.0:
        rest = 1.0 - power
        step = rest if kept(rest) >= 0.0 else optimize.brentq(kept, 0.0, rest)
        weight = np.exp(step * (value - value.max()))
        power += step
        points = points[random.choice(POPULATION, POPULATION, p=weight / weight.sum())]
        sampler = _ensemble(POPULATION, dimensions, tempered, random)
        last = sampler.run_mcmc(points, MOVES, skip_initial_state_check=True)
        points, value = last.coords, last.log_prob / power
    return points[random.permutation(POPULATION)]


def split_r_hat(chains: np.ndarray) -> np.ndarray:
    """Compute R-hat (d,) of chains (m, n, d), each cut in two (Gelman et al. 2013, Bayesian Data Analysis, 11.4)."""
    n = chains.shape[1] // 2
    halves = np.concatenate([chains[:, :n], chains[:, -n:]])
    within = halves.var(axis=1, ddof=1).mean(axis=0)  # W
    between = n * halves.mean(axis=1).var(axis=0, ddof=1)  # B
    return np.sqrt(((n - 1) / n * within + between / n) / within)


def information_bits(draws: np.ndarray, effective: float) -> float:
    """Compute the Kullback-Leibler divergence of one parameter's posterior from its prior, in bits, at least 0.

    It is the divergence of a histogram. Its expected excess for `effective` independent draws, (bins - 1) / (2
    effective ln 2), is subtracted (Miller 1955, Note on the bias of information estimates).
    """
    return bits_of_shares(
        np.histogram(draws, bins=BINS, range=(0, 1))[0] / len(draws), effective
    )


def bits_of_shares(share: np.ndarray, effective: float) -> float:
    """Compute `information_bits` from a histogram: the share of the draws in each of the BINS."""
    filled = share[share > 0]
    excess = (len(filled) - 1) / (2 * effective * math.log(2))
    return max(0.0, float(filled @ np.log2(filled * BINS)) - excess)


def joint_information_bits(
    log_likelihood: Density,
    drawn: np.ndarray,
    effective: float,
    space: ParameterSpace,
    seed: int,
) -> tuple[float, float]:
    """Compute the Kullback-Leibler divergence of the whole posterior from the prior, in bits, and its standard error.

    It is E_posterior[log L] - log E_prior[L]. The second mean is over a scrambled Sobol sequence; its standard error is
    computed as for independent points, which makes it too large rather than too small.
    """
    points = space.from_prior(
        stats.qmc.Sobol(space.dimensions, rng=seed).random(PRIOR_DRAWS)
    )
    prior = np.concatenate(
        [log_likelihood(part) for part in np.array_split(points, PRIOR_DRAWS // 2048)]
    )
    likelihood = np.exp(prior - prior.max())
    evidence = prior.max() + math.log(likelihood.mean())
    of_prior = likelihood.std() / likelihood.mean() / math.sqrt(PRIOR_DRAWS)
    error = math.hypot(of_prior, drawn.std() / math.sqrt(effective))
    return float((drawn.mean() - evidence) / math.log(2)), float(error / math.log(2))
