"""Posterior of the free parameters given the physical measurements.

The prior is uniform on the range of each parameter, or normal and cut to the range where the parameter was measured.
The likelihood is defined in `repose.calibrate.uncertainty.likelihood`; `repose.calibrate.uncertainty.sampler` draws from the posterior.
"""

import contextlib
import functools
import math
from collections.abc import Callable, Mapping
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate import training as train
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import derived
from repose.calibrate.strategies.base import Studied
from repose.calibrate.surrogates.base import Predictor, Surrogate
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty import discrepancy, implausibility, noise
from repose.calibrate.uncertainty.likelihood import (
    Observed,
    log_likelihood,
    misfit,
    observation,
)
from repose.calibrate.uncertainty.sampler import (
    information_bits,
    joint_information_bits,
    sample,
    split_r_hat,
)
from repose.calibrate.uncertainty.settings import PosteriorSettings
from repose.common.errors import InputError, require
from repose.common.files import Path_, read_table, write_json, write_table

CREDIBLE = 0.95
FREEDOM = 2  # runs beyond the first of a sample that a correlation needs, besides one for each response of a bench test
DRAWS_KEPT = 4000
LARGEST_R_HAT, FEWEST_EFFECTIVE = (
    1.01,
    400,
)  # Vehtari et al. 2021, Bayesian Analysis 16, 667
# Kullback-Leibler information, in bits: half the range is worth 1 bit.
DETERMINED, UNDETERMINED = 1.0, 0.2
WIDE = 0.75  # of the prior's width: a parameter of so wide an interval is not determined, whatever its bits
MOSTLY = 0.5
Observing = Callable[[np.ndarray], Observed]
Pairs = dict[str, dict[str, float]]


class Posterior(NamedTuple):
    """Tables and summary of the posterior."""

    parameters: pd.DataFrame  # posterior.csv: a row for each free parameter
    draws: pd.DataFrame  # draws.csv: parameter sets, predictions, their standard errors
    summary: dict[
        str, Any
    ]  # posterior.json: likelihood, fit, information, convergence, statements


def infer(
    model: Predictor,
    support: Support,
    runs: pd.DataFrame,
    study: Studied,
    settings: PosteriorSettings,
    references: Mapping[str, pd.DataFrame],
    shapes: np.ndarray | None = None,
) -> Posterior:
    """Sample the posterior and state which parameters it determines.

    `runs` give the correlation of the responses, `references` other intervals by name: tables with low and high.
    `shapes` (k, k) is the covariance of the discrepancies by a shape study; None means stated values.
    """
    space, targets, seed = study.parameters, study.targets, settings.seed
    observed, pairs = _observed(runs, targets, settings)
    stated = settings.discrepancy_percent, settings.discrepancy_correlation
    unknown = (
        discrepancy.of_targets(targets, runs, *stated) if shapes is None else shapes
    )
    measured = observed(unknown)

    def likelihood(unit: np.ndarray) -> np.ndarray:
        X = space.values(unit)
        return log_likelihood(model.predict(X), model.covariance(X), measured)

    def log_density(unit: np.ndarray) -> np.ndarray:
        return likelihood(unit) + space.log_prior(unit)

    chains = sample(
        log_density, space.dimensions, settings.walkers, settings.steps, seed
    )
    r_hat, effective = (
        split_r_hat(chains.points),
        chains.log_density.size / chains.times,
    )
    unit = chains.points.reshape(-1, space.dimensions)
    # at random: draws at a regular distance in time may all be of one walker
    kept = unit[
        np.sort(np.random.default_rng(seed).permutation(len(unit))[:DRAWS_KEPT])
    ]
    drawn = chains.log_density.ravel() - space.log_prior(unit)
    bits, error = joint_information_bits(
        likelihood, drawn, drawn.size / chains.density_time, space, seed
    )
    about = {
        "r_hat": r_hat,
        "effective_draws": effective,
        "autocorrelation_steps": chains.times,
    }
    table = _parameters(space, unit, about, references)

    X = space.values(kept)
    Y, std = model.predict(X, return_std=True, noise=False)
    draws = pd.DataFrame(X, columns=list(space.names))
    for k, response in enumerate(targets.responses):
        draws[response.predicted] = Y[:, k]
        draws[derived(response.name, f"{model.name}_se")] = std[:, k]
    summary = {
        "correlation": noise.correlation_record(pairs),
        "physical_se": np.sqrt(np.diag(measured[1] - unknown)).tolist(),
        "discrepancy_sd": np.sqrt(np.diag(unknown)).tolist(),
        "discrepancy_of": "stated" if shapes is None else "shape study",
        f"{model.name}_se": np.sqrt((std**2).mean(axis=0)).tolist(),
        "predicted": {
            name: {"mean": float(values.mean()), **_interval(values)}
            for name, values in zip(targets.names, Y.T, strict=True)
        },
        "misfit": misfit(Y, model.covariance(X), measured),
        "information_bits": bits,
        "information_se_bits": error,
        "sum_of_marginals_bits": float(sum(table["information_bits"])),
        "thin_share": float(support.is_thin(X).mean()),
        "converged": bool(
            (r_hat <= LARGEST_R_HAT).all() and (effective >= FEWEST_EFFECTIVE).all()
        ),
        "largest_r_hat": float(r_hat.max()),
        "least_effective_draws": float(effective.min()),
        "correlations": np.atleast_2d(np.corrcoef(kept.T)).round(3).tolist(),
        "statements": dict(zip(table["parameter"], table["statement"], strict=True))
        | {
            name: f"{name} is fixed at {value:g}" for name, value in space.fixed.items()
        },
    }
    return Posterior(table, draws, summary)


