"""The section `network` of the configuration: training of a surrogate."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, field_validator

from repose.calibrate.surrogates.two_layer import PRIORS
from repose.common.section import (
    AUTO,
    OF_OTHERS,
    Contradictions,
    OneOf,
    OrAuto,
    Section,
    Seed,
    Share,
    refuse,
)

PUBLISHED: dict[str, Any] = {
    "hidden": 12,
    "epochs": 1500,
    "goal": 1e-4,
    "starts": 20,
    "prior": "one",
    "seed": 2026,
    "split": (0.70, 0.15, 0.15),
    "replicates": False,
    "validation_noise": False,
}
SHARES = "three shares (training, validation, test) that sum to 1"
LARGEST_ROUNDING = 1e-6  # of the sum of the shares
Shares = Annotated[tuple[Share, Share, Share], Field(strict=False, description=SHARES)]


class NetworkSettings(Section):
    """Settings of the training; a surrogate takes those that it knows.

    config/README.md explains the keys.
    """

    hidden: int = Field(ge=1, le=100)
    """Neurons of the hidden layer."""

    epochs: int = Field(ge=1, le=100000)
    """Largest number of steps of a start."""

    goal: Share
    """Mean squared error of the scaled outputs at which training stops."""

    split: OrAuto[Shares] = OF_OTHERS
    """Shares of the samples for training, validation and test."""

    starts: int = Field(ge=1, le=1000)
    """Number of starts of the training."""

    prior: Annotated[str, OneOf(lambda: PRIORS)]
    """Which weights share a regularisation."""

    replicates: bool
    """Whether the runs of each sample give the noise."""

    validation_noise: bool
    """Whether the errors of a first fit at the validation samples give the noise."""

    seed: Seed
    """Of the split and of the first weights."""

    @classmethod
    def of(cls, keys: Mapping[str, Any]) -> Self:
        """Take the known keys of a mapping, unchecked; the others are as published."""
        known = {key: keys[key] for key in cls.model_fields if key in keys}
        return cls.model_construct(None, **PUBLISHED | known)

    @field_validator("split")
    @classmethod
    def _check_shares(cls, shares: Any) -> Any:
        """Refuse shares that do not sum to 1, or without training or test samples."""
        if shares == AUTO:
            return shares
        training, _, test = shares
        if abs(sum(shares) - 1) > LARGEST_ROUNDING or training == 0 or test == 0:
            refuse([("", "three shares that sum to 1, training and test above 0")])
        return shares

    def contradictions(self) -> Contradictions:
        """Refuse two sources of the noise."""
        if self.validation_noise and self.replicates:
            yield (
                "validation_noise",
                "false where replicates is true: the runs of a sample show the noise",
            )


AS_PUBLISHED = NetworkSettings.of({})
