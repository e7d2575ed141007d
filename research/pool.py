"""The pool: points simulated once for all comparisons, some for training and fresh ones for tests.

Both sets are scrambled Sobol sequences, so a comparison that wants fewer points takes the first ones, and a larger
pool keeps those that were simulated. The scramblings are independent of each other and of the main design.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import qmc

from repose.calibrate.designs import latin_hypercube as design
from repose.calibrate.parameter_space import ParameterSpace
from repose.common.files import write_table
from research.script import Script


class PointSet(NamedTuple):
    """A set of points."""

    prefix: str  # of the names of its files
    size: str  # key of its size in the section `pool`
    scrambling: int  # number of the scrambling of its Sobol sequence


SETS = {
    "pool": PointSet("", "samples", 0),
    "fresh": PointSet("fresh_", "fresh_samples", 1),
}


def sobol(n: int, d: int, seed: int | list[int]) -> np.ndarray:
    """First points (n, d) of a scrambled Sobol sequence; a longer one of the same seed begins with them."""
    sequence = qmc.Sobol(d, scramble=True, rng=np.random.default_rng(seed))
    return sequence.random_base2(math.ceil(math.log2(n)))[:n]


def points_of(
    name: str, space: ParameterSpace, settings: Mapping[str, Any]
) -> pd.DataFrame:
    """Points of a set of `SETS`: ``sample`` from 1, and the six parameters; `settings` is the section `pool`."""
    chosen = SETS[name]
    unit = sobol(
        settings[chosen.size], space.dimensions, [settings["seed"], chosen.scrambling]
    )
    return design.tabulate_parameter_sets(unit, space)


def run(
    space: ParameterSpace, settings: Mapping[str, Any], out_dir: str | Path
) -> dict[str, pd.DataFrame]:
    """Write samples.csv and fresh_samples.csv; return both tables by set."""
    tables = {name: points_of(name, space, settings) for name in SETS}
    for name, table in tables.items():
        write_table(
            Path(out_dir) / f"{SETS[name].prefix}samples.csv",
            table,
            float_format="%.10g",
        )
    return tables


script = Script("pool", __doc__)


@script.part("points", "results/pool")
def choose(args, config):
    """Choose the points, for training and for testing."""
    run(args.study.parameters, config["pool"], args.out)


if __name__ == "__main__":
    script.run()
