"""The pool: pours made once for all comparisons, at points to train on and at fresh ones to judge by.

Both sets are scrambled Sobol sequences, so a comparison that wants fewer points takes the first ones, and a larger
pool keeps those that were poured. The scramblings are independent of each other and of the main design.
"""

from pathlib import Path

from repose.chain import design
from repose.core.files import write_table

# Each set of points: what its files' names begin with, its size in the configuration, and its scrambling.
SETS = {"pool": ("", "samples", 0), "fresh": ("fresh_", "fresh_samples", 1)}


def run(space, settings, out_dir):
    """Write samples.csv and fresh_samples.csv (sample, the six parameters) to out_dir; return both by set.

    space: `ParameterSpace`; settings: the configuration's section `pool`.
    """
    tables = {}
    for name, (prefix, count, scrambling) in SETS.items():
        points = design.sobol(settings[count], space.dimensions, [settings["seed"], scrambling])
        table = design.parameter_sets(points, space)
        write_table(Path(out_dir) / f"{prefix}samples.csv", table, float_format="%.10g")
        tables[name] = table
    return tables
