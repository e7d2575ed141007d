"""The section `measure` of the configuration: how a pile is measured."""

from typing import Annotated, Literal

from pydantic import Field

from repose.common.section import AUTO, Auto, Contradictions, OneOf, Section
from repose.measure.angles import DEFINITIONS
from repose.measure.profile_points import FLANK_RULES


class MeasureSection(Section):
    """Measurement of a pile."""

    views: int = Field(ge=1, le=360)
    mm_per_pixel: Annotated[float, Field(ge=0.02, le=5)] | Auto = AUTO
    response: Annotated[str, OneOf(lambda: DEFINITIONS)]
    fit_from: Literal["berry"] | Annotated[float, Field(ge=0, le=0.9)]
    fit_to: Literal["berry"] | Annotated[float, Field(ge=0.1, le=1)]
    berry_height_mm: Annotated[float, Field(gt=0, le=1000)] | None
    largest_pile_only: bool
    flank: Annotated[str, OneOf(lambda: FLANK_RULES)]
    smallest_window: float = Field(ge=0.1, le=1)

    def contradictions(self) -> Contradictions:
        """Refuse an upper end of the fitted part that leaves the part too short for a line."""
        start, end = self.fit_from, self.fit_to
        if start == end == "berry":
            yield "fit_to", "a number from 0.1 to 1, as measure.fit_from is berry"
        if isinstance(start, float) and isinstance(end, float) and end < start + 0.1:
            yield "fit_to", f"at least 0.1 above measure.fit_from, {start:g}"
