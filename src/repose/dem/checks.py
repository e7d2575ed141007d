"""Check the values that a user gives: numbers, vectors, names and mappings.

Each function returns the value in the form that the engine needs, or raises a
ValueError that names the argument, its value and what is allowed.
"""

import math
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np

from .errors import shown

NUMBER_WORDS = {3: "three", 4: "four", 7: "seven"}  # for messages


def is_number(value: Any, *, finite: bool = True) -> bool:
    """Return whether a value is a real number and not a truth value.

    Parameters
    ----------
    value : object
        Any value.
    finite : bool
        Whether to reject infinite numbers. NaN is always rejected.
    """
    if not isinstance(value, Real) or isinstance(value, bool | np.bool):
        return False
    return math.isfinite(value) if finite else not math.isnan(value)


def check_number(
    name: str, value: Any, allowed: str, accepts: Callable[[Any], Any]
) -> float:
    """Check that a value is a finite number for which a condition holds.

    Parameters
    ----------
    name : str
        The argument's name, for the message.
    value : object
        The value that the user gave.
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
        If the value is not such a number.
    """
    if not (is_number(value) and accepts(value)):
        raise ValueError(f"{name} is {shown(value)}; expected {allowed}")
    return float(value)


def check_positive(name: str, value: Any) -> float:
    """Check that a value is a finite number above 0."""
    return check_number(name, value, "above 0", lambda v: v > 0.0)


def check_not_negative(name: str, value: Any) -> float:
    """Check that a value is a finite number, 0 or more."""
    return check_number(name, value, "0 or more", lambda v: v >= 0.0)


def check_height(name: str, value: Any) -> float:
    """Check that a value is a height [m], finite or infinite.

    No body reaches an infinite height, so an infinite value switches the height off.
    """
    if not is_number(value, finite=False):
        raise ValueError(
            f"{name} is {shown(value)}; expected a number, or -inf for none"
        )
    return float(value)


def check_whole_number(name: str, value: Any, minimum: int) -> int:
    """Check that a value is a whole number, `minimum` or more."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < minimum:
        raise ValueError(
            f"{name} is {shown(value)}; expected a whole number, {minimum} or more"
        )
    return int(value)


def check_vector(name: str, value: Any, length: int = 3) -> np.ndarray:
    """Check that a value is a vector of 3, 4 or 7 finite numbers, and return a copy."""
    allowed = f"{NUMBER_WORDS[length]} finite numbers"
    return check_array(name, value, (length,), allowed)


def check_box(lower: Any, upper: Any) -> tuple[np.ndarray, np.ndarray]:
    """Check that two corners make a box, and return copies of both.

    Raises ValueError unless the lower corner is below the upper one in every direction.
    """
    lower_corner = check_vector("lower", lower)
    upper_corner = check_vector("upper", upper)
    if not np.all(lower_corner < upper_corner):
        raise ValueError(
            f"lower is {lower!r}, upper {upper!r}; "
            "expected lower below upper in every direction"
        )
    return lower_corner, upper_corner


def check_array(
    name: str,
    value: Any,
    shape: tuple[int | None, ...],
    allowed: str,
    accepts: Callable[[np.ndarray], Any] = lambda _: True,
    rows: bool = False,
) -> np.ndarray:
    """Check that a value is an array of finite numbers with a shape, and return a copy.

    Parameters
    ----------
    name : str
        The argument's name, for the message.
    value : object
        The value that the user gave.
    shape : tuple
        The length of each dimension; None stands for any length.
    allowed : str
        Describes the accepted values in the message.
    accepts : callable
        A further condition: a function of the array. The array is accepted if the
        result is true.
    rows : bool
        Whether a single row is accepted without the outer brackets, such as (x, y, z)
        in place of ((x, y, z),).

    Returns
    -------
    ndarray
        The numbers.

    Raises
    ------
    ValueError
        If the value is not such an array.
    """
    # With `ndmin`, numpy adds the missing outer dimension to a single row.
    fewest_dimensions = len(shape) if rows else 0
    try:
        numbers = np.array(value, float, ndmin=fewest_dimensions)
    except (TypeError, ValueError):
        # NaN is rejected below, since it is not finite.
        numbers = np.array(np.nan)
    is_valid = (
        _has_shape(numbers, shape) and np.all(np.isfinite(numbers)) and accepts(numbers)
    )
    if not is_valid:
        raise ValueError(f"{name} is {shown(value)}; expected {allowed}")
    return numbers


def _has_shape(numbers: np.ndarray, shape: tuple[int | None, ...]) -> bool:
    """Return whether an array has a shape in which None stands for any length."""
    if numbers.ndim != len(shape):
        return False
    return all(
        expected is None or expected == length
        for expected, length in zip(shape, numbers.shape, strict=True)
    )


def check_direction(name: str, value: Any, length: int = 3) -> np.ndarray:
    """Check that a vector of 3 or 4 numbers has a direction, and scale it to length 1.

    Raises ValueError for a vector of zeros.
    """
    numbers = check_vector(name, value, length)
    norm = np.linalg.norm(numbers)
    if not norm > 0.0:
        raise ValueError(
            f"{name} is {shown(value)}; expected a vector that is not zero"
        )
    return numbers / norm


def is_name(value: Any) -> bool:
    """Return whether a value can be the name of a shape, a material or a wall.

    A name is a string that is not empty.
    """
    return isinstance(value, str) and bool(value)


def check_name(argument: str, value: Any) -> str:
    """Check that an argument is the name of a shape, a material or a wall."""
    if not is_name(value):
        raise ValueError(
            f"{argument} is {shown(value)}; expected a name, a non-empty string"
        )
    return value


def check_mapping(
    name: str, value: Any, classes: Any, description: str
) -> dict[str, Any]:
    """Check that a value is a mapping of names to objects, and return a copy.

    Parameters
    ----------
    name : str
        The argument's name, for the message.
    value : object
        The value that the user gave.
    classes : class, union or tuple of classes
        Classes of which the objects may be instances.
    description : str
        Phrase that describes such an object in the message.

    Returns
    -------
    dict
        The copy.

    Raises
    ------
    ValueError
        If the value is not such a mapping.
    """
    is_valid = isinstance(value, Mapping) and all(
        is_name(key) and isinstance(item, classes) for key, item in value.items()
    )
    if not is_valid:
        raise ValueError(
            f"{name} is {shown(value)}; expected names, each with a {description}"
        )
    return dict(value)


def look_up_choice(name: str, value: Any, choices: Mapping[str, Any]) -> Any:
    """Look up the object of a name among the choices.

    Raises ValueError for an unknown name. The message lists all names.
    """
    if not (isinstance(value, str) and value in choices):
        raise ValueError(
            f"{name} is {shown(value)}; expected {', '.join(map(repr, choices))}"
        )
    return choices[value]
