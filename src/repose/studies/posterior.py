"""Posterior of the six parameters given the physical piles.

Priors are uniform on the configured ranges. The mean of m physical piles, y (2,), is taken as normal about the
network's prediction f(theta):

    y ~ N(f(theta), S_y + S_d + S_w(theta))

    S_y  of the mean of the piles: sd / sqrt(m) of each response, their correlation that of simulated piles of
         one sample. It holds the scatter from pile to pile, so the network's noise term is left out.
    S_d  what the model cannot do, whatever its parameters: a share of each target, independent (Kennedy & O'Hagan
         2001, J. R. Stat. Soc. B 63, 425, with a constant in place of a process).
    S_w  of the network's prediction, by the uncertainty of its weights.

S_w varies over the parameters, so the density keeps its determinant. Ensembles that know nothing of each other are
drawn by emcee (Foreman-Mackey et al. 2013, PASP 125, 306); R-hat compares them, since the walkers of one ensemble
are not independent.
"""

import json
import math
from pathlib import Path

import numpy as np
from scipy import stats

from repose.chain import train
from repose.core import variance
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.studies import noise
from repose.surrogate.bayesian_bp import RESPONSES
from repose.surrogate.support import Support

ENSEMBLES = 4
BURN_IN = 0.5  # share of the steps that is dropped
CREDIBLE = 0.95
DRAWS_KEPT = 4000
BINS = 40
PRIOR_DRAWS = 2**15
LARGEST_R_HAT, FEWEST_EFFECTIVE = 1.01, 400  # Vehtari et al. 2021, Bayesian Analysis 16, 667
# Kullback-Leibler information, in bits: halving the range is worth one.
DETERMINED, UNDETERMINED = 1.0, 0.2
MOSTLY = 0.5


def observation(target, correlation, discrepancy_percent):
    """Mean (2,) of the physical piles and S_y + S_d (2, 2), in deg and mm.

    target: physical_aor_deg, physical_aor_sd_deg, physical_height_mm, physical_height_sd_mm, physical_piles.
    correlation: of the two responses from pile to pile.
    """
    if not -1 < correlation < 1:
        raise ValueError(f"correlation is {correlation!r}; allowed: above -1 and below 1")
    mean = np.array([target["physical_aor_deg"], target["physical_height_mm"]])
    error = np.array([target["physical_aor_sd_deg"], target["physical_height_sd_mm"]])
    error = error / math.sqrt(target["physical_piles"])
    covariance = np.outer(error, error) * np.array([[1, correlation], [correlation, 1]])
    return mean, covariance + np.diag((discrepancy_percent / 100 * mean) ** 2)


def log_likelihood(responses, covariances, mean, covariance):
    """log N(mean; responses, covariance + covariances) for responses (n, k), covariances (n, k, k): (n,)."""
    total = covariance + covariances
    off = mean - responses
    distance = np.einsum("ni,ni->n", off, np.linalg.solve(total, off[:, :, None])[:, :, 0])
    _, log_det = np.linalg.slogdet(total)
    return -0.5 * (distance + log_det + off.shape[1] * math.log(2 * math.pi))


def sample(log_density, dimensions, walkers, steps, seed, ensembles=ENSEMBLES):
    """Draws in the unit cube: chains (ensembles, draws, dimensions) in order of time, autocorrelation times (d,).

    log_density: points (n, d) in the unit cube to (n,); outside it the density is zero. Walkers start anywhere in the
    cube; the first half of the steps is dropped. Autocorrelation times are in steps, means over the ensembles
    (Goodman & Weare 2010, Comm. App. Math. Comp. Sci. 5, 65).
    """
    import emcee

    def inside(points):
        value = np.full(len(points), -np.inf)
        allowed = ((points >= 0) & (points <= 1)).all(axis=1)
        if allowed.any():
            value[allowed] = log_density(points[allowed])
        return value

    chains, times = [], []
    for k in range(ensembles):
        random = np.random.RandomState([seed, k])
        # not the snooker move: as of emcee 3.1.6 its acceptance has half the exponent, and draws are too narrow
        moves = [(emcee.moves.DEMove(), 0.5), (emcee.moves.StretchMove(), 0.5)]
        sampler = emcee.EnsembleSampler(walkers, dimensions, inside, moves=moves, vectorize=True)
        sampler.random_state = random.get_state()
        sampler.run_mcmc(random.uniform(size=(walkers, dimensions)), steps)
        chain = sampler.get_chain(discard=int(BURN_IN * steps))
        times.append(emcee.autocorr.integrated_time(chain, tol=0))
        chains.append(chain.reshape(-1, dimensions))
    return np.array(chains), np.mean(times, axis=0)


