"""The line that registers each surrogate of the package; `repose.calibrate.surrogates.base` imports it when a name is needed."""

from repose.calibrate.surrogates import (
    bayesian_bp,
    gaussian_process,
    network_ensemble,
    quadratic,
)

__all__ = ["bayesian_bp", "gaussian_process", "network_ensemble", "quadratic"]
