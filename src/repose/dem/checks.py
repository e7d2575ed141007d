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
    """A finite number that `accepts` accepts; `allowed` says in words which numbers are accepted."""
    if not (is_number(value) and accepts(value)):
        raise ValueError(f"{name} is {shown(value)}; expected {allowed}")
    return float(value)


def positive(name: str, value: Any) -> float:
    """A finite number above 0."""
    return number(name, value, "above 0", lambda v: v > 0.0)


def not_negative(name: str, value: Any) -> float:
    """A finite number, 0 or more."""
    return number(name, value, "0 or more", lambda v: v >= 0.0)


def height(name: str, value: Any) -> float:
    """A number that may be infinite: a height that no body reaches."""
    if not is_number(value, finite=False):
        raise ValueError(f"{name} is {shown(value)}; expected a number, or -inf for none")
    return float(value)


def whole_number(name: str, value: Any, least: int) -> int:
    """A whole number, `least` or more."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise ValueError(f"{name} is {shown(value)}; expected a whole number, {least} or more")
    return int(value)


def vector(name: str, value: Any, length: int = 3) -> np.ndarray:
    """A copy of 3, 4 or 7 finite numbers."""
    words = {3: "three", 4: "four", 7: "seven"}[length]
    return array(name, value, (length,), f"{words} finite numbers")


def box(lower: Any, upper: Any) -> tuple[np.ndarray, np.ndarray]:
    """Copies of two corners, the lower one below the upper one in every direction."""
    corners = vector("lower", lower), vector("upper", upper)
    if not np.all(corners[0] < corners[1]):
        raise ValueError(f"lower is {lower!r}, upper {upper!r}; expected lower below upper in every direction")
    return corners


def array(name: str, value: Any, shape: tuple[int, ...], allowed: str) -> np.ndarray:
    """A copy of finite numbers of a shape; `allowed` is their description in the error."""
    numbers: np.ndarray | None
    try:
        numbers = np.array(value, float)
    except (TypeError, ValueError):
        numbers = None
    if numbers is None or numbers.shape != shape or not np.all(np.isfinite(numbers)):
        raise ValueError(f"{name} is {shown(value)}; expected {allowed}")
    return numbers


def direction(name: str, value: Any) -> np.ndarray:
    """The unit vector (3,) along a vector of a length above 0."""
    along = vector(name, value)
    length = np.linalg.norm(along)
    if not length > 0.0:
        raise ValueError(f"{name} is {shown(value)}; expected a vector that is not zero")
    return along / length


def is_name(value: Any) -> bool:
    """Whether a value can be the name of a shape, a material or a wall: text that is not empty."""
    return isinstance(value, str) and bool(value)


def name_of(what: str, value: Any) -> str:
    """The name of a shape, a material or a wall; `what` is named in the error."""
    if not is_name(value):
        raise ValueError(f"{what} is {shown(value)}; expected a name, text that is not empty")
    return value


def mapping(name: str, value: Any, kinds: Any, words: str) -> dict[str, Any]:
    """Names and objects of some classes, as a new dictionary; `words` is the name of the classes in the error."""
    good = isinstance(value, Mapping) and all(is_name(k) and isinstance(v, kinds) for k, v in value.items())
    if not good:
        raise ValueError(f"{name} is {shown(value)}; expected names, each with a {words}")
    return dict(value)


def chosen(name: str, value: Any, choices: Mapping[str, Any]) -> Any:
    """The value of a name among named choices."""
    if not (isinstance(value, str) and value in choices):
        raise ValueError(f"{name} is {shown(value)}; expected {', '.join(map(repr, choices))}")
    return choices[value]
