"""The sections of the configuration as typed models, and `StudySettings`, the whole.

Each bench test brings its own section (`repose.apparatus.BenchTest.settings`); config/README.md explains the keys.
"""

import difflib
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import pairwise
from numbers import Real
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, create_model, field_validator
from pydantic_core import core_schema

from repose.apparatus import bench, names
from repose.apparatus.settings import SimulationSettings, WallSettings
from repose.config import results_folder
from repose.core.parameter_space import PRIOR_WIDTHS
from repose.core.parameters import ALLOWED, FURTHER
from repose.core.profiles import OfProfile
from repose.core.responses import Response, named, responses_of
from repose.core.section import ABSENT, AUTO, Auto, Contradictions, OneOf, Section, refuse
from repose.core.targets import LARGEST, LEAST_RANGE, range_about
from repose.dem.constants import Constant
from repose.measure.angles import DEFINITIONS
from repose.measure.profile_points import FLANK_RULES
from repose.particle.particle import KINDS, SURFACES

LARGEST_BLOCKS = 100  # of a refined proposal's pours: jobs of a round have three digits


def _surrogates() -> Iterable[str]:
    from repose import surrogate

    return surrogate.names()


def _priors() -> Iterable[str]:
    from repose.surrogate.two_layer import PRIORS

    return PRIORS


def _strategies() -> Iterable[str]:
    from repose import strategies

    return strategies.names()


def _rising(numbers: Sequence[float]) -> Sequence[float]:
    """Check that numbers rise; ValueError if they do not."""
    if not all(low < high for low, high in pairwise(numbers)):
        raise ValueError("the numbers do not rise")
    return numbers


def _folder_of_results(path: str) -> str:
    """Refuse a folder that a study may not write into."""
    refuse(("", allowed) for _, allowed in results_folder.contradictions(path))
    return path


# --- types of several keys -------------------------------------------------------------------------------------

Label = Annotated[
    str,
    Field(
        max_length=60,
        pattern=r"^[A-Za-z0-9_][A-Za-z0-9_-]*$",
        description="text of 1 to 60 characters, letters, digits, _ and -",
    ),
]
ResultsFolder = Annotated[
    str,
    Field(
        max_length=1000,
        pattern=r"^/?[A-Za-z0-9_][A-Za-z0-9_.-]*(/[A-Za-z0-9_][A-Za-z0-9_.-]*)*/?$",
        description="a folder; letters, digits and . _ / -, without .., and no part begins with . or -",
    ),
    AfterValidator(_folder_of_results),
]
Colour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$", description='a colour in quotes, as "#cca86b"')]
_NO_BRACES = r"^[^{}\x00-\x1f\x7f]+$"  # snakemake takes braces for wildcards
_FILE = object()  # marks the types of `named_files`
Path = Annotated[str, Field(pattern=_NO_BRACES, description="a path of a file, without braces"), _FILE]
PathOrNull = Annotated[
    Annotated[str, Field(pattern=_NO_BRACES)] | None,
    Field(description="a path of a file, without braces, or null"),
    _FILE,
]
Seed = Annotated[int, Field(ge=0, le=4294967295)]
Percent = Annotated[float, Field(gt=0, le=50)]
Poisson = Annotated[float, Field(ge=0, le=0.49)]
Modulus = Annotated[float, Field(ge=1.0e3, le=1.0e12)]
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Share = Annotated[float, Field(ge=0, le=1)]


def _is_number(value: object) -> bool:
    """Return whether a value is a number, of numpy too."""
    return isinstance(value, Real) and not isinstance(value, bool)


