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

    # Most rounds after the first.
    rounds: int = Field(ge=0, le=90)
    # Runs of the proposal.
    seeds: int = Field(ge=2, le=1000)
    # Runs of the proposal in one job.
    block: int = Field(ge=1, le=1000)
    # Samples around the proposal, and the runs of each.
    neighbours: int = Field(ge=0, le=99)
    neighbour_seeds: int = Field(ge=1, le=1000)
    # Half the width of the box that is searched, in ranges.
    reach: float = Field(ge=0.01, le=1)
    # Largest deviation of a simulated mean from its target.
    tolerance_percent: Percent
    # Largest standard error of a simulated mean, in percent of its target.
    standard_error_percent: Percent

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
