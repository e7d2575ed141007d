"""Scales of parameters: how values become coordinates in which the method works.

A range of several decades is searched evenly in the logarithm. On the scale ``log`` the
design, the surrogate, the search and the prior use the logarithm of the value. All
tables keep the values themselves.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

LINEAR = "linear"
LOG = "log"


class Scale(NamedTuple):
    """A rising function of a value, and its inverse."""

    forward: Callable[[np.ndarray], np.ndarray]  # converts values to coordinates
    backward: Callable[[np.ndarray], np.ndarray]


def _identity(values: np.ndarray) -> np.ndarray:
    """Return the values unchanged: on the linear scale they are the coordinates."""
    return values


SCALES = {LINEAR: Scale(_identity, _identity), LOG: Scale(np.log, np.exp)}


def to_coordinates(
    values: np.ndarray, names: Sequence[str], scale: Mapping[str, str]
) -> np.ndarray:
    """Turn values (n, p) into coordinates (n, p).

    Parameters
    ----------
    values : numpy.ndarray, (n, p)
        Parameter sets.
    names : sequence of str
        Names of the columns.
    scale : mapping
        Name of the scale by the name of the column. A column without one is linear.
    """
    functions = {name: SCALES[scale[name]].forward for name in scale}
    return _apply_by_column(values, names, functions)


def to_values(
    coordinates: np.ndarray, names: Sequence[str], scale: Mapping[str, str]
) -> np.ndarray:
    """Turn coordinates (n, p) into values (n, p); the inverse of `to_coordinates`."""
    functions = {name: SCALES[scale[name]].backward for name in scale}
    return _apply_by_column(coordinates, names, functions)


def _apply_by_column(
    table: np.ndarray,
    names: Sequence[str],
    functions: Mapping[str, Callable[[np.ndarray], np.ndarray]],
) -> np.ndarray:
    """Apply functions to columns of a table (n, p).

    `functions` has a function for some of the column `names`. The other columns are
    unchanged. Without functions, the table itself is returned, not a copy.
    """
    if not functions:
        return table
    columns = []
    for name, column in zip(names, table.T, strict=True):
        columns.append(functions.get(name, _identity)(column))
    return np.column_stack(columns)
