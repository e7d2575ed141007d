"""The section `design` of the configuration; config/README.md explains the keys."""

from typing import Literal

from pydantic import Field

from repose.common.section import Section, Seed


class DesignSettings(Section):
    """Settings of the design of experiments."""

    method: Literal["optimal", "lhsdesign"] = Field(
        description="`lhsdesign`: a Latin hypercube; `optimal`: one whose samples are "
        "as far apart as possible",
        json_schema_extra={"source": "3.2.1; `optimal` is ours"},
    )

    samples: int = Field(
        ge=12,
        le=10000,
        description="number of parameter sets",
        json_schema_extra={"source": "3.2.1: 150"},
    )

    seed: Seed = Field(
        description="seed of the design; the seeds of all pours follow from it",
    )
