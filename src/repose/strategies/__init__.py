"""Ways to calibrate, each chosen by the configuration's `strategy`: from the runs so far to the next, or to the answer.

Importing this package registers every strategy (`repose.strategies.base`).
"""

from repose.strategies import published, refined, response_surface, sequential
from repose.strategies.base import Answer, Batch, Strategy, names, register, strategy

__all__ = [
    "Answer",
    "Batch",
    "Strategy",
    "names",
    "published",
    "refined",
    "register",
    "response_surface",
    "sequential",
    "strategy",
]
