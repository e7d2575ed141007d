"""The content of a material card as a typed model, from which `card.schema.json` is made (`schema`)."""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, JsonValue, TypeAdapter, ValidationError

from repose.bench.parameters import PARAMETERS, PHYSICAL_LIMITS
from repose.bench.settings import WallSettings
from repose.calibrate.responses import named
from repose.common.errors import InputError, raise_together
from repose.common.section import ABSENT, OneOf, Section
from repose.grain.settings import GrainSettings

WHAT = "a material card"
OK = "ok"
FEWEST_RUNS = 2  # successful runs of each bench test, for the probability that the targets are met
MISSING = "the key is missing"
ROUNDING, UNLIKE = (
    1e-3,
    0.01,
)  # of a correlation; largest relative difference of a value from what others give
UNLIKE_AXES = {
    "ellipsoid": 0.01,
    "smooth": 0.1,
    "multisphere": 0.25,
}  # the same of the axes of a body for the grain
WORDS = {
    "missing": MISSING,
    "extra_forbidden": "a known key",
}  # by the type of pydantic's error
Faults = Iterator[tuple[str, Any, str]]  # key, value, what is allowed

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Chance = Annotated[float, Field(ge=0, le=1)]
Text = Annotated[str, Field(min_length=1)]
Three = Annotated[list[Positive], Field(min_length=3, max_length=3)]


def said(words: str, **bounds: Any) -> Any:
    """Describe a key that every card has."""
    return Field(description=words, **bounds)


def absent(words: str) -> Any:
    """Describe a key that a card may lack."""
    return Field(ABSENT, description=words)


class Part(Section):
    """A part of a card; the schema shows no name of a class, and the description of every key."""

    model_config = ConfigDict(
        json_schema_extra=lambda schema: schema.pop("description", None)
    )


class Wall(Part):
    """The material of the walls."""

    shear_modulus_pa: float = WallSettings.model_fields["shear_modulus_pa"]  # type: ignore[assignment]
    poisson_ratio: float = Field(ge=0, le=0.5)


class Grain(Wall):
    """The grain as simulated."""

    mean_axes_mm: Three = said("full axes, the longest first")
    measured: int = said("number of grains", ge=1)
    relative_spread: float = said(
        "standard deviation of the size over its mean; 0 where all are alike",
        ge=0,
        le=1,
    )
    density_kg_m3: float = GrainSettings.model_fields["density_kg_m3"]  # type: ignore[assignment]
    elastic_modulus_pa: Positive
    shape: Literal["ellipsoid", "smooth", "multisphere"]
    volume_mm3: Positive
    mass_g: Positive
    inertia_kg_m2: Three = absent(
        "principal moments; cards of earlier versions lack them"
    )
    ellipsoids_mm: list[Three] = said(
        "half axes of the ellipsoids that add up to the body"
    )
    spheres_mm: list[Annotated[list[float], Field(min_length=4, max_length=4)]] = said(
        "x, y, z, radius of a multisphere's spheres"
    )

    def impossible(self) -> Faults:
        """Name each value that contradicts another: its key in the card, it, and what is allowed."""
        if any(radius <= 0 for *_, radius in self.spheres_mm):
            yield (
                "grain.spheres_mm",
                min(radius for *_, radius in self.spheres_mm),
                "positive radii",
            )
        mass = 1e-6 * self.density_kg_m3 * self.volume_mm3
        if self.shape != "multisphere" and abs(self.mass_g / mass - 1) > UNLIKE:
            yield (
                "grain.mass_g",
                self.mass_g,
                f"{mass:.4g}, its density times its volume",
            )
        modulus = 2 * self.shear_modulus_pa * (1 + self.poisson_ratio)
        if abs(self.elastic_modulus_pa / modulus - 1) > UNLIKE:
            yield (
                "grain.elastic_modulus_pa",
                self.elastic_modulus_pa,
                f"{modulus:.4g}, 2 G (1 + nu)",
            )
        if self.ellipsoids_mm:
            extents = [2 * sum(axes) for axes in zip(*self.ellipsoids_mm, strict=True)]
        else:
            axes = (
                [(ball[k] - ball[3], ball[k] + ball[3]) for ball in self.spheres_mm]
                for k in range(3)
            )
            extents = [
                max(top for _, top in ends) - min(low for low, _ in ends)
                for ends in axes
                if ends
            ]
        if any(
            abs(a / b - 1) > UNLIKE_AXES[self.shape]
            for a, b in zip(extents, self.mean_axes_mm, strict=False)
        ):
            yield (
                "grain.mean_axes_mm",
                self.mean_axes_mm,
                f"those of its body, {[float(f'{x:.4g}') for x in extents]}",
            )
        inertia = (
            1e-10 * self.mass_g * sum(axis**2 for axis in self.mean_axes_mm)
        )  # the sum of the three, of full axes
        sums = inertia if self.inertia_kg_m2 is ABSENT else sum(self.inertia_kg_m2)
        of_axes = (
            "volume_mm3",
            self.volume_mm3,
            math.pi / 6 * math.prod(self.mean_axes_mm),
        )
        for key, value, likely in (of_axes, ("inertia_kg_m2", sums, inertia)):
            if not 0.5 * likely < value < 1.9 * likely:
                yield f"grain.{key}", value, f"some {likely:.3g}, as its axes have it"
        parts = {
            "ellipsoid": self.ellipsoids_mm,
            "smooth": self.ellipsoids_mm,
            "multisphere": self.spheres_mm,
        }
        if not parts[self.shape]:
            yield (
                "grain.shape",
                self.shape,
                "ellipsoids_mm or spheres_mm of such a body",
            )


