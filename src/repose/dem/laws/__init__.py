"""Force laws by name.

A new law is a file in this folder and a line in one of the two tables below.
"""

from collections import UserDict
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from .law import Law

__all__ = ["CONTACT_LAWS", "ROLLING_LAWS", "Laws", "RollingLaw", "RollingLaws"]


class Laws(UserDict[str, Any]):
    """A table of laws by name.

    An entry is a law, or the name of its module in this folder. Importing a module
    loads the compiler, so this is done only when its law is looked up.
    """

    def __getitem__(self, name: str) -> "Law":
        return _load(super().__getitem__(name))


class RollingLaw(NamedTuple):
    """An entry of `ROLLING_LAWS`: a law and its effect on bodies.

    Configuration, bench tests and export read these properties. They are given here,
    not in the module of the law, so that a configuration can be checked without the
    compiler.

    Attributes
    ----------
    law : str or Law
        The law, or the name of its module in this folder.
    of_each_body : bool
        Whether it resists the rotation of each body in space. Other laws resist the
        rotation of two bodies relative to each other.
    twists : bool
        Whether it resists spin about the normal with the twisting friction mu_t. If so,
        a study may have the parameters ``mut_gg`` and ``mut_gp``.
    creeps : bool
        Whether it can only resist an existing rotation. If so, a body creeps as long as
        a torque acts on it.
    """

    law: "str | Law"
    of_each_body: bool = False
    twists: bool = False
    creeps: bool = False


class RollingLaws(Laws):
    """A table of rolling laws by name, whose entries are instances of `RollingLaw`.

    An entry may also be a law or the name of a module, as in `Laws`. All its properties
    are then False.
    """

    def __getitem__(self, name: str) -> "Law":
        return _load(self.entry(name).law)

    def entry(self, name: str) -> RollingLaw:
        """Return the properties of a law without importing its module."""
        entry = self.data[name]
        return entry if isinstance(entry, RollingLaw) else RollingLaw(entry)


def _load(law: "str | Law") -> "Law":
    """Return a law, given the law itself or the name of its module in this folder."""
    if isinstance(law, str):
        module_law: Law = import_module(f".{law}", __name__).LAW
        return module_law
    return law


CONTACT_LAWS = Laws(
    hertz_mindlin="hertz_mindlin",
    hertz_mindlin_rescaled="hertz_mindlin_rescaled",
    linear_spring="linear_spring",
    jkr="jkr",
    sjkr="sjkr",
    eepa="eepa",
)
ROLLING_LAWS = RollingLaws(
    budget=RollingLaw("rolling", of_each_body=True),
    constant_torque=RollingLaw("constant_torque", twists=True, creeps=True),
    epsd=RollingLaw("epsd", twists=True),
    epsd2=RollingLaw("epsd2", twists=True),
)
