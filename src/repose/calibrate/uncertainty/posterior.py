"""Infer the free parameters from the physical measurements: their posterior.

The prior of a parameter is uniform over its range, along its scale. If the parameter
was measured, its prior is a normal distribution that is cut to the range.
`repose.calibrate.uncertainty.likelihood` defines the likelihood.
`repose.calibrate.uncertainty.sampler` draws from the posterior.
"""

import contextlib
import math
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate import training as train
from repose.calibrate.determination import Determination, judge_determination
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Definitions, name_derived_column
from repose.calibrate.scales import to_coordinates
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty import discrepancy, implausibility, noise
from repose.calibrate.uncertainty.likelihood import (
    Observation,
    compute_log_likelihood,
    compute_misfit,
    make_observation,
)
from repose.calibrate.uncertainty.sampler import (
    Chains,
    Information,
    compute_information_bits,
    compute_joint_information,
    compute_split_r_hat,
    draw_chains,
)
from repose.calibrate.uncertainty.settings import PosteriorSettings
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table, write_json, write_table
from repose.common.numbers import format_significant

CREDIBLE_PROBABILITY = 0.95
# Probability on each side of a credible interval.
TAIL_PROBABILITY = (1 - CREDIBLE_PROBABILITY) / 2
# A correlation needs one run beyond the first of a sample for each response of the
# bench test, and this many more.
SPARE_DEGREES_OF_FREEDOM = 2
MAX_KEPT_DRAWS = 4000
# Convergence: Vehtari et al. 2021, Bayesian Analysis 16, 667.
MAX_R_HAT = 1.01
MIN_EFFECTIVE_DRAWS = 400
# A warning is due if more than this fraction of the draws lies where samples are sparse.
MAX_SPARSE_FRACTION = 0.5


class Posterior(NamedTuple):
    """Tables and summary of the posterior."""

    parameters: pd.DataFrame  # posterior.csv: a row for each free parameter
    draws: pd.DataFrame  # draws.csv: parameter sets, predictions, standard errors
    # posterior.json: likelihood, fit, information, convergence, statements
    summary: dict[str, Any]


class Measurement(NamedTuple):
    """The physical measurement of k targets, and its uncertainty."""

    observed: Observation  # physical means, and their covariance S_y + S_d
    correlation: np.ndarray  # (k, k), of the measured responses
    pairs: noise.PairCorrelations  # correlations of simulated runs within a bench test
    discrepancy: np.ndarray  # S_d (k, k)
    source: str  # of the discrepancy: `STATED` or `SHAPE_STUDY` of `implausibility`


class InputFiles(NamedTuple):
    """Files that `infer_from_files` reads."""

    network: StrPath  # the trained surrogate
    predictions: StrPath
    dataset: StrPath
    runs: StrPath
    feasible: StrPath  # solutions of the search
    table3: StrPath | None  # published intervals of the parameters


class Interval(NamedTuple):
    """An interval of a parameter."""

    low: float
    high: float


class Convergence(NamedTuple):
    """Convergence of the chains; the fields are columns of posterior.csv, each (d,)."""

    r_hat: np.ndarray
    effective_draws: np.ndarray
    autocorrelation_steps: np.ndarray

    @property
    def is_reached(self) -> bool:
        """Whether the chains have converged, and there are enough draws."""
        are_alike = (self.r_hat <= MAX_R_HAT).all()
        are_enough = (self.effective_draws >= MIN_EFFECTIVE_DRAWS).all()
        return bool(are_alike and are_enough)


