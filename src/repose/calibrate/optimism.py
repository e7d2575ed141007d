"""Estimate the bias of predictions at parameter sets that a search has chosen.

This bias is called optimism, because these predictions are usually too favourable.

A fit to noisy runs is too high at some points and too low at others. The search chooses
points where the fit meets the targets. If the targets are near the edge of what is
possible, these are mostly points where the error of the fit helps, so the predictions
there are too favourable on average. This is known as the winner's curse.

The bootstrap (E79) shows by how much. For each replicate, the runs of each sample are
drawn again, the surrogate is fitted again, and the search is repeated. The original fit
takes the place of the unknown truth. The optimism of a replicate is its prediction
minus that of the original fit, at the parameter sets that the replicate found.

  (E79)  Efron 1979, Bootstrap methods: another look at the jackknife, Annals of
         Statistics 7
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from repose.calibrate.inversion import invert
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.runs import select_bench_runs
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.calibrate.training import Replicates

# Function of a surrogate that returns the parameter sets (n, d) found and their roles.
SearchFunction = Callable[[Surrogate], tuple[np.ndarray, Sequence[str]]]
REPRESENTATIVE_ROLE = "representative"
# Largest number of rounds of the search in a replicate, which saves time.
MAX_ROUNDS = 20
OPTIMISM_COLUMNS = ("role", "response", "optimism", "optimism_se", "replicates")


class ReplicateRuns(NamedTuple):
    """Single runs of the samples of a fit; a sample has several, with other seeds.

    Attributes
    ----------
    X : numpy.ndarray, (n, d)
        The parameter sets.
    means : numpy.ndarray, (n, k)
        Mean responses of each sample.
    counts : list of numpy.ndarray, (n,)
        For each bench test, the number of runs of each sample.
    deviations : list of list of numpy.ndarray
        For each bench test and each sample, the deviations (runs, responses of the
        bench test) from which its runs are drawn. They are scaled up to the scatter of
        a single run.
    columns : list of list of int
        For each bench test, the columns of its responses in `means`.
    noise : mapping
        The arguments of `Surrogate.fit` that describe the noise.

    The lists `counts`, `deviations` and `columns` have the bench tests in the same
    order.
    """

    X: np.ndarray
    means: np.ndarray
    counts: list[np.ndarray]
    deviations: list[list[np.ndarray]]
    columns: list[list[int]]
    noise: Mapping[str, Any]

    @classmethod
    def collect(
        cls,
        surrogate: Surrogate,
        dataset: pd.DataFrame,
        runs: pd.DataFrame,
        targets: Targets,
    ) -> Self | None:
        """Collect the runs of the samples to which a surrogate was fitted.

        Parameters
        ----------
        surrogate : Surrogate
            The surrogate, which knows the numbers of its samples and the names of its
            parameters.
        dataset : pandas.DataFrame
            A row for each sample: ``sample``, parameters, mean responses.
        runs : pandas.DataFrame
            The single runs of these samples.
        targets : Targets
            The targets of the study.

        Returns
        -------
        ReplicateRuns or None
            None if the noise cannot be estimated (see `Replicates.estimate`).
        """
        samples = list(surrogate.samples)
        noise = Replicates.estimate(runs, samples, targets)
        if noise is None:
            return None
        fitted_samples = dataset.set_index("sample").loc[samples]
        good_runs = runs[runs["status"] == "ok"]
        counts = []
        deviations = []
        columns = []
        # Each bench test has separate runs, so collect them one test at a time.
        for bench_test, columns_of_bench_test in targets.benches.items():
            names = [targets.names[k] for k in columns_of_bench_test]
            grouped = select_bench_runs(good_runs, bench_test).groupby("sample")[names]
            # Iterating over the groups gives pairs of sample and table of its runs.
            runs_of_sample = dict(list(grouped))
            # An array (runs, responses) for each sample.
            responses = [runs_of_sample[sample].to_numpy(float) for sample in samples]
            counts.append(np.array([len(values) for values in responses]))
            deviations.append(_compute_deviations(responses))
            columns.append(list(columns_of_bench_test))
        return cls(
            X=fitted_samples[list(surrogate.inputs)].to_numpy(float),
            means=fitted_samples[list(targets.names)].to_numpy(float),
            counts=counts,
            deviations=deviations,
            columns=columns,
            noise=noise._asdict(),
        )

    def draw_means(self, rng: np.random.Generator) -> np.ndarray:
        """Draw the runs of each sample again, with replacement; return their means (n, k).

        A change of the order of the draws would change the results of a seed.
        """
        means = self.means.copy()
        for columns, counts, deviations in zip(
            self.columns, self.counts, self.deviations, strict=True
        ):
            for sample, (count, sample_deviations) in enumerate(
                zip(counts, deviations, strict=True)
            ):
                drawn_deviations = sample_deviations[
                    rng.integers(len(sample_deviations), size=count)
                ]
                means[sample, columns] += drawn_deviations.mean(axis=0)
        return means


def _compute_deviations(values: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Compute the deviations of the runs of each sample from its mean.

    The mean square of n runs about their own mean is on average (n - 1) / n of the
    variance of a run, so the deviations are multiplied by sqrt(n / (n - 1)). A sample
    with a single run shows no scatter, so it gets the deviations of all samples with
    several runs. There must be at least one such sample.

    Parameters
    ----------
    values : sequence of numpy.ndarray, (runs, responses)
        The responses of the runs of each sample.

    Returns
    -------
    list of numpy.ndarray, (deviations, responses)
        One array for each sample. It has as many rows as the sample has runs, or more
        if these are the deviations of other samples.
    """
    deviations_of_samples = []
    for runs in values:
        n_runs = len(runs)
        factor = np.sqrt(n_runs / max(n_runs - 1, 1))
        deviations_of_samples.append(factor * (runs - runs.mean(axis=0)))
    pooled = np.concatenate(
        [deviations for deviations in deviations_of_samples if len(deviations) > 1]
    )
    return [
        deviations if len(deviations) > 1 else pooled
        for deviations in deviations_of_samples
    ]


