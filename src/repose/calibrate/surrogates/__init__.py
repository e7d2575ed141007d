"""Surrogates of the simulator, and the support of their samples.

`repose.calibrate.surrogates.base` has the interface,
`repose.calibrate.surrogates.registry` makes and loads surrogates by name.
"""

from repose.calibrate.surrogates.base import Surrogate, register
from repose.calibrate.surrogates.registry import (
    find_surrogate_class,
    load,
    make,
    names,
    wrap_for_scale,
)

__all__ = [
    "Surrogate",
    "find_surrogate_class",
    "load",
    "make",
    "names",
    "register",
    "wrap_for_scale",
]
