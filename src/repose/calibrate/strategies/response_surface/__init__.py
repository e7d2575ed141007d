"""The usual way in the field: Plackett-Burman screening, steepest ascent, a response surface, its optimum, a check."""

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from repose.calibrate.strategies.base import (
    Answer,
    Batch,
    Pours,
    Strategy,
    register,
)
from repose.common.section import Contradictions, Section, Seeds

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from repose.calibrate.study import Study

FITTED = ("anova", "effects", "statistics")  # tables of a step's models


class ResponseSurfaceSettings(Section):
    """Settings of screening, steepest ascent and quadratic surface; config/README.md explains the keys."""

    seeds: Seeds  # runs of each sample
    screening_runs: Literal[8, 12, 16, 20, 24]  # of the Plackett-Burman design
    significance: float = Field(gt=0, le=0.5)  # largest p of a parameter that is kept
    most_factors: int = Field(ge=2, le=7)  # of the surface
    steps: int = Field(ge=1, le=50)  # of the ascent
    surface: Literal["box_behnken", "rotatable", "face_centred"]
    centres: int = Field(ge=1, le=50)  # samples at the centre of a design
    reach: float = Field(
        ge=0.01, le=0.5
    )  # from the surface's centre to its outermost level, in ranges
    checks: int = Field(ge=2, le=500)  # samples at the optimum

    @property
    def fewest_factors(self) -> int:
        """The smallest number of factors of the surface."""
        return 3 if self.surface == "box_behnken" else 2

    def coded(self, factors: int) -> tuple["np.ndarray", float]:
        """Design the surface of some factors in coded units (n, factors); return also its outermost level."""
        from repose.calibrate.designs.box_behnken import box_behnken
        from repose.calibrate.designs.central_composite import central_composite

        if self.surface == "box_behnken":
            return box_behnken(factors, self.centres), 1.0
        return central_composite(factors, self.surface, self.centres)


@register("response_surface")
class ResponseSurface(Strategy[ResponseSurfaceSettings]):
    """Screening, steepest ascent, surface, check: each a batch."""

    settings = ResponseSurfaceSettings
    repeats_points = True
    files = (
        *(
            f"{step}_{table}.csv"
            for step in ("screening", "surface")
            for table in FITTED
        ),
        *(
            "screening.json",
            "path.csv",
            "surface.csv",
            "predictions.csv",
            "optimum.json",
        ),
    )
    reads = (
        "parameters",
        "targets",
        "design.seed",
        "response_surface",
        "miga.solutions",
        "miga.distance",
    )

    def propose(self, study: "Study", data: "pd.DataFrame") -> Batch | Answer:
        from repose.calibrate.strategies.response_surface import strategy

        return strategy.propose(study, data)

    def contradictions(
        self, section: ResponseSurfaceSettings, free: int, responses: int
    ) -> Contradictions:
        """Refuse a response surface of too few factors or runs."""
        name, fewest = section.surface, section.fewest_factors
        if free < fewest:
            yield (
                "surface",
                f"a design for {free} free parameters; {name} needs {fewest}",
            )
        if section.most_factors < fewest:
            yield "most_factors", f"at least {fewest} where surface is {name}"
        if section.screening_runs < free + 2:
            yield "screening_runs", f"at least {free + 2} for {free} free parameters"
        if section.centres < (centres := 3 if name == "box_behnken" else 1):
            yield "centres", f"at least {centres} where surface is {name}"

    def pours(self, section: ResponseSurfaceSettings, free: int) -> Pours:
        """Count the steps' pours; the screening may keep fewer parameters than `response_surface.most_factors`."""
        steps = {
            "screening": section.screening_runs + section.centres,
            "ascent": section.steps + 1,
        }
        steps |= {
            "surface": len(section.coded(min(section.most_factors, free))[0]),
            "check": section.checks,
        }
        return tuple((name, sets, section.seeds) for name, sets in steps.items())
