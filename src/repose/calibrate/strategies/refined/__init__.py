"""The strategy `refined`.

It is the published one with a second stage: single runs at many places where the fit of
the first stage may meet the targets.
"""

from typing import TYPE_CHECKING

from pydantic import Field

from repose.calibrate.strategies.base import Answer, Batch, Strategy, register
from repose.common.section import Percent, Section, Seeds

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.study import Study

# Largest number of places of the second stage. It is the number of places whose errors
# are computed (`repose.calibrate.strategies.refined.places.N_NEAREST`).
MAX_POURS = 4096


class RefineSettings(Section):
    """The section `refine`; config/README.md explains the keys."""

    pours: int = Field(
        ge=2,
        le=MAX_POURS,
        description="places where the fit may meet the targets, poured once each",
    )
    tolerance_percent: Percent = Field(
        description="a place is drawn with the probability that its means lie within "
        "this percentage of all targets",
    )
    design_seeds: Seeds = Field(
        description="pours of each sample of the design with `strategy: refined`, in "
        "place of `funnel.seeds` and those of other bench tests",
    )
    seeds: int = Field(
        ge=1,
        le=1000,
        description="pours that check the answer",
    )


@register("refined")
class Refined(Strategy[None]):
    """The published batch, a batch of single runs near the targets, and the answer."""

    begins_with_design = True
    seeds_key = "refine.design_seeds"
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