class Simulation(Part):
    """Numbers of every simulation of the study."""

    time_step_s: Positive
    gravity_m_s2: Positive


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
    at_bound: Literal["lower", "upper"] = absent(
        "the end of the range at which the value lies"
    )
    widened: Literal[True] = absent(
        "low or high is the value itself, which the interval did not hold"
    )
    given: Literal["calibrated", "calibrated from a prior", "fixed"]


class Reach(Part):
    """Whether piles of the grains can have an angle at the targeted Height."""

    line: str = said("whose slope the angle is")
    bound_deg: float | None = said(
        "the steepest by mass alone; null where mass sets no bound"
    )
    band_deg: Annotated[list[float], Field(min_length=3, max_length=3)] = said(
        "mean, standard deviation and largest of such piles"
    )
    possible: bool
    sentence: str


class Definition(Part):
    """How a response is measured."""

    name: str | None = said(
        "one of `repose docs measurement`, or another simulator's user's words"
    )
    settings: dict[str, JsonValue] = said(
        "what the definition reads, units in the keys"
    )


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
    whole: Positive = absent("100 % of a score of a profile, which may be 0 itself")
    predicted: float = absent("by the surrogate, before the runs of the check")
    simulated: float | None
    standard_error: NotNegative | None
    runs: int = Field(ge=0)
    status: str
    met: bool | None
    reach: Reach = absent("whether piles can have this angle at the targeted Height")
    definition: Definition
    line: str = absent("of an angle of a pile: the line whose slope it is, in words")
    definitions: dict[str, Line] = absent(
        "of an angle of a pile: the same piles by every definition"
    )
    bench: dict[str, JsonValue] | None = said(
        "as in the configuration; null of another simulator"
    )


class MadeBy(Part):
    """What made the card."""

    version: str | None = said("of repose")
    commit: str | None
    configuration: str | None = said("hash of all settings")
    engine: str | None = said("hash of simulator and bench tests")
    seed: int | None


