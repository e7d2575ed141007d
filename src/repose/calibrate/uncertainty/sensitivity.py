"""Effects of the parameters on the responses, computed with the surrogate.

There are Sobol indices and main effects. The indices use the estimators of Saltelli et
al. 2010 (Computer Physics Communications 181, 259) on a Sobol sequence, as
scipy.stats.sobol_indices has them. The free parameters are independent and uniform on
their ranges, along their scales; prior knowledge of a parameter does not enter. The intervals contain the
error of the sampling, by bootstrap over the rows of the sequence. They do not contain
the surrogate's own error.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Definitions
from repose.calibrate.surrogates import Surrogate, load
from repose.calibrate.targets import Targets
from repose.calibrate.training import require_targets
from repose.calibrate.uncertainty.posterior import require_free
from repose.calibrate.uncertainty.settings import SensitivitySettings
from repose.common.errors import InputError
from repose.common.files import Path_, write_table

CONFIDENCE = 0.95
EFFECT_POINTS = 41
EFFECT_DRAWS = 2048
ROUNDING = 1e-12  # a constant output varies by no more than this share of it

Function = Callable[[np.ndarray], np.ndarray]


class Sensitivity(NamedTuple):
    """Tables of the effects of the parameters."""

    indices: pd.DataFrame  # sobol.csv: a row for each response and parameter
    effects: pd.DataFrame  # main_effects.csv: a row for each parameter and value


def indices(
    function: Function,
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
        From points (n, d) to outputs (n,) or (n, outputs).
    low, high : array (d,)
        Ranges of the inputs.
    samples : int
        A power of two.
    resamples : int
        Of the bootstrap.
    seed : int

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
    # A and B (samples, d) are independent points of the unit cube. AB[i] is A with column i
    # replaced by that of B, so f_A and f_AB[i] differ only by the effect of input i.
    d = len(low)
    sequence = stats.qmc.Sobol(2 * d, rng=seed)
    A, B = np.split(sequence.random(samples), 2, axis=1)
    AB = np.repeat(A[None], d, axis=0)
    AB[np.arange(d), :, np.arange(d)] = B.T
    f_A = _values(function, A, low, high)
    f_B = _values(function, B, low, high)
    f_AB = np.array([_values(function, points, low, high) for points in AB])
    if not (f_A.std(axis=1) > ROUNDING * np.abs(f_A).max(axis=1)).all():
        raise ValueError(
            "an output of the function does not vary; expected outputs that do"
        )

    def compute(rows: np.ndarray | slice) -> np.ndarray:
        """Compute first-order and total indices (2, outputs, d) of some samples."""
        # Pass copies, because SciPy centres its arguments in place.
        values = {
            "f_A": f_A[:, rows].copy(),
            "f_B": f_B[:, rows].copy(),
            "f_AB": f_AB[:, :, rows].copy(),
        }
        result = stats.sobol_indices(func=values, n=samples)
        return np.reshape([result.first_order, result.total_order], (2, -1, d))

    # Estimate the intervals by bootstrap, from samples drawn with replacement.
    random = np.random.default_rng(seed)
    replicates = [
        compute(random.integers(samples, size=samples)) for _ in range(resamples)
    ]
    tail = (1 - CONFIDENCE) / 2
    lowest, highest = np.quantile(replicates, [tail, 1 - tail], axis=0)
    first, total = compute(slice(None))
    return {
        "first": first,
        "first_low": lowest[0],
        "first_high": highest[0],
        "total": total,
        "total_low": lowest[1],
        "total_high": highest[1],
    }


def _values(
    function: Function, unit: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Compute the outputs (outputs, n) at points (n, d) of the unit cube."""
    outputs = np.asarray(function(low + (high - low) * unit), dtype=float)
    return outputs.reshape(len(unit), -1).T


