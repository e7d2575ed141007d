"""The sections `posterior` and `sensitivity` of the configuration; config/README.md explains the keys."""

from typing import Annotated, Literal

from pydantic import Field

from repose.common.section import PathOrNull, Section, Seed


class PosteriorSettings(Section):
    """Settings of the posterior of the parameters."""

    shape_study: (
        PathOrNull  # table whose models give the discrepancy; null: it is stated
    )
    discrepancy_percent: float = Field(
        ge=0, le=100
    )  # of each response's mean, that no parameters remove
    discrepancy_correlation: float = Field(ge=0, le=0.99)  # within a bench test
    measured_correlation: (
        Literal["simulated"] | Annotated[float, Field(ge=-0.99, le=0.99)]
    ) = Field(description="simulated or a number from -0.99 to 0.99")
    walkers: int = Field(ge=14, le=1000)
    steps: int = Field(ge=100, le=1000000)
    seed: Seed


class SensitivitySettings(Section):
    """Settings of Sobol's indices."""

    samples: Literal[64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768, 65536]
    resamples: int = Field(ge=20, le=10000)  # of the bootstrap
    seed: Seed
