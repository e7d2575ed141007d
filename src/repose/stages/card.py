"""Define and check the material card: the answer of a calibration as one JSON file.

`Card` and `OtherCard` are its content as typed models. `card.schema.json` next to this
module and docs/card.md are made from them: `python tests/documents/card_files.py`.
`card_study` makes the card of a study, and `card_text` prints cards.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, JsonValue, TypeAdapter, ValidationError

from repose.bench.parameters import PARAMETERS, PHYSICAL_LIMITS
from repose.calibrate.answer import Verdict
from repose.calibrate.determination import Determination
from repose.common.errors import InputError, raise_together
from repose.common.files import StrPath, read_json
from repose.common.section import ABSENT, OneOf, Section
from repose.grain.settings import Density, ShearModulus
from repose.stages.card_contradictions import find_contradictions

EXPECTED_CONTENT = "a material card"
# Pydantic's path to a fault has steps that are not keys of the file: "[key]" for a
# wrong key, and the name of the type that was chosen from a union.
PYDANTIC_STEPS = ("[key]", "float", "list", "dict")

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Chance = Annotated[float, Field(ge=0, le=1)]
Text = Annotated[str, Field(min_length=1)]
Three = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Sphere = Annotated[list[float], Field(min_length=4, max_length=4)]

# --- content --------------------------------------------------------------------------
# A field whose default is `ABSENT` may be missing from a card, but must not be null.


class Wall(Section):
    """Material of the walls."""

    # The same bounds as in a configuration.
    shear_modulus_pa: ShearModulus
    poisson_ratio: float = Field(ge=0, le=0.5)


class Grain(Wall):
    """The simulated grain."""

    mean_axes_mm: Three = Field(description="full axes, the longest first")
    measured: int = Field(ge=1, description="how many grains were measured")
    relative_spread: float = Field(
        ge=0,
        le=1,
        description="standard deviation of the size, divided by its mean; "
        "0 if all grains are equal",
    )
    density_kg_m3: Density
    elastic_modulus_pa: Positive
    shape: Literal["ellipsoid", "smooth", "multisphere"]
    volume_mm3: Positive
    mass_g: Positive
    inertia_kg_m2: Three = Field(
        ABSENT, description="principal moments; cards of earlier versions lack them"
    )
    ellipsoids_mm: list[Three] = Field(
        description="half axes of the ellipsoids that form the body"
    )
    spheres_mm: list[Sphere] = Field(
        description="x, y, z and radius of each sphere of a multisphere"
    )


class Simulation(Section):
    """Numbers that are the same in every simulation of the study."""

    time_step_s: Positive
    gravity_m_s2: Positive


class Probability(Section):
    """How probable it is that the means of another simulator meet the targets."""

    within_1_percent: Chance = Field(description="all means within 1 % of the targets")
    within_2_percent: Chance = Field(description="all means within 2 % of the targets")
    inside: Chance = Field(description="all means inside their target ranges")


class Parameter(Section):
    """A parameter of the simulation, calibrated or fixed."""

    meaning: str = Field(description="name of the parameter in words")
    value: float
    low: float | None = Field(
        description="lower end of the interval; null if there is none"
    )
    high: float | None = Field(
        description="upper end of the interval; null if there is none"
    )
    at_bound: Literal["lower", "upper"] = Field(
        ABSENT, description="the end of the searched range at which the value lies"
    )
    widened: Literal[True] = Field(
        ABSENT,
        description="the interval did not contain the value and was extended to it, "
        "or to the bound at which it lies",
    )
    determination: Annotated[
        str, OneOf(lambda: [kind.value for kind in Determination])
    ] = Field(
        ABSENT,
        description="how well the measurements determine the parameter; missing "
        "without a posterior",
    )
    given: Literal["calibrated", "calibrated from a prior", "fixed"]
    scale: Literal["log"] = Field(
        ABSENT,
        description="the range was searched in the logarithm of the parameter, and "
        "correlations are those of the logarithm",
    )


class Reach(Section):
    """Whether piles of these grains can have an angle at the target Height."""

    line: str = Field(
        description="line at the side of the pile whose slope is the angle"
    )
    bound_deg: float | None = Field(
        description="steepest angle that the mass of the grains allows; "
        "null if it sets no bound"
    )
    band_deg: Annotated[list[float], Field(min_length=3, max_length=3)] = Field(
        description="mean, standard deviation and largest angle of such piles"
    )
    possible: bool
    sentence: str = Field(description="the result in words")


class Definition(Section):
    """How a response is measured."""

    name: str | None = Field(
        description="a definition of `repose docs measurement`, or for another "
        "simulator the words of its user"
    )
    settings: dict[str, JsonValue] = Field(
        description="settings of the definition, with units in the keys"
    )


class Line(Section):
    """The angle of a test's piles by another definition."""

    line: str
    simulated: float | None
    standard_error: NotNegative | None


