"""Force laws by name; a new law is a file in this folder and a line in one of the two tables below."""

from collections import UserDict
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .law import Law

__all__ = ["CONTACT_LAWS", "ROLLING_LAWS", "Laws"]


class Laws(UserDict[str, Any]):
    """Laws by name; a law's file is imported at its first use, since it loads the compiler."""

    def __getitem__(self, name: str) -> "Law":
        law = super().__getitem__(name)
        return import_module(f".{law}", __name__).LAW if isinstance(law, str) else law


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
