"""The strategy `refined`.

It is the published one, but goes on near its answer until the simulated means meet the
targets.
"""

from typing import TYPE_CHECKING

from pydantic import Field

from repose.calibrate.strategies.base import Answer, Batch, Strategy, register
from repose.common.section import Contradictions, Percent, Section

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.study import Study

# Most jobs of a proposal: the numbers of the jobs of a round have three digits.
LARGEST_BLOCKS = 100


class RefineSettings(Section):
    """The section `refine`; config/README.md explains the keys."""

    rounds: int = Field(
        ge=0,
        le=90,
        description="refits at most; round 0, the main chain's answer, comes before "
        "the first",
    )
    seeds: int = Field(
        ge=2,
        le=1000,
        description="pours of each round's proposal",
    )
    block: int = Field(
        ge=1,
        le=1000,
        description="pours of the proposal in one job, and one sample of the refit; at "
        "least `seeds` / 100",
    )
    neighbours: int = Field(
        ge=0,
        le=99,
        description="points around the proposal that are poured with it; 0 or at least "
        "2",
    )
    neighbour_seeds: int = Field(
        ge=1,
        le=1000,
        description="pours per neighbour",
    )
    reach: float = Field(
        ge=0.01,
        le=1,
        description="largest distance of the neighbours and of the next search from "
        "the proposal, as a share of each parameter's range",
    )
    tolerance_percent: Percent = Field(
        description="largest distance of the simulated mean from the `value` of each "
        "target, in percent of the value",
    )
    standard_error_percent: Percent = Field(
        description="the standard error of each of these means must be below this "
        "percentage of the target",
    )

    def contradictions(self) -> Contradictions:
        """Refuse impossible numbers of jobs or neighbours."""
        if self.seeds > LARGEST_BLOCKS * self.block:
            yield "block", f"at least refine.seeds / {LARGEST_BLOCKS}"
        if self.neighbours == 1:
            yield "neighbours", "0 or at least 2: they fill a Latin hypercube"


@register("refined")
class Refined(Strategy[None]):
    """The published batch, then rounds."""

    repeats_points = True
    begins_with_design = True
    reads = (
        "parameters",
        "targets",
        "design.samples",
        "design.seed",
        "surrogate",
        "network",
        "miga",
        "refine",
    )

    def propose(self, study: "Study", data: "pd.DataFrame") -> Batch | Answer:
        from repose.calibrate.strategies.refined import strategy

        return strategy.propose(study, data)
