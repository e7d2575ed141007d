"""Look up dotted keys of a configuration: the value of a key, and the file that has it.

No YAML is loaded here, which takes time.
"""

from collections.abc import Iterable, Mapping
from functools import reduce
from operator import getitem
from typing import Any

from repose.common.errors import require

Config = Mapping[str, Any]


class Origin:
    """The file of each dotted key.

    Parameters
    ----------
    origin : mapping of str to str
        The file of each dotted key that a file has.
    default : str
        The file of a key that is missing.
    shared : str
        The file of the method, which is not the user's.
    """

    def __init__(
        self, origin: Mapping[str, str], default: str, shared: str = ""
    ) -> None:
        self.origin = origin
        self.default = default
        self.shared = shared

    def of(self, key: str) -> str:
        """Return the name of the file that holds a dotted key.

        An entry of a list, such as ``targets.0``, belongs to the file of the list.
        """
        # The part of the key before the first position in a list.
        steps = []
        for step in key.split("."):
            if step.isdigit():
                break
            steps.append(step)
        return self.origin.get(".".join(steps), self.default)

    def find_owner(self, key: str) -> str:
        """Return the file in which the user should edit a dotted key.

        It is the file that holds the key, or else the innermost section around it. The
        file of the method does not count, since users do not edit it. Without any such
        file it is the default.
        """
        # Look up the key, then the section around it, and so on outwards.
        steps = key.split(".")
        while steps:
            file = self.origin.get(".".join(steps), self.shared)
            if file != self.shared:
                return file
            steps.pop()
        return self.default


def owner_of(source: "str | Origin", key: str) -> str:
    """Return the name of the user's file to edit for a dotted key."""
    return source.find_owner(key) if isinstance(source, Origin) else source


def origin_of(source: "str | Origin", key: str) -> str:
    """Return the name of the file that holds a dotted key."""
    return source.of(key) if isinstance(source, Origin) else source


def follow_path(config: Any, path: Iterable[int | str], default: Any = None) -> Any:
    """Follow a path of keys into a configuration.

    Parameters
    ----------
    config : object
        The configuration as plain values.
    path : iterable of int or str
        Its steps: names of keys, which may contain dots, and positions in lists. A
        position may be a text of digits.
    default : object
        Returned where the path leads nowhere.

    Returns
    -------
    object
        The value at the end of the path, or the default.
    """
    value = config
    for step in path:
        if isinstance(value, Mapping):
            value = value.get(step, default)
        elif isinstance(value, list) and str(step).isdigit() and int(step) < len(value):
            value = value[int(step)]
        else:
            return default
    return value


def get(config: Any, key: str, default: Any = None) -> Any:
    """Return the value of a dotted key, or a default where there is none.

    An empty key stands for the whole configuration.
    """
    return follow_path(config, key.split(".") if key else (), default)


def lookup(config: Config, key: str) -> Any:
    """Return the value of a dotted key; KeyError where there is none."""
    return reduce(getitem, key.split("."), config)


def section(config: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a section that may be absent; InputError if it is."""
    allowed = "a section of this name (`repose docs configuration`); a configuration may lack it"
    require(name in config, "configuration", name, None, allowed)
    return config[name]