def estimate_optimism(
    surrogate: Surrogate,
    runs: ReplicateRuns,
    search: SearchFunction,
    targets: Targets,
    *,
    replicates: int,
    seed: int,
) -> pd.DataFrame:
    """Estimate by how much predictions are too favourable, by bootstrap.

    Each replicate resamples the runs, refits the surrogate and repeats the search. As
    the truth is unknown, the prediction of the replicate is compared with that of the
    original fit. Their difference, the optimism, is averaged over all parameter sets
    with the same role. A role says why the search found a set, such as
    "representative".

    Parameters
    ----------
    surrogate : Surrogate
        The original fit.
    runs : ReplicateRuns
        The runs to which it was fitted.
    search : callable
        It maps a surrogate to the parameter sets (n, d) that it finds, and their n
        roles.
    targets : Targets
        The targets of the study.
    replicates : int
        Number of refits, at least 2.
    seed : int
        Replicate k draws from default_rng([seed, k]).

    Returns
    -------
    pandas.DataFrame
        A row for each role and response, with the `OPTIMISM_COLUMNS`. The optimism of a
        replicate is its prediction minus that of the original fit, in the units of the
        response. The row has the mean over the replicates, and its standard error.
    """
    differences_by_role: dict[str, list[np.ndarray]] = {}
    for k in range(replicates):
        rng = np.random.default_rng([seed, k])
        # `runs.noise` has the weights of the samples and the covariance of the noise,
        # which are those of the original fit.
        replicate = surrogate.refit(runs.X, runs.draw_means(rng), **runs.noise)
        parameter_sets, roles = search(replicate)
        differences = replicate.predict(parameter_sets) - surrogate.predict(
            parameter_sets
        )
        # Average over the sets with the same role; there may be many feasible ones.
        for role in dict.fromkeys(roles):
            has_role = np.array([role_of_set == role for role_of_set in roles])
            mean = differences[has_role].mean(axis=0)
            differences_by_role.setdefault(role, []).append(mean)
    rows = []
    for role, differences_of_role in differences_by_role.items():
        rows += _make_rows(role, np.array(differences_of_role), targets)
    return pd.DataFrame(rows, columns=list(OPTIMISM_COLUMNS))


def list_rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    """List the rows of `estimate_optimism`, for the notes of an answer.

    pandas allows any type as a column name, but JSON only text.
    """
    return [
        {str(key): value for key, value in row.items()}
        for row in table.to_dict("records")
    ]


def _make_rows(
    role: str, differences: np.ndarray, targets: Targets
) -> list[tuple[str, str, float, float, int]]:
    """Make a row for each response, from the differences (replicates, k) of a role.

    The fields of a row are `OPTIMISM_COLUMNS`.
    """
    n_replicates, n_responses = differences.shape
    errors = np.full(n_responses, np.nan)
    if n_replicates > 1:
        errors = differences.std(axis=0, ddof=1) / np.sqrt(n_replicates)
    means = differences.mean(axis=0)
    return [
        (role, name, mean, error, n_replicates)
        for name, mean, error in zip(targets.names, means, errors, strict=True)
    ]


def shorten_search(settings: MigaSettings) -> MigaSettings:
    """Return settings of a search with at most `MAX_ROUNDS` rounds."""
    rounds = min(MAX_ROUNDS, settings.rounds)
    return settings.model_copy(update={"rounds": rounds})


def make_representative_search(
    space: ParameterSpace,
    targets: Targets,
    settings: MigaSettings,
    support: Support | None = None,
) -> SearchFunction:
    """Make a function that searches briefly and returns only the representative set.

    `support` is the region of the samples, as in `invert`.
    """

    def search(surrogate: Surrogate) -> tuple[np.ndarray, Sequence[str]]:
        found = invert(surrogate, space, targets, shorten_search(settings), support)
        solutions = found.solutions
        chosen = solutions[solutions["representative"]]
        return chosen[list(space.names)].to_numpy(float), [REPRESENTATIVE_ROLE]

    return search
