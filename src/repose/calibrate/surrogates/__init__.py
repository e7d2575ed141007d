"""Surrogates of the simulator, and the support of their samples.

`repose.calibrate.surrogates.kinds` registers those of the package when the first name is looked up (`repose.calibrate.surrogates.base`).
"""

from repose.calibrate.surrogates.base import (
    Surrogate,
    kind_of,
    load,
    make,
    names,
    register,
)

__all__ = ["Surrogate", "kind_of", "load", "make", "names", "register"]
