"""Compute the effects of the parameters on the responses, with the surrogate.

The effects are Sobol indices and main effects. The indices are estimated as by Saltelli
et al. 2010 (Computer Physics Communications 181, 259) on a Sobol sequence, with the
function scipy.stats.sobol_indices. The free parameters are independent and uniform over
their ranges, along their scales. Priors are ignored.

Constraints make the parameters depend on each other, so the variance cannot be divided
in this way. With constraints, the parameters are uniform over the allowed part of the
ranges, and two fractions of the variance take the place of the indices. `explained`,
Var(E[y | x]) / Var(y), is what one parameter x alone explains. `remaining`, E[Var(y |
others)] / Var(y), is what remains once all other parameters are known. Without
constraints, the two fractions are the first-order and the total index. The source is
Kucherenko, Klymenko and Shah, Sobol' indices for problems defined in non-rectangular
domains, Reliability Engineering and System Safety 167 (2017) 218-231.

The intervals account for the error of the sampling, which is estimated by bootstrap
over the rows of the sequence. They do not account for the error of the surrogate
itself.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Definitions
from repose.calibrate.surrogates import Surrogate, load
from repose.calibrate.targets import Targets
from repose.calibrate.training import reject_other_targets
from repose.calibrate.uncertainty.posterior import reject_all_fixed
from repose.calibrate.uncertainty.settings import SensitivitySettings
from repose.common.errors import InputError
from repose.common.files import StrPath, write_table

INDICES_FILE = "sobol.csv"
EFFECTS_FILE = "main_effects.csv"
CONFIDENCE = 0.95
# Probability on each side of an interval.
TAIL_PROBABILITY = (1 - CONFIDENCE) / 2
N_EFFECT_POINTS = 41
N_EFFECT_DRAWS = 2048
# An output that varies by no more than this fraction of its size counts as constant.
ROUNDING_FRACTION = 1e-12
# Values of a parameter at which each draw of the others is evaluated, with constraints.
N_LINE_POINTS = 32
# A mean at a value of a parameter needs at least this many of the `N_EFFECT_DRAWS`.
MIN_DRAWS = 20
RESAMPLES_PER_BLOCK = 100

ArrayFunction = Callable[[np.ndarray], np.ndarray]
# Marks the allowed points (n, d) of the unit cube.
MaskFunction = Callable[[np.ndarray], np.ndarray]


class Sensitivity(NamedTuple):
    """Tables of the effects of the parameters."""

    indices: pd.DataFrame  # sobol.csv: a row for each response and parameter
    effects: pd.DataFrame  # main_effects.csv: a row for each parameter and value


def compute_sobol_indices(
    function: ArrayFunction,
    low: np.ndarray,
    high: np.ndarray,
    samples: int,
    resamples: int,
    seed: int,
) -> dict[str, np.ndarray]:
    """Compute first-order and total Sobol indices with intervals.

    Parameters
    ----------
    function : callable
        It maps points (n, d) to outputs (n,) or (n, outputs).
    low, high : array (d,)
        Ranges of the inputs.
    samples : int
        Number of rows of the Sobol sequence, a power of two.
    resamples : int
        Number of bootstrap samples, from which the intervals follow.
    seed : int
        Seed of the sequence and of the bootstrap.

    Returns
    -------
    dict
        `first`, `first_low`, `first_high`, `total`, `total_low` and `total_high`, each
        (outputs, d).

    Raises
    ------
    ValueError
        If an output does not vary.
    """
    # A and B (samples, d) are independent points of the unit cube. AB[i] is a copy of A
    # whose column i is that of B. Thus f_A and f_AB[i] differ only by the effect of
    # input i.
    d = len(low)
    sequence = stats.qmc.Sobol(2 * d, rng=seed)
    A, B = np.split(sequence.random(samples), 2, axis=1)
    AB = np.repeat(A[None], d, axis=0)
    for i in range(d):
        AB[i, :, i] = B[:, i]
    f_A = _evaluate_at(function, A, low, high)
    f_B = _evaluate_at(function, B, low, high)
    f_AB = np.array([_evaluate_at(function, points, low, high) for points in AB])
    _require_variation(f_A)

    def compute_indices(rows: np.ndarray | slice) -> np.ndarray:
        """Compute first-order and total indices (2, outputs, d) from some samples.

        `rows` selects as many samples as there are, possibly some of them repeatedly.
        """
        # Pass copies, because SciPy subtracts the means of its arguments in place.
        values = {
            "f_A": f_A[:, rows].copy(),
            "f_B": f_B[:, rows].copy(),
            "f_AB": f_AB[:, :, rows].copy(),
        }
        result = stats.sobol_indices(func=values, n=samples)
        return np.reshape([result.first_order, result.total_order], (2, -1, d))

    # Estimate the intervals by bootstrap, from samples drawn with replacement.
    rng = np.random.default_rng(seed)
    replicates = [
        compute_indices(rng.integers(samples, size=samples)) for _ in range(resamples)
    ]
    estimates = compute_indices(slice(None))
    return _add_intervals(("first", "total"), estimates, np.array(replicates))


def compute_allowed_fractions(
    function: ArrayFunction,
    low: np.ndarray,
    high: np.ndarray,
    *,
    is_allowed: MaskFunction,
    samples: int,
    resamples: int,
    seed: int,
) -> dict[str, np.ndarray]:
    """Compute which fractions of the variance a parameter explains and leaves.

    The constraints of a study allow only a part of the ranges, and make the parameters
    depend on each other. The docstring of the module defines the two fractions, which
    take the place of the first-order and the total Sobol index.

    For each parameter x, draws of the other parameters are combined with
    `N_LINE_POINTS` values of x, so the points of a draw form a line. The points that
    are allowed are uniformly distributed over the allowed part of the ranges. The means
    of their outputs at each value of x give Var(E[y | x]), and the variances along each
    line give E[Var(y | others)].

    Parameters
    ----------
    function, low, high, resamples, seed
        See `compute_sobol_indices`.
    is_allowed : callable
        Marks the allowed points (n, d) of the unit cube.
    samples : int
        Number of draws for each parameter, a power of two.

    Returns
    -------
    dict
        `explained`, `explained_low`, `explained_high`, `remaining`, `remaining_low` and
        `remaining_high`, each (outputs, d).

    Raises
    ------
    ValueError
        If an output does not vary.
    """
    d = len(low)
    draws = stats.qmc.Sobol(d, rng=seed).random(samples)
    values = (np.arange(N_LINE_POINTS) + 0.5) / N_LINE_POINTS
    fractions = []  # an array (outputs, 2, 1 + resamples) for each parameter
    for k in range(d):
        outputs = _evaluate_along_lines(
            function, draws, k, values=values, ends=(low, high), is_allowed=is_allowed
        )
        # The outputs are NaN at points that are not allowed, all at the same points.
        is_evaluated = ~np.isnan(outputs[0])
        _require_variation(outputs[:, is_evaluated])
        blocks = []
        for counts in _draw_bootstrap_counts(samples, resamples, seed):
            blocks.append([_compute_fractions(output, counts) for output in outputs])
        fractions.append(np.concatenate(blocks, axis=2))
    # Reverse the axes from (d, outputs, 2, 1 + resamples), so that the resamples come
    # first. The first of them has each draw once, and gives the estimates.
    estimates, *replicates = np.transpose(fractions, (3, 2, 1, 0))
    return _add_intervals(("explained", "remaining"), estimates, np.array(replicates))


def _draw_bootstrap_counts(
    samples: int, resamples: int, seed: int
) -> Iterator[np.ndarray]:
    """Yield how often each draw counts, in blocks (n, samples) that fit in memory.

    The first block has a single row, in which each draw counts once. In each row of the
    other blocks, a draw counts as often as the bootstrap drew it.
    """
    yield np.ones((1, samples))
    rng = np.random.default_rng(seed)
    equal = np.full(samples, 1 / samples)
    for first in range(0, resamples, RESAMPLES_PER_BLOCK):
        n_rows = min(RESAMPLES_PER_BLOCK, resamples - first)
        yield rng.multinomial(samples, equal, size=n_rows).astype(float)


def _evaluate_along_lines(
    function: ArrayFunction,
    draws: np.ndarray,
    k: int,
    *,
    values: np.ndarray,
    ends: tuple[np.ndarray, np.ndarray],
    is_allowed: MaskFunction | None,
) -> np.ndarray:
    """Evaluate a function at each draw, combined with each of several values of an input.

    Parameters
    ----------
    function : callable
        It maps points (n, d) to outputs (n,) or (n, outputs).
    draws : array (n, d)
        Points of the unit cube.
    k : int
        Number of the input that is changed.
    values : array (values,)
        Values of this input, from 0 to 1.
    ends : pair of array (d,)
        Lowest and highest value of each input, in its own units.
    is_allowed : callable or None
        Marks the allowed points (n, d) of the unit cube. None allows all of them.

    Returns
    -------
    array (outputs, values, n)
        NaN at points that are not allowed.
    """
    grid = np.repeat(draws[None], len(values), axis=0)  # (values, n, d)
    grid[:, :, k] = values[:, None]
    points = grid.reshape(-1, draws.shape[1])
    is_evaluated = np.ones(len(points), dtype=bool)
    if is_allowed is not None:
        is_evaluated = is_allowed(points)
    evaluated = _evaluate_at(function, points[is_evaluated], *ends)
    n_outputs = len(evaluated)
    outputs = np.full((n_outputs, len(points)), np.nan)
    outputs[:, is_evaluated] = evaluated
    return outputs.reshape(n_outputs, len(values), len(draws))


def _compute_fractions(output: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Compute the explained and the remaining fraction of the variance of one output.

    This is a step of `compute_allowed_fractions`. The points of each draw form a line:
    on it, one input x has several values, and the other inputs are constant.

    Parameters
    ----------
    output : array (values, n)
        The output at the points: a row for each value of x, a column for the line of
        each draw. It is NaN at points that are not allowed.
    counts : array (resamples, n)
        How often each bootstrap sample contains each draw.

    Returns
    -------
    array (2, resamples)
        The explained fraction Var(E[y | x]) / Var(y), and the remaining fraction
        E[Var(y | others)] / Var(y).
    """
    is_allowed = ~np.isnan(output)
    deviation = np.where(is_allowed, output - np.nanmean(output), 0.0)

    # Count the allowed points at each value, and sum their outputs (resamples, values).
    # From these follow the mean and the variance over all allowed points.
    n_points = counts @ is_allowed.T
    sums = counts @ deviation.T
    n_all_points = n_points.sum(axis=1)
    mean = sums.sum(axis=1) / n_all_points
    variance = counts @ (deviation**2).sum(axis=0) / n_all_points - mean**2

    # The explained part is the variance of the means at the values.
    mean_at_value = sums / np.maximum(n_points, 1)
    squares_at_value = n_points * (mean_at_value - mean[:, None]) ** 2
    explained = squares_at_value.sum(axis=1) / n_all_points

    # The remaining part is the mean of the variances along the lines. The bootstrap
    # draws whole lines, so the mean of a line is the same in all resamples.
    n_points_on_line = np.maximum(is_allowed.sum(axis=0), 1)
    mean_on_line = deviation.sum(axis=0) / n_points_on_line
    squares = np.where(is_allowed, (deviation - mean_on_line) ** 2, 0.0)
    remaining = counts @ squares.sum(axis=0) / n_all_points
    return np.array([explained, remaining]) / variance


