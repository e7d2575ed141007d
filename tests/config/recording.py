"""Configurations that record which of their keys are read.

A key is recorded by its dotted name. A section that is taken without reading a key of it
is recorded by its own name, with a dot behind it: a library may then read it unseen.
"""

from collections.abc import Iterator
from types import FunctionType
from typing import Any

from repose.common.section import Section
from repose.config.dependencies import RESPONSES


class RecordedSection:
    """A typed section that records which of its fields are read, by it or by others."""

    def __init__(self, section: Section, keys: set[str], prefix: str = "") -> None:
        self._section = section
        self._keys = keys
        self._prefix = prefix

    def __getattr__(self, name: str) -> Any:
        kind = type(self._section)
        if name in kind.model_fields:
            return self._read(name)
        # A method or property reads fields of the recorded section, too.
        found = getattr(kind, name)
        if isinstance(found, property):
            return found.fget(self)
        if isinstance(found, FunctionType):
            return found.__get__(self)
        raise AttributeError(f"{name} of a section is not recorded")

    def model_copy(self, *, update: dict[str, Any] | None = None) -> "RecordedSection":
        """A copy of the section with other values, which records its reads, too."""
        copied = self._section.model_copy(update=update)
        return RecordedSection(copied, self._keys, self._prefix)

    def _read(self, name: str) -> Any:
        value = getattr(self._section, name)
        if isinstance(value, Section):
            self._keys.add(f"{self._prefix}{name}.")
            return RecordedSection(value, self._keys, f"{self._prefix}{name}.")
        self._keys.add(f"{self._prefix}{name}")
        return value

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        """All fields with their values, as of a section of pydantic."""
        for name in type(self._section).model_fields:
            yield name, self._read(name)


class RecordedMapping(dict):
    """A mapping that records which of its keys are read."""

    def __init__(
        self, content: dict[str, Any], keys: set[str], prefix: str = ""
    ) -> None:
        super().__init__(content)
        self._keys = keys
        self._prefix = prefix

    def __getitem__(self, key: str) -> Any:
        value = super().__getitem__(key)
        if isinstance(value, dict):
            self._keys.add(f"{self._prefix}{key}.")
            return RecordedMapping(value, self._keys, f"{self._prefix}{key}.")
        self._keys.add(f"{self._prefix}{key}")
        return value

    def get(self, key: str, default: Any = None) -> Any:
        if key not in self:
            return default
        return self[key]

    def items(self) -> Any:
        return [(key, self[key]) for key in self]

    def values(self) -> Any:
        return [self[key] for key in self]


def without_parents(keys: set[str]) -> set[str]:
    """Leave out a section of which single keys were read as well."""
    return {
        key
        for key in keys
        if not any(other != key and other.startswith(key) for other in keys)
        or not key.endswith(".")
    }


def entry_of(key: str, listed: set[str]) -> str:
    """The entry that lists a recorded key: itself or its section; the key without one."""
    section, _, name = key.partition(".")
    whole = section if name == "" else key
    if whole == "targets" and RESPONSES in listed:
        return RESPONSES
    for entry in (whole, section):
        if entry in listed:
            return entry
    return whole
