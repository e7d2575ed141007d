"""The strategy `refined`: the published one that goes on near its answer until the simulated means meet the targets."""

from typing import TYPE_CHECKING

from repose.strategies.base import Answer, Batch, Strategy, Studied, register

if TYPE_CHECKING:
    import pandas as pd

DESIGN = ("design.samples", "design.seed")


@register("refined")
class Refined(Strategy):
    """The published batch, then rounds."""

    repeats_points = True
    begins_with_design = True
    reads = ("parameters", "targets", *DESIGN, "surrogate", "network", "miga", "refine")

    def propose(self, study: Studied, data: "pd.DataFrame") -> Batch | Answer:
        from repose.strategies.refined import strategy

        return strategy.propose(study, data)
