"""The strategy `response_surface`, the usual way in the field.

Its steps are a Plackett-Burman screening, the steepest ascent, a response surface with
its optimum, and a check.
"""

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from repose.calibrate.strategies.base import (
    Answer,
    Batch,
    CheckRuns,
    Pours,
    Strategy,
    register,
)
from repose.common.section import Contradictions, Section, Seeds

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from repose.calibrate.study import Study

# Tables of the models of a step.
ANALYSIS_TABLES = ("anova", "effects", "statistics")
# The smallest number of parameters of each design of a surface.
MIN_FACTORS = {"box_behnken": 3, "rotatable": 2, "face_centred": 2}


class ResponseSurfaceSettings(Section):
    """The section `response_surface`; config/README.md explains the keys."""

    seeds: Seeds = Field(
        description="pours of each run of a design; their mean is the run's response",
    )
    screening_runs: Literal[8, 12, 16, 20, 24] = Field(
        description="runs of the Plackett-Burman design, at least two more than free "
        "parameters",
    )
    significance: float = Field(
        gt=0,
        le=0.5,
        description="a parameter is kept if its effect has a smaller p value",
    )
    most_factors: int = Field(
        ge=2,
        le=7,
        description="largest number of parameters that are kept; at least 3 for "
        "`box_behnken`, 2 for the others",
    )
    steps: int = Field(
        ge=1,
        le=50,
        description="steps of the path of ascent, which ends at the end of a range",
    )
    surface: Literal["box_behnken", "rotatable", "face_centred"] = Field(
        description="design of the surface",
    )
    centres: int = Field(
        ge=1,
        le=50,
        description="runs at the centre of the surface, and of the screening; at least "
        "3 for `box_behnken`",
    )
    reach: float = Field(
        ge=0.01,
        le=0.5,
        description="distance of the surface's outermost level from its centre, as a "
        "share of each parameter's range",
    )
    checks: int = Field(
        ge=2,
        le=500,
        description="runs of the check, with `seeds` pours each",
    )

    @property
    def min_factors(self) -> int:
        """The smallest number of factors (varied parameters) of the surface."""
        return MIN_FACTORS[self.surface]

    def make_surface_design(self, factors: int) -> tuple["np.ndarray", float]:
        """Make the design of the surface for a number of factors (varied parameters).

        Returns
        -------
        numpy.ndarray, (n, factors)
            The samples in coded units, in which 0 is the centre of each factor.
        float
            The outermost level of these samples, which is 1 or larger.
        """
        from repose.calibrate.designs.box_behnken import box_behnken
        from repose.calibrate.designs.central_composite import central_composite

        if self.surface == "box_behnken":
            return box_behnken(factors, self.centres), 1.0
        return central_composite(factors, self.surface, self.centres)


@register("response_surface")
class ResponseSurface(Strategy[ResponseSurfaceSettings]):
    """Screening, steepest ascent, surface and check, each of which is a batch."""

    settings = ResponseSurfaceSettings
    repeats_points = True
    files = (
        *(f"screening_{table}.csv" for table in ANALYSIS_TABLES),
        *(f"surface_{table}.csv" for table in ANALYSIS_TABLES),
        "screening.json",
        "path.csv",
        "surface.csv",
        "predictions.csv",
        "optimum.json",
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
        """Find settings with too few factors or runs for a response surface.

        The arguments are those of `Strategy.contradictions`: `free` is the number of
        free parameters, and `responses`, the number of targets, is not used.

        Yields
        ------
        pair of str
            The key of the section, and what is allowed, for an error message.
        """
        design = section.surface
        min_factors = section.min_factors
        if free < min_factors:
            # Name the designs that need no more factors than there are, if any.
            possible = [
                name for name, minimum in MIN_FACTORS.items() if minimum <= free
            ]
            choice = " or ".join(possible) or "another strategy"
            parameters = "parameter" if free == 1 else "parameters"
            yield (
                "surface",
                f"{choice} for {free} free {parameters}; {design} needs {min_factors}",
            )
        if section.most_factors < min_factors:
            yield "most_factors", f"at least {min_factors} where surface is {design}"
        # A linear model has a constant and a slope for each parameter. One more run
        # shows how well it fits.
        min_runs = free + 2
        if section.screening_runs < min_runs:
            yield "screening_runs", f"at least {min_runs} for {free} free parameters"
        # A Box-Behnken design has up to three blocks, and each needs a centre run.
        min_centres = 3 if design == "box_behnken" else 1
        if section.centres < min_centres:
            yield "centres", f"at least {min_centres} where surface is {design}"

    def pours(self, section: ResponseSurfaceSettings, free: int) -> Pours:
        """Return the largest number of runs of each step.

        The screening may keep fewer parameters than `most_factors`.
        """
        most_factors = min(section.most_factors, free)
        surface, _ = section.make_surface_design(most_factors)
        return (
            ("screening", section.screening_runs + section.centres, section.seeds),
            ("ascent", section.steps + 1, section.seeds),
            ("surface", len(surface), section.seeds),
            CheckRuns("check", section.checks, section.seeds),
        )