class _Parameter:
    """The type of a contact parameter within bounds: a range, a fixed value, or prior knowledge."""

    def __init__(self, low: float, high: float) -> None:
        self.low, self.high = low, high

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        value = Annotated[float, Field(ge=self.low, le=self.high)]
        spread = Annotated[float, Field(gt=0, le=self.high)]
        pair = Annotated[tuple[value, value], Field(strict=False), AfterValidator(_rising)]
        fixed = create_model("Fixed", __base__=Section, fixed=value)
        prior = create_model("Prior", __base__=Section, mean=value, sd=spread)
        known = create_model("Known", __base__=Section, range=(pair, None), prior=prior)
        return handler.generate_schema(Annotated[pair | fixed | known, BeforeValidator(self._explained)])

    def _explained(self, given: Any) -> Any:
        """Return what is given; where it is a section, refuse the faults of its single keys."""
        if isinstance(given, Mapping):
            refuse(self._faults(given))
        return given

    def _faults(self, given: Mapping[str, Any]) -> Contradictions:
        """Yield the faults of a section."""
        bounded = self.high < sys.float_info.max
        number = f"a number from {self.low:g} to {self.high:g}" if bounded else "a number"
        keys = ("fixed", "prior", "range")
        for key in given:
            if key not in keys:
                near = difflib.get_close_matches(str(key), keys, 1)
                hint = f"did you mean {near[0]}?" if near else f"keys here: {', '.join(keys)}"
                yield str(key), f"a known key; {hint}"
        if "fixed" in given and len(given) > 1:
            yield "", "fixed alone, or prior with or without range"
        elif "fixed" in given and not self._is_within(given["fixed"]):
            yield "fixed", number
        elif "range" in given and "prior" not in given:
            yield "", "a pair [low, high]; a range stands beside a prior only"
        prior = given.get("prior")
        if prior is not None:
            if not isinstance(prior, Mapping) or set(prior) != {"mean", "sd"}:
                yield "prior", "a section with the keys mean and sd"
            elif not self._is_within(prior["mean"]):
                yield "prior", f"a mean that is {number}"
            elif not (_is_number(prior["sd"]) and 0 < prior["sd"] <= self.high):
                yield "prior", "an sd above 0" + (f" and up to {self.high:g}" if bounded else "")

    def _is_within(self, value: Any) -> bool:
        """Return whether a value is a number within the bounds."""
        return _is_number(value) and self.low <= value <= self.high


def far_priors(parameters: Iterable[tuple[str, Any]]) -> Contradictions:
    """Refuse parameters, by name, whose range lies beyond their prior."""
    for name, given in parameters:
        if getattr(given, "range", None) is not None:
            mean, reach = given.prior.mean, PRIOR_WIDTHS * given.prior.sd
            if mean + reach < given.range[0] or mean - reach > given.range[1]:
                low, high = mean - reach, mean + reach
                yield (name, f"a range that meets {low:g} to {high:g}, {PRIOR_WIDTHS:g} sd about the mean of its prior")


def _described(low: float, high: float) -> Any:
    """Describe the allowed values of a contact parameter within bounds."""
    pair = f"a pair [low, high] of numbers from {low:g} to {high:g} with low < high"
    return Field(description=f"{pair}; or fixed; or prior with mean and sd")


Restitution = Annotated[Any, _described(*ALLOWED["e_gg"]), _Parameter(*ALLOWED["e_gg"])]
StaticFriction = Annotated[Any, _described(*ALLOWED["mus_gg"]), _Parameter(*ALLOWED["mus_gg"])]
RollingFriction = Annotated[Any, _described(*ALLOWED["mur_gg"]), _Parameter(*ALLOWED["mur_gg"])]
ParameterOfAnySize = Annotated[
    Any,
    _Parameter(-sys.float_info.max, sys.float_info.max),
    Field(description="a pair [low, high] of numbers with low < high; or fixed; or prior with mean and sd"),
]
StrategyName = Annotated[str, OneOf(_strategies)]
SurrogateName = Annotated[str, OneOf(_surrogates)]


# --- the grain, the parameters and the simulation --------------------------------------------------------------