class TestRow(Section):
    """A measured response, compared with simulations with the calibrated parameters."""

    response: str = Field(description="what was measured, such as `aor_deg`")
    apparatus: str = Field(description="the experiment, such as `funnel`")
    unit: str
    measured: float = Field(description="mean of the measurements")
    sd: NotNegative = Field(description="standard deviation of the measurements")
    repetitions: int = Field(ge=1, description="number of measurements")
    low: float = Field(description="lower end of the target range")
    high: float = Field(description="upper end of the target range")
    whole: Positive = Field(
        ABSENT, description="100 % of a score of a profile, which may be 0 itself"
    )
    predicted: float = Field(
        ABSENT, description="prediction of the surrogate before the check"
    )
    optimism: float = Field(
        ABSENT,
        description="how much the prediction is expected to exceed the true mean",
    )
    optimism_error: float | None = Field(
        ABSENT, description="standard error of the expected optimism"
    )
    simulated: float | None = Field(description="mean of the check's simulations")
    standard_error: NotNegative | None = Field(
        description="standard error of this mean"
    )
    runs: int = Field(ge=0, description="number of the check's simulations")
    status: str
    met: bool | None = Field(
        description="whether the mean lies in the target range; "
        "null if it is undecided or not simulated"
    )
    verdict: Annotated[str, OneOf(lambda: [state.value for state in Verdict])] = Field(
        ABSENT,
        description="the same in words; cards of older versions lack it",
    )
    probability_inside: Chance | None = Field(
        ABSENT,
        description="probability that the simulator's true mean lies in the target "
        "range; null if fewer than two simulations",
    )
    reach: Reach = Field(
        ABSENT, description="whether piles can have this angle at the targeted Height"
    )
    definition: Definition
    line: str = Field(
        ABSENT, description="of an angle of a pile: the line whose slope is the angle"
    )
    definitions: dict[str, Line] = Field(
        ABSENT,
        description="of an angle of a pile: the same piles, measured by every "
        "definition",
    )
    bench: dict[str, JsonValue] | None = Field(
        description="settings of the experiment as in the configuration; "
        "null for another simulator"
    )


class PublishedMean(Section):
    """A response of the published answer, simulated in the bench test of the study."""

    simulated: float = Field(description="mean of the simulations")
    standard_error: NotNegative | None = Field(
        description="standard error of this mean; null if it is unknown"
    )


class Published(Section):
    """The answer that a publication recommends, to compare it with that of the study."""

    source: Text = Field(ABSENT, description="the publication")
    parameters: Annotated[dict[str, float], Field(min_length=1)]
    responses: dict[str, PublishedMean] = Field(
        ABSENT,
        description="means in the simulator of the study; missing if not simulated",
    )
    runs: int = Field(ABSENT, ge=0, description="number of these simulations")
    stale: Literal[True] = Field(
        ABSENT, description="they were made with another engine or scene than the study"
    )


class SamplesInside(Section):
    """How many simulated samples already meet all targets."""

    samples: int = Field(ge=0, description="number of all simulated samples")
    inside: int = Field(
        ge=0, description="number of samples whose means lie in all target ranges"
    )
    spans: dict[str, Chance] = Field(
        ABSENT,
        description="fraction of its range over which a parameter varies in these "
        "samples; missing for fewer than two",
    )


class MadeBy(Section):
    """The program, settings and seed that made the card."""

    version: str | None = Field(description="version of repose")
    commit: str | None
    configuration: str | None = Field(description="hash of all settings")
    engine: str | None = Field(description="hash of simulator and bench tests")
    seed: int | None


class AnyCard(Section):
    """The part that the cards of all simulators have in common."""

    card: Literal[1] = Field(description="version of this schema")
    material: Text = Field(description="label of the study")
    parameters: Annotated[dict[str, Parameter], Field(min_length=1)]
    interval: Literal[
        "central 95 % of the posterior", "range of the parameter sets found"
    ] = Field(
        description="what low and high are; a range of sets shows where a search ended, "
        "not how uncertain a parameter is"
    )
    correlations: dict[str, dict[str, Annotated[float, Field(ge=-1, le=1)]]] = Field(
        description="correlations of the calibrated parameters in the same sets"
    )
    near_bounds: list[str] = Field(
        ABSENT,
        description="a clause for each parameter at most one standard error from a bound",
    )
    tests: Annotated[list[TestRow], Field(min_length=1)]
    met: bool | None = Field(
        description="whether the prediction and the simulated piles meet every target; "
        "null if it is undecided or not simulated"
    )
    verdict: Annotated[str, OneOf(lambda: [state.value for state in Verdict])] = Field(
        ABSENT,
        description="the same in words; undecided means that the probability of being "
        "inside lies between 5 and 95 %",
    )
    probability_inside: Chance | None = Field(
        ABSENT,
        description="probability that all true means lie in their target ranges; "
        "null if fewer than two simulations",
    )
    out_of_reach: bool = Field(
        ABSENT,
        description="no parameter set is predicted to meet the targets; these parameters are the "
        "nearest",
    )
    reason: Text = Field(
        ABSENT,
        description="why the targets are met or not; cards of older versions lack it",
    )
    small_run: Literal[True] = Field(
        ABSENT,
        description="the study was too small for a calibration, and only shows that the "
        "program works",
    )
    samples_inside: SamplesInside = Field(
        ABSENT,
        description="the simulated samples that already meet all targets; missing "
        "for a strategy of our simulator without a design",
    )
    published: Published = Field(
        ABSENT, description="a published answer; missing if the study has none"
    )
    within: dict[str, Chance | None] = Field(
        description="probability that all means lie within 1 % or 2 % of their targets; "
        "null if too few simulations"
    )
    provenance: dict[str, JsonValue] = Field(
        ABSENT,
        description="how the file was made, as in every result of repose",
    )
    made_by: MadeBy


