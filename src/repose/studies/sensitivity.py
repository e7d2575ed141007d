"""Which parameter moves which response, by the network: Sobol indices and main effects.

Indices by the estimators of Saltelli et al. 2010 (Computer Physics Communications 181, 259) on a Sobol sequence, as
scipy.stats.sobol_indices has them; parameters are independent and uniform on their ranges. The intervals are those of
the sampling, by bootstrap over the rows of the sequence; they know nothing of the network's own error.
"""

from pathlib import Path

import numpy as np
from scipy import stats

from repose.core.parameters import PARAMETERS
from repose.surrogate.bayesian_bp import RESPONSES, evaluate, load

CONFIDENCE = 0.95
EFFECT_POINTS = 41
EFFECT_DRAWS = 2048


def indices(function, low, high, samples, resamples, seed):
    """First-order and total indices with intervals, each (outputs, d), as a dict.

    function: points (n, d) to (n, outputs). low, high (d,): ranges. samples: a power of two; the function is
    evaluated samples (d + 2) times. resamples: of the rows of the sequence, for percentile intervals. Keys
    first, first_low, first_high, total, total_low, total_high. Raises ValueError where samples is no power of
    two, or an output does not vary.
    """
    if samples < 2 or samples & (samples - 1):
        raise ValueError(f"samples is {samples!r}; allowed: a power of two")
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    d = len(low)
    A, B = np.split(stats.qmc.Sobol(2 * d, rng=seed).random(samples), 2, axis=1)
    AB = np.repeat(A[None], d, axis=0)  # A with column i of B
    AB[np.arange(d), :, np.arange(d)] = B.T
    f_A, f_B = _values(function, A, low, high), _values(function, B, low, high)
    f_AB = np.array([_values(function, points, low, high) for points in AB])
    if not (f_A.std(axis=1) > 0).all():
        raise ValueError("an output of the function does not vary; allowed: outputs that do")

    def of(rows):
        # scipy centres what it is given in place
        values = {"f_A": f_A[:, rows].copy(), "f_B": f_B[:, rows].copy(), "f_AB": f_AB[:, :, rows].copy()}
        found = stats.sobol_indices(func=values, n=samples)
        return np.reshape([found.first_order, found.total_order], (2, -1, d))

    random = np.random.default_rng(seed)
    again = [of(random.integers(samples, size=samples)) for _ in range(resamples)]
    tail = (1 - CONFIDENCE) / 2
    ends = np.quantile(again, [tail, 1 - tail], axis=0)
    result = {}
    for k, (name, value) in enumerate(zip(("first", "total"), of(slice(None)), strict=True)):
        result |= {name: value, f"{name}_low": ends[0, k], f"{name}_high": ends[1, k]}
    return result


def main_effects(function, low, high, seed, points=EFFECT_POINTS, draws=EFFECT_DRAWS):
    """Mean outputs over all other inputs along each input: grid (d, points), means (d, points, outputs)."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    base = low + (high - low) * stats.qmc.Sobol(len(low), rng=seed).random(draws)
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


def run(network_json, ranges, settings, out_dir):
    """Write sobol.csv and main_effects.csv for both responses; return the first table.

    ranges: parameter to (low, high). settings: samples, resamples, seed. Raises InputError for a bad file.
    """
    import pandas as pd

    network = load(network_json)
    low, high = np.array([ranges[name] for name in PARAMETERS], dtype=float).T

    def respond(X):
        return evaluate(network, X)

    found = indices(respond, low, high, settings["samples"], settings["resamples"], settings["seed"])
    rows = [
        {"response": response, "parameter": name} | {key: value[i, k] for key, value in found.items()}
        for i, response in enumerate(RESPONSES)
        for k, name in enumerate(PARAMETERS)
    ]
    table = pd.DataFrame(rows)
    grid, means = main_effects(respond, low, high, settings["seed"])
    effects = [
        {"parameter": name, "value": grid[k, j]} | dict(zip(RESPONSES, means[k, j], strict=True))
        for k, name in enumerate(PARAMETERS)
        for j in range(grid.shape[1])
    ]
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "sobol.csv", index=False)
    pd.DataFrame(effects).to_csv(out / "main_effects.csv", index=False)
    return table


def _values(function, unit, low, high):
    """Outputs (outputs, n) at points (n, d) of the unit cube."""
    return np.asarray(function(low + (high - low) * unit), dtype=float).reshape(len(unit), -1).T


def message(table):
    """First-order and total indices in words, one line a response."""
    lines = []
    for response, rows in table.groupby("response", sort=False):
        order = rows.sort_values("total", ascending=False)
        parts = [f"{row.parameter} {row.first:.2f} ({row.total:.2f})" for row in order.itertuples()]
        lines.append(f"{response}: first-order (total) " + ", ".join(parts))
    return "\n".join(lines)