class Berry(Section):
    """The measurements of the grain, and the body that represents it."""

    sizes: Path
    compression: PathOrNull
    density_kg_m3: float = Field(ge=10, le=25000)
    poisson_ratio: Poisson | None
    shear_modulus_pa: Modulus | None
    stl: PathOrNull
    mass_g: Annotated[float, Field(gt=0, le=1.0e6)] | None
    particle: Annotated[str, OneOf(lambda: KINDS)]
    spheres: Literal["fewest"] | Annotated[int, Field(ge=1, le=64)] = Field(
        description="fewest or an integer from 1 to 64"
    )
    surface: Annotated[str, OneOf(lambda: SURFACES)]
    size_distribution: Literal["none", "measured"]

    @field_validator("poisson_ratio", "shear_modulus_pa")
    @classmethod
    def _measured(cls, value: float | None, info: ValidationInfo) -> float | None:
        """Refuse a modulus that is missing if there are no compression tests either."""
        if value is None and info.data.get("compression", "invalid") is None:
            tests = "a table of compression tests in berry.compression, which gives both moduli"
            refuse([("", f"a number; or {tests}")])
        return value


class _SixParameters(Section):
    """The six contact parameters, and the contact law's own."""

    e_gg: Restitution
    mus_gg: StaticFriction
    mur_gg: RollingFriction
    e_gp: Restitution
    mus_gp: StaticFriction
    mur_gp: RollingFriction

    def contradictions(self) -> Contradictions:
        """Refuse parameters that are all fixed, and a prior that its range excludes."""
        yield from far_priors(self)
        if all(value is None or hasattr(value, "fixed") for _, value in self):
            yield "", "at least one free parameter: there is nothing to calibrate"


def _of_the_law(constant: Constant) -> Any:
    """Make the type of a further parameter."""
    ends = constant.least, min(constant.most, 1.0e9)
    return Annotated[Any, _described(*ends), _Parameter(*ends)]


_further: dict[str, Any] = {name: (_of_the_law(further.constant), ABSENT) for name, further in FURTHER.items()}
Parameters = create_model("Parameters", __base__=_SixParameters, **_further)


class Design(Section):
    """The design of experiments."""

    method: Literal["optimal", "lhsdesign"]
    samples: int = Field(ge=12, le=10000)
    seed: Seed


class Measure(Section):
    """Measurement of a pile."""

    views: int = Field(ge=1, le=360)
    mm_per_pixel: Annotated[float, Field(ge=0.02, le=5)] | Auto = AUTO
    response: Annotated[str, OneOf(lambda: DEFINITIONS)]
    fit_from: Literal["berry"] | Annotated[float, Field(ge=0, le=0.9)] = Field(
        description="berry or a number from 0 to 0.9"
    )
    fit_to: Literal["berry"] | Annotated[float, Field(ge=0.1, le=1)] = Field(
        description="berry or a number from 0.1 to 1"
    )
    berry_height_mm: Annotated[float, Field(gt=0, le=1000)] | None
    largest_pile_only: bool
    flank: Annotated[str, OneOf(lambda: FLANK_RULES)]
    smallest_window: float = Field(ge=0.1, le=1)

    @field_validator("fit_to")
    @classmethod
    def _long_enough(cls, end: str | float, info: ValidationInfo) -> str | float:
        """Refuse an upper end of the fitted part that leaves the part too short for a line."""
        start = info.data.get("fit_from")
        if start == end == "berry":
            refuse([("", "a number from 0.1 to 1, as measure.fit_from is berry")])
        if isinstance(start, float) and isinstance(end, float) and end < start + 0.1:
            refuse([("", f"at least 0.1 above measure.fit_from, {start:g}")])
        return end


