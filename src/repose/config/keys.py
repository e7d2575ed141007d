"""Dotted keys of a configuration: the file of each, its value, its section. No YAML is loaded, which takes time."""

from collections.abc import Mapping
from typing import Any

from repose.core.errors import InputError


class Origin:
    """The file of each dotted key; an entry of a list belongs to the file of the list, a missing key to `default`."""

    def __init__(self, origin: Mapping[str, str], default: str, shared: str = "") -> None:
        self.origin, self.default, self.shared = origin, default, shared

    def of(self, key: str) -> str:
        """Return the name of the file that holds a dotted key."""
        of_list = key.split(".")
        place = next((k for k, step in enumerate(of_list) if step.isdigit()), len(of_list))
        return self.origin.get(".".join(of_list[:place]), self.default)

    def owner(self, key: str) -> str:
        """Return the user's file in which to edit a key: its own, or the file of the innermost section around it."""
        steps = key.split(".")
        for k in range(len(steps), 0, -1):
            name = self.origin.get(".".join(steps[:k]), self.shared)
            if name != self.shared:
                return name
        return self.default


def owner_of(source: "str | Origin", key: str) -> str:
    """Return the name of the user's file to edit for a dotted key."""
    return source.owner(key) if isinstance(source, Origin) else source


def origin_of(source: "str | Origin", key: str) -> str:
    """Return the name of the file that holds a dotted key."""
    return source.of(key) if isinstance(source, Origin) else source


def get(config: Any, key: str) -> Any:
    """Return the value of a dotted key; None if its section leaves it out."""
    *way, last = key.split(".")
    for step in way:
        config = config[int(step)] if isinstance(config, list) else config[step]
    return config[int(last)] if isinstance(config, list) else config.get(last)


def section(config: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a section that may be absent; InputError if it is."""
    if name not in config:
        allowed = "a section of this name (`repose docs configuration`); a configuration may lack it"
        raise InputError("configuration", name, None, allowed)
    return config[name]
