"""Ways to calibrate: each goes from the runs so far to the next runs, or to the answer.

The key `strategy` of the configuration chooses one. Importing this package registers
every strategy (`repose.calibrate.strategies.base`).
"""

# Each import registers a strategy. They are listed in this order.
from repose.calibrate.strategies import published  # noqa: F401, isort: skip
from repose.calibrate.strategies import refined  # noqa: F401, isort: skip
from repose.calibrate.strategies import response_surface  # noqa: F401, isort: skip
from repose.calibrate.strategies import sequential  # noqa: F401, isort: skip
from repose.calibrate.strategies.base import (
    Answer,
    Batch,
    Strategy,
    names,
    obeying_strategies,
    register,
    strategy,
)

__all__ = [
    "Answer",
    "Batch",
    "Strategy",
    "names",
    "obeying_strategies",
    "register",
    "strategy",
]
