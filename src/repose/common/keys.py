"""Look up dotted keys of a configuration: the value of a key, and the file that has it.

This module does not import PyYAML, because that takes time.
"""

from collections.abc import Iterable, Mapping
from functools import reduce
from operator import getitem
from typing import Any

from repose.common.errors import InputError

Config = Mapping[str, Any]


class Origin:
    """The file of each dotted key.

    Parameters
    ----------
    files_by_key : mapping of str to str
        The file of each dotted key that is in a file.
    default_file : str
        The file to name for a key that is in no file.
    method_file : str
        The file of the method, which users do not edit.
    """

    def __init__(
        self,
        files_by_key: Mapping[str, str],
        default_file: str,
        method_file: str = "",
    ) -> None:
        self.files_by_key = files_by_key
        self.default_file = default_file
        self.method_file = method_file

    def find_file(self, key: str) -> str:
        """Return the name of the file that holds a dotted key.

        An entry of a list, such as ``targets.0``, belongs to the file of the list.
        """
        # The part of the key before the first position in a list.
        steps = []
        for step in key.split("."):
            if step.isdigit():
                break
            steps.append(step)
        return self.files_by_key.get(".".join(steps), self.default_file)

    def find_file_to_edit(self, key: str) -> str:
        """Return the file in which the user should edit a dotted key.

        It is the file that holds the key. If no file holds the key, it is the file that
        holds the innermost section around the key. The file of the method has the
        program's own defaults and does not count, because users do not edit it. If no
        file is left, it is the default file.
        """
        # Look up the key, then the section around it, and so on outwards.
        parts = key.split(".")
        while parts:
            file = self.files_by_key.get(".".join(parts))
            if file is not None and file != self.method_file:
                return file
            parts.pop()
        return self.default_file


def find_file_to_edit(source: "str | Origin", key: str) -> str:
    """Return the name of the user's file to edit for a dotted key."""
    return source.find_file_to_edit(key) if isinstance(source, Origin) else source


def find_source_file(source: "str | Origin", key: str) -> str:
    """Return the name of the file that holds a dotted key."""
    return source.find_file(key) if isinstance(source, Origin) else source


def follow_path(config: Any, path: Iterable[int | str], default: Any = None) -> Any:
    """Follow a path of keys into a configuration.

    Parameters
    ----------
    config : object
        The configuration as plain values.
    path : iterable of int or str
        The steps: names of keys, which may contain dots, and positions in lists, as
        integers or as strings of digits.
    default : object
        Result if there is no value at the end of the path.

    Returns
    -------
    object
        The value at the end of the path, or the default.
    """
    value = config
    for step in path:
        if isinstance(value, Mapping):
            if step not in value:
                return default
            value = value[step]
        elif isinstance(value, list):
            if not str(step).isdigit() or int(step) >= len(value):
                return default
            value = value[int(step)]
        else:
            return default
    return value


def get_value(config: Any, key: str, default: Any = None) -> Any:
    """Return the value of a dotted key, or a default if there is none.

    An empty key stands for the whole configuration.
    """
    return follow_path(config, key.split(".") if key else (), default)


def lookup(config: Config, key: str) -> Any:
    """Return the value of a dotted key; raise KeyError if there is none."""
    return reduce(getitem, key.split("."), config)


def require_section(config: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a section of a configuration; raise InputError if it is missing."""
    if name not in config:
        raise InputError(
            "configuration",
            key=name,
            value=None,
            allowed="a section of this name (`repose docs configuration`); a configuration may lack it",
        )
    return config[name]
