"""Read the values of config/method.yaml, for settings that are made in Python."""

from functools import cache
from typing import Any, TypeVar

from repose.common import faults, places
from repose.common.errors import raise_together
from repose.common.section import Section

S = TypeVar("S", bound=Section)


@cache
def _values() -> dict[str, Any]:
    """Read the program's own config/method.yaml."""
    from repose.common.reading import read  # loads PyYAML

    return read(places.root() / places.METHOD_CONFIG)


def with_defaults(model: type[S], name: str, keys: dict[str, Any]) -> S:
    """Make a section, with the values of config/method.yaml for the keys left out.

    Parameters
    ----------
    model : type of Section
    name : str
        Name of the section.
    keys : dict
        Values of the section that differ.

    Returns
    -------
    Section

    Raises
    ------
    InputError
        With all faults of the keys.
    """
    values = {**_values()[name], **keys}
    raise_together(faults.check(values, name, model).faults)
    return model.model_validate(values)
