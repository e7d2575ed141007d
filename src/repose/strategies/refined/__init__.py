"""The strategy `refined`: the published one that goes on near its answer until the simulated means meet the targets."""

from typing import TYPE_CHECKING

from repose.strategies.base import Answer, Batch, Strategy, Studied, register

if TYPE_CHECKING:
    import pandas as pd


@register("refined")
class Refined(Strategy):
    """The published batch, then rounds."""

    repeats_points = True
    rules = ("calibration", "figures", "refined")

    def propose(self, study: Studied, data: "pd.DataFrame") -> Batch | Answer:
        from repose.strategies.refined import strategy

        return strategy.propose(study, data)
