"""Screening designs of Plackett and Burman: many main effects in few runs.

The designs follow from their printed generators, one line each, and tests compare them
with the printed tables.
"""

import numpy as np

# First row of each design (Plackett and Burman 1946).
GENERATORS = {
    8: "+++-+--",
    12: "++-+++---+-",
    16: "++++-+-++--+---",
    20: "++--++++-+-+----++-",
    24: "+++++-+-++--++--+-+----",
}


def plackett_burman(factors: int, runs: int) -> np.ndarray:
    """Make a Plackett-Burman design.

    The rows are the generator shifted by one place after another, and a last row of low
    levels. Plackett and Burman, The design of optimum multifactorial experiments,
    Biometrika 33 (1946) 305-325.

    Parameters
    ----------
    factors : int
        Fewer than the runs. The remaining columns are the dummy factors from which the
        analysis estimates the error.
    runs : int
        One of `GENERATORS`.

    Returns
    -------
    array (runs, factors)
        The runs in coded units: -1 or 1 for each factor.
    """
    generator = np.array([1.0 if sign == "+" else -1.0 for sign in GENERATORS[runs]])
    shifted = [np.roll(generator, shift) for shift in range(runs - 1)]
    design = np.vstack([*shifted, -np.ones(runs - 1)])
    return design[:, :factors]
