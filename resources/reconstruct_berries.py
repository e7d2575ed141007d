"""Makes berries.csv and compression.csv, which stand in for raw data that were never published.

    PYTHONPATH=src python resources/reconstruct_berries.py

Sizes: each axis takes the normal scores of 50 berries, its ends set to the published maximum and minimum
and its mean to the published one, all on the table's grid of 0.01 mm. Which values belong to one berry is
then found by annealing: exchanges within an axis, and small shifts that keep its mean, until equivalent
diameter and sphericity, which depend on nothing else, come as close to Table 1 as they can.

Compression: six berries of plausible size and strain; the forces and lengths are set so that the means of
Eq. 2 and Eq. 3 are the published moduli.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.stats import norm

from repose.grain.berry import SIZE_COLUMNS, elastic_modulus, poisson_ratio

HERE = Path(__file__).parent
BERRIES = 50
SEED = 2026
STEPS = 300_000
ELASTIC_MODULUS_PA = 1.1352e5
POISSON_RATIO = 0.32


def normal_axis(maximum, minimum, mean):
    """Fifty increasing hundredths of a millimetre, normally distributed, with exactly these statistics."""
    ends = np.array([round(100 * minimum), round(100 * maximum)])
    scores = norm.ppf((np.arange(1, BERRIES + 1) - 0.375) / (BERRIES + 0.25))
    spread = min(100 * (maximum - mean), 100 * (mean - minimum)) / scores[-2]
    total = round(100 * mean * BERRIES)

    def inner(shift):
        return np.clip(
            100 * mean + shift + spread * scores[1:-1], ends[0] + 1, ends[1] - 1
        )

    shift = brentq(lambda s: inner(s).sum() + ends.sum() - total, -500, 500)
    values = np.concatenate([[ends[0]], np.rint(inner(shift)), [ends[1]]]).astype(int)
    # What rounding left over goes, a hundredth each, to the berries in the middle.
    rest = total - values.sum()
    middle = BERRIES // 2 - abs(rest) // 2
    values[middle : middle + abs(rest)] += np.sign(rest)
    return values


def derived(sizes):
    """(maximum, minimum, mean) of equivalent diameter in mm, then of sphericity in percent."""
    diameter = np.cbrt(sizes.prod(axis=1)) / 100
    percent = 1e4 * diameter / sizes[:, 0]
    return np.array(
        [f(x) for x in (diameter, percent) for f in (np.max, np.min, np.mean)]
    )


def pair_axes(axes, target, rng):
    """Anneal which values belong to one berry; axes (50, 3) in hundredths of a millimetre.

    In the second half two values of an axis may also move by a few hundredths, in opposite directions,
    which keeps the mean; the ends never move, and stay the only ones of their size.
    """
    sizes = axes.copy()
    lowest, highest = axes.min(axis=0), axes.max(axis=0)

    def misfit(candidate):
        """What is left of the differences from Table 1 beyond its rounding, in units of its last digit."""
        return np.maximum(np.abs(100 * (derived(candidate) - target)) - 0.4, 0).sum()

    current = misfit(sizes)
    best, best_sizes = current, sizes.copy()
    for step in range(STEPS):
        temperature = 30.0 * 1e-3 ** (step / STEPS)
        column = rng.integers(3)
        pair = rng.choice(BERRIES, size=2, replace=False)
        before = sizes[pair, column]
        if 2 * step > STEPS and rng.random() < 0.5:
            after = before + rng.integers(1, 6) * np.array([1, -1])
            ends = lowest[column], highest[column]
            fixed = (
                np.isin(before, ends).any()
                or after.min() <= ends[0]
                or after.max() >= ends[1]
            )
        else:
            after, fixed = before[::-1].copy(), False
        sizes[pair, column] = after
        ordered = not fixed and np.all(np.diff(sizes[pair], axis=1) <= 0)
        trial = misfit(sizes) if ordered else np.inf
        if trial <= current or rng.random() < np.exp((current - trial) / temperature):
            current = trial
            if current < best:
                best, best_sizes = current, sizes.copy()
        else:
            sizes[pair, column] = before
    return best_sizes


def reconstruct_sizes(table1, rng):
    """Fifty berries, (50, 3) in hundredths of a millimetre."""
    table1 = table1.set_index("dimension")
    axes = np.stack(
        [
            normal_axis(*table1.loc[name, ["maximum", "minimum", "mean"]])
            for name in SIZE_COLUMNS
        ],
        axis=1,
    )
    target = table1.loc[
        ["equivalent_diameter_mm", "sphericity_percent"], ["maximum", "minimum", "mean"]
    ]
    sizes = pair_axes(axes, target.to_numpy(dtype=float).ravel(), rng)
    return rng.permutation(sizes)


def reconstruct_compression(sizes_mm, rng):
    """Six tests on the berries nearest to the mean size; columns as `repose.grain.berry.read_compression` wants."""
    nearest = np.argsort(np.abs(sizes_mm / sizes_mm.mean(axis=0) - 1).sum(axis=1))[:6]
    length, breadth, width = sizes_mm[nearest].T
    strain = np.round(rng.uniform(0.08, 0.12, 6), 3)
    width_2 = np.round(width * (1 - strain), 2)
    nu = POISSON_RATIO + rng.normal(0, 0.015, 6)
    length_2 = np.round(length * (1 + nu * (1 - width_2 / width)), 2)
    # The last test's length sets the mean of nu as near as the 0.01 mm grid allows.
    measured = poisson_ratio(length, length_2, width, width_2)
    nu_last = 6 * POISSON_RATIO - measured[:-1].sum()
    length_2[-1] = np.round(
        length[-1] * (1 + nu_last * (1 - width_2[-1] / width[-1])), 2
    )
    elastic = ELASTIC_MODULUS_PA * (1 + rng.normal(0, 0.08, 6))
    per_newton = elastic_modulus(
        1.0, length * 1e-3, breadth * 1e-3, width * 1e-3, width_2 * 1e-3
    )
    force = np.round(elastic / per_newton, 4)
    elastic_last = 6 * ELASTIC_MODULUS_PA - (force * per_newton)[:-1].sum()
    force[-1] = np.round(elastic_last / per_newton[-1], 4)
    columns = {
        "test": np.arange(1, 7),
        "force_n": force,
        "length_1_mm": length,
        "length_2_mm": length_2,
        "width_1_mm": width,
        "width_2_mm": width_2,
        "breadth_mm": breadth,
    }
    return pd.DataFrame(columns)


def main():
    """Write both files beside this one."""
    rng = np.random.default_rng(SEED)
    sizes_mm = (
        reconstruct_sizes(pd.read_csv(HERE / "published" / "table1.csv"), rng) / 100
    )
    with (HERE / "berries.csv").open("w") as file:
        file.write(
            "# reconstruction: these 50 berries were not measured. reconstruct_berries.py made them so that\n"
            "# maximum, minimum and mean of the three axes equal the published Table 1 and equivalent\n"
            "# diameter and sphericity come as close to it as they can. Put your own measurements here.\n"
        )
        pd.DataFrame(sizes_mm, columns=list(SIZE_COLUMNS)).to_csv(
            file, index=False, float_format="%.2f"
        )
    with (HERE / "compression.csv").open("w") as file:
        file.write(
            "# reconstruction: these six tests were not measured. reconstruct_berries.py made them so that\n"
            "# the mean elastic modulus and Poisson's ratio by Eq. 2 and 3 equal the published values.\n"
            "# The load acts along the width, the minor diameter; 1 is before the load, 2 at the critical\n"
            "# deformation; breadth is the major diameter.\n"
        )
        reconstruct_compression(sizes_mm, rng).to_csv(file, index=False)


if __name__ == "__main__":
    main()
