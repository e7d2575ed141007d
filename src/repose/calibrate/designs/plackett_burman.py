"""Screening designs of Plackett and Burman: the main effects of many factors from few runs.

The designs follow from their printed generators, one line each, and tests compare them with the printed tables.
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
    """Make a Plackett-Burman design (runs, factors) of -1 and 1; there are more runs than factors.

    Plackett and Burman, The design of optimum multifactorial experiments, Biometrika 33 (1946) 305-325. The remaining
    columns are the dummy factors from which the analysis estimates the error.
    """
    first = np.array([1.0 if sign == "+" else -1.0 for sign in GENERATORS[runs]])
    return np.vstack(
        [*(np.roll(first, shift) for shift in range(runs - 1)), -np.ones(runs - 1)]
    )[:, :factors]
