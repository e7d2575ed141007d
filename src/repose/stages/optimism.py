"""The stage `optimism`: estimate by how much the predictions are too favourable."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from repose.calibrate.inversion import invert
from repose.calibrate.optimism import (
    OPTIMISM_COLUMNS,
    ReplicateRuns,
    SearchFunction,
    estimate_optimism,
    shorten_search,
)
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.surrogates import Surrogate, load
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.common.files import StrPath, write_table
from repose.stages.tables import read_dataset, read_runs
from repose.stages.validate import select_for_validation


def make_repeated_search(
    parameters: ParameterSpace,
    targets: Targets,
    settings: MigaSettings,
    count: int,
    support: Support | None = None,
) -> SearchFunction:
    """Make a function that repeats a shortened search with another surrogate.

    Parameters
    ----------
    parameters : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    settings : MigaSettings
        Settings of the whole search. A repetition makes only a few of its rounds.
    count : int
        Number of sets besides the representative one.
    support : Support, optional
        Region of the samples, as in the search. Without it, the whole ranges count as
        covered.

    Returns
    -------
    callable
        It maps a surrogate to the sets that would be simulated again (M, P), and to the
        role of each set.
    """

    def search(surrogate: Surrogate) -> tuple[np.ndarray, Sequence[str]]:
        solutions = invert(
            surrogate, parameters, targets, shorten_search(settings), support
        ).solutions
        selected = select_for_validation(solutions, count, parameters)
        sets = selected[list(parameters.names)].to_numpy(float)
        return sets, selected["role"].tolist()

    return search


def write_optimism(
    surrogate_json: StrPath,
    dataset_csv: StrPath,
    runs_csv: StrPath,
    out_csv: StrPath,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    settings: MigaSettings,
    n_solutions: int,
    parameter_names: Sequence[str] | None = None,
) -> pd.DataFrame:
    """Estimate how optimistic the predictions of a search are, and write the result.

    A search chooses parameter sets whose predictions are favourable. The predictions of
    these sets are therefore too favourable on average. Their bias is called optimism.

    Parameters
    ----------
    surrogate_json : path
        The surrogate that the stage `network` has written.
    dataset_csv, runs_csv : path
        The samples that it was trained on, and their single runs.
    out_csv : path
        The table to write.
    parameters : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    settings : MigaSettings
        The section `miga`.
    n_solutions : int
        Number of parameter sets that are simulated again besides the representative
        one, which is the answer. The optimism of all these sets is estimated.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    pandas.DataFrame
        Result of `repose.calibrate.optimism.estimate_optimism`. It is empty if no
        sample has two runs, or if `miga.replicates` is 0.
    """
    surrogate = load(surrogate_json, targets.names)
    dataset = read_dataset(dataset_csv, targets, parameter_names)
    runs = read_runs(runs_csv, targets, dataset, dataset_csv)
    # Collect the runs to which the surrogate was fitted. If no sample has two runs,
    # their scatter is unknown, and `replicate_runs` is None.
    replicate_runs = ReplicateRuns.collect(surrogate, dataset, runs, targets)
    if replicate_runs is None or settings.replicates == 0:
        table = pd.DataFrame(columns=list(OPTIMISM_COLUMNS))
    else:
        search = make_repeated_search(
            parameters,
            targets,
            settings,
            count=n_solutions,
            # The region that the samples cover, which limits the search.
            support=Support.from_dataset(dataset_csv, parameters),
        )
        table = estimate_optimism(
            surrogate,
            replicate_runs,
            search,
            targets,
            replicates=settings.replicates,
            seed=settings.seed,
        )
    write_table(Path(out_csv), table)
    return table
