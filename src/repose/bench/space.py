"""Make the parameter space of the contact parameters in a configuration."""

from collections.abc import Mapping
from typing import Any

from repose.bench.parameters import ALLOWED, parameters_among
from repose.calibrate.parameter_space import ParameterSpace


def contact_space(section: Mapping[str, Any]) -> ParameterSpace:
    """Make the parameter space of the section `parameters` of a configuration.

    Parameters
    ----------
    section : mapping
        A range, a fixed value or a prior for each of the six contact parameters, and
        for those that the contact law adds. The section has been checked.

    Returns
    -------
    ParameterSpace
        The space. Its parameters have the order of all tables. A prior without a range
        is limited to the values that a configuration allows.
    """
    return ParameterSpace.of(section, names=parameters_among(section), limits=ALLOWED)
