"""A study with a simulator of the user's own: the typed models of its short configuration, and its completion."""

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, create_model, field_validator

from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.profiles import OfProfile, Profile
from repose.calibrate.responses import Response
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.strategies import names, strategy
from repose.calibrate.strategies.refined import RefineSettings
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Target, Targets
from repose.common import places
from repose.common.errors import YamlError, raise_together
from repose.common.section import ABSENT, AUTO, Contradictions, Section, Seed, refuse
from repose.config import typed
from repose.config.keys import get
from repose.config.models import (
    StrategyName,
    SurrogateName,
    all_fixed,
    far_priors,
    parameter,
)
from repose.config.profiles import expanded_own
from repose.config.reading import read

# Columns of tables that are neither parameter nor response.
RESERVED = (
    "sample",
    "run",
    "status",
    "turn",
    "runs",
    "seeds",
    "batch",
    "reason",
    "n_seeds",
)
BENCH = "own"  # bench test of the responses
OF_TARGETS = ("noise_sd", "definition")  # keys of targets that are collected
TRAINING = (
    "network.split",
    "network.replicates",
    "network.validation_noise",
)  # of every surrogate
DESIGNED = (
    "seeds",
    "design",
    "surrogate",
    "network",
    "miga",
    *TRAINING,
)  # what follows the article's design reads
READ_BY_ALL = (
    "parameters",
    "targets",
    "posterior",
    "sequential.tolerance_percent",
    "sequential.probability",
)
RANGE_PERCENT = 2.0  # of the value, to each side, where no range is given
LARGEST = 1e12
ANY_SIZE = parameter(-1e30, 1e30)

Line = Annotated[
    str, Field(pattern=r"^[^\n]*\S[^\n]*$", description="text of one line")
]
Size = Annotated[float, Field(ge=0, le=LARGEST)]
Value = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]


class OwnTarget(Section):
    """A measured response."""

    value: Value
    sd: Size
    repetitions: int = Field(ge=1, le=10_000)
    range: Annotated[
        tuple[Value, Value],
        Field(strict=False, description="a pair [low, high] of numbers"),
    ] = ABSENT
    unit: Line = ""
    definition: Line = ABSENT
    noise_sd: Annotated[float, Field(gt=0, le=LARGEST)] = ABSENT
    profile: OfProfile = (
        ABSENT  # it is a score of this; `repose.config.profiles` writes it
    )

    def contradictions(self) -> Contradictions:
        """Refuse a target of 0, which has no relative tolerance, a range apart from it, and a tiny noise."""
        if self.value == 0 and self.profile is None:
            yield "value", "not 0: tolerances are in percent of it"
        low, high = self.range or (-math.inf, math.inf)
        if not low <= self.value <= high or low == high:
            yield "range", f"a pair [low, high] about the value, {self.value:g}"
        least = 1e-9 * abs(self.value)
        if self.noise_sd is not None and self.noise_sd < least:
            yield "noise_sd", f"at least {least:g}"


class OwnSequential(Section):
    """The strategy `sequential`, whose budget is in runs."""

    start_samples: int = Field(default=16, ge=2, le=10_000)
    seeds: int = Field(default=2, ge=1, le=1000)
    batch: int = Field(default=8, ge=1, le=1000)
    tolerance_percent: float = Field(default=1.0, ge=0.01, le=50)
    probability: float = Field(default=0.7, ge=0.05, le=0.99)
    most_runs: int = Field(default=120, ge=4, le=1_000_000)


class OwnPosterior(Section):
    """The posterior of the parameters."""

    discrepancy_percent: float = Field(default=2.0, ge=0, le=50)
    discrepancy_correlation: float = Field(default=0.0, ge=0, le=0.99)
    walkers: int = Field(default=128, ge=32, le=10_000)
    steps: int = Field(default=400, ge=100, le=1_000_000)


