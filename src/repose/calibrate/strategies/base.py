"""A strategy: from the runs so far to the samples to simulate next, or to the answer.

To add a strategy, write a subclass of `Strategy` in a module of its own, put
`@register("its_name")` above it, and import the module in
`repose.calibrate.strategies`. Then the configuration knows the name, and `repose.Study`
and the workflow follow it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.common.errors import InputError
from repose.common.section import Contradictions, Section

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.study import Study
    from repose.calibrate.surrogates.base import Predictor

# The type of the section of a strategy; None for one without a section.
SectionType = TypeVar("SectionType", bound=Section | None)
# Purpose, number of samples, and runs of each; for runs that check an answer,
# `CheckRuns`.
Pours = tuple[tuple[str, int, int], ...]
# Explanation for an answer that is given before the strategy has ended.
SO_FAR = "more runs may give a better answer"


class CheckRuns(NamedTuple):
    """Runs that check an answer; all other runs of a strategy look for it."""

    purpose: str
    n_sets: int
    n_seeds: int


@dataclass(frozen=True)
class Batch:
    """Samples to simulate next.

    Attributes
    ----------
    samples : pandas.DataFrame
        `sample` (its number), a column for each parameter, and `seeds`, the number of
        runs of the sample. A strategy may add columns.
    notes : mapping
        Further results of the strategy, by name: tables, and what JSON can hold. `why`
        is a sentence; `row` is the row of this proposal in the workflow's table of
        batches, a mapping.
    """

    samples: "pd.DataFrame"
    notes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Answer:
    """The parameters that meet the targets.

    Attributes
    ----------
    values : numpy.ndarray, (p,)
        All parameters, in the order of the study.
    mean : numpy.ndarray, (k,)
        Their predicted responses.
    covariance : numpy.ndarray, (k, k)
        Covariance of these predictions.
    probability : dict
        Probabilities that the simulator's means lie `within_1_percent` and
        `within_2_percent` of all targets, and `inside` all ranges.
    samples : pandas.DataFrame
        The answer as the table of a `Batch`, to simulate it again.
    why : str
        Reason why the strategy asks for no more runs.
    others : numpy.ndarray, (n, p)
        Further parameter sets that are predicted inside all ranges, the best first.
    others_mean : numpy.ndarray, (n, k)
        Their predicted responses.
    model : Predictor or None
        The model over the whole ranges; None if the strategy has none.
    notes : mapping
        As in `Batch`. The workflow writes those that `Strategy.files` names. It puts
        `summary`, a mapping, into the summary of the answer; `steps`, sentences, into
        the report; and `note`, a sentence, behind the message. `check` is a table in
        place of the ordinary `check.csv`.
    simulated : tuple of int
        Numbers of the samples in the last batch that already simulated the answer. If
        there are none, `samples` are simulated to check it.
    """

    values: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    probability: dict[str, float]
    samples: "pd.DataFrame"
    why: str
    others: np.ndarray
    others_mean: np.ndarray
    model: "Predictor | None" = None
    notes: Mapping[str, Any] = field(default_factory=dict)
    simulated: tuple[int, ...] = ()

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the predicted responses, (k,)."""
        return np.sqrt(np.diagonal(self.covariance))