def make_measurement(
    targets: Targets,
    runs: pd.DataFrame,
    settings: PosteriorSettings,
    shape_study_covariance: np.ndarray | None = None,
) -> Measurement:
    """Combine the targets with their correlation and the discrepancy.

    The discrepancy is the deviation between simulator and reality that no choice of the
    parameters can remove.

    Parameters
    ----------
    targets : Targets
        The targets of the study.
    runs : pandas.DataFrame
        Simulated runs, from which the correlation of the responses is estimated unless
        the settings state it.
    settings : PosteriorSettings
        The section `posterior`.
    shape_study_covariance : array (k, k), optional
        Covariance of the discrepancies from a shape study. Without it, the discrepancy
        of the settings is used.

    Returns
    -------
    Measurement

    Raises
    ------
    ValueError
        If there are too few runs for the correlation.
    """
    correlation, pairs = _find_measured_correlation(targets, runs, settings)
    if shape_study_covariance is None:
        source = implausibility.STATED
        discrepancy_covariance = discrepancy.compute_stated_covariance(
            targets,
            runs,
            percent=settings.discrepancy_percent,
            correlation=settings.discrepancy_correlation,
        )
    else:
        source = implausibility.SHAPE_STUDY
        discrepancy_covariance = shape_study_covariance
    return Measurement(
        observed=make_observation(targets, correlation, discrepancy_covariance),
        correlation=correlation,
        pairs=pairs,
        discrepancy=discrepancy_covariance,
        source=source,
    )


def _find_measured_correlation(
    targets: Targets, runs: pd.DataFrame, settings: PosteriorSettings
) -> noise.WithinCorrelation:
    """Find the correlation between the measured responses.

    The correlation is either stated in the settings or estimated from the simulated
    runs.

    Parameters
    ----------
    targets : Targets
        The targets of the study.
    runs : pandas.DataFrame
        Simulated runs.
    settings : PosteriorSettings
        Its key `measured_correlation` is a number, or a word that asks for the
        estimate.

    Returns
    -------
    WithinCorrelation
        The correlation between runs of the same parameter set, as a matrix for the
        measurement, and as estimated for each pair of simulated responses.

    Raises
    ------
    ValueError
        If the correlation is to be estimated, but the runs are too few.
    """
    stated_correlation = settings.measured_correlation
    # The word "simulated" in place of a number asks for the estimate.
    if isinstance(stated_correlation, str):
        simulated = noise.estimate_within_correlation(runs, targets)
        _check_degrees_of_freedom(targets, simulated.pairs)
        return simulated
    pairs: noise.PairCorrelations = {}
    # The estimates for pairs of responses are only reported here. They raise ValueError
    # if there are too few runs; then leave them out.
    with contextlib.suppress(ValueError):
        pairs = noise.estimate_within_correlation(runs, targets).pairs
    return noise.WithinCorrelation(targets.correlated(stated_correlation), pairs)


def _check_degrees_of_freedom(targets: Targets, pairs: noise.PairCorrelations) -> None:
    """Raise ValueError for a bench test with too few runs for the correlations.

    The estimated correlation matrix of its responses would be singular, or nearly so.
    """
    for bench_test, responses in targets.benches.items():
        minimum = len(responses) + SPARE_DEGREES_OF_FREEDOM
        names = [targets.names[k] for k in responses]
        for first, second in combinations(names, 2):
            degrees_of_freedom = pairs[f"{first}, {second}"]["degrees_of_freedom"]
            if degrees_of_freedom < minimum:
                raise ValueError(
                    f"{degrees_of_freedom} degrees of freedom within samples of "
                    f"{bench_test}; expected at least {minimum}"
                )