class OwnSettings(Section):
    """The whole configuration, without the sections of further strategies (`settings_type`)."""

    simulator: Line
    label: Line
    seed: int = Field(ge=0, le=2**31 - 1)
    parameters: dict[str, ANY_SIZE] = Field(  # type: ignore[valid-type]
        description="a section with a range for each parameter"
    )
    targets: dict[str, OwnTarget] = Field(
        description="a section with value, sd and repetitions for each response"
    )
    strategy: StrategyName
    seeds: int = Field(ge=1, le=1000)
    surrogate: SurrogateName
    sequential: OwnSequential
    posterior: OwnPosterior
    design: DesignSettings
    network: NetworkSettings
    miga: MigaSettings
    refine: RefineSettings

    @field_validator("sequential")
    @classmethod
    def _within_budget(cls, own: OwnSequential, info: ValidationInfo) -> OwnSequential:
        if (
            info.data.get("strategy") == "sequential"
            and own.start_samples * own.seeds > own.most_runs
        ):
            refuse(
                [
                    (
                        "most_runs",
                        "at least sequential.start_samples times sequential.seeds",
                    )
                ]
            )
        return own

    @field_validator("parameters")
    @classmethod
    def _free(cls, parameters: dict[str, Any]) -> dict[str, Any]:
        refuse([*_bad_columns(parameters), *far_priors(parameters)])
        if all_fixed(parameters):
            refuse([("", "at least one range or prior")])
        return parameters

    @field_validator("targets")
    @classmethod
    def _some(
        cls, targets: dict[str, OwnTarget], info: ValidationInfo
    ) -> dict[str, OwnTarget]:
        parameters = info.data.get("parameters", {})
        taken = {
            *parameters,
            *(f"{name}_se" for name in targets),
        }  # with the columns of standard errors
        both = [name for name in targets if name in taken or f"{name}_se" in parameters]
        allowed = (
            "a name that is no parameter's, nor that of another with _se at its end"
        )
        refuse([*_bad_columns(targets), *((name, allowed) for name in both)])
        if not targets:
            refuse([("", "at least one response")])
        return targets