class AnyCard(Part):
    """What the cards of all simulators have."""

    card: Literal[1] = said("version of this schema")
    material: Text = said("label of the study")
    parameters: Annotated[dict[str, Parameter], Field(min_length=1)]
    interval: Literal[
        "central 95 % of the posterior", "range of the parameter sets found"
    ] = said("what low and high are")
    correlations: dict[str, dict[str, Annotated[float, Field(ge=-1, le=1)]]] = said(
        "of the free parameters, within the same sets"
    )
    tests: Annotated[list[TestRow], Field(min_length=1)]
    met: bool | None = said(
        "whether prediction and simulated piles meet every target; null if not simulated"
    )
    out_of_reach: bool = absent(
        "no set is predicted to meet the targets; these are the nearest"
    )
    reason: Text = absent(
        "why the targets are met or not; cards of older versions lack it"
    )
    small_run: Literal[True] = absent(
        "the run shows that the chain works; its numbers are no calibration"
    )
    within: dict[str, Chance | None] = said(
        "probability that all means are so near their targets; null with too few runs"
    )
    provenance: dict[str, JsonValue] = absent(
        "what the file stands on, as every result of repose carries it"
    )
    made_by: MadeBy

    def impossible(self) -> Faults:
        """Name each value that is allowed by itself and contradicts another: its key, it, and what is allowed."""
        if (
            grain := getattr(self, "grain", ABSENT)
        ) is not ABSENT:  # a field of both kinds of card
            yield from grain.impossible()
        for name, row in self.parameters.items():
            held = (
                row.low is None
                or row.at_bound
                or row.low <= row.value <= (row.high or 0)
            )
            if (row.given == "fixed") != (row.low is None):
                allowed = (
                    "fixed, without low and high" if row.low is None else "calibrated"
                )
                yield f"parameters.{name}.given", row.given, allowed
            if (row.low is None) != (row.high is None) or (row.low or 0) > (
                row.high or 0
            ):
                yield (
                    f"parameters.{name}",
                    [row.low, row.high],
                    "low and high, or null for both",
                )
            elif self.reason and not held:
                yield (
                    f"parameters.{name}.value",
                    row.value,
                    f"in its interval, {row.low:g} to {row.high:g}",
                )
            if row.widened and row.value not in (row.low, row.high):
                yield (
                    f"parameters.{name}.widened",
                    True,
                    f"absent, as {row.value:g} is no end of its interval",
                )
        names = set(self.correlations)
        for name, others in self.correlations.items():
            if set(others) != names or name not in self.parameters:
                yield (
                    f"correlations.{name}",
                    sorted(others),
                    ", ".join(sorted(names & set(self.parameters))),
                )
                continue
            for other, value in others.items():
                mirrored = self.correlations[other].get(name, value)
                if abs(value - mirrored) > ROUNDING or (
                    other == name and value not in (0, 1)
                ):
                    allowed = (
                        "1" if other == name else f"{mirrored:g}, as {other}.{name}"
                    )
                    yield f"correlations.{name}.{other}", value, allowed
        rows = [
            [self.correlations[one].get(name, 0.0) for name in names] for one in names
        ]
        least = np.linalg.eigvalsh(rows)[0] if rows else 0.0
        if least < -UNLIKE * len(rows):
            yield (
                "correlations",
                f"a matrix with the eigenvalue {least:.2g}",
                "one whose eigenvalues are positive or 0",
            )
        one, two = self.within.get("1 %"), self.within.get("2 %")
        if one is not None and two is not None and one > two:
            yield "within.1 %", one, f"at most {two:g}, that within 2 %"
        yield from self._contradicting_tests()
        if (
            min(test.runs if test.status == OK else 0 for test in self.tests)
            >= FEWEST_RUNS
        ):
            for percent in (
                percent for percent, chance in self.within.items() if chance is None
            ):
                yield (
                    f"within.{percent}",
                    None,
                    f"a probability, as each test has {FEWEST_RUNS} runs or more",
                )

    def _contradicting_tests(self) -> Faults:
        """Name what contradicts itself in a test, or in the verdict on all."""
        names = [test.response for test in self.tests]
        for k, test in enumerate(self.tests):
            known = named(test.response)
            if test.response in names[:k]:
                yield f"tests.{k}.response", test.response, "each response once"
            if test.runs == 0 and test.simulated is not None:
                yield f"tests.{k}.runs", 0, "from 1, as there is a simulated mean"
            if test.met and test.status != OK:
                yield f"tests.{k}.status", test.status, f"{OK}, as the target is met"
            for name, of_line in (
                {} if test.definitions is ABSENT else test.definitions
            ).items():
                if of_line.line == test.line and of_line.simulated != test.simulated:
                    allowed = f"{test.simulated}, as of the test, whose line it is"
                    yield (
                        f"tests.{k}.definitions.{name}.simulated",
                        of_line.simulated,
                        allowed,
                    )
            if test.low > test.high:
                yield f"tests.{k}.low", test.low, f"at most high, {test.high:g}"
            if known and known.apparatus == test.apparatus and known.unit != test.unit:
                yield f"tests.{k}.unit", test.unit, known.unit
            met = test.simulated is not None and test.low <= test.simulated <= test.high
            if test.met is not None and test.met != met:
                allowed = f"{met}: simulated {test.simulated}, target {test.low:g} to {test.high:g}"
                yield f"tests.{k}.met", test.met, allowed
        if self.met and self.out_of_reach is True:
            yield "out_of_reach", True, "false, as the targets are met"
        met = all(test.met for test in self.tests)
        if (
            self.met is not None
            and self.met != met
            and not (met and self.out_of_reach is not False)
        ):
            yield "met", self.met, f"{met}, as its tests say"