def infer_posterior(
    model: Predictor,
    support: Support,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    measurement: Measurement,
    settings: PosteriorSettings,
    references: Mapping[str, pd.DataFrame],
) -> Posterior:
    """Draw from the posterior, and state which parameters the data determine.

    Parameters
    ----------
    model : Predictor
        It predicts the responses of the targets.
    support : Support
        Region of the samples to which the model was fitted.
    parameters : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    measurement : Measurement
        The measurement with its uncertainty.
    settings : PosteriorSettings
        The section `posterior`.
    references : mapping
        Other intervals of the parameters by name: tables with `low` and `high`, whose
        index has the parameters.
    """
    space = parameters

    def likelihood(unit: np.ndarray) -> np.ndarray:
        means, covariances = model.moments(space.values(unit))
        return compute_log_likelihood(means, covariances, measurement.observed)

    def log_density(unit: np.ndarray) -> np.ndarray:
        return likelihood(unit) + space.log_prior(unit)

    # Draw from the posterior.
    chains = draw_chains(
        log_density,
        dimensions=space.dimensions,
        walkers=settings.walkers,
        steps=settings.steps,
        seed=settings.seed,
    )
    unit = chains.points.reshape(-1, space.dimensions)
    convergence = _compute_convergence(chains)
    log_likelihoods = chains.log_density.ravel() - space.log_prior(unit)
    information = compute_joint_information(
        likelihood,
        posterior_log_likelihoods=log_likelihoods,
        effective_draws=log_likelihoods.size / chains.density_time,
        space=space,
        seed=settings.seed,
    )

    # Describe each parameter, and predict the responses at some of the draws. Choose
    # these at random, because equally spaced draws may all belong to the same walker.
    table = _tabulate_parameters(space, unit, convergence, references)
    order = np.random.default_rng(settings.seed).permutation(len(unit))
    kept = unit[np.sort(order[:MAX_KEPT_DRAWS])]
    X = space.values(kept)
    Y, std = model.predict(X, return_std=True, noise=False)
    draws = pd.DataFrame(X, columns=list(space.names))
    for k, response in enumerate(targets.responses):
        draws[response.predicted] = Y[:, k]
        draws[name_derived_column(response.name, f"{model.name}_se")] = std[:, k]

    summary = _summarise_measurement(measurement)
    summary[f"{model.name}_se"] = np.sqrt((std**2).mean(axis=0)).tolist()
    summary["predicted"] = _summarise_predictions(targets, Y)
    summary["misfit"] = compute_misfit(Y, model.covariance(X), measurement.observed)
    summary |= _summarise_information(information, table)
    summary["thin_share"] = float(support.is_sparse(X).mean())
    summary |= _summarise_convergence(convergence)
    summary["correlations"] = np.atleast_2d(np.corrcoef(kept.T)).round(3).tolist()
    summary["statements"] = _collect_statements(space, table)
    return Posterior(table, draws, summary)


def _compute_convergence(chains: Chains) -> Convergence:
    """Compute the convergence of each parameter."""
    return Convergence(
        r_hat=compute_split_r_hat(chains.points),
        effective_draws=chains.log_density.size / chains.times,
        autocorrelation_steps=chains.times,
    )


def _summarise_measurement(measurement: Measurement) -> dict[str, Any]:
    """Collect the entries of posterior.json about the measurement."""
    # The covariance of the observation is the sum of both covariances.
    discrepancy_covariance = measurement.discrepancy
    physical_covariance = measurement.observed.covariance - discrepancy_covariance
    return {
        "correlation": noise.make_correlation_record(measurement.pairs),
        "physical_se": np.sqrt(np.diag(physical_covariance)).tolist(),
        "discrepancy_sd": np.sqrt(np.diag(discrepancy_covariance)).tolist(),
        "discrepancy_of": measurement.source,
    }


def _summarise_predictions(targets: Targets, Y: np.ndarray) -> dict[str, Any]:
    """Collect mean and interval of each predicted response from draws (n, k)."""
    summary = {}
    for name, values in zip(targets.names, Y.T, strict=True):
        interval = _find_credible_interval(values)
        summary[name] = {"mean": float(values.mean()), **interval._asdict()}
    return summary


def _summarise_information(
    information: Information, table: pd.DataFrame
) -> dict[str, Any]:
    """Collect the entries of posterior.json about the information."""
    return {
        "information_bits": information.bits,
        "information_se_bits": information.error,
        "sum_of_marginals_bits": float(sum(table["information_bits"])),
    }


