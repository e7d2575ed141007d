"""The contact parameters of a configuration as a parameter space."""

from collections.abc import Mapping
from typing import Any

from repose.bench.parameters import ALLOWED, parameters_among
from repose.calibrate.parameter_space import ParameterSpace


def contact_space(section: Mapping[str, Any]) -> ParameterSpace:
    """Read the section `parameters` of a configuration that was checked.

    Parameters
    ----------
    section : mapping
        A range, a fixed value or a prior for each of the six contact parameters, and
        for those that the contact law adds.

    Returns
    -------
    ParameterSpace
        In the order of all tables. A prior without a range is cut to the values that a
        configuration allows.
    """
    return ParameterSpace.of(section, names=parameters_among(section), limits=ALLOWED)
