"""Screening designs of Plackett and Burman: many main effects in few runs.

Each design follows from its printed generator, which is a single line. Tests compare
the designs with the printed tables.
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

    Each row is the previous one shifted by one place, beginning with the generator. The
    last row has all factors at their low levels. The source is Plackett and Burman, The
    design of optimum multifactorial experiments, Biometrika 33 (1946) 305-325.

    Parameters
    ----------
    factors : int
        Number of factors, smaller than the number of runs. The remaining columns are
        the dummy factors from which the analysis estimates the error.
    runs : int
        Number of runs, one of the keys of `GENERATORS`.

    Returns
    -------
    array (runs, factors)
        The runs in coded units: -1 or 1 for each factor.
    """
    generator = np.array([1.0 if sign == "+" else -1.0 for sign in GENERATORS[runs]])
    shifted = [np.roll(generator, shift) for shift in range(runs - 1)]
    design = np.vstack([*shifted, -np.ones(runs - 1)])
    return design[:, :factors]