def _summarise_convergence(convergence: Convergence) -> dict[str, Any]:
    """Collect the entries of posterior.json about the convergence."""
    return {
        "converged": convergence.is_reached,
        "largest_r_hat": float(convergence.r_hat.max()),
        "least_effective_draws": float(convergence.effective_draws.min()),
    }


def _collect_statements(space: ParameterSpace, table: pd.DataFrame) -> dict[str, str]:
    """Collect a statement about each parameter, the fixed ones included."""
    statements = dict(zip(table["parameter"], table["statement"], strict=True))
    for name, value in space.fixed.items():
        statements[name] = f"{name} is fixed at {format_significant(value)}"
    return statements


def reject_all_fixed(space: ParameterSpace) -> None:
    """Raise InputError for parameters that are all fixed."""
    if space.dimensions == 0:
        raise InputError(
            source="configuration",
            key="parameters",
            value="all fixed",
            allowed="at least one range or prior",
        )


def infer_from_files(
    files: InputFiles,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    definitions: Definitions,
    settings: PosteriorSettings,
    out_dir: StrPath,
    source: object = "configuration",
) -> dict[str, Any]:
    """Infer the parameters of a study from its files.

    Write the posterior (posterior.csv, draws.csv, posterior.json), its information by
    size of the discrepancy (discrepancy.csv), and the plausible region (region.csv).

    Parameters
    ----------
    files : InputFiles
        The files to read.
    parameters : ParameterSpace
        The parameters of the study.
    targets : Targets
        The responses that the surrogate must have.
    definitions : mapping
        Their definitions, which must be those of the surrogate.
    settings : PosteriorSettings
        The section `posterior`.
    out_dir : path
        Folder for these files.
    source : object, optional
        Name of the configuration, for an error about definitions.

    Returns
    -------
    dict
        The content of posterior.json.

    Raises
    ------
    InputError
        If no parameter is free, if a file is invalid, or if there are too few runs.
    """
    reject_all_fixed(parameters)
    model = train.restore_surrogate(files.network, files.predictions, files.dataset)
    train.reject_other_targets(model, files.network, targets, definitions, source)
    support = Support.from_dataset(files.dataset, parameters)
    references = _read_references(files, parameters)
    runs = noise.read_runs(files.runs, targets)
    shape_study = None
    if settings.shape_study is not None:
        shape_study = discrepancy.estimate_from_shape_study(
            settings.shape_study, targets
        )
    try:
        measurement = make_measurement(
            targets,
            runs,
            settings,
            None if shape_study is None else shape_study.covariance,
        )
        result = infer_posterior(
            model,
            support,
            parameters=parameters,
            targets=targets,
            measurement=measurement,
            settings=settings,
            references=references,
        )
    except ValueError as error:
        raise InputError(
            source=files.runs,
            key="runs",
            value=str(error),
            allowed="enough runs per sample for the correlation of the responses",
        ) from None

    out = Path(out_dir)
    points = implausibility.PriorPoints(model, parameters)
    curve = _compute_information_curve(points, targets, runs, measurement)
    region = implausibility.find_region(
        points, implausibility.compute_implausibility(points, *measurement.observed)
    )
    summary = result.summary
    summary["not_implausible_share"] = region.fraction
    summary["over_the_discrepancy"] = implausibility.describe_curve(
        curve, region.fraction
    )
    if shape_study is not None:
        summary["discrepancy_models"] = shape_study.models
        summary["discrepancy_mean"] = shape_study.mean.tolist()
    write_table(out / "discrepancy.csv", curve, float_format="%.6g")
    write_table(out / "region.csv", region.projections, float_format="%.6g")
    write_table(out / "posterior.csv", result.parameters)
    write_table(out / "draws.csv", result.draws)
    write_json(out / "posterior.json", summary)
    return summary


