"""repose: contact parameters of a discrete element model, calibrated from a pile."""

from typing import Any

__version__ = "0.4.0"
__all__ = ["Study", "__version__"]


def __getattr__(name: str) -> Any:
    """`Study`, which loads what the simulator alone does not need."""
    if name == "Study":
        from repose.config.study import Study

        return Study
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), "Study"})
