"""Estimate the bias of predictions at parameter sets that a search has chosen.

This bias is called optimism, because these predictions are usually too favourable.

A fit to noisy pours is too high at some places and too low at others. The search
chooses places where the fit meets the targets. If the targets are near the edge of what
is possible, these are mostly places where the error of the fit helps, so the
predictions there are too favourable on average. This is known as the winner's curse.

The bootstrap (E79) shows by how much. For each replicate, the pours of each sample are
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


class Pours(NamedTuple):
    """Single pours of the samples of a fit.

    Attributes
    ----------
    X : numpy.ndarray, (n, d)
        The parameter sets.
    means : numpy.ndarray, (n, k)
        Mean responses of each sample.
    counts : list of numpy.ndarray, (n,)
        For each bench test, the number of pours of each sample.
    deviations : list of list of numpy.ndarray
        For each bench test and each sample, the deviations (pours, responses of the
        bench test) from which its pours are drawn. They are scaled up to the scatter of
        a single pour.
    columns : list of list of int
        For each bench test, the columns of its responses in `means`.
    noise : mapping
        Arguments of `Surrogate.fit` about the noise.
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
        """Collect the pours of the samples to which a surrogate was fitted.

        Parameters
        ----------
        surrogate : Surrogate
            Its attributes name the samples and the parameters.
        dataset : pandas.DataFrame
            A row for each sample: ``sample``, parameters, mean responses.
        runs : pandas.DataFrame
            The single runs of these samples.
        targets : Targets
            The targets of the study.

        Returns
        -------
        Pours or None
            None if the noise cannot be estimated (see `Replicates.estimate`).
        """
        samples = list(surrogate.samples)
        noise = Replicates.estimate(runs, samples, targets)
        if noise is None:
            return None
        fitted_samples = dataset.set_index("sample").loc[samples]
        good = runs[runs["status"] == "ok"]
        counts = []
        deviations = []
        columns = []
        # Each bench test has separate runs, so collect them one test at a time.
        for bench, columns_of_bench in targets.benches.items():
            names = [targets.names[k] for k in columns_of_bench]
            runs_of_bench = select_bench_runs(good, bench).groupby("sample")
            runs_by_sample = dict(list(runs_of_bench[names]))
            # An array (pours, responses) for each sample.
            responses = [runs_by_sample[sample].to_numpy(float) for sample in samples]
            counts.append(np.array([len(pours) for pours in responses]))
            deviations.append(_compute_deviations(responses))
            columns.append(list(columns_of_bench))
        return cls(
            X=fitted_samples[list(surrogate.inputs)].to_numpy(float),
            means=fitted_samples[list(targets.names)].to_numpy(float),
            counts=counts,
            deviations=deviations,
            columns=columns,
            noise=noise._asdict(),
        )

    def draw_means(self, random: np.random.Generator) -> np.ndarray:
        """Draw the pours of each sample again; return their means (n, k)."""
        means = self.means.copy()
        for columns, counts, deviations in zip(
            self.columns, self.counts, self.deviations, strict=True
        ):
            for sample, (count, sample_deviations) in enumerate(
                zip(counts, deviations, strict=True)
            ):
                drawn_deviations = sample_deviations[
                    random.integers(len(sample_deviations), size=count)
                ]
                means[sample, columns] += drawn_deviations.mean(axis=0)
        return means


def _compute_deviations(values: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Compute the deviations of the pours of each sample from its mean.

    The mean square of n pours about their own mean is on average (n - 1) / n of the
    variance of a pour, so the deviations are multiplied by sqrt(n / (n - 1)). A sample
    with a single pour shows no scatter, so it gets the deviations of all other samples.

    Parameters
    ----------
    values : sequence of numpy.ndarray, (pours, responses)
        The pours of each sample.

    Returns
    -------
    list of numpy.ndarray, (deviations, responses)
        One for each sample.
    """
    deviations = []
    for pours in values:
        count = len(pours)
        factor = np.sqrt(count / max(count - 1, 1))
        deviations.append(factor * (pours - pours.mean(axis=0)))
    pooled = np.concatenate([sample for sample in deviations if len(sample) > 1])
    return [sample if len(sample) > 1 else pooled for sample in deviations]


def estimate_optimism(
    surrogate: Surrogate,
    pours: Pours,
    search: SearchFunction,
    targets: Targets,
    *,
    replicates: int,
    seed: int,
) -> pd.DataFrame:
    """Estimate the expected optimism of predictions by bootstrap.

    Each replicate resamples the pours, refits the surrogate and repeats the search. The
    original fit takes the place of the unknown truth. The optimism is averaged over all
    parameter sets with the same role. A role says why the search found a set, such as
    "representative".

    Parameters
    ----------
    surrogate : Surrogate
        The original fit.
    pours : Pours
        The pours to which it was fitted.
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
        random = np.random.default_rng([seed, k])
        replicate = surrogate.refit(pours.X, pours.draw_means(random), **pours.noise)
        sets, roles = search(replicate)
        differences = replicate.predict(sets) - surrogate.predict(sets)
        # Average over the sets with the same role; there may be many feasible ones.
        for role in dict.fromkeys(roles):
            has_role = np.array([other == role for other in roles])
            mean = differences[has_role].mean(axis=0)
            differences_by_role.setdefault(role, []).append(mean)
    rows = []
    for role, differences_of_role in differences_by_role.items():
        rows += _make_rows(role, np.array(differences_of_role), targets)
    return pd.DataFrame(rows, columns=list(OPTIMISM_COLUMNS))


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
