"""The strategy `sequential`: few runs, each where it is most informative.

It begins with samples that fill the whole ranges. The batches that follow are simulated
where the targets are probably met.
"""

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from repose.calibrate.strategies.base import (
    Answer,
    Batch,
    CheckRuns,
    Pours,
    Strategy,
    register,
)
from repose.common.section import Contradictions, Section, Seeds

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.study import Study


class SequentialSettings(Section):
    """The section `sequential`; config/README.md explains the keys."""

    start_samples: int = Field(
        ge=4,
        le=999,
        description="samples of the start, a Latin hypercube all over the ranges",
    )
    seeds: Seeds = Field(
        description="pours of each sample; at least 2, because they show the noise",
    )
    batch: int = Field(
        ge=1,
        le=100,
        description="samples of a batch, poured in parallel",
    )
    tolerance_percent: Annotated[float, Field(gt=0, le=50)] = Field(
        description="the answer should lie within this percentage of the `aim` of "
        "every target",
    )
    probability: float = Field(
        ge=0.05,
        le=0.99,
        description="the strategy stops when the answer does so with this probability",
    )
    most_pours: int = Field(
        ge=8,
        le=9999,
        description="budget of pours in each bench test of the targets, without the "
        "check; at least `start_samples` times `seeds`",
    )
    checks: int = Field(
        ge=2,
        le=500,
        description="pours of the answer, with fresh seeds",
    )


@register("sequential")
class Sequential(Strategy[SequentialSettings]):
    """A space-filling start, then batches where the targets are probably met."""

    settings = SequentialSettings
    reads = (
        "parameters",
        "targets",
        "design.seed",
        "sequential",
        "miga.solutions",
        "miga.distance",
    )

    def propose(self, study: "Study", data: "pd.DataFrame") -> Batch | Answer:
        from repose.calibrate.strategies.sequential import strategy

        return strategy.propose(study, data)

    def answer(self, study: "Study", data: "pd.DataFrame") -> Answer:
        from repose.calibrate.strategies.sequential import strategy

        return strategy.give_answer(study, data)

    def contradictions(
        self, section: SequentialSettings, free: int, responses: int
    ) -> Contradictions:
        """Find a start that has too few repeated runs, or exceeds the budget."""
        if section.start_samples * (section.seeds - 1) <= responses:
            yield "seeds", "at least 2: the noise comes from pours of one sample"
        if section.start_samples * section.seeds > section.most_pours:
            allowed = "at least sequential.start_samples times sequential.seeds"
            yield "most_pours", allowed

    def pours(self, section: SequentialSettings, free: int) -> Pours:
        return (
            ("at most", section.most_pours // section.seeds, section.seeds),
            CheckRuns("check", 1, section.checks),
        )
