"""Settings of the measurement of a pile: the section `measure` of a configuration."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

from repose.measure.angles import CALIBRATED_ANGLE, MEAN_KEYS


@dataclass(frozen=True)
class MeasureSettings:
    """Settings of the measurement of a pile; `repose.config.models` checks those of a configuration."""

    views: int = 18  # side views, evenly over half a turn; the other half mirrors them
    mm_per_pixel: float = 0.25  # scale of the silhouettes
    response: str = (
        "whole"  # the definition used as the angle of repose, one of `DEFINITIONS`
    )
    fit_from: float | str = (
        0.3  # lower end of the flank: share of the height, or "berry" (one grain high)
    )
    fit_to: float | str = 0.8  # upper end, likewise
    berry_height_mm: float | None = (
        None  # None means the particle's equivalent diameter
    )
    largest_pile_only: bool = True  # False: loose grains count, too
    flank: str = "levels"  # rule for the points of a line, one of `FLANK_RULES`
    smallest_window: float = 0.333  # of `straightest`: share of a side's points

    @classmethod
    def of(
        cls, section: Mapping[str, Any], berry: Mapping[str, Any]
    ) -> "MeasureSettings":
        """Make the settings of the section `measure`; a grain is as high as `berry`'s diameter if not given."""
        settings = cls(**section)
        axes: list[Any] = [
            berry.get(key) for key in ("long_mm", "major_mm", "minor_mm")
        ]
        if settings.berry_height_mm is None and None not in axes:
            return replace(settings, berry_height_mm=math.prod(axes) ** (1 / 3))
        return settings


def line_of(how: object, definition: str | None = None) -> str:
    """Describe a definition of the angle with its settings for tables and figures; default: the calibrated one.

    `how` is the section `measure`, typed or as a mapping.
    """
    section = how if isinstance(how, Mapping) else vars(how)
    definition = definition or section["response"]
    if definition == "secant":
        return "secant, foot to crest"
    if definition == "whole":
        return "whole side, columns"
    if definition == "straightest":
        return f"straightest window, at least {section['smallest_window']:.2g} of the side, columns"
    ends = [
        "one grain" if section[key] == "berry" else f"{100 * section[key]:g}"
        for key in ("fit_from", "fit_to")
    ]
    band = f"{ends[0]} to {ends[1]}{' % of the height' if section['fit_to'] != 'berry' else ''}"
    part = "steepest half or more of the " if definition == "steepest" else ""
    return f"{part}flank, {band}, {section['flank']}"


def line_for(section: object, response: str) -> str:
    """Describe the line of a response that is an angle of a pile; empty for any other response, or no section."""
    if section is None:
        return ""
    if response == CALIBRATED_ANGLE:
        return line_of(section)
    return next(
        (line_of(section, name) for name, key in MEAN_KEYS.items() if key == response),
        "",
    )


def mean_axes_mm(sizes_csv: str | PathLike) -> dict[str, float]:
    """Mean axes of measured grains [mm], by the names of their columns."""
    from repose.grain.berry_files import SIZE_COLUMNS, read_sizes

    sizes = read_sizes(sizes_csv)
    return {column: float(sizes[column].mean()) for column in SIZE_COLUMNS}
