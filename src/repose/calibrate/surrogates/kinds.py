"""The modules of the package's surrogates, each of which registers its class.

To add a surrogate to the package, import its module here.
"""

from repose.calibrate.surrogates import (
    bayesian_bp,
    gaussian_process,
    network_ensemble,
    quadratic,
)

__all__ = ["bayesian_bp", "gaussian_process", "network_ensemble", "quadratic"]