def _require_variation(outputs: np.ndarray) -> None:
    """Raise ValueError if one of the outputs (outputs, n) is constant."""
    if not (
        outputs.std(axis=1) > ROUNDING_FRACTION * np.abs(outputs).max(axis=1)
    ).all():
        raise ValueError(
            "an output of the function does not vary; expected outputs that do"
        )


def _add_intervals(
    names: tuple[str, str], estimates: np.ndarray, replicates: np.ndarray
) -> dict[str, np.ndarray]:
    """Add bootstrap intervals to two estimates, and name all of them.

    Parameters
    ----------
    names : pair of str
        Names of the estimates.
    estimates : array (2, outputs, d)
        The two estimates.
    replicates : array (resamples, 2, outputs, d)
        The same estimates from resamples of the data.

    Returns
    -------
    dict
        For each name, an array (outputs, d). There are also arrays for the ends of the
        interval, with the endings `_low` and `_high`.
    """
    lowest, highest = np.quantile(
        replicates, [TAIL_PROBABILITY, 1 - TAIL_PROBABILITY], axis=0
    )
    table: dict[str, np.ndarray] = {}
    for name, estimate, low, high in zip(
        names, estimates, lowest, highest, strict=True
    ):
        table |= {name: estimate, f"{name}_low": low, f"{name}_high": high}
    return table


