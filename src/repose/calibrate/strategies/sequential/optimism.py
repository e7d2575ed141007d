"""Estimate the optimism of the predicted answer of the strategy `sequential`.

The bootstrap is that of `repose.calibrate.optimism`. A replicate keeps the variance and
the lengths of the kriging model, and conditions it on other means of the samples.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.optimism import (
    REPRESENTATIVE_ROLE,
    ReplicateRuns,
    estimate_optimism,
    list_rows,
)
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.runs import split_by_bench, summarise_samples
from repose.calibrate.strategies.sequential.kriging import Kriging, SpaceKriging
from repose.calibrate.study import Study

# A replicate takes 0.1 s with 40 samples of six parameters, and 1 s with 250.
N_REPLICATES = 10

ChoosePoint = Callable[[Kriging], np.ndarray]


class RefittedKriging(SpaceKriging):
    """A kriging model as the bootstrap needs it: it learns other means of its samples.

    Attributes
    ----------
    inputs : tuple of str
        Names of the parameters.
    samples : tuple of int
        Numbers of the good samples, in the order of the fit.
    """

    def __init__(
        self, model: Kriging, space: ParameterSpace, samples: Sequence[int]
    ) -> None:
        super().__init__(model, space)
        self.inputs = space.names
        self.samples = tuple(samples)

    def refit(self, X: np.ndarray, Y: np.ndarray, **noise: Any) -> "RefittedKriging":
        """Return a copy that has learned other means Y (n, k) of its samples.

        The parameter sets and the noise are those of the model, so the other arguments
        are ignored.
        """
        return RefittedKriging(self.model.refit(Y), self.space, self.samples)


def estimate_optimism_of_answer(
    study: Study, data: pd.DataFrame, model: Kriging, choose_point: ChoosePoint
) -> list[dict[str, Any]]:
    """Estimate by how much the prediction of the answer is too favourable.

    Parameters
    ----------
    study : Study
        The study.
    data : pandas.DataFrame
        All runs.
    model : Kriging
        The model of these runs.
    choose_point : callable
        It maps a model to the answer (d,) in the unit cube that the strategy would
        choose by it.

    Returns
    -------
    list of dict
        A row for each response, as `repose.calibrate.optimism.estimate_optimism`
        returns it. It is empty if the noise cannot be estimated, because too few
        samples have two runs.
    """
    space = study.parameters
    table = summarise_samples(data, space, study.targets)
    good = table[table["status"] == "ok"]
    if len(good) != len(model.centred_points):
        return []
    refitted: Any = RefittedKriging(model, space, good["sample"].tolist())
    runs = ReplicateRuns.collect(
        refitted, table, split_by_bench(data, study.targets), study.targets
    )
    if runs is None:
        return []

    def search(replicate: Any) -> tuple[np.ndarray, Sequence[str]]:
        point = choose_point(replicate.model)
        return space.values(point[None]), [REPRESENTATIVE_ROLE]

    optimism = estimate_optimism(
        refitted,
        runs,
        search,
        study.targets,
        replicates=N_REPLICATES,
        seed=study.settings.design.seed,
    )
    return list_rows(optimism)
