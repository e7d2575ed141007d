"""The contact parameters that are calibrated, in the order every table uses: six, then the contact law's own."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from repose.common.errors import InputError, require
from repose.dem.constants import OF_LAWS, TWISTED_BY, TWISTING, Constant

PARAMETERS = ("e_gg", "mus_gg", "mur_gg", "e_gp", "mus_gp", "mur_gp")

PAIRS = {"gg": "grain-grain", "gp": "grain-wall"}
# Words, symbol, limits of any simulation (a larger friction is an angle in degrees), and what a configuration allows,
# to which its priors are cut.
_KINDS = {
    "e": ("restitution", "e_{", (0.01, 1.0), (0.01, 1.0)),
    "mus": ("static friction", r"\mu_{s,", (0.0, 10.0), (0.0, 5.0)),
    "mur": ("rolling friction", r"\mu_{r,", (0.0, 10.0), (0.0, 1.0)),
}

LABELS: dict[str, str] = {}
SYMBOLS: dict[str, str] = {}
PHYSICAL_LIMITS: dict[
    str, tuple[float, float]
] = {}  # a study's ranges lie inside (Table 2)
ALLOWED: dict[str, tuple[float, float]] = {}
for _name in PARAMETERS:
    _kind, _pair = _name.split("_")
    _words, _symbol, PHYSICAL_LIMITS[_name], ALLOWED[_name] = _KINDS[_kind]
    LABELS[_name], SYMBOLS[_name] = f"{_words}, {PAIRS[_pair]}", f"${_symbol}{_pair}}}$"


class Further(NamedTuple):
    """A parameter that some force laws add to the six."""

    laws: tuple[str, ...]
    constant: Constant
    pair: str  # of `PAIRS`
    needed: bool  # whether each of these laws needs it


def _further(constant: Constant, needed: bool, *laws: str) -> dict[str, Further]:
    """Name the parameters of a constant, one for each pair."""
    return {
        f"{constant.short}_{pair}": Further(laws, constant, pair, needed)
        for pair in PAIRS
    }


FURTHER: dict[str, Further] = {}
for _constant in dict.fromkeys(
    constant for constants in OF_LAWS.values() for constant in constants
):
    FURTHER |= _further(
        _constant, True, *(law for law, asks in OF_LAWS.items() if _constant in asks)
    )
FURTHER |= _further(TWISTING, False, *TWISTED_BY)
for _name, _of in FURTHER.items():
    _unit = f" ({_of.constant.unit})" if _of.constant.unit else ""
    LABELS[_name] = f"{_of.constant.words}{_unit}, {PAIRS[_of.pair]}"
    SYMBOLS[_name] = rf"${_of.constant.symbol}_{{{_of.pair}}}$"
    PHYSICAL_LIMITS[_name] = ALLOWED[_name] = (_of.constant.least, _of.constant.most)


def of_law(law: str) -> tuple[str, ...]:
    """Name the further parameters that a force law needs."""
    return tuple(
        name
        for name, further in FURTHER.items()
        if further.needed and law in further.laws
    )


def named(names: Iterable[str]) -> tuple[str, ...]:
    """Name the six parameters, and the further ones that are among some names, such as a table's columns."""
    given = set(names)
    return (*PARAMETERS, *(name for name in FURTHER if name in given))


NUMBER = re.compile(
    r"\s*[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf)\s*", re.ASCII | re.IGNORECASE
)


def plain_number(value: object) -> float:
    """Read a number as tables write it; ValueError for what only Python takes for one: 1_0, full-width digits."""
    if isinstance(value, str) and not NUMBER.fullmatch(value):
        raise ValueError(f"{value!r} is no number")
    return float(value)  # type: ignore[arg-type]


def check_value(
    name: str, value: object, source: object, key: str | None = None
) -> float:
    """Read a parameter's value, or its text, as a number within `PHYSICAL_LIMITS`; otherwise InputError."""
    key = name if key is None else key
    try:
        number = plain_number(value)
    except (TypeError, ValueError):
        raise InputError(source, key, value, "a number") from None
    low, high = PHYSICAL_LIMITS[name]
    require(low <= number <= high, source, key, number, f"{low:g} to {high:g}")
    return number
