"""The usual way in the field: Plackett-Burman screening, steepest ascent, a response surface, its optimum, a check."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from repose.core.parameter_space import ParameterSpace
from repose.core.section import Section, Seeds
from repose.strategies.base import Answer, Batch, Strategy, Studied, register

if TYPE_CHECKING:
    import pandas as pd

FITTED = ("anova", "effects", "statistics")  # tables of a step's models


class ResponseSurfaceSettings(Section):
    """Screening, steepest ascent and a quadratic surface."""

    seeds: Seeds
    screening_runs: Literal[8, 12, 16, 20, 24]
    significance: float = Field(gt=0, le=0.5)
    most_factors: int = Field(ge=2, le=7)
    steps: int = Field(ge=1, le=50)
    surface: Literal["box_behnken", "rotatable", "face_centred"]
    centres: int = Field(ge=1, le=50)
    reach: float = Field(ge=0.01, le=0.5)
    checks: int = Field(ge=2, le=500)


@register("response_surface")
class ResponseSurface(Strategy):
    """Screening, steepest ascent, surface, check: each a batch."""

    settings = ResponseSurfaceSettings
    repeats_points = True
    files = (
        *(f"{step}_{table}.csv" for step in ("screening", "surface") for table in FITTED),
        *("screening.json", "path.csv", "surface.csv", "predictions.csv", "optimum.json"),
    )
    reads = ("parameters", "targets", "design.seed", "response_surface", "miga.solutions", "miga.distance")

    def propose(self, study: Studied, data: "pd.DataFrame") -> Batch | Answer:
        from repose.strategies.response_surface import strategy

        return strategy.propose(study, data)

    def contradictions(self, config: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Refuse a response surface of too few factors or runs."""
        section, free = config["response_surface"], _free(config)
        name, fewest = section["surface"], fewest_factors(section)
        centres = 3 if name == "box_behnken" else 1
        if free < fewest:
            yield "response_surface.surface", f"a design for {free} free parameters; {name} needs {fewest}"
        if section["most_factors"] < fewest:
            yield "response_surface.most_factors", f"at least {fewest} where surface is {name}"
        if section["screening_runs"] < free + 2:
            yield "response_surface.screening_runs", f"at least {free + 2} for {free} free parameters"
        if section["centres"] < centres:
            yield "response_surface.centres", f"at least {centres} where surface is {name}"

    def pours(self, config: Mapping[str, Any]) -> tuple[tuple[str, int, int], ...]:
        """Count the steps' pours; the screening may keep fewer parameters than `response_surface.most_factors`."""
        from repose.doe.box_behnken import box_behnken
        from repose.doe.central_composite import central_composite

        section = config["response_surface"]
        factors = min(section["most_factors"], _free(config))
        if section["surface"] == "box_behnken":
            runs = len(box_behnken(factors, section["centres"])[0])
        else:
            runs = len(central_composite(factors, section["surface"], section["centres"])[0])
        steps = (
            ("screening", section["screening_runs"] + section["centres"]),
            ("ascent", section["steps"] + 1),
            ("surface", runs),
            ("check", section["checks"]),
        )
        return tuple((name, sets, section["seeds"]) for name, sets in steps)


def fewest_factors(section: Mapping[str, Any]) -> int:
    """Return the smallest number of factors of the surface."""
    return 3 if section["surface"] == "box_behnken" else 2


def _free(config: Mapping[str, Any]) -> int:
    """Count the free parameters."""
    section = config["parameters"]
    return ParameterSpace.of(section, names=tuple(section)).dimensions