def _bad_columns(names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Refuse names that no column of the table of runs may have."""
    for name in names:
        if (
            name in RESERVED
            or name != name.strip()
            or not name
            or not name.isprintable()
        ):
            yield (
                name,
                f"another name: one line of text without spaces around it, and none of {', '.join(RESERVED)}",
            )


class _Sequential(OwnSequential):
    most_pours: int  # `most_runs`


class _Posterior(OwnPosterior):
    seed: Seed


class _Runs(Section):
    seeds: int


class OwnStudySettings(OwnSettings):
    """The configuration once it is completed."""

    sequential: _Sequential
    posterior: _Posterior
    seeds: int = ABSENT
    own: _Runs
    noise_sd: dict[str, float]
    definitions: dict[str, str]


@cache
def settings_type(whole: type[OwnSettings] = OwnSettings) -> type[OwnSettings]:
    """Make the model with the section of each strategy but `sequential`, which has its own here."""
    sections = {
        name: strategy(name).settings
        for name in names()
        if name not in OwnSettings.model_fields
    }
    others: dict[str, Any] = {
        name: (model, ABSENT) for name, model in sections.items() if model is not None
    }
    return create_model("OwnConfiguration", __base__=whole, **others)


def is_own(path: str | os.PathLike) -> bool:
    """Return whether a configuration is for a simulator of the user's own: it names the simulator."""
    return "simulator" in read(path)


def completed(content: Mapping[str, Any], source: object = "study") -> dict[str, Any]:
    """Complete a configuration by every section that a strategy reads, in the form of a whole configuration.

    Missing keys of `sequential` and `posterior` have the defaults above, keys of other sections the values of
    config/method.yaml. InputError with all faults; `source` names the file in it.
    """
    from repose.calibrate.strategies import cost
    from repose.config import computed, faults

    defaults: dict[str, Any] = read(places.find(places.METHOD_CONFIG))
    # the runs of a sample may stand at the top or there
    seeds = next(
        one
        for one in (get(content, "seeds"), get(content, "sequential.seeds"), 2)
        if isinstance(one, int)
    )
    given: dict[str, Any] = {
        "strategy": "sequential",
        "seeds": seeds,
        "surrogate": "gaussian_process",
    } | dict(content)
    sequential = OwnSequential().model_dump() | {"seeds": seeds}
    defaults |= {"sequential": sequential, "posterior": OwnPosterior().model_dump()}
    named = {
        name: given[name]
        for name in ("parameters", "targets")
        if isinstance(given.get(name), Mapping)
    }
    others = (
        (name, key) for name in named for key in named[name] if not isinstance(key, str)
    )
    raise_together(
        YamlError(str(source), name, key, "text as each name; put it in quotes")
        for name, key in others
    )
    given["targets"] = expanded_own(given.get("targets"), source)
    sections = [
        name
        for name in settings_type().model_fields
        if isinstance(defaults.get(name), Mapping)
    ]
    for name in sections:
        section = given.get(name, {})
        given[name] = (
            {**defaults[name], **section} if isinstance(section, Mapping) else section
        )
    raise_together(faults.check(given, str(source), settings_type()).faults)
    for name in ("design", "network", "miga", "posterior"):
        given[name] |= {"seed": given["seed"]}
    if given["network"].get("split", AUTO) == AUTO:
        given["network"] |= {"split": computed.split_of(given["surrogate"])}
    given["sequential"] |= {
        "most_pours": given["sequential"]["most_runs"]
    }  # the strategy counts pours
    found = {
        key: {name: one[key] for name, one in given["targets"].items() if key in one}
        for key in OF_TARGETS
    }
    seeds, definitions = given.pop("seeds"), found.pop("definition")
    config = given | found | {"definitions": definitions, BENCH: {"seeds": seeds}}
    if (
        given["strategy"] != "sequential"
    ):  # its own rule is for pours, whose noise no key gives
        off = cost.contradictions(sections_of(config))
        raise_together(
            YamlError(str(source), key, get(config, key), allowed)
            for key, allowed in off
        )
    return config


def unread(content: Mapping[str, Any]) -> list[str]:
    """List the given keys of a checked configuration that neither its strategy nor any answer reads."""
    name = content.get("strategy", "sequential")
    after, designed = strategy(name).reads, strategy(name).begins_with_design
    read_by = {
        *READ_BY_ALL,
        *(DESIGNED if designed else ()),
        *(after or (() if designed else content)),
    }
    read_by -= (
        {"network"}
        if designed and not content.get("surrogate", "").startswith("network")
        else set()
    )
    read_by |= {"seeds"} if "sequential" in read_by else set()
    if get(content, "sequential.seeds") is not None and (
        name == "sequential" or "seeds" not in content
    ):
        read_by ^= {"seeds", "sequential.seeds"} if "seeds" in read_by else set()
    given = [
        name
        for name in settings_type().model_fields
        if isinstance(content.get(name), Mapping)
    ]
    keys = [f"{name}.{key}" for name in given for key in content[name]] + [
        *({"seeds", "surrogate"} & {*content})
    ]
    # `seed` stands in place of each section's own
    return sorted(
        key
        for key in keys
        if key.endswith(".seed") or not read_by & {key, key.partition(".")[0]}
    )


def sections_of(config: Mapping[str, Any]) -> Any:
    """Return the typed sections of a completed configuration."""
    return typed.sections(config, "study", settings_type(OwnStudySettings))


def targets_of(section: Mapping[str, Mapping[str, Any]]) -> Targets:
    """Make the targets of a checked configuration; one without a range gets its value and 2 % to each side."""
    return Targets([_target(name, one) for name, one in section.items()])


def _target(name: str, given: Mapping[str, Any]) -> Target:
    value, half = given["value"], RANGE_PERCENT / 100 * abs(given["value"])
    low, high = given.get("range", (value - half, value + half))
    response = Response(name, given.get("unit", ""), name, name, BENCH, -math.inf)
    profile = Profile.of(given["profile"]) if "profile" in given else None
    return Target(
        response,
        value,
        given["sd"],
        given["repetitions"],
        low,
        high,
        value,
        profile=profile,
    )
