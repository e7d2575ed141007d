"""repose: contact parameters of a discrete element model, calibrated from a pile."""

__version__ = "0.2.0"
