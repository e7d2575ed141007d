"""The strategy `refined`: the published one that goes on near its answer until the simulated means meet the targets."""

from typing import TYPE_CHECKING

from pydantic import Field

from repose.calibrate.strategies.base import Answer, Batch, Strategy, register
from repose.common.section import Contradictions, Percent, Section

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.study import Study

LARGEST_BLOCKS = 100  # of a proposal's pours: jobs of a round have three digits


class RefineSettings(Section):
    """The section `refine`: more pours near the answer; config/README.md explains the keys."""

    rounds: int = Field(ge=0, le=90)  # most of them after the first
    seeds: int = Field(ge=2, le=1000)  # pours of the proposal
    block: int = Field(ge=1, le=1000)  # pours of the proposal in one job
    neighbours: int = Field(ge=0, le=99)  # samples around the proposal
    neighbour_seeds: int = Field(ge=1, le=1000)  # pours of each
    reach: float = Field(
        ge=0.01, le=1
    )  # half the width of the box that is searched, in ranges
    tolerance_percent: Percent  # of a simulated mean from its target
    standard_error_percent: Percent  # of a simulated mean, in percent of its target

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