def split_r_hat(chains):
    """R-hat (d,) of chains (m, n, d), each cut in two (Gelman et al. 2013, Bayesian Data Analysis, 11.4).

    Raises ValueError for chains of fewer than four steps or of another shape.
    """
    chains = np.asarray(chains, dtype=float)
    if chains.ndim != 3 or chains.shape[1] < 4:
        raise ValueError(
            f"chains has shape {chains.shape}; allowed: (chains, steps, dimensions), 4 steps or more"
        )
    n = chains.shape[1] // 2
    halves = np.concatenate([chains[:, :n], chains[:, -n:]])
    within = halves.var(axis=1, ddof=1).mean(axis=0)  # W
    between = n * halves.mean(axis=1).var(axis=0, ddof=1)  # B
    return np.sqrt(((n - 1) / n * within + between / n) / within)


def information_bits(draws, effective):
    """Kullback-Leibler divergence from the uniform prior, in bits, of one parameter's draws (n,) in [0, 1].

    Of a histogram; its expected excess, (bins - 1) / (2 effective ln 2) for this many independent draws, is taken off
    (Miller 1955), and it is not below 0.
    """
    share = np.histogram(draws, bins=BINS, range=(0, 1))[0] / len(draws)
    filled = share[share > 0]
    excess = (len(filled) - 1) / (2 * effective * math.log(2))
    return max(0.0, float(filled @ np.log2(filled * BINS)) - excess)


