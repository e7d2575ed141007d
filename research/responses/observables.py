"""Possible observations: the responses of bench tests, and parameters that have a direct test."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import response
from repose.measure import further_responses
from research.responses import discrepancies, information
from research.responses.response_sets import minutes_of
from research.responses.responses_over_design import Data

PILE = "pile"


class Tests(NamedTuple):
    """Possible tests; k numbers in all, those of the responses before those of the parameters."""

    columns: dict[str, list[int]]  # columns of the numbers of each test
    minutes: dict[str, float]  # of an experimenter's work for each test
    covariance: np.ndarray  # (k, k), of the numbers about the model's predictions

    def of(self, chosen: Sequence[str]) -> list[int]:
        """Columns of several tests."""
        return [column for name in chosen for column in self.columns[name]]


def direct(name: str) -> str:
    """Name of the direct test of a parameter."""
    return f"direct {name}"


def tests_of(
    names: Sequence[str],
    of_responses: np.ndarray,
    space: ParameterSpace,
    settings: Mapping[str, Any],
) -> Tests:
    """The bench tests of some responses and the direct tests of the free parameters.

    `of_responses` (r, r) is the covariance of their observations about the surrogates' predictions; parameters are
    observed as places in their ranges. `settings` holds ``minutes`` by bench test, and ``direct_tests`` with ``sd`` and
    ``minutes`` by parameter. InputError if the minutes of a bench test are missing.
    """
    columns: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        test = response(name).apparatus
        columns.setdefault(
            PILE if test == further_responses.BENCH else test, []
        ).append(k)
    minutes = {test: minutes_of(test, settings["minutes"]) for test in columns}
    variances: list[float] = []
    for k, name in enumerate(space.free):
        if name not in settings["direct_tests"]:
            continue
        direct_test = settings["direct_tests"][name]
        columns[direct(name)] = [len(names) + len(variances)]
        minutes[direct(name)] = float(direct_test["minutes"])
        variances.append((direct_test["sd"] / (space.high[k] - space.low[k])) ** 2)
    covariance = np.zeros((len(names) + len(variances),) * 2)
    covariance[: len(names), : len(names)] = of_responses
    covariance[len(names) :, len(names) :] = np.diag(variances)
    return Tests(columns, minutes, covariance)


def with_parameters(prior: information.Prior, tested: Sequence[int]) -> None:
    """Add the places of the free parameters `tested` to the predictions of `prior`, in place."""
    prior.predicted = np.hstack([prior.predicted, prior.place[:, list(tested)]])


def discrepancy_of(
    data: Data, names: Sequence[str], settings: Mapping[str, Any]
) -> np.ndarray:
    """Covariance S_d (k, k) of the discrepancies of some responses.

    `settings` holds ``discrepancy_percent``, ``discrepancy_correlation`` and ``smallest_discrepancy``.
    """
    means = np.array([data.known[name].row["mean"] for name in names])
    sd = discrepancies.sizes(
        names, means, settings["discrepancy_percent"], settings["smallest_discrepancy"]
    )
    over_design = np.column_stack([data.known[name].mean for name in names])
    return discrepancies.covariance(
        names, sd, over_design, settings["discrepancy_correlation"]
    )
