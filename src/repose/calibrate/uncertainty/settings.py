"""The sections `posterior` and `sensitivity` of the configuration.

config/README.md explains the keys.
"""

from typing import Annotated, Literal

from pydantic import Field

from repose.common.section import Allowed, PathOrNull, Section, Seed


class PosteriorSettings(Section):
    """Settings of the posterior of the parameters."""

    shape_study: PathOrNull = Field(
        description="table `combinations.csv` of a shape study, or null; a table "
        "replaces the next two keys",
    )

    discrepancy_percent: float = Field(
        ge=0,
        le=100,
        description="stated standard deviation of the model's error, in percent of "
        "each response's physical mean",
    )

    discrepancy_correlation: float = Field(
        ge=0,
        le=0.99,
        description="absolute correlation between the stated discrepancies of two "
        "responses of the same bench test; 0: independent",
    )

    measured_correlation: Annotated[
        Literal["simulated"] | Annotated[float, Field(ge=-0.99, le=0.99)],
        Allowed("simulated or a number from -0.99 to 0.99"),
    ] = Field(
        description="correlation between the errors of two measured responses of one "
        "bench test; `simulated`: as in simulated pours",
    )

    walkers: int = Field(
        ge=14,
        le=1000,
        description="walkers in each ensemble of the sampler",
    )

    steps: int = Field(
        ge=100,
        le=1000000,
        description="steps per walker; the first half is dropped",
    )

    seed: Seed = Field(
        description="seed of the sampler",
    )


class SensitivitySettings(Section):
    """Settings of Sobol's indices."""

    samples: Literal[64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768, 65536] = (
        Field(
            description="points of the Sobol sequence; the surrogate is evaluated "
            "eight times as often, with constraints 32 times for each parameter",
        )
    )

    resamples: int = Field(
        ge=20,
        le=10000,
        description="resamples of the bootstrap",
    )

    seed: Seed = Field(
        description="seed of the sequence and of the bootstrap",
    )
