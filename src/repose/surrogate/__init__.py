"""Surrogates of the simulator, and the support of their samples.

`repose.surrogate.kinds` registers those of the package when the first name is looked up (`repose.surrogate.base`).
"""

from repose.surrogate.base import Surrogate, kind_of, load, make, names, register

__all__ = ["Surrogate", "kind_of", "load", "make", "names", "register"]
