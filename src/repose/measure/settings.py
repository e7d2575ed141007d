"""The section `measure` of the configuration: how a pile is measured."""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import Field

from repose.common import method
from repose.common.section import OF_OTHERS, Contradictions, OneOf, OrAuto, Section
from repose.measure.definitions import CALIBRATED_ANGLE, DEFINITIONS, MEAN_KEYS
from repose.measure.profile_points import FLANK_RULES

ONE_GRAIN = "berry"  # value of `fit_from` and `fit_to` for the height of a grain
AXIS_KEYS = ("long_mm", "major_mm", "minor_mm")
# Scale of a silhouette whose grain is not known.
DEFAULT_MM_PER_PIXEL = 0.25
FINEST_MM_PER_PIXEL = 0.02
COARSEST_MM_PER_PIXEL = 5.0
# The height of a grain may lie beyond the axes of the mean grain by this factor,
# because grains differ in size.
GRAIN_HEIGHT_MARGIN = 2.0


class MeasureSettings(Section):
    """Settings of the measurement of a pile."""

    views: int = Field(
        ge=1,
        le=360,
        description="side views, evenly around half a turn; the angle is their mean",
        json_schema_extra={"source": "2.3: one"},
    )
    mm_per_pixel: OrAuto[
        Annotated[float, Field(ge=FINEST_MM_PER_PIXEL, le=COARSEST_MM_PER_PIXEL)]
    ] = Field(
        default=OF_OTHERS,
        description="scale of the rendered silhouette; `auto`: 1/32 of the equivalent "
        "diameter of a grain",
        json_schema_extra={"source": "open"},
    )
    response: Annotated[str, OneOf(lambda: DEFINITIONS)] = Field(
        description="definition of the calibrated angle, `aor_deg` in all tables "
        "([measurement.md](../docs/measurement.md#definitions))",
        json_schema_extra={"source": "2.3: a line fit"},
    )
    fit_from: Literal["berry"] | Annotated[float, Field(ge=0, le=0.9)] = Field(
        description="lower end of the flank, as a part of the pile's height; `berry`: "
        "one grain above the plate",
        json_schema_extra={"source": "open"},
    )
    fit_to: Literal["berry"] | Annotated[float, Field(ge=0.1, le=1)] = Field(
        description="upper end of the flank, as a part of the height; `berry`: one grain "
        "above the plate",
        json_schema_extra={"source": "open"},
    )
    berry_height_mm: Annotated[float, Field(gt=0, le=1000)] | None = Field(
        description="height of a grain, for `secant` and `berry`; null: the equivalent "
        "diameter of the mean grain (Eq. 1)",
    )
    largest_pile_only: bool = Field(
        description="leave out grains that do not touch the pile",
        json_schema_extra={"source": "open"},
    )
    flank: Annotated[str, OneOf(lambda: FLANK_RULES)] = Field(
        description="points that the line of `flank` and `steepest` is fitted to",
        json_schema_extra={"source": "open"},
    )
    smallest_window: float = Field(
        ge=0.1,
        le=1,
        description="of `straightest`: the smallest window, as a part of a side's "
        "points",
        json_schema_extra={"source": "open"},
    )

    @classmethod
    def with_defaults(
        cls, mm_per_pixel: float | str = DEFAULT_MM_PER_PIXEL, **keys: Any
    ) -> Self:
        """Make settings with the values of config/method.yaml for the keys left out."""
        keys["mm_per_pixel"] = mm_per_pixel
        return method.make_section_with_defaults(cls, "measure", keys)

    def contradictions(self) -> Contradictions:
        """Reject ends of the flank that are too close to each other for a line."""
        start, end = self.fit_from, self.fit_to
        if start == end == ONE_GRAIN:
            yield "fit_to", "a number from 0.1 to 1, as measure.fit_from is berry"
        if isinstance(start, float) and isinstance(end, float) and end < start + 0.1:
            yield "fit_to", f"at least 0.1 above measure.fit_from, {start:g}"

    def misfits(self, axes_mm: Sequence[float]) -> Contradictions:
        """Reject a height of a grain that a grain of these sizes cannot have.

        A number outside the limits is probably in another unit.

        Parameters
        ----------
        axes_mm : sequence of float
            The full axes of the mean grain.

        Yields
        ------
        tuple of str
            The dotted key and its allowed values.
        """
        low_mm = min(axes_mm) / GRAIN_HEIGHT_MARGIN
        high_mm = max(axes_mm) * GRAIN_HEIGHT_MARGIN
        height_mm = self.berry_height_mm
        if height_mm is not None and not low_mm <= height_mm <= high_mm:
            yield (
                "measure.berry_height_mm",
                f"null, or the height of a grain in mm, from {low_mm:.3g} to {high_mm:.3g}",
            )

    def with_scale(self, mm_per_pixel: float) -> Self:
        """Copy the settings, with another scale of the picture."""
        return self.model_copy(update={"mm_per_pixel": mm_per_pixel})

    def with_grain_height(self, height_mm: float) -> Self:
        """Copy the settings, with the height of a grain if they have none."""
        if self.berry_height_mm is not None:
            return self
        return self.model_copy(update={"berry_height_mm": height_mm})

    def for_grain(self, grain: Mapping[str, Any]) -> Self:
        """Copy the settings, with the height of a grain if they have none.

        Parameters
        ----------
        grain : mapping
            Measurements of the grain. The height is the equivalent diameter of its axes
            ``long_mm``, ``major_mm`` and ``minor_mm``; without them the settings stay
            as they are.
        """
        if any(grain.get(axis) is None for axis in AXIS_KEYS):
            return self
        diameter_mm = math.prod(grain[axis] for axis in AXIS_KEYS) ** (1 / 3)
        return self.with_grain_height(diameter_mm)


