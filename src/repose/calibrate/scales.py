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
    if not scale:
        return values
    columns = []
    for name, column in zip(names, values.T, strict=True):
        columns.append(SCALES[scale.get(name, LINEAR)].forward(column))
    return np.column_stack(columns)


def to_values(
    coordinates: np.ndarray, names: Sequence[str], scale: Mapping[str, str]
) -> np.ndarray:
    """Turn coordinates (n, p) into values (n, p); the inverse of `to_coordinates`."""
    if not scale:
        return coordinates
    columns = []
    for name, column in zip(names, coordinates.T, strict=True):
        columns.append(SCALES[scale.get(name, LINEAR)].backward(column))
    return np.column_stack(columns)
