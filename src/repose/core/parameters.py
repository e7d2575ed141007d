"""The six contact parameters that are calibrated, in the order every table uses."""

import math

from repose.core.errors import InputError

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


def check_value(name: str, value: object, source: object, key: str | None = None) -> float:
    """A parameter's value, or its text, as a finite number within `PHYSICAL_LIMITS`; otherwise InputError.

    The message names `source` and `key` (default: the name of the parameter).
    """
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
