"""Designs compared, and few points with many seeds beside many points with one.

Emulated rows: each repetition is a new design with new noise, poured by `emulator`, judged against the emulator's
own mean, which has no noise. Real rows: the main design and parts of the pool, judged at the fresh points.

References
----------
(JCS05) Jin, Chen & Sudjianto 2005: the optimal design of `repose.calibrate.designs.latin_hypercube`.
(MM09) Myers, Montgomery & Anderson-Cook 2009, Response Surface Methodology: central composite designs.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.designs import latin_hypercube as design
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.accuracy import compute_r2
from repose.common.files import write_json, write_table
from research.comparison import emulator, models, scores
from research.comparison.points import Points
from research.pool import sobol

SAMPLES = (30, 60, 100, 150)
REPETITIONS = 10
REPETITION_STARTS = 4  # of the network, at most
LARGEST_PROCESS = 500  # points of a Gaussian process, whose time grows with their cube
TRADES = (1, 2, 4, 8)  # seeds per point, at the main design's number of simulations
JUDGED_AT = 1024  # points of a Sobol sequence
FITS = {
    name: models.MODELS[name]
    for name in ("network", "Gaussian process", "quadratic surface")
}
# Generators of the factorial part: each further factor is the product of these free factors (MM09).
GENERATORS = {0: (), 1: ((0, 1, 2, 3, 4),), 2: ((0, 1, 2), (1, 2, 3))}


COMPOSITE_DIMENSIONS = 6


def central_composite(n: int, d: int = COMPOSITE_DIMENSIONS) -> np.ndarray:
    """Face-centred central composite design (n, d) in the unit cube (MM09).

    It has corners (all, half or a quarter of the 2^6, the largest fraction that fits), 12 face centres and the middle.
    The rest of n repeats these points in their order: the middle, the faces, the corners. ValueError for another d than
    6, or n below 29.
    """
    if d != COMPOSITE_DIMENSIONS or n < 29:
        raise ValueError(
            f"n is {n}, d {d}; expected at least 29 points in 6 dimensions"
        )
    fraction = next(k for k in GENERATORS if 2 ** (d - k) + 2 * d + 1 <= n)
    free = d - fraction
    corners = 1 - 2.0 * ((np.arange(2**free)[:, None] >> np.arange(free)) & 1)
    products = [corners[:, word].prod(axis=1) for word in GENERATORS[fraction]]
    corners = np.column_stack([corners, *products])
    faces = np.concatenate([np.eye(d), -np.eye(d)])
    whole = np.concatenate([np.zeros((1, d)), faces, corners])
    return 0.5 + 0.5 * np.resize(whole, (n, d))


Design = Callable[[int, int, Any], np.ndarray]  # of a size, dimensions and a seed
DESIGNS: dict[str, Design] = {
    "random Latin hypercube": lambda n, d, seed: design.random_lhs(
        n, d, np.random.default_rng(seed)
    ),
    "best of 20 Latin hypercubes": lambda n, d, seed: design.lhsdesign(
        n, d, rng=np.random.default_rng(seed)
    ),
    "optimal Latin hypercube": lambda n, d, seed: design.optimal_lhs(n, d, seed),
    "Sobol sequence": lambda n, d, seed: sobol(n, d, seed),
    "central composite": lambda n, d, seed: central_composite(n, d),
}


def designs_for(d: int) -> dict[str, Design]:
    """Designs that exist in d dimensions, by name: functions of a size, d and a seed."""
    return {
        name: make
        for name, make in DESIGNS.items()
        if name != "central composite" or d == COMPOSITE_DIMENSIONS
    }


class Case(NamedTuple):
    """The common data of all emulated cases."""

    stand_in: emulator.Emulator
    space: ParameterSpace
    names: Sequence[str]  # responses, (k,)
    # section `network`, with at most `REPETITION_STARTS` starts
    settings: Mapping[str, Any]
    seed: int  # of the repetitions


def table_of(
    sets: Sequence[Points],
    names: Sequence[str],
    space: ParameterSpace,
    settings: Mapping[str, Any],
    seeds: int,
    seed: int,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Comparison of designs, and of points against seeds; with a summary of the emulator.

    `sets` are as `points.read_sets` returns them; `settings` is the section `network`; `seeds` is the number of runs of
    a sample of the main design; `seed` is for the repetitions.
    """
    main, pool, fresh = sets
    settings = {**settings, "starts": min(settings["starts"], REPETITION_STARTS)}
    stand_in = emulator.chosen_by_cross_validation(pool, settings, seed)
    case = Case(stand_in, space, names, settings, seed)
    rows = [
        *_designs(case, seeds),
        *_trades(case, seeds),
        *_real(main, pool, fresh, names, settings, seed),
    ]
    return pd.DataFrame(rows), _emulator_summary(stand_in, pool, names)


def run(
    sets: Sequence[Points],
    names: Sequence[str],
    space: ParameterSpace,
    settings: Mapping[str, Any],
    seeds: int,
    seed: int,
    out_dir: str | Path,
) -> pd.DataFrame:
    """Write sampling.csv and emulator.json; return the table."""
    table, summary = table_of(sets, names, space, settings, seeds, seed)
    write_table(Path(out_dir) / "sampling.csv", table, float_format="%.6g")
    write_json(Path(out_dir) / "emulator.json", summary)
    return table