def require_free(space: ParameterSpace) -> None:
    """Refuse parameters that are all fixed."""
    require(
        space.dimensions,
        "configuration",
        "parameters",
        "all fixed",
        "at least one range or prior",
    )


def run(
    files: Mapping[str, Any],
    study: Studied,
    out_dir: Path_,
    source: object = "configuration",
) -> dict[str, Any]:
    """Read the inputs of `infer`; write the posterior, its curve over the discrepancy, and the region not excluded."""
    space, targets, settings = study.parameters, study.targets, study.settings.posterior
    require_free(space)
    model = train.restore(files["network"], files["predictions"], files["dataset"])
    train.require_targets(model, files["network"], targets, study.definitions, source)
    support = Support.of_dataset(files["dataset"], space)
    feasible = read_table(files["feasible"], space.names)[list(space.names)]
    runs = noise.read_runs(files["runs"], targets)
    references = {}
    if files["table3"] is not None:
        references["published"] = read_table(
            files["table3"], ("parameter", "low", "high")
        ).set_index("parameter")
    references["miga"] = feasible.agg(["min", "max"]).T.set_axis(
        ["low", "high"], axis=1
    )
    models = (
        None
        if settings.shape_study is None
        else discrepancy.of_shape_study(settings.shape_study, targets)
    )
    shapes = None if models is None else models.covariance
    try:
        result = infer(model, support, runs, study, settings, references, shapes)
    except ValueError as error:
        allowed = "enough runs a sample for the correlation of the responses"
        raise InputError(files["runs"], "runs", str(error), allowed) from None
    out = Path(out_dir)
    result.summary.update(_further_studies(model, study, runs, shapes, out))
    if models is not None:
        result.summary.update(
            discrepancy_models=models.models, discrepancy_mean=models.mean.tolist()
        )
    write_table(out / "posterior.csv", result.parameters)
    write_table(out / "draws.csv", result.draws)
    write_json(out / "posterior.json", result.summary)
    return result.summary


def _observed(
    runs: pd.DataFrame, targets: Targets, settings: PosteriorSettings
) -> tuple[Observing, Pairs]:
    """Return a function from S_d to the physical means and their covariance, and the pairs of correlations."""
    pairs: Pairs = {}
    stated = settings.measured_correlation
    if isinstance(stated, str):
        correlation, pairs = noise.within_correlation(runs, targets)
        _check_freedom(targets, pairs)
    else:
        correlation = targets.correlated(stated)
        with contextlib.suppress(ValueError):  # a stated correlation needs no runs
            pairs = noise.within_correlation(runs, targets)[1]
    return functools.partial(observation, targets, correlation), pairs


def _check_freedom(targets: Targets, pairs: Pairs) -> None:
    """Raise ValueError for a bench test with fewer repeated runs than a correlation of its responses needs.

    The matrix would be singular, or nearly so.
    """
    for bench, names in targets.benches.items():
        for pair in combinations([targets.names[k] for k in names], 2):
            freedom, least = (
                pairs[", ".join(pair)]["degrees_of_freedom"],
                len(names) + FREEDOM,
            )
            if freedom < least:
                raise ValueError(
                    f"{freedom} degrees of freedom within samples of {bench}; expected at least {least}"
                )


def _further_studies(
    model: Surrogate,
    study: Studied,
    runs: pd.DataFrame,
    shapes: np.ndarray | None,
    out: Path,
) -> dict[str, Any]:
    """Write discrepancy.csv and region.csv; return their entries of the summary."""
    targets, settings = study.targets, study.settings.posterior
    observed, _ = _observed(runs, targets, settings)
    points = implausibility.Points(model, study.parameters)

    def stated(percent: float, between: float) -> Observed:
        return observed(discrepancy.of_targets(targets, runs, percent, between))

    of_shapes = None if shapes is None else observed(shapes)
    table = implausibility.curve(points, targets, stated, of_shapes)
    chosen = of_shapes or stated(
        settings.discrepancy_percent, settings.discrepancy_correlation
    )
    share, projections = implausibility.region(
        points, implausibility.implausibility(points, *chosen)
    )
    write_table(out / "discrepancy.csv", table, float_format="%.6g")
    write_table(out / "region.csv", projections, float_format="%.6g")
    return {
        "not_implausible_share": share,
        "over_the_discrepancy": implausibility.message(table, share),
    }


