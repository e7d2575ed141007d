"""Surrogates of the simulator, and the support of their samples.

Importing this package registers every surrogate (`repose.surrogate.base`).
"""

from repose.surrogate import bayesian_bp, gaussian_process, network_ensemble, quadratic
from repose.surrogate.base import Surrogate, load, make, names, register

__all__ = [
    "Surrogate",
    "bayesian_bp",
    "gaussian_process",
    "load",
    "make",
    "names",
    "network_ensemble",
    "quadratic",
    "register",
]
