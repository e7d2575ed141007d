"""Checks of a user's values: each returns the value for the engine, or raises ValueError with its name and limits."""

import math
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np

from .errors import shown


def is_number(value: Any, *, finite: bool = True) -> bool:
    """Whether a value is a real number and not a truth value; `finite` False accepts infinite numbers, too."""
    if not isinstance(value, Real) or isinstance(value, bool | np.bool):
        return False
    return math.isfinite(value) if finite else not math.isnan(value)


def number(name: str, value: Any, allowed: str, accepts: Callable[[Any], Any]) -> float:
    """Check a finite number by `accepts`; `allowed` says in words which numbers are accepted."""
    if not (is_number(value) and accepts(value)):
        raise ValueError(f"{name} is {shown(value)}; expected {allowed}")
    return float(value)


def positive(name: str, value: Any) -> float:
    """Check a finite number above 0."""
    return number(name, value, "above 0", lambda v: v > 0.0)


def not_negative(name: str, value: Any) -> float:
    """Check a finite number, 0 or more."""
    return number(name, value, "0 or more", lambda v: v >= 0.0)


def height(name: str, value: Any) -> float:
    """Check a number that may be infinite: a height that no body reaches."""
    if not is_number(value, finite=False):
        raise ValueError(
            f"{name} is {shown(value)}; expected a number, or -inf for none"
        )
    return float(value)


def whole_number(name: str, value: Any, least: int) -> int:
    """Check a whole number, `least` or more."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise ValueError(
            f"{name} is {shown(value)}; expected a whole number, {least} or more"
        )
    return int(value)


def vector(name: str, value: Any, length: int = 3) -> np.ndarray:
    """Copy 3, 4 or 7 finite numbers."""
    words = {3: "three", 4: "four", 7: "seven"}[length]
    return array(name, value, (length,), f"{words} finite numbers")


def box(lower: Any, upper: Any) -> tuple[np.ndarray, np.ndarray]:
    """Copy two corners, the lower one below the upper one in every direction."""
    corners = vector("lower", lower), vector("upper", upper)
    if not np.all(corners[0] < corners[1]):
        raise ValueError(
            f"lower is {lower!r}, upper {upper!r}; expected lower below upper in every direction"
        )
    return corners


def array(
    name: str,
    value: Any,
    shape: tuple[int | None, ...],
    allowed: str,
    accepts: Callable[[np.ndarray], Any] = lambda _: True,
    rows: bool = False,
) -> np.ndarray:
    """Copy finite numbers of a shape that `accepts` accepts; `allowed` describes them in the error.

    A length None may be any; with `rows` a single row may be given without its brackets.
    """
    try:
        numbers = np.array(value, float, ndmin=len(shape) if rows else 0)
    except (TypeError, ValueError):
        numbers = np.full((1,) * len(shape), np.nan)
    fits = numbers.ndim == len(shape) and all(
        n in (None, m) for n, m in zip(shape, numbers.shape, strict=True)
    )
    if not (fits and np.all(np.isfinite(numbers)) and accepts(numbers)):
        raise ValueError(f"{name} is {shown(value)}; expected {allowed}")
    return numbers


def direction(name: str, value: Any, length: int = 3) -> np.ndarray:
    """Scale a vector of 3 or 4 numbers that are not all 0 to the length 1."""
    along = vector(name, value, length)
    size = np.linalg.norm(along)
    if not size > 0.0:
        raise ValueError(
            f"{name} is {shown(value)}; expected a vector that is not zero"
        )
    return along / size


def is_name(value: Any) -> bool:
    """Whether a value can be the name of a shape, a material or a wall: text that is not empty."""
    return isinstance(value, str) and bool(value)


def name_of(what: str, value: Any) -> str:
    """Check the name of a shape, a material or a wall; `what` is named in the error."""
    if not is_name(value):
        raise ValueError(
            f"{what} is {shown(value)}; expected a name, text that is not empty"
        )
    return value


def mapping(name: str, value: Any, kinds: Any, words: str) -> dict[str, Any]:
    """Copy a mapping of names to objects of some classes; `words` names the classes in the error."""
    good = isinstance(value, Mapping) and all(
        is_name(k) and isinstance(v, kinds) for k, v in value.items()
    )
    if not good:
        raise ValueError(
            f"{name} is {shown(value)}; expected names, each with a {words}"
        )
    return dict(value)


def chosen(name: str, value: Any, choices: Mapping[str, Any]) -> Any:
    """Look up a name among named choices."""
    if not (isinstance(value, str) and value in choices):
        raise ValueError(
            f"{name} is {shown(value)}; expected {', '.join(map(repr, choices))}"
        )
    return choices[value]
