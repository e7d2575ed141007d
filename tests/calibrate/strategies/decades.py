"""A simulator whose first parameter acts over decades, and studies of it.

The formula stands for a cohesive pile: both responses rise with the logarithm of the
surface energy gamma above 1e-3 J/m2, and with the friction mu.
"""

import numpy as np

import repose

DECADES = (1e-4, 1.0)  # range of gamma: four decades
FRICTIONS = (0.1, 0.9)
NOISE = 0.01  # of a run, as a share of the response
SCATTER = 0.02  # of a measurement, likewise
REPETITIONS = 10


def responses(gamma, mu):
    logarithm = np.log10(1 + gamma / 1e-3)
    return np.array([25 + 20 * mu + 6 * logarithm, 40 + 25 * mu + 2 * logarithm])


def hidden_truth(random):
    """Draw a hidden truth from the prior: gamma even in its logarithm, and mu."""
    low, high = np.log(DECADES)
    return {
        "gamma": float(np.exp(random.uniform(low, high))),
        "mu": float(random.uniform(*FRICTIONS)),
    }


def study_of(truth, gamma, random, seed=0, **sections):
    """Make a study whose targets were measured at a truth; `gamma` is its entry."""
    means = responses(**truth)
    error = SCATTER / np.sqrt(REPETITIONS)
    measured = means * (1 + error * random.standard_normal(2))
    targets = {
        name: (value, SCATTER * value, REPETITIONS)
        for name, value in zip(("angle", "height"), measured.tolist(), strict=True)
    }
    parameters = {"gamma": gamma, "mu": FRICTIONS}
    return repose.Study(parameters, targets, seed=seed, **sections)


def simulator(random):
    def simulate(run):
        means = responses(run["gamma"], run["mu"])
        angle, height = means * (1 + NOISE * random.standard_normal(2))
        return {"angle": angle, "height": height}

    return simulate


def is_inside(calibration, truth):
    """Return which parameters of a truth lie in the 95 % interval of the answer."""
    return {
        name: bool(interval["low"] <= truth[name] <= interval["high"])
        for name, interval in calibration.intervals.items()
    }
