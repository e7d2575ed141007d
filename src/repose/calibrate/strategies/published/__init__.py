"""The strategy `published`, the method of the article.

It takes one Latin hypercube, a surrogate, and a search on it.
"""

from typing import TYPE_CHECKING

from repose.calibrate.strategies.base import Answer, Batch, Strategy, register

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.study import Study


@register("published")
class Published(Strategy[None]):
    """One batch, then the answer."""

    begins_with_design = True
    files = ("metrics.json", "accuracy.csv", "intervals.csv")

    def propose(self, study: "Study", data: "pd.DataFrame") -> Batch | Answer:
        from repose.calibrate.strategies.published import strategy

        return strategy.propose(study, data)
