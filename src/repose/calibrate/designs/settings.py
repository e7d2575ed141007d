"""The section `design` of the configuration."""

from typing import Literal

from pydantic import Field

from repose.common.section import Section, Seed


class DesignSettings(Section):
    """Settings of the design of experiments."""

    method: Literal["optimal", "lhsdesign"]
    samples: int = Field(ge=12, le=10000)
    seed: Seed  # of the study, too
