"""Define names and limits of the contact parameters that are calibrated."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from repose.common.errors import InputError
from repose.dem.constants import OF_LAWS, TWISTING, Constant
from repose.dem.laws import ROLLING_LAWS

PARAMETERS = ("e_gg", "mus_gg", "mur_gg", "e_gp", "mus_gp", "mur_gp")
# The two contacts of a study, by the end of their parameters' names.
PAIRS = {"gg": "grain-grain", "gp": "grain-wall"}


class _Coefficient(NamedTuple):
    """A coefficient of a contact. Every study has it as a parameter for each pair."""

    label: str
    symbol: str  # LaTeX, up to the index that names the pair
    physical_limits: tuple[float, float]  # of any simulation
    allowed: tuple[float, float]  # limits of a configuration and of its priors


# A friction above 10 is probably an angle in degrees.
_COEFFICIENTS = {
    "e": _Coefficient("restitution", "e_{", (0.01, 1.0), (0.01, 1.0)),
    "mus": _Coefficient("static friction", r"\mu_{s,", (0.0, 10.0), (0.0, 5.0)),
    "mur": _Coefficient("rolling friction", r"\mu_{r,", (0.0, 10.0), (0.0, 1.0)),
}


@dataclass(frozen=True)
class Parameter:
    """A contact parameter of one pair of bodies."""

    name: str
    pair: str  # key of `PAIRS`
    label: str  # words with the unit and the pair
    symbol: str  # LaTeX
    physical_limits: tuple[float, float]  # of any simulation
    allowed: tuple[float, float]  # limits of a configuration


@dataclass(frozen=True)
class LawParameter(Parameter):
    """A contact parameter that only some force laws have."""

    constant: Constant  # constant of the engine that gets the value
    laws: tuple[str, ...]  # force laws that use it
    needed: bool  # whether these laws require it


def _make_parameter(name: str) -> Parameter:
    """Make one of the six parameters from its name."""
    kind, pair = name.split("_")
    coefficient = _COEFFICIENTS[kind]
    return Parameter(
        name=name,
        pair=pair,
        label=f"{coefficient.label}, {PAIRS[pair]}",
        symbol=f"${coefficient.symbol}{pair}}}$",
        physical_limits=coefficient.physical_limits,
        allowed=coefficient.allowed,
    )


def _make_law_parameter(
    constant: Constant, pair: str, laws: tuple[str, ...], needed: bool
) -> LawParameter:
    """Make the parameter of a constant for one pair of bodies.

    Parameters
    ----------
    constant : Constant
        The constant of the engine.
    pair : str
        The pair, a key of `PAIRS`.
    laws : tuple of str
        Force laws that use the constant.
    needed : bool
        Whether these laws cannot work without the parameter.
    """
    unit = f" ({constant.unit})" if constant.unit else ""
    limits = (constant.least, constant.most)
    return LawParameter(
        name=f"{constant.short}_{pair}",
        pair=pair,
        label=f"{constant.words}{unit}, {PAIRS[pair]}",
        symbol=rf"${constant.symbol}_{{{pair}}}$",
        physical_limits=limits,
        allowed=limits,
        constant=constant,
        laws=laws,
        needed=needed,
    )


def _make_law_parameters() -> list[LawParameter]:
    """Make the parameters that only some force laws have.

    They are added to the six parameters that every study has (`PARAMETERS`). Each
    constant of a force law has a parameter for each pair of bodies. The parameters of
    the twisting resistance come last. Rolling laws use this constant if it is given,
    but none needs it.
    """
    # `OF_LAWS` lists the constants of each law. Several laws may use the same constant,
    # so collect the laws of each constant first.
    laws_by_constant: dict[Constant, list[str]] = {}
    for law, constants in OF_LAWS.items():
        for constant in constants:
            laws_by_constant.setdefault(constant, []).append(law)
    parameters = []
    for constant, laws in laws_by_constant.items():
        for pair in PAIRS:
            parameters.append(
                _make_law_parameter(constant, pair, tuple(laws), needed=True)
            )
    # `entry` returns the description of a law; iterating over the laws gives their
    # names.
    twisting_laws = tuple(law for law in ROLLING_LAWS if ROLLING_LAWS.entry(law).twists)
    for pair in PAIRS:
        parameters.append(
            _make_law_parameter(TWISTING, pair, twisting_laws, needed=False)
        )
    return parameters


LAW_PARAMETERS = {parameter.name: parameter for parameter in _make_law_parameters()}
_ALL: list[Parameter] = [*map(_make_parameter, PARAMETERS), *LAW_PARAMETERS.values()]
LABELS = {parameter.name: parameter.label for parameter in _ALL}
SYMBOLS = {parameter.name: parameter.symbol for parameter in _ALL}
PHYSICAL_LIMITS = {parameter.name: parameter.physical_limits for parameter in _ALL}
ALLOWED = {parameter.name: parameter.allowed for parameter in _ALL}


def parameters_of_law(law: str) -> tuple[str, ...]:
    """List the parameters that a force law needs beyond the six of every study."""
    return tuple(
        name
        for name, parameter in LAW_PARAMETERS.items()
        if parameter.needed and law in parameter.laws
    )


def parameters_among(names: Iterable[str]) -> tuple[str, ...]:
    """List the contact parameters of a study in the order of all tables.

    Parameters
    ----------
    names : iterable of str
        Names that include those of the study's parameters, such as columns of a table.

    Returns
    -------
    tuple of str
        The six parameters of every study, even if `names` lacks them, and the
        parameters of force laws that are among the names.
    """
    known_names = set(names)
    law_names = (name for name in LAW_PARAMETERS if name in known_names)
    return (*PARAMETERS, *law_names)


NUMBER_PATTERN = re.compile(
    r"\s*[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf)\s*", re.ASCII | re.IGNORECASE
)


def read_number(value: object) -> float:
    """Convert a number, or a string as tables use it for a number, to a float.

    Parameters
    ----------
    value : object
        The number or the string.

    Raises
    ------
    ValueError
        For any other string, even if `float` would accept it, such as ``1_0`` or
        full-width digits.
    TypeError
        For an object that is neither a number nor a string.
    """
    if isinstance(value, str) and not NUMBER_PATTERN.fullmatch(value):
        raise ValueError(f"{value!r} is not a number")
    return float(value)  # type: ignore[arg-type]


def check_value(
    name: str, value: object, source: object, key: str | None = None
) -> float:
    """Read the value of a parameter and check it against its physical limits.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : object
        Value of the parameter, a number or a string that represents it.
    source : object
        File or command that the value comes from, for the error message.
    key : str, optional
        Key of the value there, for the error message; by default `name`.

    Returns
    -------
    float
        The value as a number.

    Raises
    ------
    InputError
        If the value is not a number, or is outside `PHYSICAL_LIMITS`.
    """
    shown_key = name if key is None else key
    try:
        number = read_number(value)
    except (TypeError, ValueError):
        raise InputError(source, shown_key, value, "a number") from None
    low, high = PHYSICAL_LIMITS[name]
    if not low <= number <= high:
        raise InputError(source, shown_key, number, f"{low:g} to {high:g}")
    return number
