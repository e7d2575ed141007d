"""Surrogates of the simulator, and the support of their samples.

Importing this package registers every surrogate (`repose.surrogate.base`).
"""

# The line that registers each surrogate.
from repose.surrogate import bayesian_bp, gaussian_process, network_ensemble, quadratic  # noqa: F401
from repose.surrogate.base import Surrogate, kind_of, load, make, names, register

__all__ = ["Surrogate", "kind_of", "load", "make", "names", "register"]
