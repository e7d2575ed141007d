"""The study of a picture: its configuration as typed sections, without checking it again."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from repose.bench.space import contact_space
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets

Config = Mapping[str, Any]


class Shown:
    """The study that a picture shows: what follows from its configuration, and sections as attributes, `study.drum`.

    The configuration was checked before, and may hold only what a figure says that it reads. `known` are `targets` and
    `space` where they follow from a configuration of another form.
    """

    def __init__(self, config: Config, **known: Any) -> None:
        self.config = config
        self.__dict__.update(known)

    def __getattr__(self, name: str) -> Any:
        from repose.config.models import settings_type

        value, model = self.config[name], settings_type().model_fields[name].annotation
        return (
            model.model_construct(**value)
            if isinstance(value, Mapping) and model
            else value
        )

    @cached_property
    def targets(self) -> Targets:
        """The targets, in the order of the configuration."""
        return Targets.of(self.config["targets"])

    @cached_property
    def space(self) -> ParameterSpace:
        """The parameters with their ranges."""
        return contact_space(self.config["parameters"])

    @cached_property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """The ends of the axis of each parameter: its range, with some room around a fixed value."""
        space = self.space
        ranges = dict(
            zip(
                space.free,
                zip(space.low.tolist(), space.high.tolist(), strict=True),
                strict=True,
            )
        )
        for name, value in space.fixed.items():
            room = 0.05 * abs(value) or 0.01
            ranges[name] = (value - room, value + room)
        return ranges
