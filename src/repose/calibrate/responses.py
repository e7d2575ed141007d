"""The responses of bench tests, and their registry by name.

A response is a number that a bench test gives: the angle of repose of a pile, its
height, the angle at which a bed slips. Each bench test registers its responses in its
module (`repose.bench`). All later stages find them in this registry by name, and work
for any number of them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from repose.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

Number = TypeVar("Number", float, "pd.Series")

Definitions = Mapping[str, Mapping[str, Any]]
"""For each response the configuration keys, with their values, that define it."""


@dataclass(frozen=True)
class Response:
    """One number that a bench test gives.

    Attributes
    ----------
    name : str
        Name of its column in every table. It ends with the unit, as in ``aor_deg``.
    unit : str
        Unit as it is written for readers: ``deg``, ``mm``, ``%``, ``s``, or empty.
    label : str
        Description, such as ``angle of repose``.
    symbol : str
        Short name for axes and column heads, as in ``AoR``.
    apparatus : str
        Name of the bench test that gives it.
    low, high : float
        Limits of a target of the response, in its unit.
    definition : tuple of str
        Dotted keys of the configuration that define the number. Tables made with
        different definitions must not be mixed.
    function : function, optional
        ``function(run)`` takes a measured run, a mapping, and returns its number, or
        None if it could not be measured. By default the number is the value of the run
        under the name of the response.
    computed_from : tuple of str
        Names of the measured numbers that `function` needs. Where one of them could not
        be measured, the response is None and `function` is not called.
    profile : str
        Name of the profile of which it is a score (`repose.calibrate.profiles`); empty
        for any other number.
    """

    name: str
    unit: str
    label: str
    symbol: str
    apparatus: str
    low: float = 0.0
    high: float = math.inf
    definition: tuple[str, ...] = ()
    function: Callable[[Mapping[str, Any]], float | None] | None = field(
        default=None, compare=False
    )
    computed_from: tuple[str, ...] = ()
    profile: str = ""

    def of(self, run: Mapping[str, Any]) -> float | None:
        """Return the number of a measured run; None if it could not be measured."""
        if self.function is None:
            return run.get(self.name)
        if any(run.get(name) is None for name in self.computed_from):
            return None
        return self.function(run)

    def settings(self, config: Mapping[str, Any]) -> dict[str, Any]:
        """Return the keys of its definition with their values in a configuration.

        Keys that the configuration lacks are left out.
        """
        values = {}
        for key in self.definition:
            section, name = key.split(".")
            if name in config[section]:
                values[key] = config[section][name]
        return values

    @property
    def predicted(self) -> str:
        """Column of a surrogate's prediction: ``aor_predicted_deg``."""
        return name_derived_column(self.name, "predicted")

    @property
    def optimism(self) -> str:
        """Column of the expected optimism of a prediction: ``aor_optimism_deg``."""
        return name_derived_column(self.name, "optimism")

    @property
    def optimism_error(self) -> str:
        """Column of its standard error: ``aor_optimism_se_deg``."""
        return name_derived_column(self.name, "optimism_se")

    @property
    def simulated(self) -> str:
        """Column of the simulated response: ``aor_simulated_deg``."""
        return name_derived_column(self.name, "simulated")

    @property
    def standard_error(self) -> str:
        """Column of the standard error of a sample's mean: ``aor_se_deg``."""
        return name_derived_column(self.name, "se")

    @property
    def deviation_percent(self) -> str:
        """Column of a prediction's deviation from the simulation: ``aor_error_percent``.

        The deviation is an absolute value, in percent of the simulated response.
        """
        return f"{self.quantity}_error_percent"

    @property
    def quantity(self) -> str:
        """Name without the unit: ``aor``."""
        return self.name.rsplit("_", 1)[0]


def name_derived_column(name: str, what: str) -> str:
    """Return the name of a column that is derived from a response.

    The word `what` is inserted before the unit, so ``aor_deg`` and ``se`` give
    ``aor_se_deg``. Without a unit, it is appended.
    """
    quantity, underscore, unit = name.rpartition("_")
    return f"{quantity}_{what}_{unit}" if underscore else f"{name}_{what}"


# A function that takes a name, and returns the response with this name or None. A bench
# test registers one if it gives any number of responses, such as the scores of a
# profile.
Family = Callable[[str], Response | None]
_REGISTRY: dict[str, Response] = {}
# A dict keeps the order, and holds a family only once even if it is registered again.
_FAMILIES: dict[Family, None] = {}


def compute_deviation_percent(predicted: Number, simulated: Number) -> Number:
    """Compute the deviation of a prediction, without sign, in percent of the simulation.

    The arguments are two numbers, or two columns of a table.
    """
    return 100 * abs(predicted - simulated) / abs(simulated)


def register(*responses: Response, family: Family | None = None) -> None:
    """Add responses of a bench test, or a family of them, to the registry.

    Raises
    ------
    ValueError
        If another response has one of the names.
    """
    if family is not None:
        _FAMILIES[family] = None
    for response in responses:
        known = _REGISTRY.setdefault(response.name, response)
        if known != response:
            raise ValueError(
                f"response {response.name!r} is registered already, by {known.apparatus}"
            )


def response(name: str, source: object = "response") -> Response:
    """Find a response by its name.

    Raises
    ------
    InputError
        If there is none; it names `source`.
    """
    known = find_response(name)
    if known is None:
        raise InputError(
            source=source,
            key="response",
            value=name,
            allowed=f"one of {', '.join(sorted(_REGISTRY))}",
        )
    return known


def find_response(name: str) -> Response | None:
    """Find a response by its name; None if there is no such response.

    The registered responses are searched first. Then each family is asked, a function
    that makes the response from its name, or returns None for a name that it does not
    know.
    """
    if name in _REGISTRY:
        return _REGISTRY[name]
    for find_in_family in _FAMILIES:
        found = find_in_family(name)
        if found is not None:
            return found
    return None


def list_responses(apparatus: str) -> tuple[Response, ...]:
    """List the responses of a bench test, in the order of their registration."""
    return tuple(
        response for response in _REGISTRY.values() if response.apparatus == apparatus
    )


def reject_other_definitions(
    definitions: Definitions, path: object, expected: Definitions, source: object
) -> None:
    """Raise InputError for a file that defines a response unlike another file.

    Parameters
    ----------
    definitions, expected : mapping
        Definitions of the two files.
    path, source : object
        The files, for the error.

    Raises
    ------
    InputError
        If a response that both have is defined differently.
    """
    for name, definition in definitions.items():
        if name in expected and definition != expected[name]:
            raise InputError(
                source=path,
                key=f"definition of {name}",
                value=definition,
                allowed=f"{expected[name]}, as in {source}",
            )