def _evaluate_at(
    function: ArrayFunction, unit: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Compute the outputs (outputs, n) at points (n, d) of the unit cube."""
    outputs = np.asarray(function(low + (high - low) * unit), dtype=float)
    return outputs.reshape(len(unit), -1).T


def compute_main_effects(
    function: ArrayFunction,
    low: np.ndarray,
    high: np.ndarray,
    seed: int,
    points: int = N_EFFECT_POINTS,
    is_allowed: MaskFunction | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the mean outputs at values of each input, averaged over the other inputs.

    Parameters
    ----------
    function : callable
        It maps points (n, d) to outputs (n,) or (n, outputs).
    low, high : array (d,)
        Ranges of the inputs.
    seed : int
        Seed of the draws of the other inputs.
    points : int
        Number of values of each input.
    is_allowed : callable, optional
        Marks the allowed points (n, d) of the unit cube. Only these are averaged; by
        default all points are allowed.

    Returns
    -------
    grid : array (d, points)
        Values of each input.
    means : array (d, points, outputs)
        NaN at values where fewer than `MIN_DRAWS` points are allowed.
    """
    d = len(low)
    unit_draws = stats.qmc.Sobol(d, rng=seed).random(N_EFFECT_DRAWS)
    draws = low + (high - low) * unit_draws
    grid = np.linspace(low, high, points, axis=1)
    unit_grid = np.linspace(0, 1, points)
    means = []
    for k in range(d):
        # Set input k to the same value in all draws, and keep the other inputs. The
        # function takes points in the units of the inputs, and `is_allowed` the same
        # points in the unit cube.
        points_in_units = draws.copy()
        points_in_cube = unit_draws.copy()
        means_of_input = []
        for value, unit_value in zip(grid[k], unit_grid, strict=True):
            points_in_units[:, k] = value
            points_in_cube[:, k] = unit_value
            if is_allowed is None:
                outputs = np.asarray(function(points_in_units))
            else:
                # The result is NaN if too few points are allowed.
                outputs = _evaluate_allowed(
                    function, points_in_units, is_allowed(points_in_cube)
                )
            means_of_input.append(np.mean(outputs, axis=0))
        means.append(means_of_input)
    return grid, np.array(means)


def _evaluate_allowed(
    function: ArrayFunction, points: np.ndarray, is_allowed: np.ndarray
) -> np.ndarray:
    """Compute the outputs at allowed points; NaN if there are too few for a mean."""
    if is_allowed.sum() >= MIN_DRAWS:
        return np.asarray(function(points[is_allowed]))
    return np.full_like(function(points[:1]), np.nan, dtype=float)


def analyse_surrogate(
    model: Surrogate,
    parameters: ParameterSpace,
    targets: Targets,
    settings: SensitivitySettings,
) -> Sensitivity:
    """Compute the effects of the parameters on the responses of a surrogate.

    The effects are Sobol indices and mean responses. With constraints,
    `compute_variance_fractions` computes other fractions of the variance in place of
    the indices.

    Parameters
    ----------
    model : Surrogate
        The surrogate.
    parameters : ParameterSpace
        The ranges over which the parameters vary.
    targets : Targets
        The responses of the surrogate.
    settings : SensitivitySettings
        The section `sensitivity`.

    Returns
    -------
    Sensitivity

    Raises
    ------
    ValueError
        If a response does not vary.
    """

    def predict(coordinates: np.ndarray) -> np.ndarray:
        """Predict the responses (n, k) at coordinates (n, d) of the free parameters.

        The coordinate of a parameter is its value, or the logarithm of its value if its
        scale is logarithmic.
        """
        values = parameters.from_coordinates(coordinates)
        return model.predict(parameters.add_fixed_values(values))

    # Make a row for each response and parameter. The arrays (k, d) are raveled in the
    # order of the pairs.
    fractions = compute_variance_fractions(predict, parameters, settings)
    pairs = pd.MultiIndex.from_product(
        [targets.names, parameters.free], names=["response", "parameter"]
    )
    columns = {name: fraction.ravel() for name, fraction in fractions.items()}
    indices = pd.DataFrame(columns, pairs).reset_index()

    # Make a row for each parameter and value. The coordinates have the shape (d,
    # values), and the means (d, values, k).
    low, high = parameters.coordinate_bounds
    is_allowed = parameters.is_allowed if parameters.constraints else None
    coordinates, means = compute_main_effects(
        predict, low, high, seed=settings.seed, is_allowed=is_allowed
    )
    values = parameters.from_coordinates(coordinates.T).T  # (d, values)
    names = np.repeat(parameters.free, values.shape[1])
    effects = pd.DataFrame({"parameter": names, "value": values.ravel()})
    effects[list(targets.names)] = means.reshape(len(effects), -1)
    # The means are NaN where hardly any parameter set is allowed, so drop these rows.
    return Sensitivity(indices, effects.dropna(ignore_index=True))


def compute_variance_fractions(
    function: ArrayFunction, parameters: ParameterSpace, settings: SensitivitySettings
) -> dict[str, np.ndarray]:
    """Compute Sobol indices, or with constraints the fractions that replace them.

    The result is that of `compute_sobol_indices` or of `compute_allowed_fractions`.
    """
    low, high = parameters.coordinate_bounds
    if parameters.constraints:
        return compute_allowed_fractions(
            function,
            low,
            high,
            is_allowed=parameters.is_allowed,
            samples=settings.samples,
            resamples=settings.resamples,
            seed=settings.seed,
        )
    return compute_sobol_indices(
        function,
        low=low,
        high=high,
        samples=settings.samples,
        resamples=settings.resamples,
        seed=settings.seed,
    )


def analyse_from_file(
    surrogate_json: StrPath,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    definitions: Definitions,
    settings: SensitivitySettings,
    out_dir: StrPath,
    source: object = "configuration",
) -> pd.DataFrame:
    """Analyse the surrogate in a file, and write sobol.csv and main_effects.csv.

    Parameters
    ----------
    surrogate_json : path
        File of the surrogate.
    parameters : ParameterSpace
        The parameters of the study.
    targets : Targets
        The responses that the surrogate must have.
    definitions : mapping
        Their definitions, which must be those of the surrogate.
    settings : SensitivitySettings
        The section `sensitivity`.
    out_dir : path
        Folder for the two tables.
    source : object, optional
        Name of the configuration, which an error about definitions shows.

    Returns
    -------
    pandas.DataFrame
        The content of sobol.csv.

    Raises
    ------
    InputError
        If no parameter is free, or if the surrogate has other or constant responses.
    """
    reject_all_fixed(parameters)
    model = load(surrogate_json)
    reject_other_targets(model, surrogate_json, targets, definitions, source)
    # `analyse_surrogate` raises a ValueError only for responses that do not vary.
    try:
        result = analyse_surrogate(model, parameters, targets, settings)
    except ValueError as error:
        raise InputError(
            source=surrogate_json,
            key="surrogate",
            value=str(error),
            allowed="responses that vary",
        ) from None
    write_table(Path(out_dir) / INDICES_FILE, result.indices)
    write_table(Path(out_dir) / EFFECTS_FILE, result.effects)
    return result.indices


def describe_indices(table: pd.DataFrame) -> str:
    """Describe the two fractions of the variance in text, with a line for each response.

    Parameters
    ----------
    table : pandas.DataFrame
        The content of sobol.csv. The fractions are the Sobol indices, or with
        constraints the explained and the remaining fraction.

    Returns
    -------
    str
        Each line lists the parameters with both fractions, the second one in brackets.
    """
    column_alone = "first"
    column_with_others = "total"
    meaning = "first-order (total)"
    if "explained" in table:
        column_alone = "explained"
        column_with_others = "remaining"
        meaning = "explained by a parameter alone (remaining if all others are known):"
    lines = []
    for response, rows in table.groupby("response", sort=False):
        # Begin with the parameter that has the largest effect together with others.
        sorted_rows = rows.sort_values(column_with_others, ascending=False)
        fractions = sorted_rows[["parameter", column_alone, column_with_others]]
        parameters = ", ".join(
            f"{name} {alone:.2f} ({with_others:.2f})"
            for name, alone, with_others in fractions.itertuples(index=False)
        )
        lines.append(f"{response}: {meaning} {parameters}")
    return "\n".join(lines)
