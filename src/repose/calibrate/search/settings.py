"""The section `miga` of the configuration: the island genetic algorithm, and the choice of the answer."""

from typing import Literal

from pydantic import Field

from repose.common.section import Contradictions, Section, Seed, Share


class MigaSettings(Section):
    """Settings of the search; config/README.md explains the keys."""

    islands: int = Field(ge=1, le=100)
    population: int = Field(ge=4, le=10000)  # of each island
    rounds: int = Field(ge=1, le=100000)  # migrations
    generations: int = Field(ge=1, le=10000)  # between two migrations
    tournament: int = Field(ge=1, le=1000)
    mutation_probability: Share  # of each gene
    mutation_amplitude: Share  # standard deviation of a gene's change, in half ranges
    solutions: int = Field(ge=10, le=1000)  # most that are kept
    distance: float = Field(
        ge=0, le=0.5
    )  # least one between two solutions, in half ranges
    answer: Literal["least_expected_loss", "least_objective"]
    seed: Seed

    def contradictions(self) -> Contradictions:
        """Refuse a tournament larger than its population."""
        if self.tournament > self.population:
            yield "tournament", f"at most miga.population, {self.population}"
