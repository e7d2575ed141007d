"""Settings of stages: the section `validation`, and the numbers of the study `next`."""

from pydantic import Field

from repose.common.section import PathOrNull, Section

# Number of parameter sets that the study `next` draws from the posterior.
SETS_OF_NEXT = 16
# Runs of each in each bench test: the fewest that show the scatter.
SEEDS_OF_NEXT = 2


class ValidationSettings(Section):
    """Settings of the runs that check the answer."""

    solutions: int = Field(
        ge=1,
        le=9,
        description="solutions simulated again beside the representative one",
        json_schema_extra={"source": "4.2.1: 5"},
    )
    seeds: int = Field(
        ge=1,
        le=1000,
        description="pours per solution",
        json_schema_extra={"source": "open"},
    )
    representative_seeds: int = Field(
        ge=1,
        le=1000,
        description="pours of the representative solution",
        json_schema_extra={"source": "open"},
    )
    published: PathOrNull = Field(
        description="CSV of published solutions, which the target `published_sets` "
        "simulates; null: none",
        json_schema_extra={"source": "Table 4"},
    )
    published_simulated: PathOrNull = Field(
        description="the table that `published_sets` made once, shown beside the "
        "results; null: none",
    )