class Strategy(ABC, Generic[SectionType]):
    """A way to calibrate.

    Attributes
    ----------
    name : str
        Name of the strategy in the configuration; set by `register`.
    settings : type of Section or None
        Model of the section with the strategy's name; None for a strategy that reads
        only other sections. `study.settings.of_strategy` returns the section.
    repeats_points : bool
        Whether several of its samples, with different numbers, have the same
        parameters.
    begins_with_design : bool
        Whether its first batch is the article's design, which the workflow simulates as
        such.
    seeds_key : str or None
        Key that sets the number of runs of each sample in its design; None if this is
        the key of the published strategy.
    files : tuple of str
        Notes of its answer that the workflow writes. A name ends in `.csv` for a table
        and in `.json` for a mapping.
    obeys_constraints : bool
        Whether its proposals obey constraints between parameters.
    reads : tuple of str or None
        Keys of the configuration that its proposals after a simulated batch depend on;
        None for all.
    """

    name: ClassVar[str]
    settings: ClassVar[type[Section] | None] = None
    repeats_points: ClassVar[bool] = False
    begins_with_design: ClassVar[bool] = False
    seeds_key: ClassVar[str | None] = None
    files: ClassVar[tuple[str, ...]] = ()
    obeys_constraints: ClassVar[bool] = True
    reads: ClassVar[tuple[str, ...] | None] = None

    @abstractmethod
    def propose(self, study: "Study", data: "pd.DataFrame") -> Batch | Answer:
        """Propose the next samples, or give the answer.

        The same study and the same runs give the same proposal, so a study that was
        interrupted continues as if it had not been.

        Parameters
        ----------
        study : Study
            Its parameters, targets and settings are read, never its runs.
        data : pandas.DataFrame
            All runs so far, a row for each: `sample`, parameters, responses; empty at
            the start. A run failed if a response is NaN. An optional column `batch` has
            the number of the proposal that the run comes from.

        Returns
        -------
        Batch or Answer

        Raises
        ------
        InputError
            If the runs do not determine the model of the strategy.
        """

    def answer(self, study: "Study", data: "pd.DataFrame") -> Answer:
        """Return the best answer that the runs so far allow.

        Parameters
        ----------
        study, data
            As in `propose`.

        Returns
        -------
        Answer

        Raises
        ------
        InputError
            If the strategy has no answer yet.
        """
        proposal = self.propose(study, data)
        if isinstance(proposal, Batch):
            raise InputError(
                source="runs",
                key="rows",
                value=len(data),
                allowed=(
                    f"more: strategy {self.name} asks for {len(proposal.samples)} more "
                    "samples before it answers"
                ),
            )
        return proposal

    def contradictions(
        self, section: SectionType, free: int, responses: int
    ) -> Contradictions:
        """Yield the keys of the strategy's section with which it cannot run.

        Parameters
        ----------
        section : Section or None
            The section of the strategy, of the type `settings`. It is valid on its own.
        free, responses : int
            Numbers of free parameters and of targets.

        Returns
        -------
        iterator of (str, str)
            The key of the section that is at fault, and what is allowed.
        """
        return iter(())

    def pours(self, section: SectionType, free: int) -> Pours | None:
        """Return the largest number of runs that the strategy can ask for.

        Parameters
        ----------
        section, free
            As in `contradictions`.

        Returns
        -------
        tuple of (str, int, int) or None
            For each step: its purpose, its number of samples, and the number of runs of
            each. The runs that check the answer are `CheckRuns`. None for the article's
            method, whose runs `repose.config.cost` counts.
        """
        return None


_REGISTRY: dict[str, Strategy[Any]] = {}
Kind = TypeVar("Kind", bound=type[Strategy[Any]])


def register(name: str) -> Callable[[Kind], Kind]:
    """Return a class decorator that registers a strategy.

    Parameters
    ----------
    name : str
        Name of the strategy in the configuration.

    Returns
    -------
    callable
        The decorator.

    Raises
    ------
    ValueError
        If another class has the name.
    """

    def add_to_registry(kind: Kind) -> Kind:
        # The same class may be registered again.
        if name in _REGISTRY and type(_REGISTRY[name]) is not kind:
            other = type(_REGISTRY[name]).__name__
            raise ValueError(f"strategy {name!r} is registered already, by {other}")
        kind.name = name
        _REGISTRY[name] = kind()
        return kind

    return add_to_registry


def names() -> tuple[str, ...]:
    """Return the names of all strategies, in the order of their registration."""
    return tuple(_REGISTRY)


def obeying_strategies() -> str:
    """Describe which strategies are allowed with constraints, for an error message."""
    obeying = [name for name, one in _REGISTRY.items() if one.obeys_constraints]
    return f"{' or '.join(obeying)} where there are constraints"


def strategy(name: str, source: object = "strategy") -> Strategy[Any]:
    """Return the strategy with a name.

    Parameters
    ----------
    name : str
        One of `names`.
    source : object
        A file or a key, which the error names.

    Returns
    -------
    Strategy

    Raises
    ------
    InputError
        If no strategy has this name.
    """
    if name not in _REGISTRY:
        raise InputError(
            source=source,
            key="strategy",
            value=name,
            allowed=f"one of {', '.join(_REGISTRY)}",
        )
    return _REGISTRY[name]


def samples_of(
    space: ParameterSpace, unit: np.ndarray, seeds: int, first: int = 1
) -> "pd.DataFrame":
    """Make the table of samples of a `Batch`.

    Parameters
    ----------
    space : ParameterSpace
        The parameters of the study.
    unit : numpy.ndarray, (n, d)
        The samples' free parameters in the unit cube.
    seeds : int
        Number of runs of each sample.
    first : int, optional
        Number of the first sample.

    Returns
    -------
    pandas.DataFrame
        `sample`, the parameters and `seeds`.
    """
    from repose.calibrate.designs.latin_hypercube import tabulate_parameter_sets

    return tabulate_parameter_sets(unit, space, first).assign(seeds=seeds)
