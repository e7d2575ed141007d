"""The content of a material card as a typed model, from which `card.schema.json` is made (`schema`)."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import ConfigDict, Field, JsonValue, TypeAdapter, ValidationError

from repose.core.errors import InputError, raise_together
from repose.core.parameters import PARAMETERS, PHYSICAL_LIMITS
from repose.core.section import ABSENT, OneOf, Section

WHAT = "a material card"
OK = "ok"
FEWEST_RUNS = 2  # successful runs of each bench test, for the probability that the targets are met
POSTERIOR: Final = "central 95 % of the posterior"
RANGE: Final = "range of the parameter sets found"
MISSING = "the key is missing"
WORDS = {"missing": MISSING, "extra_forbidden": "no such key"}  # by the type of pydantic's error
Faults = Iterator[tuple[str, Any, str]]  # key, value, what is allowed

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Chance = Annotated[float, Field(ge=0, le=1)]
Text = Annotated[str, Field(min_length=1)]
Three = Annotated[list[Positive], Field(min_length=3, max_length=3)]


class Part(Section):
    """A part of a card; the schema shows no name of a class, and the description of every key."""

    model_config = ConfigDict(json_schema_extra=lambda schema: schema.pop("description", None))


class Wall(Part):
    """The material of the walls."""

    shear_modulus_pa: Positive
    poisson_ratio: float = Field(ge=0, le=0.5)


class Grain(Wall):
    """The grain as simulated."""

    mean_axes_mm: Three = Field(description="full axes, the longest first")
    measured: int = Field(ge=1, description="number of grains")
    relative_spread: float = Field(
        ge=0,
        description="standard deviation of the size over its mean; 0 where all grains are simulated alike",
    )
    density_kg_m3: Positive
    elastic_modulus_pa: Positive
    shape: Literal["ellipsoid", "smooth", "multisphere"]
    volume_mm3: Positive
    mass_g: Positive
    ellipsoids_mm: list[Three] = Field(
        description="half axes of the ellipsoids whose support functions add up to the body's; none of a multisphere"
    )
    spheres_mm: list[Annotated[list[float], Field(min_length=4, max_length=4)]] = Field(
        description="x, y, z and radius of a multisphere's spheres; none of the others"
    )


class Probability(Part):
    """How probably the means of another simulator meet the targets."""

    within_1_percent: Chance
    within_2_percent: Chance
    inside: Chance


class Parameter(Part):
    """A parameter of the answer."""

    meaning: str
    value: float
    low: float | None
    high: float | None
    at_bound: Literal["lower", "upper"] = Field(
        ABSENT,
        description="the bound of the searched range at which the value lies, within 0.1 % of its width; the interval "
        "may then not hold the value",
    )
    widened: Literal[True] = Field(
        ABSENT, description="low or high is the value itself, which the interval did not hold"
    )
    given: Literal["calibrated", "calibrated from a prior", "fixed"]


class Reach(Part):
    """Whether piles of the grains can have an angle at the targeted Height."""

    line: str = Field(description="whose slope the angle is")
    bound_deg: float | None = Field(
        description="the steepest by mass alone; null where mass alone sets no bound to this line"
    )
    band_deg: Annotated[list[float], Field(min_length=3, max_length=3)] = Field(
        description="mean, standard deviation and largest of piles of this mass and Height"
    )
    possible: bool
    sentence: str


class Definition(Part):
    """How a response is measured."""

    name: str | None = Field(
        description="which of the definitions in `repose docs measurement`, or the words of another simulator's user; "
        "null where he told none"
    )
    settings: dict[str, JsonValue] = Field(description="what the definition reads, units in the keys")


class Line(Part):
    """The piles of a test by another definition of the angle."""

    line: str
    simulated: float | None
    standard_error: NotNegative | None


class TestRow(Part):
    """A response of the answer beside its target."""

    response: str
    apparatus: str
    unit: str
    measured: float
    sd: NotNegative
    repetitions: int = Field(ge=1)
    low: float
    high: float
    whole: Positive = Field(ABSENT, description="100 % of a score of a profile, which may be 0 itself")
    predicted: float = Field(ABSENT, description="by the surrogate, before the runs of the check")
    simulated: float | None
    standard_error: NotNegative | None
    runs: int = Field(ge=0)
    status: str
    met: bool | None
    reach: Reach = Field(
        ABSENT, description="whether piles of the grains can have this angle at the targeted Height"
    )
    definition: Definition
    line: str = Field(ABSENT, description="of an angle of a pile: the line whose slope it is, in words")
    definitions: dict[str, Line] = Field(
        ABSENT,
        description="of an angle of a pile: the same simulated piles by every definition, in the unit of the test",
    )
    bench: dict[str, JsonValue] | None = Field(
        description="how the bench test is done, as in the configuration's section of its name; "
        "null of another simulator"
    )


class MadeBy(Part):
    """What made the card."""

    version: str | None = Field(description="of repose")
    commit: str | None
    configuration: str | None = Field(description="hash of all settings")
    engine: str | None = Field(description="hash of simulator and bench tests")
    seed: int | None


class AnyCard(Part):
    """What the cards of all simulators have."""

    card: Literal[1] = Field(description="version of this schema")
    material: Text = Field(description="label of the study")
    parameters: Annotated[dict[str, Parameter], Field(min_length=1)]
    interval: Literal["central 95 % of the posterior", "range of the parameter sets found"] = Field(
        description="what low and high are"
    )
    correlations: dict[str, dict[str, Annotated[float, Field(ge=-1, le=1)]]] = Field(
        description="of the free parameters, within the same sets"
    )
    tests: Annotated[list[TestRow], Field(min_length=1)]
    met: bool | None = Field(
        description="whether the parameters are predicted to meet every target and their simulated piles do; null "
        "where the answer was not simulated again"
    )
    out_of_reach: bool = Field(
        ABSENT,
        description="no parameter set is predicted to meet the targets (sequential: probably none meets them), and the "
        "parameters are the nearest; cards of older versions lack it where it is false",
    )
    reason: Text = Field(
        ABSENT,
        description="why the targets are met or not, a sentence; cards of older versions lack it",
    )
    small_run: Literal[True] = Field(
        ABSENT,
        description="the run shows that the chain works, and its numbers are no calibration; absent from other cards",
    )
    within: dict[str, Chance | None] = Field(
        description="probability that all means lie within so many percent of their targets, by the runs of the tests "
        "alone; null where a test has fewer than two good runs"
    )
    provenance: dict[str, JsonValue] = Field(
        ABSENT, description="what the file stands on, as every result of repose carries it"
    )
    made_by: MadeBy

    def impossible(self) -> Faults:
        """Name each value that is allowed by itself and contradicts another: its key, it, and what is allowed."""
        for name, row in self.parameters.items():
            if (row.low is None) != (row.high is None) or (row.low or 0) > (row.high or 0):
                yield f"parameters.{name}", [row.low, row.high], "low and high, or null for both"
        names = set(self.correlations)
        for name, others in self.correlations.items():
            if set(others) != names:
                yield f"correlations.{name}", sorted(others), ", ".join(sorted(names))
        if min(test.runs if test.status == OK else 0 for test in self.tests) >= FEWEST_RUNS:
            for percent in (percent for percent, chance in self.within.items() if chance is None):
                yield f"within.{percent}", None, f"a probability, as each test has {FEWEST_RUNS} runs or more"


class Card(AnyCard):
    """The card of a study that this program simulated."""

    grain: Grain
    wall: Wall
    laws: Annotated[dict[str, str], Field(min_length=1)] = Field(description="contact laws by name")
    parameters: dict[Annotated[str, OneOf(lambda: PHYSICAL_LIMITS)], Parameter]
    met: bool

    def impossible(self) -> Faults:
        yield from (
            (f"parameters.{name}", None, MISSING) for name in PARAMETERS if name not in self.parameters
        )
        for name, row in self.parameters.items():
            least, most = PHYSICAL_LIMITS[name]
            for key, value in (("value", row.value), ("low", row.low), ("high", row.high)):
                if value is not None and not least <= value <= most:
                    yield f"parameters.{name}.{key}", value, f"{least:g} to {most:g}"
        yield from super().impossible()


class OtherCard(AnyCard):
    """The card of a study that another program simulated."""

    simulator: Text = Field(
        description="another simulator than repose's; the parameters and responses are then columns of its user's table"
    )
    probability: Probability = Field(
        ABSENT,
        description="that the simulator's mean responses lie within 1 % and 2 % of all targets, and inside all ranges",
    )


def check(card: Mapping[str, Any], source: object) -> None:
    """Raise InputError, for all faults at once, if the content is not a card, or lacks a computable probability."""
    found: Faults = iter(())
    try:
        found = (OtherCard if "simulator" in card else Card).model_validate(card).impossible()
    except ValidationError as error:
        found = map(_fault, error.errors(include_url=False))
    raise_together(InputError(source, key, value, f"{WHAT}: {words}") for key, value, words in found)


def _fault(error: Any) -> tuple[str, Any, str]:
    """Tell a fault by pydantic's error, whose path may end in types."""
    words = WORDS.get(error["type"], error["msg"].removeprefix("Input should be "))
    key = ".".join(str(step) for step in error["loc"] if step not in ("[key]", "float", "list", "dict"))
    return key, None if error["type"] == "missing" else error["input"], words


def schema() -> dict[str, Any]:
    """Make the JSON schema of a card."""
    return TypeAdapter(Card | OtherCard).json_schema() | {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "repose material card",
        "description": "A calibrated granular material: the grain, the contact laws, the parameters and the tests they "
        "stand on. SI units but where a name says another.",
    }
