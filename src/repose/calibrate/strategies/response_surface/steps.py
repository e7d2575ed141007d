"""The steps of the strategy `response_surface`, and the numbers of their samples.

Samples of the first step are numbered from 1001, of the second from 2001, and so on.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from repose.calibrate.designs.latin_hypercube import parameter_sets
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets
from repose.common.errors import InputError

STEPS = ("screening", "ascent", "surface", "check")
OF_A_STEP = 1000
# Before the name of a parameter: its column in coded units.
CODED = "coded_"


def samples(
    step: str,
    space: ParameterSpace,
    unit: np.ndarray,
    factors: Sequence[str],
    coded: np.ndarray,
) -> pd.DataFrame:
    """Make the table of the samples of a step.

    Parameters
    ----------
    step : str
        One of `STEPS`.
    space : ParameterSpace
    unit : numpy.ndarray, (n, d)
        The free parameters in the unit cube.
    factors : sequence of str
        The parameters that the step varies.
    coded : numpy.ndarray, (n, factors)
        The same samples in coded units.

    Returns
    -------
    pandas.DataFrame
        `sample`, the parameters, and the factors in coded units, whose names begin with
        `CODED`.
    """
    first = OF_A_STEP * (STEPS.index(step) + 1) + 1
    table = parameter_sets(unit, space, first)
    for name, column in zip(factors, np.asarray(coded).T, strict=True):
        table[CODED + name] = column
    return table


def factors_of(table: pd.DataFrame) -> tuple[str, ...]:
    """Return the parameters that a step varied, from its table of `samples`."""
    return tuple(name.removeprefix(CODED) for name in table if name.startswith(CODED))


def good_samples(table: pd.DataFrame, dataset: pd.DataFrame) -> pd.DataFrame:
    """Select the good samples of a step, with their responses.

    Parameters
    ----------
    table : pandas.DataFrame
        The samples of the step.
    dataset : pandas.DataFrame
        All samples with `status` and responses.

    Raises
    ------
    InputError
        If a sample is not in the dataset, or none is good.
    """
    missing = sorted(set(table["sample"]) - set(dataset["sample"]))
    if missing:
        raise InputError("runs", "sample", missing, "all samples of the step")
    coded = [CODED + name for name in factors_of(table)]
    joined = table[["sample", *coded]].merge(dataset, on="sample")
    good = joined[joined["status"] == "ok"].reset_index(drop=True)
    if good.empty:
        statuses = sorted(set(dataset["status"]))
        raise InputError("runs", "status", statuses, "at least one sample that is ok")
    return good


def scale_of(targets: Targets) -> np.ndarray:
    """Return the scale (k,) of the deviations from the targets.

    It is 100 % of each target over the root of its weight.
    """
    return targets.whole / np.sqrt(targets.weight)