def _read_references(
    files: InputFiles, space: ParameterSpace
) -> dict[str, pd.DataFrame]:
    """Read intervals of the parameters from other sources, to compare them.

    `infer_posterior` computes how probable they are according to the posterior.

    Parameters
    ----------
    files : InputFiles
        The files to read.
    space : ParameterSpace
        The parameters of the study.

    Returns
    -------
    dict
        Tables with the columns `low` and `high`, and a row for each parameter. The key
        "miga", the name of the search's genetic algorithm, has the ranges of the
        solutions that the search found. The key "published" has the published intervals
        (Table 3 of the paper), and is missing if there is no file for them.
    """
    references = {}
    if files.table3 is not None:
        table = read_table(files.table3, ("parameter", "low", "high"))
        references["published"] = table.set_index("parameter")
    feasible = read_table(files.feasible, space.names)[list(space.names)]
    ranges = feasible.agg(["min", "max"]).T
    references["miga"] = ranges.set_axis(["low", "high"], axis=1)
    return references


def _compute_information_curve(
    points: implausibility.PriorPoints,
    targets: Targets,
    runs: pd.DataFrame,
    measurement: Measurement,
) -> pd.DataFrame:
    """Compute how the information about the parameters depends on the discrepancy.

    A larger discrepancy between simulator and reality leaves less information.

    Parameters
    ----------
    points : PriorPoints
        Points of the prior, with the predictions there.
    targets : Targets
        The targets of the study.
    runs : pandas.DataFrame
        Simulated runs of the design. They show whether two responses rise together,
        which gives the sign of the correlation between their discrepancies.
    measurement : Measurement
        The measurement with its uncertainty.

    Returns
    -------
    pandas.DataFrame
        Result of `implausibility.compute_information_curve`.
    """

    def observe_with(percent: float, correlation: float) -> Observation:
        """Combine the measurement with a discrepancy of this size and correlation."""
        stated_covariance = discrepancy.compute_stated_covariance(
            targets, runs, percent, correlation
        )
        return make_observation(targets, measurement.correlation, stated_covariance)

    observed_with_shape_study = None
    if measurement.source == implausibility.SHAPE_STUDY:
        observed_with_shape_study = measurement.observed
    return implausibility.compute_information_curve(
        points, targets, observe_with, observed_with_shape_study
    )


def state_determination(row: Mapping[str, Any]) -> str:
    """Make a sentence about how well the data determine a parameter.

    The criteria are the information about the parameter, and the width of its credible
    interval compared with the interval of its prior.

    Parameters
    ----------
    row : mapping
        The columns of posterior.csv for the parameter, without the statement.

    Returns
    -------
    str
        The sentence, without a full stop at its end.
    """
    name = row["parameter"]
    bits = row["information_bits"]
    low = format_significant(row["credible_low"], 3)
    high = format_significant(row["credible_high"], 3)
    interval = f"{low} to {high}"
    width = f"{100 * row['width_ratio']:.0f} % of the prior's width, {bits:.2f} bits"
    determination = judge_determination(row["width_ratio"], bits)
    # With little information, only state in which half of the prior the parameter lies.
    if determination is Determination.WEAK:
        low_half_probability = row["below_centre"]
        high_half_probability = 1 - low_half_probability
        half = "high" if high_half_probability >= low_half_probability else "low"
        return (
            f"{name} is {determination}, in the {half} half with probability "
            f"{max(high_half_probability, low_half_probability):.2f}: {width}"
        )
    if determination is Determination.SEVERAL:
        return f"{name} lies {determination} within {interval}: {width}"
    if determination is Determination.DETERMINED:
        return f"{name} is {determination}, {interval}: {width}"
    return f"{name} is {determination}: {width}"