class Target(Section):
    """A measured response."""

    response: str = Field(min_length=1, max_length=60)
    apparatus: str = Field(min_length=1, max_length=60)
    value: Number
    aim: Number = ABSENT  # a target without this key aims at its value
    sd: float = Field(ge=0, le=LARGEST)
    repetitions: int = Field(ge=1, le=10000)
    range: Annotated[tuple[Number, Number], Field(strict=False), AfterValidator(_rising)] = Field(
        description="a pair [low, high] of numbers with low < high"
    )
    weight: float = Field(default=1.0, gt=0, le=1.0e6)
    profile: OfProfile = ABSENT  # it is a score of this; `repose.config.profiles` writes it

    def contradictions(self) -> Contradictions:
        """Refuse a response of no bench test, and values outside the allowed range."""
        known = [response.name for response in responses_of(self.apparatus)]
        found = named(self.response)
        if not known:
            yield "apparatus", f"one of {', '.join(names())}"
        elif found is None or found.apparatus != self.apparatus:
            yield "response", f"one of {', '.join(known)}, the responses of {self.apparatus}"
        elif found.profile and self.profile is None:
            yield "response", f"a number, or {found.profile} with the file of its measured heights"
        else:
            yield from self._outside(found)

    def _outside(self, limits: Response) -> Contradictions:
        """Refuse values outside the limits of the response, or outside the target's own range."""
        low, high = self.range
        within = f"from {limits.low:g} to {limits.high:g}"
        if not limits.low <= self.value <= limits.high:
            yield "value", within
            return
        if low < limits.low or high > limits.high:
            written = (low, high) != range_about(self.value, self.sd, self.repetitions)
            if not written and self.sd / math.sqrt(self.repetitions) > LEAST_RANGE * abs(self.value):
                yield ("sd", f"so small that the mean with its standard error, {low:g} to {high:g}, lies {within}")
            else:
                yield "range", f"a pair [low, high] {within}"
            return
        aimed = "value" if self.aim is None else "aim"
        if not low <= getattr(self, aimed) <= high:
            yield aimed, f"inside its range, {low:g} to {high:g}"


# --- the chain -------------------------------------------------------------------------------------------------


class Network(Section):
    """Training of a surrogate."""

    hidden: int = Field(ge=1, le=100)
    epochs: int = Field(ge=1, le=100000)
    goal: Share
    split: (
        Annotated[
            tuple[Share, Share, Share],
            Field(strict=False, description="three shares (training, validation, test) that sum to 1"),
        ]
        | Auto
    ) = AUTO
    starts: int = Field(ge=1, le=1000)
    prior: Annotated[str, OneOf(_priors)]
    replicates: bool
    validation_noise: bool
    seed: Seed

    @field_validator("split")
    @classmethod
    def _whole(cls, shares: Any) -> Any:
        """Refuse shares that do not sum to 1, or leave nothing to train or to test."""
        if shares != AUTO and (abs(sum(shares) - 1) > 1e-6 or shares[0] == 0 or shares[2] == 0):
            refuse([("", "three shares that sum to 1, training and test above 0")])
        return shares

    def contradictions(self) -> Contradictions:
        """Refuse two sources of the noise."""
        if self.validation_noise and self.replicates:
            yield "validation_noise", "false where replicates is true: the runs of a sample show the noise"


class Miga(Section):
    """The island genetic algorithm, and the choice of the answer."""

    islands: int = Field(ge=1, le=100)
    population: int = Field(ge=4, le=10000)
    rounds: int = Field(ge=1, le=100000)
    generations: int = Field(ge=1, le=10000)
    tournament: int = Field(ge=1, le=1000)
    mutation_probability: Share
    mutation_amplitude: Share
    solutions: int = Field(ge=10, le=1000)
    distance: float = Field(ge=0, le=0.5)
    answer: Literal["least_expected_loss", "least_objective"]
    seed: Seed

    def contradictions(self) -> Contradictions:
        """Refuse a tournament larger than its population."""
        if self.tournament > self.population:
            yield "tournament", f"at most miga.population, {self.population}"


class Validation(Section):
    """The pours that check the answer."""

    solutions: int = Field(ge=1, le=9)
    seeds: int = Field(ge=1, le=1000)
    representative_seeds: int = Field(ge=1, le=1000)
    published: PathOrNull
    published_simulated: PathOrNull


class Posterior(Section):
    """The posterior of the parameters."""

    shape_study: PathOrNull
    discrepancy_percent: float = Field(ge=0, le=100)
    discrepancy_correlation: float = Field(ge=0, le=0.99)
    measured_correlation: Literal["simulated"] | Annotated[float, Field(ge=-0.99, le=0.99)] = Field(
        description="simulated or a number from -0.99 to 0.99"
    )
    walkers: int = Field(ge=14, le=1000)
    steps: int = Field(ge=100, le=1000000)
    seed: Seed


