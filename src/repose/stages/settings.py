"""Settings of stages: sections `validation` and `simulator`, numbers for `next`."""

from typing import Annotated

from pydantic import Field

from repose.common.section import (
    ABSENT,
    Allowed,
    Contradictions,
    OneOf,
    Path,
    PathOrNull,
    Section,
)
from repose.measure.conventions import DIRECTIONS, UNITS

# Number of parameter sets that the study `next` draws from the posterior.
N_PLAUSIBLE_SETS = 16
# Number of runs of each set in each bench test. Fewer would not show the scatter.
N_SEEDS_OF_PLAUSIBLE_SET = 2


class ValidationSettings(Section):
    """Settings of the runs that check the answer."""

    solutions: int = Field(
        ge=1,
        le=9,
        description="number of solutions that are simulated again besides the "
        "representative one",
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
        description="table made by `published_sets`, shown next to the results; null: "
        "none",
    )


# Statuses with which a run of the user's own program may end.
RUN_STATUSES = (
    "ok",
    "exit_status",
    "time_limit",
    "no_output",
    "bad_output",
    "no_pile",
    "failed",
)

_FILE_NAME = r"[A-Za-z0-9_][A-Za-z0-9_.-]*"
FileName = Annotated[
    str,
    Field(max_length=100, pattern=rf"^{_FILE_NAME}(/{_FILE_NAME})*$"),
    Allowed("a file below the run's folder; letters, digits and . _ / -"),
]
Line = Annotated[
    str,
    Field(max_length=200, pattern=r"^[^\n]*\S[^\n]*$"),
    Allowed("text of one line"),
]
COMMAND_FORM = "a list of strings: the program, then its arguments"
Argument = Annotated[str, Field(min_length=1, max_length=4000)]


class ParticlesSettings(Section):
    """A file with the particles of a run, whose pile is measured."""

    file: FileName = Field(
        description="dump, VTK, CSV or text of Yade with the particles"
    )
    unit: Annotated[str, OneOf(lambda: UNITS)] = Field(
        default="m", description="unit of lengths in the file: m, cm or mm"
    )
    up: Annotated[str, OneOf(lambda: DIRECTIONS)] = Field(
        default=ABSENT, description="direction against gravity; by default detected"
    )
    base: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(
        default=ABSENT,
        description="height of the plate along `up`, in `unit`; by default detected",
    )


class SimulatorSettings(Section):
    """A program of the user's own that the workflow calls for each run."""

    name: Line = Field(description="name and version, printed on the card")
    command: Annotated[
        Annotated[tuple[Argument, ...], Field(strict=False)],
        Allowed(COMMAND_FORM),
    ] = Field(
        description="program and arguments, one entry each, without a shell; names "
        "in double braces as in the template",
    )
    template: Path = Field(
        default=ABSENT,
        description="Jinja2 template of the deck, which has its name without .j2; "
        "without it the program reads `parameters.json`",
    )
    files: Annotated[
        Annotated[tuple[Path, ...], Field(strict=False)],
        Allowed("a list of files"),
    ] = Field(default=(), description="further files, copied into the run's folder")
    output: FileName = Field(
        default=ABSENT,
        description="table of responses that a run leaves: JSON, or CSV with one row",
    )
    particles: ParticlesSettings = ABSENT
    keep: Annotated[
        Annotated[tuple[FileName, ...], Field(strict=False)],
        Allowed("a list of file names"),
    ] = Field(default=(), description="further files of a run to keep")
    cores: int = Field(default=1, ge=1, le=1024, description="cores of a run")
    memory_mb: int = Field(
        default=1000, ge=1, le=10_000_000, description="memory of a run in MB"
    )
    time_limit_s: float = Field(
        default=3600.0,
        gt=0,
        le=1e7,
        description="time after which a run is stopped; it then counts as failed",
    )

    def contradictions(self) -> Contradictions:
        """Yield a contradiction if the command is empty, or if runs leave no file."""
        if not self.command:
            yield "command", COMMAND_FORM
        if self.output is None and self.particles is None:
            yield "output", "the file of responses that a run leaves, or `particles`"

    @property
    def files_by_key(self) -> dict[str, str]:
        """The files of a run that have its responses, by the keys of this section."""
        files = {}
        if self.output is not None:
            files["output"] = self.output
        if self.particles is not None:
            files["particles.file"] = self.particles.file
        return files

    @property
    def files_read(self) -> tuple[str, ...]:
        """The files of a run that have its responses."""
        return tuple(self.files_by_key.values())