def describe_posterior(summary: Mapping[str, Any]) -> str:
    """Describe the posterior in lines of text, which the command line prints.

    The lines are the statements about the parameters, the information about all
    parameters together, the misfit, and warnings about extrapolation and convergence.

    Parameters
    ----------
    summary : mapping
        The content of posterior.json. Its text `over_the_discrepancy` is the result of
        `implausibility.describe_curve`.

    Returns
    -------
    str
        The lines, joined.
    """
    lines = list(summary["statements"].values())
    bits = summary["information_bits"]
    error = summary["information_se_bits"]
    distance = math.sqrt(summary["misfit"]["squared_distance"])
    p_value = summary["misfit"]["p_value"]
    lines.append(
        f"information about all parameters together: {bits:.2f} ± {error:.2f} bits; "
        f"the best draw misses the targets by {distance:.2f} standard deviations "
        f"(p = {format_significant(p_value, 2)}); "
        f"{100 * summary['thin_share']:.0f} % of the draws lie where samples are sparse"
    )
    lines += summary.get("over_the_discrepancy", "").splitlines()
    if summary["thin_share"] > MAX_SPARSE_FRACTION:
        lines.append(
            "EXTRAPOLATED: most draws lie beyond the samples, "
            "where the surrogate is only a guess"
        )
    if not summary["converged"]:
        lines.append(
            f"NOT CONVERGED: R-hat {summary['largest_r_hat']:.3f} "
            f"(at most {MAX_R_HAT:g}), "
            f"effective draws {summary['least_effective_draws']:.0f} "
            f"(at least {MIN_EFFECTIVE_DRAWS}); raise posterior.steps"
        )
    return "\n".join(lines)


def _tabulate_parameters(
    space: ParameterSpace,
    unit: np.ndarray,
    convergence: Convergence,
    references: Mapping[str, pd.DataFrame],
) -> pd.DataFrame:
    """Make the table of the free parameters, which is written to posterior.csv.

    Parameters
    ----------
    space : ParameterSpace
        The parameters of the study.
    unit : array (n, d)
        Draws from the posterior, as points of the unit cube over the ranges.
    convergence : Convergence
        Convergence of the chains.
    references : mapping
        See `infer_posterior`. A table may lack parameters of this study, because
        published tables only have the six parameters of the paper.

    Returns
    -------
    pandas.DataFrame
        A row for each free parameter: its range, its posterior distribution, the
        information, the convergence, the references, and a statement.
    """
    prior_quantiles = space.marginal_cdf(unit)
    prior_widths = _compute_prior_widths(space)
    rows = []
    for k, name in enumerate(space.free):
        values = space.values_at(name, unit[:, k])
        row = {
            "parameter": name,
            "low": space.low[k],
            "high": space.high[k],
            **_describe_distribution(values, space, name, prior_widths[k]),
            "information_bits": compute_information_bits(
                prior_quantiles[:, k], convergence.effective_draws[k]
            ),
            "below_centre": float((prior_quantiles[:, k] < 0.5).mean()),
        }
        # The names of the fields of `Convergence` are columns of the table.
        for column, numbers in convergence._asdict().items():
            row[column] = numbers[k]
        for reference, intervals in references.items():
            if name in intervals.index:
                low, high = map(float, intervals.loc[name, ["low", "high"]])
                row |= _assess_reference(
                    reference, space, name, values, Interval(low, high)
                )
        # The statement uses the other columns, so make it last.
        row["statement"] = state_determination(row)
        rows.append(row)
    return pd.DataFrame(rows)


def _describe_distribution(
    values: np.ndarray, space: ParameterSpace, name: str, prior_width: float
) -> dict[str, float]:
    """Describe the posterior distribution of a parameter.

    Parameters
    ----------
    values : array (n,)
        Draws of the parameter.
    space : ParameterSpace
        The parameters of the study.
    name : str
        Name of the parameter.
    prior_width : float
        Width of the central interval of its prior, along its scale.

    Returns
    -------
    dict
        Columns of posterior.csv.
    """
    interval = _find_credible_interval(values)
    low, high = space.coordinates(name, np.array(interval)).tolist()
    return {
        "mean": float(values.mean()),
        "sd": float(values.std()),
        "median": float(np.median(values)),
        "credible_low": interval.low,
        "credible_high": interval.high,
        "width_ratio": (high - low) / prior_width,
    }