def main_effects(
    function: Function,
    low: np.ndarray,
    high: np.ndarray,
    seed: int,
    points: int = EFFECT_POINTS,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the mean outputs along each input, averaged over all other inputs.

    Parameters
    ----------
    function, low, high, seed
        As of `indices`.
    points : int
        Number of values of each input.

    Returns
    -------
    grid : array (d, points)
        Values of each input.
    means : array (d, points, outputs)
    """
    d = len(low)
    base = low + (high - low) * stats.qmc.Sobol(d, rng=seed).random(EFFECT_DRAWS)
    grid = np.linspace(low, high, points, axis=1)
    means = []
    for k in range(d):
        # Set input k to the same value at all points, and keep the other inputs.
        changed = base.copy()
        means_of_input = []
        for value in grid[k]:
            changed[:, k] = value
            means_of_input.append(np.mean(function(changed), axis=0))
        means.append(means_of_input)
    return grid, np.array(means)


def analyse(
    model: Surrogate,
    parameters: ParameterSpace,
    targets: Targets,
    settings: SensitivitySettings,
) -> Sensitivity:
    """Compute Sobol indices and mean responses of a surrogate.

    Parameters
    ----------
    model : Surrogate
    parameters : ParameterSpace
        The ranges over which the parameters vary.
    targets : Targets
        The responses of the surrogate.
    settings : SensitivitySettings

    Raises
    ------
    ValueError
        If a response does not vary.
    """

    def respond(coordinates: np.ndarray) -> np.ndarray:
        values = parameters.from_coordinates(coordinates)
        return model.predict(parameters.complete(values))

    low, high = parameters.coordinate_ends
    arrays = indices(
        respond,
        low=low,
        high=high,
        samples=settings.samples,
        resamples=settings.resamples,
        seed=settings.seed,
    )
    pairs = pd.MultiIndex.from_product(
        [targets.names, parameters.free], names=["response", "parameter"]
    )
    columns = {name: array.ravel() for name, array in arrays.items()}
    table = pd.DataFrame(columns, pairs).reset_index()

    grid, means = main_effects(respond, low=low, high=high, seed=settings.seed)
    grid = parameters.from_coordinates(grid.T).T
    n_values = grid.shape[1]
    effects = pd.DataFrame(
        {"parameter": np.repeat(parameters.free, n_values), "value": grid.ravel()}
    )
    effects[list(targets.names)] = means.reshape(len(effects), -1)
    return Sensitivity(table, effects)


def run(
    surrogate_json: Path_,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    definitions: Definitions,
    settings: SensitivitySettings,
    out_dir: Path_,
    source: object = "configuration",
) -> pd.DataFrame:
    """Analyse the surrogate in a file.

    Write sobol.csv and main_effects.csv, and return the first table.

    Parameters
    ----------
    surrogate_json : path
    parameters : ParameterSpace
    targets : Targets
        The responses that the surrogate must have.
    definitions : mapping
        Their definitions, which must be those of the surrogate.
    settings : SensitivitySettings
    out_dir : path
    source : object, optional
        Name of the configuration, for an error about definitions.

    Raises
    ------
    InputError
        If no parameter is free, or if the surrogate has other or constant responses.
    """
    require_free(parameters)
    model = load(surrogate_json)
    require_targets(model, surrogate_json, targets, definitions, source)
    try:
        result = analyse(model, parameters, targets, settings)
    except ValueError as error:
        raise InputError(
            surrogate_json, "surrogate", str(error), "responses that vary"
        ) from None
    write_table(Path(out_dir) / "sobol.csv", result.indices)
    write_table(Path(out_dir) / "main_effects.csv", result.effects)
    return result.indices


def message(table: pd.DataFrame) -> str:
    """Write first-order and total indices as text, a line for each response."""
    lines = []
    for response, rows in table.groupby("response", sort=False):
        by_total = rows.sort_values("total", ascending=False)
        parameters = ", ".join(
            f"{row.parameter} {row.first:.2f} ({row.total:.2f})"
            for row in by_total.itertuples()
        )
        lines.append(f"{response}: first-order (total) {parameters}")
    return "\n".join(lines)
