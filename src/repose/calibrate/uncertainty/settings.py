"""The sections `posterior` and `sensitivity` of the configuration.

config/README.md explains the keys.
"""

from typing import Annotated, Literal

from pydantic import Field

from repose.common.section import PathOrNull, Section, Seed


class PosteriorSettings(Section):
    """Settings of the posterior of the parameters."""

    shape_study: PathOrNull
    """Table whose models give the discrepancy; null: the next two keys state it."""

    discrepancy_percent: float = Field(ge=0, le=100)
    """Standard deviation of each response's discrepancy, in percent of its value."""

    discrepancy_correlation: float = Field(ge=0, le=0.99)
    """Correlation of the discrepancies within a bench test."""

    measured_correlation: (
        Literal["simulated"] | Annotated[float, Field(ge=-0.99, le=0.99)]
    ) = Field(description="simulated or a number from -0.99 to 0.99")
    """Correlation of the measured responses; simulated: that of the simulated runs."""

    walkers: int = Field(ge=14, le=1000)
    """Walkers of each ensemble of the sampler."""

    steps: int = Field(ge=100, le=1000000)
    """Steps of each walker."""

    seed: Seed
    """Of the random numbers of the sampler."""


class SensitivitySettings(Section):
    """Settings of Sobol's indices."""

    samples: Literal[64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768, 65536]
    """Number of points of the sequence."""

    resamples: int = Field(ge=20, le=10000)
    """Number of resamples of the bootstrap."""

    seed: Seed
    """Of the sequence and of the bootstrap."""
