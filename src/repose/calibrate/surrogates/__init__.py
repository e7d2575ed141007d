"""Surrogates of the simulator, and the support of their samples.

`repose.calibrate.surrogates.base` has the interface,
`repose.calibrate.surrogates.registry` makes and loads surrogates by name.
"""

from repose.calibrate.surrogates.base import Surrogate, register
from repose.calibrate.surrogates.registry import (
    load,
    make,
    names,
    on_scale,
    surrogate_class,
)

__all__ = [
    "Surrogate",
    "load",
    "make",
    "names",
    "on_scale",
    "register",
    "surrogate_class",
]
