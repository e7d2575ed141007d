"""Few pours, each where it informs most: a space-filling start, then batches where the targets are probably met."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from repose.core.section import Section, Seeds
from repose.strategies.base import Answer, Batch, Strategy, Studied, register

if TYPE_CHECKING:
    import pandas as pd


class SequentialSettings(Section):
    """Few pours, each where it says most."""

    start_samples: int = Field(ge=4, le=999)
    seeds: Seeds
    batch: int = Field(ge=1, le=100)
    tolerance_percent: Annotated[float, Field(gt=0, le=50)]
    probability: float = Field(ge=0.05, le=0.99)
    most_pours: int = Field(ge=8, le=9999)
    checks: int = Field(ge=2, le=500)


@register("sequential")
class Sequential(Strategy):
    """A space-filling start, then batches where the targets are probably met."""

    settings = SequentialSettings
    reads = ("parameters", "targets", "design.seed", "sequential", "miga.solutions", "miga.distance")

    def propose(self, study: Studied, data: "pd.DataFrame") -> Batch | Answer:
        from repose.strategies.sequential import strategy

        return strategy.propose(study, data)

    def answer(self, study: Studied, data: "pd.DataFrame") -> Answer:
        from repose.strategies.sequential import strategy

        return strategy.answer(study, data)

    def contradictions(self, config: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Refuse a start beyond its budget or without repeats."""
        section, responses = config["sequential"], len(config["targets"])
        repeats = section["start_samples"] * (section["seeds"] - 1)
        if repeats <= responses:
            yield "sequential.seeds", "at least 2: the noise comes from pours of one sample"
        if section["start_samples"] * section["seeds"] > section["most_pours"]:
            yield "sequential.most_pours", "at least sequential.start_samples times sequential.seeds"

    def pours(self, config: Mapping[str, Any]) -> tuple[tuple[str, int, int], ...]:
        section = config["sequential"]
        return (("at most", section["most_pours"] // section["seeds"], section["seeds"]),)
