"""The line that registers each surrogate of the package; `repose.surrogate.base` imports it when a name is needed."""

from repose.surrogate import bayesian_bp, gaussian_process, network_ensemble, quadratic

__all__ = ["bayesian_bp", "gaussian_process", "network_ensemble", "quadratic"]
