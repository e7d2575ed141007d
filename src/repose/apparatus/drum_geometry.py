"""The inside of the drum: a cylinder between two flat caps."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from repose import dem
from repose.apparatus.factory import Strip
from repose.apparatus.settings import SimulationSettings

if TYPE_CHECKING:
    from repose.dem import Cone, Plane

WALLS = ("shell", "near_cap", "far_cap")


@dataclass(frozen=True)
class Drum:
    """The inside of a cylinder about the y axis between two flat caps.

    Attributes
    ----------
    radius_m, length_m : float
        Of the inside [m].
    """

    radius_m: float
    length_m: float

    @classmethod
    def of(cls, section: Mapping[str, Any]) -> "Drum":
        """The drum of a configuration.

        Parameters
        ----------
        section : mapping
            The section `drum`.

        Returns
        -------
        Drum
        """
        radius_mm = 0.5 * section["outer_diameter_mm"] - section["wall_thickness_mm"]
        return cls(1e-3 * radius_mm, 1e-3 * section["length_mm"])

    def walls(self, material: str) -> "dict[str, Cone | Plane]":
        """The drum's walls.

        Parameters
        ----------
        material : str
            Name of the walls' material.

        Returns
        -------
        dict of Cone or Plane
            By name.
        """
        half = 0.5 * self.length_m
        ends = ((0.0, -half, 0.0), (0.0, half, 0.0))
        return {
            "shell": dem.Cylinder(ends[0], (0.0, 1.0, 0.0), self.length_m, self.radius_m, material),
            "near_cap": dem.Plane(ends[0], (0.0, 1.0, 0.0), material),
            "far_cap": dem.Plane(ends[1], (0.0, -1.0, 0.0), material),
        }

    def factory(self, height_m: float, berry_radius_m: float) -> Strip:
        """The widest `Strip` at a height in which a berry touches no wall.

        Parameters
        ----------
        height_m : float
            Above the axis.
        berry_radius_m : float

        Returns
        -------
        Strip

        Raises
        ------
        ValueError
            If there is none.
        """
        room = self.radius_m - berry_radius_m
        half_y = 0.5 * self.length_m - berry_radius_m
        if not (abs(height_m) < room and half_y > 0.0):
            raise ValueError(
                f"height_m is {height_m!r}; allowed: below {room:.4g}, in a drum longer than a berry"
            )
        return Strip(math.sqrt(room**2 - height_m**2), half_y, height_m)

    def holds(self, centres_m: np.ndarray) -> np.ndarray:
        """Which berries lie inside the drum.

        Parameters
        ----------
        centres_m : numpy.ndarray, (N, 3)

        Returns
        -------
        numpy.ndarray of bool, (N,)
        """
        inside = np.hypot(centres_m[:, 0], centres_m[:, 2]) < self.radius_m
        return inside & (np.abs(centres_m[:, 1]) < 0.5 * self.length_m)


def contradictions(config: Mapping[str, Any], section: str) -> Iterator[tuple[str, str]]:
    """Keys of a drum without room, that turns before the last berry is there, or is recorded finer than the time steps.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    section : str
        Name of the section that describes the drum.

    Yields
    ------
    key, allowed : str
        Dotted key, and what it may be.
    """
    drum, step_s = config[section], SimulationSettings.of(config).time_step_s
    radius = drum["outer_diameter_mm"] / 2 - drum["wall_thickness_mm"]
    if radius <= 0:
        allowed = f"below half of {section}.outer_diameter_mm, {drum['outer_diameter_mm']:g}"
        yield f"{section}.wall_thickness_mm", allowed
    elif abs(drum["factory_height_mm"]) >= radius:
        yield f"{section}.factory_height_mm", f"inside the drum, between -{radius:g} and {radius:g}"
    last = (drum["berries"] - 1) / drum["rate_per_s"]
    if last >= drum["rotate_from_s"]:
        yield f"{section}.rotate_from_s", f"above {last:g}, when the last berry appears"
    if drum["record_s"] < step_s:
        yield f"{section}.record_s", f"at least simulation.time_step_s, {step_s:g}"
