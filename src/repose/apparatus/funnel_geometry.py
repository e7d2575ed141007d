"""The inner surfaces of a funnel."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from repose import dem

if TYPE_CHECKING:
    from repose.dem import Cone, RingEdge


class ConeLine(NamedTuple):
    """The line of a cone in the half plane (r, z), as `repose.dem.Cone` takes it; lengths in m.

    Attributes
    ----------
    normal_r, normal_z : float
        Unit normal from the inside into the wall.
    offset : float
        Of the line: normal . (r, z) = offset.
    first, last : float
        Places along the line at which the cone begins and ends.
    up_r, up_z : float
        Unit vector up along the line.
    """

    normal_r: float
    normal_z: float
    offset: float
    first: float
    last: float
    up_r: float
    up_z: float


@dataclass(frozen=True)
class Funnel:
    """Inner surfaces of a funnel whose axis is z.

    The narrowest circle of the outlet lies `outlet_height_m` above the plate. A tube may follow the cone. All edges
    are rounded.

    Attributes
    ----------
    inlet_diameter_m, outlet_diameter_m : float
        Of the upper and of the narrowest circle [m].
    cone_angle_deg : float
        Slope of the cone from the horizontal.
    tube_length_m : float
        Length of the tube below the cone [m]; 0 without one.
    rim_radius_m : float
        Radius of all rounded edges [m].
    outlet_height_m : float
        Of the outlet above the plate [m].
    """

    inlet_diameter_m: float
    outlet_diameter_m: float
    cone_angle_deg: float
    tube_length_m: float
    rim_radius_m: float
    outlet_height_m: float

    @classmethod
    def of(cls, section: Mapping[str, Any]) -> "Funnel":
        """The funnel of a configuration.

        Parameters
        ----------
        section : mapping
            The section ``funnel``.

        Returns
        -------
        Funnel
        """
        return cls(
            inlet_diameter_m=1e-3 * section["inlet_diameter_mm"],
            outlet_diameter_m=1e-3 * section["outlet_diameter_mm"],
            cone_angle_deg=section["cone_angle_deg"],
            tube_length_m=1e-3 * section["tube_length_mm"],
            rim_radius_m=1e-3 * section["rim_radius_mm"],
            outlet_height_m=1e-3 * section["outlet_height_mm"],
        )

    @property
    def inlet_height_m(self) -> float:
        """Height of the inlet's circle above the plate [m]."""
        return self.cone_line().last * math.sin(self._slope) + self._foot[1]

    @property
    def neck_height_m(self) -> float:
        """Height at which the cone ends [m]: that of the outlet, or of the tube's upper end."""
        return self.outlet_height_m + self.tube_length_m

    @property
    def _slope(self) -> float:
        """Slope of the cone [rad]."""
        return math.radians(self.cone_angle_deg)

    @property
    def _core_m(self) -> float:
        """Radius of the circle about which the cone's lower edge is rounded [m]."""
        return 0.5 * self.outlet_diameter_m + self.rim_radius_m

    @property
    def _offset(self) -> float:
        """Offset of the cone's line [m]: it is tangent to the rounded edge below it."""
        return (
            math.sin(self._slope) * self._core_m
            - math.cos(self._slope) * self.neck_height_m
            - self.rim_radius_m
        )

    @property
    def _foot(self) -> tuple[float, float]:
        """Point (r, z) [m] of the cone's line from which places along it are measured, the nearest to the origin."""
        return self._offset * math.sin(self._slope), -self._offset * math.cos(self._slope)

    def cone_line(self) -> ConeLine:
        """The cone's line, from the rounded edge up to the inlet."""
        sin, cos = math.sin(self._slope), math.cos(self._slope)
        foot_r, foot_z = self._foot
        last = (0.5 * self.inlet_diameter_m - foot_r) / cos
        last += cos * foot_r + sin * foot_z
        first = cos * self._core_m + sin * self.neck_height_m
        return ConeLine(sin, -cos, self._offset, first, last, cos, sin)

    def walls(self, material: str) -> "dict[str, Cone | RingEdge]":
        """The funnel's walls: cone, outlet, and with a tube also tube and neck.

        Parameters
        ----------
        material : str
            Name of the walls' material.

        Returns
        -------
        dict of Cone or RingEdge
            By name.
        """
        up, edge = (math.cos(self._slope), math.sin(self._slope)), self.rim_radius_m
        walls: dict[str, Cone | RingEdge] = {"cone": dem.Cone(self.cone_line(), material)}
        if self.tube_length_m == 0.0:
            walls["outlet"] = dem.RingEdge(
                self._core_m, edge, material, (up, (0.0, 0.0)), self.outlet_height_m
            )
            return walls
        radius, top = 0.5 * self.outlet_diameter_m, self.neck_height_m
        tube = ConeLine(1.0, 0.0, radius, self.outlet_height_m, top, 0.0, 1.0)
        walls["tube"] = dem.Cone(tube, material)
        walls["neck"] = dem.RingEdge(self._core_m, edge, material, (up, (0.0, -1.0)), top)
        walls["outlet"] = dem.RingEdge(
            self._core_m, edge, material, ((0.0, 1.0), (0.0, 0.0)), self.outlet_height_m
        )
        return walls


def contradictions(config: Mapping[str, Any], section: str) -> Iterator[tuple[str, str]]:
    """Keys of a funnel that cannot be built.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    section : str
        Name of the section that describes the funnel.

    Yields
    ------
    key, allowed : str
        Dotted key, and what it may be.
    """
    funnel = config[section]
    inlet, outlet = funnel["inlet_diameter_mm"], funnel["outlet_diameter_mm"]
    if outlet >= inlet:
        yield f"{section}.outlet_diameter_mm", f"below {section}.inlet_diameter_mm, {inlet:g}"
    wall = (inlet - outlet) / 4
    if funnel["rim_radius_mm"] > wall:
        yield f"{section}.rim_radius_mm", f"at most {wall:g}, or no cone is left between inlet and outlet"