class Card(AnyCard):
    """The card of a study that this program simulated."""

    grain: Grain
    wall: Wall
    laws: Annotated[dict[str, str], Field(min_length=1)] = said("contact laws by name")
    simulation: Simulation = absent("cards of earlier versions lack it")
    parameters: dict[Annotated[str, OneOf(lambda: PHYSICAL_LIMITS)], Parameter]
    met: bool

    def impossible(self) -> Faults:
        yield from (
            (f"parameters.{name}", None, MISSING)
            for name in PARAMETERS
            if name not in self.parameters
        )
        for name, row in self.parameters.items():
            least, most = PHYSICAL_LIMITS[name]
            for key, value in (
                ("value", row.value),
                ("low", row.low),
                ("high", row.high),
            ):
                if value is not None and not least <= value <= most:
                    yield f"parameters.{name}.{key}", value, f"{least:g} to {most:g}"
        yield from super().impossible()


class OtherCard(AnyCard):
    """The card of a study that another program simulated."""

    simulator: Text = said(
        "another one than repose's; parameters and responses are columns of its user's table"
    )
    probability: Probability = absent(
        "that the simulator's means lie within 1 % and 2 % of all targets, and inside all ranges"
    )
    grain: Grain = absent(
        "of that simulator, where its user adds it; then `repose card find` knows the card"
    )


def check(card: Mapping[str, Any], source: object) -> None:
    """Raise InputError, for all faults at once, if the content is not a card, or lacks a computable probability."""
    found: Faults = iter(())
    try:
        found = (
            (OtherCard if "simulator" in card else Card)
            .model_validate(card)
            .impossible()
        )
    except ValidationError as error:
        found = faults_of(error)
    raise_together(
        InputError(source, key, value, f"{WHAT}: {words}")
        for key, value, words in found
    )


def faults_of(errors: ValidationError) -> Faults:
    """Tell pydantic's errors, whose paths may end in types."""
    for error in errors.errors(include_url=False):
        words = WORDS.get(error["type"], error["msg"].removeprefix("Input should be "))
        key = ".".join(
            str(step)
            for step in error["loc"]
            if step not in ("[key]", "float", "list", "dict")
        )
        yield key, None if error["type"] == "missing" else error["input"], words


def schema() -> dict[str, Any]:
    """Make the JSON schema of a card."""
    return TypeAdapter(Card | OtherCard).json_schema() | {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "repose material card",
        "description": "A calibrated granular material: the grain, the contact laws, the parameters and the tests they "
        "stand on. SI units but where a name says another.",
    }
