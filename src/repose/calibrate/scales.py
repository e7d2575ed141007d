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

    forward: Callable[[np.ndarray], np.ndarray]  # from values to coordinates
    backward: Callable[[np.ndarray], np.ndarray]


def _same(values: np.ndarray) -> np.ndarray:
    """Return the values: the coordinates of the linear scale."""
    return values


SCALES = {LINEAR: Scale(_same, _same), LOG: Scale(np.log, np.exp)}


def to_coordinates(
    values: np.ndarray, names: Sequence[str], scale: Mapping[str, str]
) -> np.ndarray:
    """Turn values (n, p) into coordinates (n, p).

    Parameters
    ----------
    values : numpy.ndarray, (n, p)
    names : sequence of str
        Of the columns.
    scale : mapping
        Name of the scale by the name of the column. A column without one is linear.
    """
    functions = {name: SCALES[scale[name]].forward for name in scale}
    return _by_column(values, names, functions)


def to_values(
    coordinates: np.ndarray, names: Sequence[str], scale: Mapping[str, str]
) -> np.ndarray:
    """Turn coordinates (n, p) into values (n, p); the inverse of `to_coordinates`."""
    functions = {name: SCALES[scale[name]].backward for name in scale}
    return _by_column(coordinates, names, functions)


def _by_column(
    table: np.ndarray,
    names: Sequence[str],
    functions: Mapping[str, Callable[[np.ndarray], np.ndarray]],
) -> np.ndarray:
    """Apply a function to each column of a table (n, p) that has one, by its name."""
    if not functions:
        return table
    columns = []
    for name, column in zip(names, table.T, strict=True):
        columns.append(functions.get(name, _same)(column))
    return np.column_stack(columns)
