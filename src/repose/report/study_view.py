"""Give figures access to their study: its configuration, or the sections that they read."""

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets
from repose.common.section import Section

if TYPE_CHECKING:
    from repose.config.models import StudySettings

Config = Mapping[str, Any]
S = TypeVar("S", bound=Section)


class StudyView:
    """The study behind a figure or a report.

    Parameters
    ----------
    config : mapping
        The configuration as plain values, such as `PipelineConfig.config`. It has
        already been checked, and is not checked again. It may contain only the sections
        that a figure reads.
    """

    def __init__(self, config: Config) -> None:
        self.config = config

    @cached_property
    def settings(self) -> "StudySettings":
        """The sections of the configuration as attributes, with their types.

        The configuration may lack sections. Reading the attribute of such a section
        raises AttributeError, unless the section has a default.
        """
        from repose.config.models import make_settings_type  # slow to import

        settings_type = make_settings_type()
        sections: dict[str, Any] = {}
        for name, value in self.config.items():
            # Studies in research/ have further sections, which have no type.
            if name not in settings_type.model_fields:
                continue
            # The annotation of a section is a class. Other values have annotations such
            # as `float | None`, which are no classes, and stay as they are.
            annotation = settings_type.model_fields[name].annotation
            if (
                isinstance(value, Mapping)
                and isinstance(annotation, type)
                and issubclass(annotation, Section)
            ):
                value = annotation.model_construct(**value)
            sections[name] = value
        # `model_construct` does not check the values, because they have already been
        # checked, and because sections may be missing.
        return settings_type.model_construct(**sections)

    @property
    def simulator(self) -> str | None:
        """Name of the program that made the runs; None for our own simulator."""
        section = self.config.get("simulator")
        return None if section is None else str(section["name"])

    def section(self, name: str, model: type[S]) -> S:
        """Return the section of a bench test other than the funnel, with its type.

        Parameters
        ----------
        name : str
            Name of the section.
        model : type
            Type of the section, a subclass of `Section`. Its values are not checked
            again.

        Returns
        -------
        Section
            The section.
        """
        return model.model_construct(**self.config[name])

    @cached_property
    def targets(self) -> Targets:
        """The targets, in the order of the configuration."""
        return Targets.of(self.config["targets"])

    @cached_property
    def parameters(self) -> ParameterSpace:
        """The parameters with their ranges, fixed values and priors.

        The contact parameters of our simulator have the order of all tables, which need
        not be that of the configuration.
        """
        section = self.config["parameters"]
        constraints = self.config.get("constraints")
        if "simulator" not in self.config and set(PARAMETERS) <= set(section):
            return contact_space(section).with_constraints(constraints)
        return ParameterSpace.of(section, constraints=constraints)


def compute_cell_edges(parameters: ParameterSpace, name: str, count: int) -> np.ndarray:
    """Divide the range of a free parameter into equal cells, along its scale.

    Parameters
    ----------
    parameters : ParameterSpace
        The parameters of the study.
    name : str
        Name of the parameter.
    count : int
        Number of cells.

    Returns
    -------
    ndarray
        The edges (count + 1,) of the cells.
    """
    if name in parameters.scale:
        return parameters.values_at(name, np.linspace(0, 1, count + 1))
    low, high = parameter_ranges(parameters)[name]
    return np.linspace(low, high, count + 1)


def parameter_ranges(parameters: ParameterSpace) -> dict[str, tuple[float, float]]:
    """Return the lower and upper end of the range of each free parameter, by name."""
    lows = parameters.low.tolist()
    highs = parameters.high.tolist()
    ends = zip(lows, highs, strict=True)
    return dict(zip(parameters.free, ends, strict=True))
