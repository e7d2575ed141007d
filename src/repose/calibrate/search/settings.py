"""The section `miga` of the configuration: the search, and the choice of the answer."""

from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from repose.common.section import Contradictions, Section, Seed, Share


@dataclass(frozen=True)
class IslandSettings:
    """Settings of `repose.calibrate.search.miga.MIGA`; by default the published ones.

    Attributes
    ----------
    islands : int
    population : int
        Individuals of each island.
    generations : int
        Number of generations between two migrations.
    tournament : int
        Individuals that compete to be a parent.
    mutation_probability : float
        Of each gene.
    mutation_amplitude : float
        Standard deviation of a gene's change.
    seed : int
        Of the random numbers.

    Raises
    ------
    ValueError
        If a setting is out of its limits.
    """

    islands: int = 5
    population: int = 40
    generations: int = 10
    tournament: int = 3
    mutation_probability: float = 0.05
    mutation_amplitude: float = 0.1
    seed: int = 2026

    def __post_init__(self) -> None:
        limits = {
            "islands": 1,
            "population": 2,
            "generations": 1,
            "tournament": 1,
            "mutation_amplitude": 0,
        }
        for name, limit in limits.items():
            value = getattr(self, name)
            if not value >= limit:
                raise ValueError(f"{name} is {value!r}; expected at least {limit}")
        if not 0 <= self.mutation_probability <= 1:
            raise ValueError(
                f"mutation_probability is {self.mutation_probability!r}; "
                "expected 0 to 1"
            )


class MigaSettings(Section):
    """Settings of the search; config/README.md explains the keys."""

    islands: int = Field(ge=1, le=100)
    """Number of islands."""

    population: int = Field(ge=4, le=10000)
    """Individuals of each island."""

    rounds: int = Field(ge=1, le=100000)
    """Number of migrations."""

    generations: int = Field(ge=1, le=10000)
    """Number of generations between two migrations."""

    tournament: int = Field(ge=1, le=1000)
    """Individuals that compete to be a parent."""

    mutation_probability: Share
    """Of each gene."""

    mutation_amplitude: Share
    """Standard deviation of a gene's change, in half ranges."""

    solutions: int = Field(ge=10, le=1000)
    """Largest number of solutions that are kept."""

    distance: float = Field(ge=0, le=0.5)
    """Least distance between two solutions, in half ranges."""

    answer: Literal["least_expected_loss", "least_objective"]
    """Which of the parameter sets is the answer."""

    replicates: int = Field(20, ge=0, le=1000)
    """Refits to pours drawn again, which show the optimism of a prediction; 0: none."""

    seed: Seed
    """Of the random numbers of the search and of the replicates."""

    def of_islands(self) -> IslandSettings:
        """Select the settings of the algorithm."""
        return IslandSettings(
            islands=self.islands,
            population=self.population,
            generations=self.generations,
            tournament=self.tournament,
            mutation_probability=self.mutation_probability,
            mutation_amplitude=self.mutation_amplitude,
            seed=self.seed,
        )

    def contradictions(self) -> Contradictions:
        """Refuse a tournament larger than its population."""
        if self.tournament > self.population:
            yield "tournament", f"at most miga.population, {self.population}"
