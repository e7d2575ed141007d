"""Make sections of settings in Python, with defaults from config/method.yaml."""

from functools import cache
from typing import Any, TypeVar

from repose.common import faults, places
from repose.common.errors import raise_together
from repose.common.section import Section

S = TypeVar("S", bound=Section)


@cache
def _read_defaults() -> dict[str, Any]:
    """Read the file config/method.yaml of the program."""
    # Import PyYAML only here, because it takes time.
    from repose.common.reading import read_yaml

    return read_yaml(places.find_program_folder() / places.METHOD_CONFIG)


def make_section_with_defaults(model: type[S], name: str, keys: dict[str, Any]) -> S:
    """Make a section, in which config/method.yaml supplies the missing keys.

    Parameters
    ----------
    model : type of Section
        The class of the section.
    name : str
        Name of the section.
    keys : dict
        Values that differ from those of the file, by key.

    Returns
    -------
    Section
        The section, checked.

    Raises
    ------
    InputError
        With all faults of the keys.
    """
    values = {**_read_defaults()[name], **keys}
    raise_together(faults.find_faults(values, name, model).faults)
    return model.model_validate(values)
