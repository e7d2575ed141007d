"""The part of a study that the rooms below `repose.config` read."""

from collections.abc import Mapping
from typing import Any, Protocol

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Definitions
from repose.calibrate.targets import Targets


class Studied(Protocol):
    """Any `repose.Study`.

    Attributes
    ----------
    settings : StudySettings
        Typed sections; a strategy's section has its name. `settings.design.seed` is the seed of the study.
    config : mapping
        The same as plain values.
    definitions : mapping
        For each response the keys that define it, with their values.
    parameters : ParameterSpace
        Ranges, fixed values and priors.
    targets : Targets
        The measured responses.
    """

    @property
    def config(self) -> Mapping[str, Any]: ...

    @property
    def settings(self) -> Any: ...

    @property
    def definitions(self) -> Definitions: ...

    @property
    def parameters(self) -> ParameterSpace: ...

    @property
    def targets(self) -> Targets: ...
