"""Designs compared, and few points with many seeds beside many points with one.

Emulated rows: each repetition is a new design with new noise, poured by `emulator`, judged against the emulator's
own mean, which has no noise. Real rows: the main design and parts of the pool, judged at the fresh points.

Sources
  (JCS05)  Jin, Chen & Sudjianto 2005: the optimal design of `repose.chain.design`
  (MM09)   Myers, Montgomery & Anderson-Cook 2009, Response Surface Methodology: central composite designs
"""

from pathlib import Path

import numpy as np

from repose.chain import design
from repose.core.parameters import PARAMETERS
from repose.studies.comparison import emulator, models, points, scores
from repose.surrogate.bayesian_bp import RESPONSES, r2

SAMPLES = (30, 60, 100, 150)
REPETITIONS = 10
REPETITION_STARTS = 4  # of the network, at most
LARGEST_PROCESS = 500  # points of a Gaussian process, whose time grows with their cube
TRADES = (1, 2, 4, 8)  # seeds a point, at the main design's number of simulations
JUDGED_AT = 1024  # points of a Sobol sequence
FITS = {name: models.MODELS[name] for name in ("network", "Gaussian process", "quadratic surface")}
# Words of the generators of the factorial part: of factors beyond the free ones, the product of which.  (MM09)
GENERATORS = {0: (), 1: ((0, 1, 2, 3, 4),), 2: ((0, 1, 2), (1, 2, 3))}


def central_composite(n, d=6):
    """Face-centred central composite design in the unit cube, n rows (n, d).

    Corners (all, half or a quarter of the 2^6, whichever fits), 12 face centres and the middle; what is left of n is
    spent on the same points again, from the first. Raises ValueError for another d or n below 29.
    """
    if d != 6 or n < 29:
        raise ValueError(f"n is {n}, d {d}; allowed: at least 29 points in 6 dimensions")
    fraction = next(k for k in GENERATORS if 2 ** (d - k) + 2 * d + 1 <= n)
    free = d - fraction
    corners = 1 - 2.0 * ((np.arange(2**free)[:, None] >> np.arange(free)) & 1)
    products = [corners[:, word].prod(axis=1) for word in GENERATORS[fraction]]
    corners = np.column_stack([corners, *products])
    faces = np.concatenate([np.eye(d), -np.eye(d)])
    whole = np.concatenate([np.zeros((1, d)), faces, corners])
    return 0.5 + 0.5 * np.resize(whole, (n, d))


DESIGNS = {
    "random Latin hypercube": lambda n, seed: design.random_lhs(n, 6, np.random.default_rng(seed)),
    "best of 20 Latin hypercubes": lambda n, seed: design.lhsdesign(n, 6, rng=np.random.default_rng(seed)),
    "optimal Latin hypercube": lambda n, seed: design.optimal_lhs(n, 6, seed),
    "Sobol sequence": lambda n, seed: design.sobol(n, 6, seed),
    "central composite": lambda n, seed: central_composite(n),
}


def run(files, ranges, settings, seeds, seed, out_dir):
    """Write sampling.csv and emulator.json; return the table.

    files: as `accuracy.run`; ranges: the configuration's `parameters`; settings: its section `network`; seeds: pours
    a sample of the main design; seed: of the repetitions. Raises InputError for a file without its columns.
    """
    import json

    import pandas as pd

    main, pool, fresh = points.read_sets(files)
    settings = settings | {"starts": min(settings["starts"], REPETITION_STARTS)}
    stand_in = emulator.fit(pool, settings, seed)
    box = [ranges[name] for name in PARAMETERS]
    rows = [*_designs(stand_in, box, settings, seeds, seed), *_trades(stand_in, box, settings, seeds, seed)]
    rows += _real(main, pool, fresh, settings, seed)
    table = pd.DataFrame(rows)
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "sampling.csv", index=False, float_format="%.6g")
    summary = {
        "mean": stand_in.name,
        "explainable": dict(zip(RESPONSES, stand_in.explainable.tolist(), strict=True)),
        "noise_correlation": stand_in.correlation,
        "noise_std": dict(zip(RESPONSES, stand_in.noise_std(pool.X).mean(axis=0).tolist(), strict=True)),
    }
    (out / "emulator.json").write_text(json.dumps(summary, indent=1) + "\n")
    return table