def statement(row: Mapping[str, Any]) -> str:
    """Say in a sentence how well one parameter is determined, from its row of posterior.csv."""
    bits, name = row["information_bits"], row["parameter"]
    where = f"{row['credible_low']:.3g} to {row['credible_high']:.3g}"
    share = f"{100 * row['width_ratio']:.0f} % of the prior's width, {bits:.2f} bits"
    if bits < UNDETERMINED:
        return f"{name} is not determined: {share}"
    if bits < DETERMINED:
        end, sure = max(
            ("high", 1 - row["below_centre"]),
            ("low", row["below_centre"]),
            key=lambda one: one[1],
        )
        return f"{name} is weakly determined, in the {end} half with probability {sure:.2f}: {share}"
    if row["width_ratio"] > WIDE:
        return f"{name} lies in one of several places within {where}: {share}"
    return f"{name} is determined, {where}: {share}"


def message(summary: Mapping[str, Any]) -> str:
    """Write statements, fit and convergence as text."""
    lines, fit = list(summary["statements"].values()), summary["misfit"]
    bits, error = summary["information_bits"], summary["information_se_bits"]
    misses = f"the best draw misses the targets by {math.sqrt(fit['squared_distance']):.2f} standard deviations"
    thin = (
        f"{100 * summary['thin_share']:.0f} % of the draws lie where samples are thin"
    )
    lines.append(
        f"together {bits:.2f} ± {error:.2f} bits; {misses} (p = {fit['p_value']:.2g}); {thin}"
    )
    lines += summary.get("over_the_discrepancy", "").splitlines()
    if summary["thin_share"] > MOSTLY:
        lines.append(
            "EXTRAPOLATED: most draws lie beyond the samples, where the surrogate is only a guess"
        )
    if not summary["converged"]:
        apart = f"R-hat {summary['largest_r_hat']:.3f} (at most {LARGEST_R_HAT:g})"
        few = f"effective draws {summary['least_effective_draws']:.0f} (at least {FEWEST_EFFECTIVE})"
        lines.append(f"NOT CONVERGED: {apart}, {few}; raise posterior.steps")
    return "\n".join(lines)


def _parameters(
    space: ParameterSpace,
    unit: np.ndarray,
    chains: Mapping[str, np.ndarray],
    references: Mapping[str, pd.DataFrame],
) -> pd.DataFrame:
    """Make the rows of posterior.csv, a row for each free parameter, from draws (n, d) in the unit cube.

    `chains` has the columns (d,) about the convergence.
    """
    shares, widths = space.prior_cdf(unit), _prior_interval(space)
    rows = []
    for k, name in enumerate(space.free):
        values = space.low[k] + unit[:, k] * (space.high[k] - space.low[k])
        interval = _interval(values)
        row = {"parameter": name, "low": space.low[k], "high": space.high[k]}
        row |= {
            "mean": float(values.mean()),
            "sd": float(values.std()),
            "median": float(np.median(values)),
        }
        row |= {f"credible_{end}": number for end, number in interval.items()}
        row["width_ratio"] = (interval["high"] - interval["low"]) / widths[k]
        row["information_bits"] = information_bits(
            shares[:, k], chains["effective_draws"][k]
        )
        row["below_centre"] = float((shares[:, k] < 0.5).mean())
        row |= {column: numbers[k] for column, numbers in chains.items()}
        for other, intervals in references.items():
            if (
                name in intervals.index
            ):  # published tables have the six parameters alone
                row |= _reference(
                    other,
                    space,
                    k,
                    values,
                    *map(float, intervals.loc[name, ["low", "high"]]),
                )
        rows.append(row | {"statement": statement(row)})
    return pd.DataFrame(rows)


def _prior_interval(space: ParameterSpace) -> np.ndarray:
    """Find the widths (d,) of the priors' central intervals of probability CREDIBLE."""
    width = CREDIBLE * (space.high - space.low)
    tail = np.full(space.dimensions, (1 - CREDIBLE) / 2)
    low, high = space.values(space.from_prior(np.array([tail, 1 - tail])))
    for name in space.prior:
        width[space.free.index(name)] = (
            high[space.names.index(name)] - low[space.names.index(name)]
        )
    return width


def _interval(values: np.ndarray) -> dict[str, float]:
    """Find the central credible interval."""
    tail = (1 - CREDIBLE) / 2
    return dict(
        zip(
            ("low", "high"), np.quantile(values, [tail, 1 - tail]).tolist(), strict=True
        )
    )


def _reference(
    other: str,
    space: ParameterSpace,
    k: int,
    values: np.ndarray,
    first: float,
    last: float,
) -> dict[str, float]:
    """Give a reference interval of free parameter k its probability by draws of the posterior and by the prior."""
    low, high = space.low[k], space.high[k]
    prior = max(0.0, min(last, high) - max(first, low)) / (high - low)
    if space.free[k] in space.prior:
        ends = np.zeros((2, space.dimensions))
        ends[:, k] = (np.clip([first, last], low, high) - low) / (high - low)
        prior = float(np.diff(space.prior_cdf(ends)[:, k])[0])
    own = float(((values >= first) & (values <= last)).mean())
    names = ("low", "high", "probability", "prior_probability")
    return {
        f"{other}_{name}": value
        for name, value in zip(names, (first, last, own, prior), strict=True)
    }
