"""The section `validation` of the configuration: the check of the answer."""

from pydantic import Field

from repose.common.section import PathOrNull, Section


class ValidationSettings(Section):
    """Settings of the runs that check the answer."""

    # Solutions that are simulated besides the representative one.
    solutions: int = Field(ge=1, le=9)
    # Runs of each of them.
    seeds: int = Field(ge=1, le=1000)
    # Runs of the representative solution.
    representative_seeds: int = Field(ge=1, le=1000)
    # Table of published parameter sets.
    published: PathOrNull
    # Table of the same sets as they were simulated once.
    published_simulated: PathOrNull