def _designs(stand_in, box, settings, seeds, seed):
    """Every design at every size, with the main design's seeds a point."""
    for samples in SAMPLES:
        for name, make in DESIGNS.items():
            case = {"comparison": "designs", "design": name}
            units = [make(samples, [seed, samples, k]) for k in range(REPETITIONS)]
            yield from _emulated(case, stand_in, box, units, seeds, settings, seed)


def _trades(stand_in, box, settings, seeds, seed):
    """The main design's simulations, on few points with many seeds or many with one; Sobol sequences."""
    total = SAMPLES[-1] * seeds
    for each in TRADES:
        samples = total // each
        case = {"comparison": "points against seeds", "design": "Sobol sequence"}
        units = [design.sobol(samples, 6, [seed, 9, k]) for k in range(REPETITIONS)]
        yield from _emulated(case, stand_in, box, units, each, settings, seed)


def _emulated(case, stand_in, box, units, seeds, settings, seed):
    """Rows of one emulated case: each fit's R2 on the emulator's mean, over the repetitions."""
    X = design.scale(design.sobol(JUDGED_AT, 6, [seed, 8]), box)
    truth = stand_in.mean(X)
    found = {name: [] for name in FITS}
    for k, unit in enumerate(units):
        sample = stand_in.pour(design.scale(unit, box), seeds, np.random.default_rng([seed, 7, k]))
        for name in FITS:
            predict = _fitted(name, sample, settings, seed + k)
            found[name].append(None if predict is None else _on_truth(truth, predict(X)[0]))
    sizes = {"points": len(units[0]), "seeds": seeds, "simulations": len(units[0]) * seeds}
    for name, scored in found.items():
        if None not in scored:
            yield from _rows(case | {"data": "emulated", "fit": name} | sizes, scored)


def _real(main, pool, fresh, settings, seed):
    """Rows of poured points: the main design, the pool's leading points, and parts of the pool drawn at random that
    trade points for seeds."""
    every = pool.values.shape[1]
    cases = [("designs", "main design", [main])]
    cases += [("designs", "Sobol sequence", [pool.take(np.arange(n))]) for n in SAMPLES if n < len(pool.X)]
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
            predicted = [_fitted(fit_name, one, settings, seed + k) for k, one in enumerate(sets)]
            if None in predicted:
                continue
            scored = [_on_fresh(fresh, predict(fresh.X)[0]) for predict in predicted]
            case = {"comparison": comparison, "design": name, "data": "real", "fit": fit_name}
            yield from _rows(case | sizes, scored)


def _fitted(name, sample, settings, seed):
    """A fit of FITS, None where the points are too many or too few for it."""
    if name == "Gaussian process" and len(sample.X) > LARGEST_PROCESS:
        return None
    return FITS[name](sample, settings, seed)


def _on_truth(truth, predicted):
    """R2 and root mean squared error by response, against means without noise."""
    return [
        {"explainable": r2(y, p), "rmse": float(np.sqrt(np.mean((y - p) ** 2)))}
        for y, p in zip(truth.T, predicted.T, strict=True)
    ]


def _on_fresh(fresh, predicted):
    """The same from noisy means, the noise taken off."""
    columns = zip(fresh.means().T, fresh.known_errors().T, predicted.T, strict=True)
    return [scores.accuracy(y, se, p) for y, se, p in columns]


def _rows(case, scored):
    """One row a response: mean and standard error over the repetitions."""
    for k, response in enumerate(RESPONSES):
        row = case | {"response": response, "repetitions": len(scored)}
        for key in ("explainable", "rmse"):
            row[key], row[f"{key}_se"] = scores.mean_and_error([one[k][key] for one in scored])
        yield row