class Card(AnyCard):
    """The card of a study that repose simulated."""

    grain: Grain
    wall: Wall
    laws: Annotated[dict[str, str], Field(min_length=1)] = Field(
        description="contact laws by name"
    )
    simulation: Simulation = Field(
        ABSENT, description="cards of earlier versions lack it"
    )
    parameters: dict[Annotated[str, OneOf(lambda: PHYSICAL_LIMITS)], Parameter]


class OtherCard(AnyCard):
    """The card of a study that another program simulated."""

    simulator: Text = Field(
        description="name of the program; parameters and responses are columns of its "
        "user's table"
    )
    probability: Probability = Field(
        ABSENT,
        description="how probable it is that the means of the simulator meet the targets",
    )
    grain: Grain = Field(
        ABSENT, description="grain of that simulator, if its user adds it"
    )


def make_schema() -> dict[str, Any]:
    """Make the JSON schema of a card."""
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "repose material card",
        "description": "A calibrated granular material: the grain, the contact laws, "
        "the parameters and the tests on which they are based. Units are SI, unless a "
        "name states another.",
    }
    return TypeAdapter(Card | OtherCard).json_schema() | head


# --- read and check -------------------------------------------------------------------


def read_card(path: StrPath) -> dict[str, Any]:
    """Read a card; raise InputError if the file cannot be read or is not a card.

    An error is also raised if entries of the card contradict each other.
    """
    card = read_json(path, (), EXPECTED_CONTENT)
    check_card(card, path)
    raise_together(one.describe(path) for one in find_contradictions(card))
    return card


def check_card(card: Mapping[str, Any], source: object) -> None:
    """Raise an InputError with all errors at once, unless a card is valid."""
    model = OtherCard if "simulator" in card else Card
    try:
        model.model_validate(card)
    except ValidationError as error:
        raise_together(translate_errors(error, source))
    if model is Card:
        raise_together(_find_parameter_errors(card["parameters"], source))


def translate_errors(
    error: ValidationError, source: object, prefix: str = ""
) -> Iterator[InputError]:
    """Translate the errors that pydantic found in a card into errors of this program.

    Parameters
    ----------
    error : ValidationError
        The errors.
    source : object
        The file of the card, for the messages.
    prefix : str, optional
        Text that is put before the key of each error, if only a section of the card was
        checked.

    Yields
    ------
    InputError
        One for each error, with its dotted key, the value, and what is allowed.
    """
    for detail_of_error in error.errors(include_url=False):
        # Pydantic adds the names of its own types to the location of an error. They are
        # no keys of the card.
        location = detail_of_error["loc"]
        keys = [str(step) for step in location if step not in PYDANTIC_STEPS]
        dotted_key = prefix + ".".join(keys)

        value = detail_of_error["input"]
        if detail_of_error["type"] == "missing":
            # Pydantic's input is the section that lacks the key, not a value of the
            # key.
            value = None
            expected = "the key is missing"
        elif detail_of_error["type"] == "extra_forbidden":
            expected = "a known key"
        else:
            # "Input should be 'a' or 'b'" becomes "'a' or 'b'".
            expected = detail_of_error["msg"].removeprefix("Input should be ")
        yield InputError(
            source,
            key=dotted_key,
            value=value,
            allowed=f"{EXPECTED_CONTENT}: {expected}",
        )


def _find_parameter_errors(
    parameters: Mapping[str, Mapping[str, Any]], source: object
) -> Iterator[InputError]:
    """Find contact parameters that are missing, and values outside the physical limits.

    Parameters
    ----------
    parameters : mapping
        The parameters of a card by name, each with `value`, `low` and `high`. The model
        `Card` has checked that their names are those of `PHYSICAL_LIMITS`.
    source : object
        The file of the card, for the messages.
    """
    for name in PARAMETERS:
        if name not in parameters:
            yield InputError(
                source,
                key=f"parameters.{name}",
                value=None,
                allowed=f"{EXPECTED_CONTENT}: the key is missing",
            )
    for name, parameter in parameters.items():
        lowest, highest = PHYSICAL_LIMITS[name]
        for key in ("value", "low", "high"):
            value = parameter[key]
            # A number that the card does not state is null.
            if value is not None and not lowest <= value <= highest:
                yield InputError(
                    source,
                    key=f"parameters.{name}.{key}",
                    value=value,
                    allowed=f"{EXPECTED_CONTENT}: {lowest:g} to {highest:g}",
                )