class Sensitivity(Section):
    """Sobol's indices."""

    samples: Literal[64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768, 65536]
    resamples: int = Field(ge=20, le=10000)
    seed: Seed


class Refine(Section):
    """More pours near the answer."""

    rounds: int = Field(ge=0, le=90)
    seeds: int = Field(ge=2, le=1000)
    block: int = Field(ge=1, le=1000)
    neighbours: int = Field(ge=0, le=99)
    neighbour_seeds: int = Field(ge=1, le=1000)
    reach: float = Field(ge=0.01, le=1)
    tolerance_percent: Percent
    standard_error_percent: Percent

    def contradictions(self) -> Contradictions:
        """Refuse impossible numbers of jobs or neighbours."""
        if self.seeds > LARGEST_BLOCKS * self.block:
            yield "block", f"at least refine.seeds / {LARGEST_BLOCKS}"
        if self.neighbours == 1:
            yield "neighbours", "0 or at least 2: they fill a Latin hypercube"


class Figures(Section):
    """The files of every figure."""

    format: Annotated[tuple[Literal["png", "pdf", "svg"], ...], Field(strict=False)] = Field(
        default=("png",), description="a list of png and, beside it, pdf or svg or both"
    )
    dpi: int = Field(default=180, ge=72, le=600)

    def contradictions(self) -> Contradictions:
        """Refuse formats that lack the report's, or hold one of them twice."""
        if "png" not in self.format or len(set(self.format)) < len(self.format):
            yield "format", "a list with png, which the report shows, and no format twice"


# --- the whole --------------------------------------------------------------------------------------------------


class StudySettings(Section):
    """The whole configuration, without the sections of strategies and bench tests (`settings_type`)."""

    label: Label
    small_run: bool
    results_dir: ResultsFolder
    photograph: PathOrNull
    colour: Colour
    strategy: StrategyName
    berry: Berry
    wall: WallSettings
    parameters: Parameters  # type: ignore[valid-type]
    design: Design
    simulation: SimulationSettings
    measure: Measure
    surrogate: SurrogateName
    network: Network
    targets: Annotated[tuple[Target, ...], Field(strict=False)] = Field(
        min_length=1,
        description="a list of one or more targets: response, value, sd and repetitions, or the file of a profile",
    )
    miga: Miga
    validation: Validation
    posterior: Posterior
    sensitivity: Sensitivity
    refine: Refine
    figures: Figures = Field(default_factory=Figures)


def settings_type() -> type[StudySettings]:
    """Make the model of a whole configuration: `StudySettings`, and a section for each strategy and bench test."""
    from repose import strategies

    return _settings_type(names(), strategies.names())


@cache
def _settings_type(apparatus: tuple[str, ...], strategies: tuple[str, ...]) -> type[StudySettings]:
    """Make the model for these bench tests and strategies."""
    from repose.strategies import strategy

    sections: dict[str, Any] = {
        name: (strategy(name).settings, ...) for name in strategies if strategy(name).settings is not None
    }
    sections |= {name: (bench(name).settings, ... if name == "funnel" else ABSENT) for name in apparatus}
    return create_model("Configuration", __base__=StudySettings, **sections)


def named_files() -> tuple[str, ...]:
    """Return the dotted keys of the configuration that name a file: those of the types `Path` and `PathOrNull`."""
    return _files_of(settings_type())


@cache
def _files_of(model: type[Section]) -> tuple[str, ...]:
    """Return the keys of a section's model, and of the sections in it, that name a file."""
    keys: list[str] = []
    for name, field in model.model_fields.items():
        if _FILE in field.metadata:
            keys.append(name)
        elif isinstance(field.annotation, type) and issubclass(field.annotation, Section):
            keys += [f"{name}.{key}" for key in _files_of(field.annotation)]
    return tuple(keys)
