"""repose: contact parameters of a discrete element model, calibrated from a pile."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from repose.calibrate.study import Study
    from repose.config.pipeline import PipelineConfig

__version__ = "0.4.0"
__all__ = ["PipelineConfig", "Study", "__version__"]


def __getattr__(name: str) -> Any:
    """Load a public class when it is asked for: the simulator alone needs none of it."""
    if name == "Study":
        from repose.calibrate.study import Study

        return Study
    if name == "PipelineConfig":
        from repose.config.pipeline import PipelineConfig

        return PipelineConfig
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
