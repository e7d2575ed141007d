"""The responses of bench tests, and their registry by name.

A response is a number that a bench test gives: the angle of repose of a pile, its height,
the angle at which a bed slips. Each bench test registers its responses in its module
(`repose.bench`). All later stages find them in this registry by name, and work for any
number of them.
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
        Column of every table; its last part is the unit, as in ``aor_deg``.
    unit : str
        As a reader writes it: ``deg``, ``mm``, ``%``, ``s``, or empty.
    label : str
        In words, as in ``angle of repose``.
    symbol : str
        Short, for axes and column heads, as in ``AoR``.
    apparatus : str
        Name of the bench test that gives it.
    low, high : float
        Limits of a target of the response, in its unit.
    definition : tuple of str
        Dotted keys of the configuration that define the number. Tables made with
        different definitions must not be mixed.
    function : function, optional
        ``function(run)`` is the number of a measured run, a mapping, or None where it
        could not be measured. By default the run has it by the name of the response.
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
        """Find the number in a measured run; None where it could not be measured."""
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
        return derived(self.name, "predicted")

    @property
    def optimism(self) -> str:
        """Column of the expected optimism of a prediction: ``aor_optimism_deg``."""
        return derived(self.name, "optimism")

    @property
    def optimism_error(self) -> str:
        """Column of its standard error: ``aor_optimism_se_deg``."""
        return derived(self.name, "optimism_se")

    @property
    def simulated(self) -> str:
        """Column of the simulated response, beside its prediction: ``aor_simulated_deg``."""
        return derived(self.name, "simulated")

    @property
    def standard_error(self) -> str:
        """Column of the standard error of a sample's mean: ``aor_se_deg``."""
        return derived(self.name, "se")

    @property
    def deviation_percent(self) -> str:
        """Column of a prediction's deviation from the simulation: ``aor_error_percent``.

        It has no sign, and is over the simulated response.
        """
        return f"{self.quantity}_error_percent"

    @property
    def quantity(self) -> str:
        """Name without the unit: ``aor``."""
        return self.name.rsplit("_", 1)[0]


def derived(name: str, what: str) -> str:
    """Name a column that belongs to a response.

    It has `what` before the unit, as in ``aor_se_deg``.
    """
    quantity, underscore, unit = name.rpartition("_")
    return f"{quantity}_{what}_{unit}" if underscore else f"{name}_{what}"


# From a name to a response of a bench test that gives any number of them, such as the
# scores of a profile.
Family = Callable[[str], Response | None]
_REGISTRY: dict[str, Response] = {}
# A mapping, so that a family that is registered twice is there once.
_FAMILIES: dict[Family, None] = {}


def deviation_percent(predicted: Number, simulated: Number) -> Number:
    """Compute the deviation of a prediction, without sign, in percent of the simulation.

    The arguments are two numbers, or two columns of a table.
    """
    return 100 * abs(predicted - simulated) / abs(simulated)


def register(*responses: Response, family: Family | None = None) -> None:
    """Make responses of a bench test known by their names.

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
    known = named(name)
    if known is None:
        allowed = f"one of {', '.join(sorted(_REGISTRY))}"
        raise InputError(source, "response", name, allowed)
    return known


def named(name: str) -> Response | None:
    """Find a response by its name, among the registered ones and then the families.

    The result is None if there is no such response.
    """
    if name in _REGISTRY:
        return _REGISTRY[name]
    for family in _FAMILIES:
        response_of_family = family(name)
        if response_of_family is not None:
            return response_of_family
    return None


def responses_of(apparatus: str) -> tuple[Response, ...]:
    """List the responses of a bench test, in the order of their registration."""
    return tuple(
        response for response in _REGISTRY.values() if response.apparatus == apparatus
    )


def require_same_definitions(
    definitions: Definitions, path: object, expected: Definitions, source: object
) -> None:
    """Refuse a file that defines a response differently from another file.

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
            allowed = f"{expected[name]}, as in {source}"
            raise InputError(path, f"definition of {name}", definition, allowed)