def line_of(settings: MeasureSettings, definition: str | None = None) -> str:
    """Describe in words the line whose slope is the angle by a definition.

    Parameters
    ----------
    settings : MeasureSettings
        Settings of the measurement.
    definition : str, optional
        The definition of the angle, one of `DEFINITIONS`. The default is the definition
        of the calibrated angle.

    Returns
    -------
    str
        Such as ``flank, 20 to 80 % of the height, columns``. The last word is the rule
        of `FLANK_RULES` that selects the points of the line.
    """
    # The key `flank` of the settings is the rule, not a definition.
    flank = f"flank, {describe_height_band(settings)}, {settings.flank}"
    match definition or settings.response:
        case "secant":
            return "secant, foot to crest"
        case "whole":
            return "whole side, columns"
        case "straightest":
            smallest = settings.smallest_window
            return f"straightest window, at least {smallest:.2g} of the side, columns"
        case "steepest":
            return f"steepest half or more of the {flank}"
        case _:  # "flank"
            return flank


def describe_height_band(settings: MeasureSettings) -> str:
    """Describe the heights between which a line is fitted to a flank."""
    lower = _describe_end(settings.fit_from)
    upper = _describe_end(settings.fit_to)
    unit = "" if settings.fit_to == ONE_GRAIN else " % of the height"
    return f"{lower} to {upper}{unit}"


def _describe_end(end: float | str) -> str:
    """Describe an end of the flank, as `fit_from` and `fit_to` give it.

    A fraction of the height is written in percent, without its unit.
    """
    if end == ONE_GRAIN:
        return "one grain"
    return f"{100 * float(end):g}"


def describe_line_of_response(settings: MeasureSettings | None, response: str) -> str:
    """Describe in words the line whose slope is a response.

    Parameters
    ----------
    settings : MeasureSettings or None
        Settings of the measurement; None for a study that measures no piles.
    response : str
        Name of a response.

    Returns
    -------
    str
        The text of `line_of` for an angle of repose. It is empty for any other
        response, such as the height of a pile, and if there are no settings.
    """
    if settings is None:
        return ""
    if response == CALIBRATED_ANGLE:
        return line_of(settings)
    # `MEAN_KEYS` has the response of each definition, and here the definition of a
    # response is needed.
    definitions_by_response = {key: name for name, key in MEAN_KEYS.items()}
    if response in definitions_by_response:
        return line_of(settings, definitions_by_response[response])
    return ""