def _emulator_summary(stand_in, pool, names):
    """Content of emulator.json; the correlation is a number for two responses and a matrix for others."""
    correlation = stand_in.noise.correlation
    return {
        "mean": stand_in.name,
        "explainable": dict(zip(names, stand_in.explainable.tolist(), strict=True)),
        "noise_correlation": float(correlation[0, 1])
        if len(names) == 2
        else correlation.tolist(),
        "noise_std": dict(
            zip(names, stand_in.noise.std(pool.X).mean(axis=0).tolist(), strict=True)
        ),
    }


def _designs(case, seeds):
    """Every design at every size, with as many runs of a point as the main design has."""
    d = case.space.dimensions
    for samples in SAMPLES:
        for name, make in designs_for(d).items():
            units = [
                make(samples, d, [case.seed, samples, k]) for k in range(REPETITIONS)
            ]
            yield from _emulated(
                case, {"comparison": "designs", "design": name}, units, seeds
            )


def _trades(case, seeds):
    """Spend the main design's simulations on few points with many seeds or many with one; Sobol sequences."""
    total = SAMPLES[-1] * seeds
    for each in TRADES:
        samples = total // each
        labels = {"comparison": "points against seeds", "design": "Sobol sequence"}
        units = [
            sobol(samples, case.space.dimensions, [case.seed, 9, k])
            for k in range(REPETITIONS)
        ]
        yield from _emulated(case, labels, units, each)


def _emulated(case, labels, units, seeds):
    """Rows of one emulated case: each fit's R2 on the emulator's mean, over the repetitions."""
    X = case.space.values(sobol(JUDGED_AT, case.space.dimensions, [case.seed, 8]))
    truth = case.stand_in.mean(X)
    found = {name: [] for name in FITS}
    for k, unit in enumerate(units):
        rng = np.random.default_rng([case.seed, 7, k])
        sample = case.stand_in.pour(case.space.values(unit), seeds, rng)
        for name in FITS:
            predict = _fitted(name, sample, case.settings, case.seed + k)
            found[name].append(
                None if predict is None else _on_truth(truth, predict(X)[0])
            )
    sizes = {
        "points": len(units[0]),
        "seeds": seeds,
        "simulations": len(units[0]) * seeds,
    }
    for name, scored in found.items():
        if None not in scored:
            yield from _rows(
                labels | {"data": "emulated", "fit": name} | sizes, case.names, scored
            )


def _real(main, pool, fresh, names, settings, seed):
    """Rows of simulated points: the main design, the pool's leading points, and random parts of the pool.

    The parts trade points for seeds.
    """
    every = pool.values.shape[1]
    cases = [("designs", "main design", [main])]
    cases += [
        ("designs", "Sobol sequence", [pool.take(np.arange(n))])
        for n in SAMPLES
        if n < len(pool.X)
    ]
    rng = np.random.default_rng([seed, 6])
    for seeds in (s for s in TRADES if s <= every):
        draws = []
        for _ in range(REPETITIONS):
            rows = rng.choice(len(pool.X), len(pool.X) // seeds, replace=False)
            draws.append(pool.take(rows).with_seeds_drawn(seeds, rng))
        cases.append(("points against seeds", "parts of the pool", draws))
    for comparison, name, sets in cases:
        sizes = {
            "points": len(sets[0].X),
            "seeds": sets[0].values.shape[1],
            "simulations": sets[0].simulations(),
        }
        for fit_name in FITS:
            predicted = [
                _fitted(fit_name, points, settings, seed + k)
                for k, points in enumerate(sets)
            ]
            if None in predicted:
                continue
            scored = [_on_fresh(fresh, predict(fresh.X)[0]) for predict in predicted]
            case = {
                "comparison": comparison,
                "design": name,
                "data": "real",
                "fit": fit_name,
            }
            yield from _rows(case | sizes, names, scored)


def _fitted(name, sample, settings, seed):
    """Fit one of FITS, None where the points are too many or too few for it."""
    if name == "Gaussian process" and len(sample.X) > LARGEST_PROCESS:
        return None
    return FITS[name](sample, settings, seed)


def _on_truth(truth, predicted):
    """R2 and root mean squared error by response, against means without noise."""
    return [
        {"explainable": compute_r2(y, p), "rmse": float(np.sqrt(np.mean((y - p) ** 2)))}
        for y, p in zip(truth.T, predicted.T, strict=True)
    ]


def _on_fresh(fresh, predicted):
    """Score the same from noisy means, the noise subtracted."""
    columns = zip(fresh.means().T, fresh.known_errors().T, predicted.T, strict=True)
    return [scores.accuracy(y, se, p) for y, se, p in columns]


def _rows(case, names, scored):
    """Make a row for each response: mean and standard error over the repetitions."""
    for k, response in enumerate(names):
        row = case | {"response": response, "repetitions": len(scored)}
        for key in ("explainable", "rmse"):
            row[key], row[f"{key}_se"] = scores.mean_and_error(
                [score[k][key] for score in scored]
            )
        yield row
