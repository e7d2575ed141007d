"""The section `network` of the configuration: training of a surrogate."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, field_validator

from repose.calibrate.surrogates.two_layer import PRIORS
from repose.common.section import (
    AUTO,
    OF_OTHERS,
    Allowed,
    Contradictions,
    OneOf,
    OrAuto,
    Section,
    Seed,
    Share,
    refuse,
)

# The training of the article. A network that is made without settings has these values.
# Those of a study are in its configuration.
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
MAX_ROUNDING = 1e-6  # largest rounding error of the sum of the fractions
Shares = Annotated[tuple[Share, Share, Share], Field(strict=False), Allowed(SHARES)]


class NetworkSettings(Section):
    """Settings of the training; a surrogate takes those that it knows.

    config/README.md explains the keys.
    """

    hidden: int = Field(
        ge=1,
        le=100,
        description="neurons of the hidden layer",
        json_schema_extra={"source": "3.2: 12"},
    )

    epochs: int = Field(
        ge=1,
        le=100000,
        description="largest number of epochs of a start",
        json_schema_extra={"source": "3.2: 1500"},
    )

    goal: Share = Field(
        description="mean squared error of the scaled outputs at which training ends; "
        "0: at the objective's minimum",
        json_schema_extra={"source": "3.2: 1e-4"},
    )

    split: OrAuto[Shares] = Field(
        default=OF_OTHERS,
        description="shares of training, validation and test samples, sum 1; `auto`: "
        "0.70, 0.15, 0.15 for a network, else 0.85, 0, 0.15",
        json_schema_extra={"source": "4.1.1: 0.70, 0.15, 0.15"},
    )

    starts: int = Field(
        ge=1,
        le=1000,
        description="trainings from different first weights; of those that converged "
        "the one with the largest evidence is used",
        json_schema_extra={"source": "open"},
    )

    prior: Annotated[str, OneOf(lambda: PRIORS)] = Field(
        description="weights that share a regularisation: `one` for all, `layers`, or "
        "`inputs`, one for each input ([network.md](../docs/network.md))",
        json_schema_extra={"source": "3.2: one"},
    )

    replicates: bool = Field(
        description="whether the noise is estimated from repeated runs of a sample",
    )

    validation_noise: bool = Field(
        description="whether the correlation of the noises is estimated from the "
        "errors at the validation samples",
    )

    seed: Seed = Field(
        description="seed of the split and of the starts",
        json_schema_extra={"source": "4.1.1: 2026"},
    )

    @classmethod
    def from_keys(cls, keys: Mapping[str, Any]) -> Self:
        """Make settings from the known keys of a mapping, without checking them.

        Missing keys have the published values. Unknown keys are ignored.
        """
        known = {key: keys[key] for key in cls.model_fields if key in keys}
        return cls.model_construct(None, **PUBLISHED | known)

    @field_validator("split")
    @classmethod
    def _check_fractions(cls, shares: Any) -> Any:
        """Refuse shares that do not sum to 1, or without training or test samples."""
        if shares == AUTO:
            return shares
        training, _, test = shares
        if abs(sum(shares) - 1) > MAX_ROUNDING or training == 0 or test == 0:
            refuse([("", "three shares that sum to 1, training and test above 0")])
        return shares

    def contradictions(self) -> Contradictions:
        """Refuse two sources of the noise."""
        if self.validation_noise and self.replicates:
            yield (
                "validation_noise",
                "false where replicates is true: the runs of a sample show the noise",
            )


AS_PUBLISHED = NetworkSettings.from_keys({})