def joint_information_bits(log_density, draws, seed, prior_draws=PRIOR_DRAWS):
    """Kullback-Leibler divergence of the whole posterior from the prior in bits, and its standard error.

    E_posterior[log L] - log E_prior[L]; log_density: log L of points (n, d) in the unit cube; draws (n, d). The second
    mean is over a scrambled Sobol sequence of prior_draws points, its error as if they were independent: too large
    rather than too small.
    """
    points = stats.qmc.Sobol(draws.shape[1], rng=seed).random(prior_draws)
    prior = np.concatenate(
        [log_density(part) for part in np.array_split(points, max(1, prior_draws // 2048))]
    )
    likelihood = np.exp(prior - prior.max())
    evidence = prior.max() + math.log(likelihood.mean())
    error = likelihood.std() / likelihood.mean() / math.sqrt(prior_draws)
    return float((log_density(draws).mean() - evidence) / math.log(2)), float(error / math.log(2))


def run(files, ranges, target, settings, out_dir):
    """Sample the posterior; write posterior.csv, draws.csv and posterior.json; return the summary.

    files: network, metrics, predictions, dataset, runs, feasible, table3 to paths. ranges: parameter to (low, high).
    target: that section of the configuration. settings: discrepancy_percent, walkers, steps, seed. Raises
    InputError for a bad file, files that do not belong together, or runs of one seed alone.
    """
    import pandas as pd

    model = train.restore(*(files[key] for key in ("network", "predictions", "dataset")))
    support = Support.of_dataset(files["dataset"], ranges)
    feasible = read_table(files["feasible"], PARAMETERS)
    published = read_table(files["table3"], ("parameter", "low", "high")).set_index("parameter")
    _, ok = noise.read_runs(files["runs"])
    correlation = variance.residual_correlation(*(ok[name] for name in RESPONSES), ok["sample"])
    mean, covariance = observation(target, correlation[0], settings["discrepancy_percent"])
    low, high = np.array([ranges[name] for name in PARAMETERS], dtype=float).T

    def log_density(unit):
        X = low + unit * (high - low)
        return log_likelihood(model.predict(X), model.covariance(X), mean, covariance)

    chains, times = sample(
        log_density, len(PARAMETERS), settings["walkers"], settings["steps"], settings["seed"]
    )
    r_hat, effective = split_r_hat(chains), chains[:, :, 0].size / times
    unit = chains.reshape(-1, len(PARAMETERS))
    kept = unit[np.linspace(0, len(unit) - 1, min(DRAWS_KEPT, len(unit))).astype(int)]
    X = low + kept * (high - low)
    Y, std = model.predict(X, return_std=True, noise=False)

    bits, bits_error = joint_information_bits(log_density, kept, settings["seed"])
    rows = []
    for k, name in enumerate(PARAMETERS):
        row = {"parameter": name, "low": low[k], "high": high[k]}
        row |= _marginal(unit[:, k], low[k], high[k], effective[k])
        row |= {"r_hat": r_hat[k], "effective_draws": effective[k], "autocorrelation_steps": times[k]}
        row |= _beside("published", unit[:, k], *published.loc[name, ["low", "high"]], low[k], high[k])
        row |= _beside("miga", unit[:, k], feasible[name].min(), feasible[name].max(), low[k], high[k])
        row["statement"] = statement(row)
        rows.append(row)
    draws = pd.DataFrame(X, columns=list(PARAMETERS))
    for k, column in enumerate(train.PREDICTED):
        draws[column] = Y[:, k]
        draws[column.replace("predicted", "network_se")] = std[:, k]
    summary = {
        "correlation": dict(zip(("value", "low", "high", "degrees_of_freedom"), correlation, strict=True)),
        "physical_se": [math.sqrt(v) for v in np.diag(observation(target, correlation[0], 0)[1])],
        "discrepancy_sd": [float(v) for v in settings["discrepancy_percent"] / 100 * mean],
        "network_se": [float(v) for v in np.sqrt((std**2).mean(axis=0))],
        "predicted": {
            name: {"mean": float(Y[:, k].mean()), **_interval(Y[:, k])} for k, name in enumerate(RESPONSES)
        },
        "misfit": misfit(Y, model.covariance(X), mean, covariance),
        "information_bits": bits,
        "information_se_bits": bits_error,
        "sum_of_marginals_bits": float(sum(row["information_bits"] for row in rows)),
        "thin_share": float(support.is_thin(X).mean()),
        "converged": bool((r_hat <= LARGEST_R_HAT).all() and (effective >= FEWEST_EFFECTIVE).all()),
        "largest_r_hat": float(r_hat.max()),
        "least_effective_draws": float(effective.min()),
        "correlations": np.corrcoef(kept.T).round(3).tolist(),
        "statements": {row["parameter"]: row["statement"] for row in rows},
    }
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows).to_csv(out / "posterior.csv", index=False)
    draws.to_csv(out / "draws.csv", index=False)
    (out / "posterior.json").write_text(json.dumps(summary, indent=1) + "\n")
    return summary


def misfit(responses, covariances, mean, covariance):
    """How well the best draw meets the piles: its squared distance in standard deviations, and the chi^2 tail."""
    off = mean - responses
    total = covariance + covariances
    distance = np.einsum("ni,ni->n", off, np.linalg.solve(total, off[:, :, None])[:, :, 0])
    best = float(distance.min())
    return {"squared_distance": best, "p_value": float(stats.chi2.sf(best, off.shape[1]))}


def statement(row):
    """What the piles say of one parameter, in words; row: of posterior.csv."""
    bits, name = row["information_bits"], row["parameter"]
    where = f"{row['credible_low']:.3g} to {row['credible_high']:.3g}"
    share = f"{100 * row['width_ratio']:.0f} % of the prior's width, {bits:.2f} bits"
    if bits < UNDETERMINED:
        return f"{name} is not determined: {share}"
    if bits < DETERMINED:
        end = "low" if row["below_centre"] > 0.5 else "high"
        sure = max(row["below_centre"], 1 - row["below_centre"])
        return f"{name} is weakly determined, in the {end} half with probability {sure:.2f}: {share}"
    return f"{name} is determined, {where}: {share}"


def message(summary):
    """Statements, fit and convergence in words."""
    lines = list(summary["statements"].values())
    fit = summary["misfit"]
    bits, error = summary["information_bits"], summary["information_se_bits"]
    distance = math.sqrt(fit["squared_distance"])
    lines.append(
        f"together {bits:.1f} ± {error:.1f} bits; the best draw misses the piles by {distance:.2f} standard "
        f"deviations (p = {fit['p_value']:.2g}); {100 * summary['thin_share']:.0f} % of the draws lie where samples "
        "are thin"
    )
    if summary["thin_share"] > MOSTLY:
        lines.append("EXTRAPOLATED: what is said here is mostly the network's word beyond its samples")
    if not summary["converged"]:
        lines.append(
            f"NOT CONVERGED: R-hat {summary['largest_r_hat']:.3f} (at most {LARGEST_R_HAT:g}), effective draws "
            f"{summary['least_effective_draws']:.0f} (at least {FEWEST_EFFECTIVE}); raise posterior.steps"
        )
    return "\n".join(lines)


def _marginal(draws, low, high, effective):
    """Mean, interval, width and information of one parameter's draws (n,) in [0, 1]."""
    values = low + draws * (high - low)
    interval = _interval(values)
    return {
        "mean": float(values.mean()),
        "sd": float(values.std()),
        "median": float(np.median(values)),
        "credible_low": interval["low"],
        "credible_high": interval["high"],
        # a uniform distribution's interval has CREDIBLE of its width
        "width_ratio": (interval["high"] - interval["low"]) / (CREDIBLE * (high - low)),
        "information_bits": information_bits(draws, effective),
        "below_centre": float((draws < 0.5).mean()),
    }


def _interval(values):
    """Central credible interval."""
    tail = (1 - CREDIBLE) / 2
    ends = np.quantile(values, [tail, 1 - tail])
    return {"low": float(ends[0]), "high": float(ends[1])}


def _beside(name, draws, first, last, low, high):
    """Another interval, the posterior's probability of it, and the prior's."""
    first, last = float(first), float(last)
    values = low + draws * (high - low)
    return {
        f"{name}_low": first,
        f"{name}_high": last,
        f"{name}_probability": float(((values >= first) & (values <= last)).mean()),
        f"{name}_prior_probability": max(0.0, min(last, high) - max(first, low)) / (high - low),
    }
