"""The sections `design` and `validation` of the configuration; config/README.md explains the keys."""

from typing import Literal

from pydantic import Field

from repose.common.section import PathOrNull, Section, Seed


class DesignSettings(Section):
    """Settings of the design of experiments."""

    method: Literal["optimal", "lhsdesign"]
    samples: int = Field(ge=12, le=10000)
    seed: Seed  # of the study, too


class ValidationSettings(Section):
    """Settings of the pours that check the answer."""

    solutions: int = Field(ge=1, le=9)  # besides the representative one
    seeds: int = Field(ge=1, le=1000)  # pours of each
    representative_seeds: int = Field(ge=1, le=1000)  # pours of the representative one
    published: PathOrNull  # table of published parameter sets
    published_simulated: PathOrNull  # the same sets, simulated once
