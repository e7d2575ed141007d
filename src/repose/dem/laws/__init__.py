"""Force laws by name.

A new law is a file in this folder and a line in one of the two tables below.
"""

from collections import UserDict
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .law import Law

__all__ = ["CONTACT_LAWS", "ROLLING_LAWS", "Laws"]


class Laws(UserDict[str, Any]):
    """A table of laws by name.

    An entry is a law, or the name of its module in this folder. A module loads the
    compiler, so it is imported when its law is looked up.
    """

    def __getitem__(self, name: str) -> "Law":
        entry = super().__getitem__(name)
        if isinstance(entry, str):
            return import_module(f".{entry}", __name__).LAW
        return entry


CONTACT_LAWS = Laws(
    hertz_mindlin="hertz_mindlin",
    hertz_mindlin_rescaled="hertz_mindlin_rescaled",
    linear_spring="linear_spring",
    jkr="jkr",
    sjkr="sjkr",
    eepa="eepa",
)
ROLLING_LAWS = Laws(
    budget="rolling", constant_torque="constant_torque", epsd="epsd", epsd2="epsd2"
)
