"""The settings of a calibration as typed sections."""

from collections.abc import Iterable
from typing import Annotated

from pydantic import Field

from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.strategies.refined import RefineSettings
from repose.calibrate.strategies.response_surface import ResponseSurfaceSettings
from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.uncertainty.settings import PosteriorSettings
from repose.common.section import OneOf, Section


def _strategy_names() -> Iterable[str]:
    """List the strategies that are registered when the first configuration is read."""
    from repose.calibrate import strategies

    return strategies.names()


def _surrogate_names() -> Iterable[str]:
    """List the surrogates that are registered when the first configuration is read."""
    from repose.calibrate import surrogates

    return surrogates.names()


StrategyName = Annotated[str, OneOf(_strategy_names)]
SurrogateName = Annotated[str, OneOf(_surrogate_names)]


class CalibrationSettings(Section):
    """All that a calibration reads besides its parameters, targets and runs.

    `repose.calibrate.study_file` makes it of the short configuration of a simulator of
    the user's own, `repose.config.pipeline` of a whole configuration.
    """

    label: str = Field(description="name of the material")
    simulator: str = Field(description="name of the simulator")
    strategy: StrategyName
    surrogate: SurrogateName
    seeds: int = Field(description="runs of each sample of the first design")
    design: DesignSettings
    network: NetworkSettings
    miga: MigaSettings
    posterior: PosteriorSettings
    sequential: SequentialSettings
    response_surface: ResponseSurfaceSettings
    refine: RefineSettings
    others: dict[str, Section] = Field(
        default={},
        description="sections of further strategies, by the name of the strategy",
    )
    noise_sd: dict[str, float] | None = Field(
        default=None,
        description="known standard deviation of a single run by response; null where "
        "the repeated runs alone show the noise",
    )
    definitions: dict[str, str] = Field(
        default={}, description="how a response is taken from a run, in words"
    )

    def of_strategy(self, name: str) -> Section | None:
        """Return the section with the name of a strategy; None if it has none."""
        if name == "sequential":
            return self.sequential
        if name == "response_surface":
            return self.response_surface
        return self.others.get(name)
