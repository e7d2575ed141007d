"""The section `design` of the configuration; config/README.md explains the keys."""

from typing import Literal

from pydantic import Field

from repose.common.section import Section, Seed


class DesignSettings(Section):
    """Settings of the design of experiments."""

    method: Literal["optimal", "lhsdesign"]
    """How the samples are chosen."""

    samples: int = Field(ge=12, le=10000)
    """Number of parameter sets."""

    seed: Seed
    """Of the design and of the study."""
