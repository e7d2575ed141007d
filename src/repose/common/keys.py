"""Dotted keys of a configuration: the file of each, its value, its section. No YAML is loaded, which takes time."""

from collections.abc import Iterable, Mapping
from typing import Any

from repose.common.errors import require

Config = Mapping[str, Any]


class Origin:
    """The file of each dotted key; an entry of a list belongs to the file of the list, a missing key to `default`."""

    def __init__(
        self, origin: Mapping[str, str], default: str, shared: str = ""
    ) -> None:
        self.origin, self.default, self.shared = origin, default, shared

    def of(self, key: str) -> str:
        """Return the name of the file that holds a dotted key."""
        of_list = key.split(".")
        place = next(
            (k for k, step in enumerate(of_list) if step.isdigit()), len(of_list)
        )
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


def at(found: Any, path: Iterable[int | str]) -> Any:
    """Return the value at the steps of a key, any of which may contain a dot; None where there is none."""
    for step in path:
        if isinstance(found, Mapping):
            found = found.get(step)
        elif isinstance(found, list) and str(step).isdigit() and int(step) < len(found):
            found = found[int(step)]
        else:
            return None
    return found


def get(config: Any, key: str) -> Any:
    """Return the value of a dotted key; None where there is none."""
    return at(config, key.split("."))


def section(config: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a section that may be absent; InputError if it is."""
    allowed = "a section of this name (`repose docs configuration`); a configuration may lack it"
    require(name in config, "configuration", name, None, allowed)
    return config[name]
