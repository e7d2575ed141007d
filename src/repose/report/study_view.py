"""The study behind a picture: its configuration as typed sections, without a new check."""

from collections.abc import Mapping
from functools import cached_property
from types import SimpleNamespace
from typing import Any

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets

Config = Mapping[str, Any]


class StudyView:
    """The study behind a figure or a report.

    The configuration was checked before. It may hold only the sections that a figure
    reads, so it is not checked again and a missing section is no error.

    Parameters
    ----------
    config : mapping
        The configuration, or some of its sections, as plain values.
    """

    def __init__(self, config: Config) -> None:
        self.config = config

    @cached_property
    def settings(self) -> Any:
        """The sections of the configuration as attributes, such as `settings.drum`."""
        from pydantic import BaseModel

        from repose.config.models import settings_type  # slow to import

        fields = settings_type().model_fields
        settings = SimpleNamespace()
        for name, value in self.config.items():
            model = fields[name].annotation if name in fields else None
            if (
                isinstance(value, Mapping)
                and isinstance(model, type)
                and issubclass(model, BaseModel)
            ):
                value = model.model_construct(**value)
            setattr(settings, name, value)
        return settings

    @cached_property
    def targets(self) -> Targets:
        """The targets, in the order of the configuration."""
        return Targets.of(self.config["targets"])

    @cached_property
    def parameters(self) -> ParameterSpace:
        """The parameters with their ranges, fixed values and priors."""
        return ParameterSpace.of(self.config["parameters"])


def parameter_ranges(parameters: ParameterSpace) -> dict[str, tuple[float, float]]:
    """Give the lower and upper end of the range of each free parameter, by name."""
    lows = parameters.low.tolist()
    highs = parameters.high.tolist()
    ends = zip(lows, highs, strict=True)
    return dict(zip(parameters.free, ends, strict=True))
