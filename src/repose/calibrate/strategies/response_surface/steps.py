"""Steps of the response surface strategy, and how their samples are numbered: 1001 and on, 2001 and on, ..."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from repose.calibrate.designs.latin_hypercube import parameter_sets
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets
from repose.common.errors import require

STEPS = ("screening", "ascent", "surface", "check")
OF_A_STEP = 1000
CODED = "coded_"  # before a parameter's name: its column in coded units


def samples(
    step: str,
    space: ParameterSpace,
    unit: np.ndarray,
    factors: Sequence[str],
    coded: np.ndarray,
) -> pd.DataFrame:
    """Make the samples of a step: `sample`, the parameters, and the factors in coded units (`CODED` + name).

    `unit` (n, d) has the free parameters in the unit cube, `coded` (n, factors) the same runs in coded units.
    """
    table = parameter_sets(unit, space, OF_A_STEP * (STEPS.index(step) + 1) + 1)
    for name, column in zip(factors, np.asarray(coded).T, strict=True):
        table[CODED + name] = column
    return table


def factors_of(table: pd.DataFrame) -> tuple[str, ...]:
    """Return the parameters that a step varied, from its table of `samples`."""
    return tuple(name.removeprefix(CODED) for name in table if name.startswith(CODED))


def usable(table: pd.DataFrame, dataset: pd.DataFrame) -> pd.DataFrame:
    """Select the samples of a step whose pours gave a pile, with their responses.

    InputError if a sample is not in the dataset, or none is usable.
    """
    missing = sorted(set(table["sample"]) - set(dataset["sample"]))
    require(not missing, "runs", "sample", missing, "all samples of the step")
    joined = table[
        ["sample", *(name for name in table if name.startswith(CODED))]
    ].merge(dataset, on="sample")
    good = joined[joined["status"] == "ok"].reset_index(drop=True)
    require(
        not good.empty,
        "runs",
        "status",
        sorted(set(dataset["status"])),
        "at least one sample that is ok",
    )
    return good


def scale_of(targets: Targets) -> np.ndarray:
    """Return the scale (responses,) of the misses: 100 % of each target over the root of its weight."""
    return targets.whole / np.sqrt(targets.weight)
