"""The contact parameters that are calibrated, in the order every table uses: six, then the contact law's own."""

import math
from collections.abc import Iterable

from repose.core.errors import InputError
from repose.dem.constants import OF_LAWS

PARAMETERS = ("e_gg", "mus_gg", "mur_gg", "e_gp", "mus_gp", "mur_gp")

LABELS = {
    "e_gg": "restitution, grain-grain",
    "mus_gg": "static friction, grain-grain",
    "mur_gg": "rolling friction, grain-grain",
    "e_gp": "restitution, grain-wall",
    "mus_gp": "static friction, grain-wall",
    "mur_gp": "rolling friction, grain-wall",
}

SYMBOLS = {
    "e_gg": r"$e_{gg}$",
    "mus_gg": r"$\mu_{s,gg}$",
    "mur_gg": r"$\mu_{r,gg}$",
    "e_gp": r"$e_{gp}$",
    "mus_gp": r"$\mu_{s,gp}$",
    "mur_gp": r"$\mu_{r,gp}$",
}

# Limits of the contact law itself; a study's ranges lie inside (Table 2).
PHYSICAL_LIMITS = {name: (0.01, 1.0) if name.startswith("e_") else (0.0, math.inf) for name in PARAMETERS}

PAIRS = {"gg": "grain-grain", "gp": "grain-wall"}
# The further parameters that a contact law adds, such as gamma_gg of the law jkr: law, constant and pair by name.
FURTHER = {
    f"{constant.short}_{pair}": (law, constant, pair)
    for law, constants in OF_LAWS.items()
    for constant in constants
    for pair in PAIRS
}
for _name, (_law, _constant, _pair) in FURTHER.items():
    LABELS[_name] = f"{_constant.words} ({_constant.unit}), {PAIRS[_pair]}"
    SYMBOLS[_name] = rf"${_constant.symbol}_{{{_pair}}}$"
    PHYSICAL_LIMITS[_name] = (_constant.least, _constant.most)


def of_law(contact_law: str) -> tuple[str, ...]:
    """The further parameters of a contact law, by its name."""
    return tuple(name for name, (law, _, _) in FURTHER.items() if law == contact_law)


def named(names: Iterable[str]) -> tuple[str, ...]:
    """The six parameters, and the further ones that are among some names, such as a table's columns."""
    given = set(names)
    return (*PARAMETERS, *(name for name in FURTHER if name in given))


def check_value(name: str, value: object, source: object, key: str | None = None) -> float:
    """A parameter's value, or its text, as a finite number within `PHYSICAL_LIMITS`; otherwise InputError."""
    key = name if key is None else key
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InputError(source, key, value, "a number") from None
    low, high = PHYSICAL_LIMITS[name]
    if not low <= number <= high or math.isinf(number):
        limit = f"{low:g} to {high:g}" if high < math.inf else f"a finite number of at least {low:g}"
        raise InputError(source, key, number, limit)
    return number
