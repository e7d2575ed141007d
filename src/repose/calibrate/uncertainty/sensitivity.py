"""Effects of the parameters on the responses, by the surrogate: Sobol indices and main effects.

The indices use the estimators of Saltelli et al. 2010 (Computer Physics Communications 181, 259) on a Sobol sequence,
as scipy.stats.sobol_indices has them. The free parameters are independent and uniform on their ranges; prior
knowledge of a parameter does not enter. The intervals contain the error of the sampling, by bootstrap over the rows
of the sequence. They do not contain the surrogate's own error.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from repose.calibrate.strategies.base import Studied
from repose.calibrate.surrogates import Surrogate, load
from repose.calibrate.training import require_targets
from repose.calibrate.uncertainty.posterior import require_free
from repose.common.errors import InputError
from repose.common.files import Path_, write_table

CONFIDENCE = 0.95
EFFECT_POINTS = 41
EFFECT_DRAWS = 2048
ROUNDING = 1e-12  # a constant output varies by no more than this share of it

Function = Callable[[np.ndarray], np.ndarray]


def indices(
    function: Function,
    low: np.ndarray,
    high: np.ndarray,
    samples: int,
    resamples: int,
    seed: int,
) -> dict[str, np.ndarray]:
    """Compute first-order and total Sobol indices with intervals, each (outputs, d); `samples` is a power of two."""
    d = len(low)
    A, B = np.split(stats.qmc.Sobol(2 * d, rng=seed).random(samples), 2, axis=1)
    AB = np.repeat(A[None], d, axis=0)  # A with column i of B
    AB[np.arange(d), :, np.arange(d)] = B.T
    f_A, f_B = _values(function, A, low, high), _values(function, B, low, high)
    f_AB = np.array([_values(function, points, low, high) for points in AB])
    if not (f_A.std(axis=1) > ROUNDING * np.abs(f_A).max(axis=1)).all():
        raise ValueError(
            "an output of the function does not vary; expected outputs that do"
        )

    def of(rows: np.ndarray | slice) -> np.ndarray:
        # scipy centres its arguments in place
        values = {
            "f_A": f_A[:, rows].copy(),
            "f_B": f_B[:, rows].copy(),
            "f_AB": f_AB[:, :, rows].copy(),
        }
        result = stats.sobol_indices(func=values, n=samples)
        return np.reshape([result.first_order, result.total_order], (2, -1, d))

    random = np.random.default_rng(seed)
    again = [of(random.integers(samples, size=samples)) for _ in range(resamples)]
    tail = (1 - CONFIDENCE) / 2
    ends = np.quantile(again, [tail, 1 - tail], axis=0)
    result: dict[str, np.ndarray] = {}
    for k, (name, value) in enumerate(
        zip(("first", "total"), of(slice(None)), strict=True)
    ):
        result |= {name: value, f"{name}_low": ends[0, k], f"{name}_high": ends[1, k]}
    return result


def main_effects(
    function: Function,
    low: np.ndarray,
    high: np.ndarray,
    seed: int,
    points: int = EFFECT_POINTS,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute values (d, points) along each input, and mean outputs (d, points, outputs) over all other inputs."""
    base = low + (high - low) * stats.qmc.Sobol(len(low), rng=seed).random(EFFECT_DRAWS)
    grid = np.linspace(low, high, points, axis=1)
    means = []
    for k in range(len(low)):
        moved = base.copy()
        along = []
        for value in grid[k]:
            moved[:, k] = value
            along.append(np.mean(function(moved), axis=0))
        means.append(along)
    return grid, np.array(means)


def analyse(model: Surrogate, study: Studied) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make the tables sobol.csv and main_effects.csv of a surrogate: Sobol indices and mean responses."""
    space, names, settings = (
        study.parameters,
        study.targets.names,
        study.settings.sensitivity,
    )

    def respond(values: np.ndarray) -> np.ndarray:
        return model.predict(space.complete(values))

    table = indices(
        respond,
        space.low,
        space.high,
        settings.samples,
        settings.resamples,
        settings.seed,
    )
    pairs = pd.MultiIndex.from_product(
        [names, space.free], names=["response", "parameter"]
    )
    sobol = pd.DataFrame(
        {key: value.ravel() for key, value in table.items()}, pairs
    ).reset_index()
    grid, means = main_effects(respond, space.low, space.high, settings.seed)
    effects = pd.DataFrame(
        {"parameter": np.repeat(space.free, grid.shape[1]), "value": grid.ravel()}
    )
    effects[list(names)] = means.reshape(len(effects), -1)
    return sobol, effects


def run(
    surrogate_json: Path_,
    study: Studied,
    out_dir: Path_,
    source: object = "configuration",
) -> pd.DataFrame:
    """Read a surrogate, write sobol.csv and main_effects.csv; return the first table."""
    require_free(study.parameters)
    model = load(surrogate_json)
    require_targets(model, surrogate_json, study.targets, study.definitions, source)
    try:
        table, effects = analyse(model, study)
    except ValueError as error:
        raise InputError(
            surrogate_json, "surrogate", str(error), "responses that vary"
        ) from None
    write_table(Path(out_dir) / "sobol.csv", table)
    write_table(Path(out_dir) / "main_effects.csv", effects)
    return table


def _values(
    function: Function, unit: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Compute the outputs (outputs, n) at points (n, d) of the unit cube."""
    return (
        np.asarray(function(low + (high - low) * unit), dtype=float)
        .reshape(len(unit), -1)
        .T
    )


def message(table: pd.DataFrame) -> str:
    """Write first-order and total indices as text, a line for each response."""
    lines = []
    for response, rows in table.groupby("response", sort=False):
        order = rows.sort_values("total", ascending=False)
        parts = [
            f"{row.parameter} {row.first:.2f} ({row.total:.2f})"
            for row in order.itertuples()
        ]
        lines.append(f"{response}: first-order (total) " + ", ".join(parts))
    return "\n".join(lines)
