"""The section `miga` of the configuration: the search, and the choice of the answer."""

from typing import Any, Literal, Self

from pydantic import Field

from repose.common import method
from repose.common.section import Contradictions, Section, Seed, Share

MIN_LOSS = "least_expected_loss"  # a value of `answer`


class MigaSettings(Section):
    """Settings of the search; config/README.md explains the keys."""

    islands: int = Field(
        ge=1,
        le=100,
        description="number of islands",
        json_schema_extra={"source": "3.3.1: 5"},
    )

    population: int = Field(
        ge=4,
        le=10000,
        description="individuals on each island",
        json_schema_extra={"source": "3.3.1: 40"},
    )

    rounds: int = Field(
        ge=1,
        le=100000,
        description="number of migrations",
        json_schema_extra={"source": "3.3.1: 870"},
    )

    generations: int = Field(
        ge=1,
        le=10000,
        description="generations between two migrations",
        json_schema_extra={"source": "3.3.1: 10"},
    )

    tournament: int = Field(
        ge=1,
        le=1000,
        description="individuals that compete to be a parent, at most `population`",
        json_schema_extra={"source": "3.3.1: 3"},
    )

    mutation_probability: Share = Field(
        description="probability that a gene changes",
        json_schema_extra={"source": "3.3.1: 0.05"},
    )

    mutation_amplitude: Share = Field(
        description="standard deviation of a gene's change, in half ranges",
        json_schema_extra={"source": "3.3.1: 0.1"},
    )

    solutions: int = Field(
        ge=10,
        le=1000,
        description="number of feasible solutions that are kept, the best first",
        json_schema_extra={"source": "4.1.2: 90"},
    )

    distance: float = Field(
        ge=0,
        le=0.5,
        description="two kept solutions lie at least this far apart, in parameters "
        "normalised to [-1, 1]",
        json_schema_extra={"source": "open"},
    )

    answer: Literal["least_expected_loss", "least_objective"] = Field(
        description="choice of the representative solution: least expected loss, if "
        "the surrogate knows its errors, or least objective (Eq. 11)",
        json_schema_extra={"source": "4.2.1: `least_objective`"},
    )

    replicates: int = Field(
        ge=0,
        le=1000,
        description="number of refits to resampled pours, which show the optimism of "
        "predictions; 0: none",
    )

    seed: Seed = Field(
        description="seed of the search and of the replicates",
        json_schema_extra={"source": "3.3.1: 2026"},
    )

    @classmethod
    def with_defaults(cls, **keys: Any) -> Self:
        """Make settings with the values of config/method.yaml for the keys left out."""
        return method.make_section_with_defaults(cls, "miga", keys)

    def contradictions(self) -> Contradictions:
        """Raise an error if a tournament is larger than the population."""
        if self.tournament > self.population:
            yield "tournament", f"at most miga.population, {self.population}"
