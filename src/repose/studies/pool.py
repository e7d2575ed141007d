"""The pool: pours made once for all comparisons, at points to train on and at fresh ones to judge by.

Both sets are scrambled Sobol sequences, so a comparison that wants fewer points takes the first ones, and a larger
pool keeps those that were poured. The scramblings are independent of each other and of the main design.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from repose.chain import design
from repose.core.parameters import PARAMETERS

# Each set of points: what its files' names begin with, its size in the configuration, and its scrambling.
SETS = {"pool": ("", "samples", 0), "fresh": ("fresh_", "fresh_samples", 1)}


def run(ranges, settings, out_dir):
    """Write samples.csv and fresh_samples.csv (sample, the six parameters) to out_dir; return both by set.

    ranges: dict parameter -> (low, high); settings: the configuration's section `pool`. Raises InputError for
    bad ranges.
    """
    design.check_ranges(ranges)
    out_dir = Path(out_dir)
    out_dir.mkdir(parents=True, exist_ok=True)
    tables = {}
    for name, (prefix, count, scrambling) in SETS.items():
        points = design.sobol(settings[count], len(PARAMETERS), [settings["seed"], scrambling])
        values = design.scale(points, [ranges[parameter] for parameter in PARAMETERS])
        table = pd.DataFrame(values, columns=list(PARAMETERS))
        table.insert(0, "sample", np.arange(1, len(table) + 1))
        table.to_csv(out_dir / f"{prefix}samples.csv", index=False, float_format="%.10g")
        tables[name] = table
    return tables