def _compute_prior_widths(space: ParameterSpace) -> np.ndarray:
    """Compute the width of the central interval of each parameter's prior.

    The interval has the probability `CREDIBLE_PROBABILITY`, as those of the posterior.

    A width is measured along the scale of the parameter. On a logarithmic scale, it is
    the difference between the logarithms of both ends.

    Parameters
    ----------
    space : ParameterSpace
        The parameters of the study.

    Returns
    -------
    array (d,)
        The width for each free parameter.
    """
    end_probabilities = np.array([TAIL_PROBABILITY, 1 - TAIL_PROBABILITY])
    # Constraints exclude some parameter sets, and so change the distribution of each
    # parameter. Then the ends are quantiles of the parameter sets that are allowed.
    if space.constraints:
        values = space.marginal_quantiles(end_probabilities)  # (2, d)
        lows, highs = to_coordinates(values, space.free, space.scale)
        return highs - lows

    # Convert the probabilities of both ends to points of the unit cube, (2, d).
    quantiles = np.repeat(end_probabilities[:, None], space.dimensions, axis=1)
    unit = space.transform_to_prior(quantiles)
    range_lows, range_highs = space.coordinate_bounds
    widths = []
    for k, name in enumerate(space.free):
        if name in space.prior:
            values = space.values_at(name, unit[:, k])
            low, high = space.coordinates(name, values)
            widths.append(high - low)
        else:
            # The parameter is uniform along its scale, so the interval is this part of
            # the range.
            widths.append(CREDIBLE_PROBABILITY * (range_highs[k] - range_lows[k]))
    return np.array(widths)


def _find_credible_interval(values: np.ndarray) -> Interval:
    """Find the central interval of draws (n,) with probability `CREDIBLE_PROBABILITY`."""
    low, high = np.quantile(values, [TAIL_PROBABILITY, 1 - TAIL_PROBABILITY]).tolist()
    return Interval(low, high)


def _assess_reference(
    reference: str,
    space: ParameterSpace,
    parameter: str,
    values: np.ndarray,
    interval: Interval,
) -> dict[str, float]:
    """Compute how probably a parameter lies in a reference interval.

    Parameters
    ----------
    reference : str
        Name of the reference, with which the names of the columns begin.
    space : ParameterSpace
        The parameters of the study.
    parameter : str
        Name of a free parameter.
    values : array (n,)
        Draws of the parameter from the posterior.
    interval : Interval
        The reference interval.

    Returns
    -------
    dict
        The ends of the interval, its probability according to the draws, and its
        probability according to the prior.
    """
    is_inside = (values >= interval.low) & (values <= interval.high)
    return {
        f"{reference}_low": interval.low,
        f"{reference}_high": interval.high,
        f"{reference}_probability": float(is_inside.mean()),
        f"{reference}_prior_probability": _compute_prior_probability(
            space, parameter, interval
        ),
    }


def _compute_prior_probability(
    space: ParameterSpace, parameter: str, interval: Interval
) -> float:
    """Compute the prior probability that a free parameter lies in an interval.

    Constraints are not taken into account.
    """
    # A parameter has no probability outside its range, so clip the interval to it.
    k = space.free.index(parameter)
    clipped = np.clip(interval, space.low[k], space.high[k])
    if parameter in space.prior:
        # `prior_cdf` takes points with all parameters, but treats each separately. So
        # the other parameters may have any number.
        ends = np.zeros((2, space.dimensions))
        ends[:, k] = space.fractions_of_range(parameter, clipped)
        cumulative_at_ends = space.prior_cdf(ends)[:, k]
        return float(np.diff(cumulative_at_ends)[0])
    # Without a measured prior, the parameter is uniform along its scale.
    range_lows, range_highs = space.coordinate_bounds
    low, high = space.coordinates(parameter, clipped).tolist()
    return (high - low) / float(range_highs[k] - range_lows[k])
