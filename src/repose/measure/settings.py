"""Settings of the measurement of a pile: the section `measure` of a configuration."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

from repose.core.errors import InputError
from repose.measure.angles import CALIBRATED_ANGLE, DEFINITIONS, MEAN_KEYS
from repose.measure.profile_points import FLANK_RULES


@dataclass(frozen=True)
class MeasureSettings:
    """Settings of the measurement of a pile; InputError if a value is not allowed."""

    views: int = 18  # side views, evenly over half a turn; the other half mirrors them
    mm_per_pixel: float = 0.25  # scale of the silhouettes
    response: str = "whole"  # the definition used as the angle of repose, one of `DEFINITIONS`
    fit_from: float | str = 0.3  # lower end of the flank: share of the height, or "berry" (one grain high)
    fit_to: float | str = 0.8  # upper end, likewise
    berry_height_mm: float | None = None  # None means the particle's equivalent diameter
    largest_pile_only: bool = True  # False: loose grains count, too
    flank: str = "levels"  # rule for the points of a line, one of `FLANK_RULES`
    smallest_window: float = 0.333  # of `straightest`: share of a side's points

    def __post_init__(self) -> None:
        whole = isinstance(self.views, int) and not isinstance(self.views, bool)
        start, end, height, window = self.fit_from, self.fit_to, self.berry_height_mm, self.smallest_window
        if "berry" in (start, end):
            fits = start != end and (end == "berry" or _between(0.1, end, 1))
            ends = "from 0.1 to 1, or berry where fit_from is not"
        else:
            fits = isinstance(start, int | float) and _between(start + 0.1, end, 1)
            ends = "berry, or at least fit_from + 0.1, at most 1"
        for key, good, allowed in (
            ("views", whole and 1 <= self.views <= 360, "a whole number from 1 to 360"),
            ("largest_pile_only", isinstance(self.largest_pile_only, bool), "true or false"),
            ("mm_per_pixel", _positive(self.mm_per_pixel), "a positive number"),
            ("berry_height_mm", height is None or _positive(height), "a positive number or null"),
            ("response", self.response in DEFINITIONS, f"one of {', '.join(DEFINITIONS)}"),
            ("flank", self.flank in FLANK_RULES, f"one of {', '.join(FLANK_RULES)}"),
            ("smallest_window", _positive(window) and _between(0.1, window, 1), "a number from 0.1 to 1"),
            ("fit_from", start == "berry" or _between(0, start, 0.9), "berry, or from 0 to 0.9"),
            ("fit_to", fits, ends),
        ):
            if not good:
                raise InputError("measure", key, getattr(self, key), allowed)

    @classmethod
    def of(cls, section: Mapping[str, Any], berry: Mapping[str, Any]) -> "MeasureSettings":
        """Make the settings of the section `measure`; a grain is as high as `berry`'s diameter if not given."""
        settings = cls(**section)
        axes: list[Any] = [berry.get(key) for key in ("long_mm", "major_mm", "minor_mm")]
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
    ends = ["one grain" if section[key] == "berry" else f"{100 * section[key]:g}" for key in ("fit_from", "fit_to")]
    band = f"{ends[0]} to {ends[1]}{' % of the height' if section['fit_to'] != 'berry' else ''}"
    part = "steepest half or more of the " if definition == "steepest" else ""
    return f"{part}flank, {band}, {section['flank']}"


def line_for(section: object, response: str) -> str:
    """Describe the line of a response that is an angle of a pile; empty for any other response, or no section."""
    if section is None:
        return ""
    if response == CALIBRATED_ANGLE:
        return line_of(section)
    return next((line_of(section, name) for name, key in MEAN_KEYS.items() if key == response), "")


def _positive(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < math.inf


def _between(low: float, value: object, high: float) -> bool:
    return isinstance(value, int | float) and low <= value <= high


def mean_axes_mm(sizes_csv: str | PathLike) -> dict[str, float]:
    """Mean axes of measured grains [mm], by the names of their columns."""
    from repose.particle.berry_files import SIZE_COLUMNS, read_sizes

    sizes = read_sizes(sizes_csv)
    return {column: float(sizes[column].mean()) for column in SIZE_COLUMNS}
