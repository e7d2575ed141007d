"""Settings of the measurement of a pile: the section `measure` of a configuration."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

from repose.measure.definitions import CALIBRATED_ANGLE, MEAN_KEYS

ONE_GRAIN = "berry"  # value of `fit_from` and `fit_to` for the height of a grain
AXES = ("long_mm", "major_mm", "minor_mm")


@dataclass(frozen=True)
class MeasureSettings:
    """Settings of the measurement of a pile.

    `repose.config.models` checks those of a configuration.

    Attributes
    ----------
    views : int
        Number of side views, evenly over half a turn; the other half mirrors them.
    mm_per_pixel : float
        Scale of the silhouettes.
    response : str
        The definition used as the angle of repose, one of `DEFINITIONS`.
    fit_from, fit_to : float or str
        Ends of the flank: shares of the height, or "berry" for the height of a grain.
    berry_height_mm : float, optional
        Height of a grain; None means the particle's equivalent diameter.
    largest_pile_only : bool
        Whether loose grains are left out.
    flank : str
        Rule for the points of a line, one of `FLANK_RULES`.
    smallest_window : float
        Share of a side's points in the smallest window of the definition "straightest".
    """

    views: int = 18
    mm_per_pixel: float = 0.25
    response: str = "whole"
    fit_from: float | str = 0.3
    fit_to: float | str = 0.8
    berry_height_mm: float | None = None
    largest_pile_only: bool = True
    flank: str = "levels"
    smallest_window: float = 0.333

    @classmethod
    def of(
        cls, section: Mapping[str, Any], grain: Mapping[str, Any]
    ) -> "MeasureSettings":
        """Make the settings of the section `measure`.

        If the section has no height of a grain, it is the equivalent diameter of the
        axes of `grain`, if they are there.
        """
        settings = cls(**section)
        if settings.berry_height_mm is not None:
            return settings
        if any(grain.get(axis) is None for axis in AXES):
            return settings
        diameter_mm = math.prod(grain[axis] for axis in AXES) ** (1 / 3)
        return replace(settings, berry_height_mm=diameter_mm)


def line_of(settings: Any, definition: str | None = None) -> str:
    """Describe a definition of the angle with its settings, for tables and figures.

    Parameters
    ----------
    settings : MeasureSettings or Mapping
        The section `measure`.
    definition : str, optional
        One of `DEFINITIONS`; the default is that of the calibrated angle.
    """
    section = settings
    if isinstance(settings, Mapping):
        section = SimpleNamespace(**settings)
    if not definition:
        definition = section.response
    if definition == "secant":
        return "secant, foot to crest"
    if definition == "whole":
        return "whole side, columns"
    if definition == "straightest":
        smallest = section.smallest_window
        return f"straightest window, at least {smallest:.2g} of the side, columns"
    lower = _end_of_flank(section.fit_from)
    upper = _end_of_flank(section.fit_to)
    unit = "" if section.fit_to == ONE_GRAIN else " % of the height"
    part = "steepest half or more of the " if definition == "steepest" else ""
    return f"{part}flank, {lower} to {upper}{unit}, {section.flank}"


def _end_of_flank(end: float | str) -> str:
    """Describe an end of the flank: in percent of the height, or as a grain."""
    if end == ONE_GRAIN:
        return "one grain"
    return f"{100 * float(end):g}"


def line_for(section: object, response: str) -> str:
    """Describe the line of a response that is an angle of a pile.

    Return an empty text for any other response, or if `section` is None.
    """
    if section is None:
        return ""
    if response == CALIBRATED_ANGLE:
        return line_of(section)
    for definition, key in MEAN_KEYS.items():
        if key == response:
            return line_of(section, definition)
    return ""
