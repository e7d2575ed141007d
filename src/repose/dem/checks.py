"""Check a user's values: numbers, vectors, names and mappings.

Each function returns the value in the form that the engine needs, or raises a
ValueError that names the argument, its value and what is allowed.
"""

import math
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np

from .errors import shown

NUMBER_WORDS = {3: "three", 4: "four", 7: "seven"}


def is_number(value: Any, *, finite: bool = True) -> bool:
    """Return whether a value is a real number and not a truth value.

    Parameters
    ----------
    value : object
        Any value.
    finite : bool
        Whether infinite numbers are refused. Nan always is.
    """
    if not isinstance(value, Real) or isinstance(value, bool | np.bool):
        return False
    return math.isfinite(value) if finite else not math.isnan(value)


def number(name: str, value: Any, allowed: str, accepts: Callable[[Any], Any]) -> float:
    """Check that a value is a finite number for which a condition holds.

    Parameters
    ----------
    name : str
        The argument's name, for the message.
    value : object
        What the user gave.
    allowed : str
        Describes the accepted numbers in the message.
    accepts : callable
        The condition, a function of the number.

    Returns
    -------
    float
        The number.

    Raises
    ------
    ValueError
        If the value is no such number.
    """
    if not (is_number(value) and accepts(value)):
        raise ValueError(f"{name} is {shown(value)}; expected {allowed}")
    return float(value)


def positive(name: str, value: Any) -> float:
    """Check that a value is a finite number above 0."""
    return number(name, value, "above 0", lambda v: v > 0.0)


def not_negative(name: str, value: Any) -> float:
    """Check that a value is a finite number, 0 or more."""
    return number(name, value, "0 or more", lambda v: v >= 0.0)


def height(name: str, value: Any) -> float:
    """Check that a value is a height; it may be infinite, which no body reaches."""
    if not is_number(value, finite=False):
        raise ValueError(
            f"{name} is {shown(value)}; expected a number, or -inf for none"
        )
    return float(value)


def whole_number(name: str, value: Any, minimum: int) -> int:
    """Check that a value is a whole number, `minimum` or more."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < minimum:
        raise ValueError(
            f"{name} is {shown(value)}; expected a whole number, {minimum} or more"
        )
    return int(value)


def vector(name: str, value: Any, length: int = 3) -> np.ndarray:
    """Copy a vector of 3, 4 or 7 finite numbers."""
    allowed = f"{NUMBER_WORDS[length]} finite numbers"
    return array(name, value, (length,), allowed)


def box(lower: Any, upper: Any) -> tuple[np.ndarray, np.ndarray]:
    """Copy the lower and the upper corner of a box; ValueError if they are no box."""
    low = vector("lower", lower)
    high = vector("upper", upper)
    if not np.all(low < high):
        raise ValueError(
            f"lower is {lower!r}, upper {upper!r}; "
            "expected lower below upper in every direction"
        )
    return low, high


def array(
    name: str,
    value: Any,
    shape: tuple[int | None, ...],
    allowed: str,
    accepts: Callable[[np.ndarray], Any] = lambda _: True,
    rows: bool = False,
) -> np.ndarray:
    """Copy finite numbers to an array of a given shape.

    Parameters
    ----------
    name : str
        The argument's name, for the message.
    value : Any
        What the user gave.
    shape : tuple
        The length of each dimension; None stands for any length.
    allowed : str
        Describes the accepted values in the message.
    accepts : callable
        Further condition that the array must fulfil.
    rows : bool
        Accept a single row without the brackets around it.

    Returns
    -------
    ndarray
        The numbers.

    Raises
    ------
    ValueError
        If the value is no such array.
    """
    # A row without brackets gets them if two dimensions are the least.
    fewest_dimensions = len(shape) if rows else 0
    try:
        numbers = np.array(value, float, ndmin=fewest_dimensions)
    except (TypeError, ValueError):
        numbers = np.array(np.nan)  # not finite, so it is refused below
    is_valid = (
        _has_shape(numbers, shape) and np.all(np.isfinite(numbers)) and accepts(numbers)
    )
    if not is_valid:
        raise ValueError(f"{name} is {shown(value)}; expected {allowed}")
    return numbers


def _has_shape(numbers: np.ndarray, shape: tuple[int | None, ...]) -> bool:
    """Return whether an array has a shape, in which None stands for any length."""
    if numbers.ndim != len(shape):
        return False
    return all(
        expected is None or expected == length
        for expected, length in zip(shape, numbers.shape, strict=True)
    )


def direction(name: str, value: Any, length: int = 3) -> np.ndarray:
    """Scale a vector of 3 or 4 numbers to unit length; ValueError for a zero vector."""
    numbers = vector(name, value, length)
    norm = np.linalg.norm(numbers)
    if not norm > 0.0:
        raise ValueError(
            f"{name} is {shown(value)}; expected a vector that is not zero"
        )
    return numbers / norm


def is_name(value: Any) -> bool:
    """Return whether a value can be the name of a shape, a material or a wall.

    A name is a text that is not empty.
    """
    return isinstance(value, str) and bool(value)


def name_of(argument: str, value: Any) -> str:
    """Check that an argument is the name of a shape, a material or a wall."""
    if not is_name(value):
        raise ValueError(
            f"{argument} is {shown(value)}; expected a name, text that is not empty"
        )
    return value


def mapping(name: str, value: Any, classes: Any, description: str) -> dict[str, Any]:
    """Copy a mapping of names to objects.

    Parameters
    ----------
    name : str
        The argument's name, for the message.
    value : object
        What the user gave.
    classes : class, union or tuple of classes
        What the objects may be.
    description : str
        Names these classes in the message.

    Returns
    -------
    dict
        The copy.

    Raises
    ------
    ValueError
        If the value is no such mapping.
    """
    is_valid = isinstance(value, Mapping) and all(
        is_name(key) and isinstance(item, classes) for key, item in value.items()
    )
    if not is_valid:
        raise ValueError(
            f"{name} is {shown(value)}; expected names, each with a {description}"
        )
    return dict(value)


def chosen(name: str, value: Any, choices: Mapping[str, Any]) -> Any:
    """Look up the object of a name; ValueError with all names for an unknown one."""
    if not (isinstance(value, str) and value in choices):
        raise ValueError(
            f"{name} is {shown(value)}; expected {', '.join(map(repr, choices))}"
        )
    return choices[value]
