"""The modules of the package's surrogates, each of which registers its class.

To add a surrogate to the package, import its module here.
"""

# They are listed in this order.
from repose.calibrate.surrogates import bayesian_bp  # noqa: F401, isort: skip
from repose.calibrate.surrogates import gaussian_process  # noqa: F401, isort: skip
from repose.calibrate.surrogates import network_ensemble  # noqa: F401, isort: skip
from repose.calibrate.surrogates import quadratic  # noqa: F401, isort: skip
