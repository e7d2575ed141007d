"""Ways to calibrate: each goes from the runs so far to the next runs, or to the answer.

The key `strategy` of the configuration chooses one. Importing this package registers
every strategy (`repose.calibrate.strategies.base`).
"""

# The line that registers each strategy.
from repose.calibrate.strategies import published, refined, response_surface, sequential  # noqa: F401
from repose.calibrate.strategies.base import (
    Answer,
    Batch,
    Strategy,
    names,
    register,
    strategy,
)

__all__ = ["Answer", "Batch", "Strategy", "names", "register", "strategy"]
