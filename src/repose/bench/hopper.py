"""Make the funnel as walls: a cone with rounded edges, and a tube below it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from repose import dem
from repose.bench.settings import Hopper
from repose.common.numbers import format_significant
from repose.common.section import Contradictions, Section

if TYPE_CHECKING:
    from repose.dem import Cone, RingEdge


class ConeLine(NamedTuple):
    """The line of a cone in the half plane (r, z), as `repose.dem.Cone` takes it.

    A point of the line is (r, z) = offset * normal + s * up. The normal and the
    direction `up` are perpendicular unit vectors. The distance s along the line counts
    from the point that is nearest to the origin. All lengths are in m.
    """

    normal_r: float  # unit vector from the inside of the funnel into the wall
    normal_z: float
    offset: float  # signed distance of the line from the origin
    first: float  # distance s of the lower end
    last: float  # distance s of the upper end
    up_r: float  # unit vector along the line
    up_z: float


@dataclass(frozen=True)
class Funnel:
    """Inner surfaces of a funnel about the z axis: a cone, and a tube below it.

    All edges are rounded. A funnel may have no tube.
    """

    inlet_diameter_m: float  # of the upper circle
    outlet_diameter_m: float  # of the narrowest circle
    cone_angle_deg: float  # slope from the horizontal
    tube_length_m: float  # below the cone; 0 without a tube
    rim_radius_m: float  # of all rounded edges
    outlet_height_m: float  # of the narrowest circle above the plate

    @classmethod
    def of(cls, hopper: Hopper, outlet_height_mm: float) -> "Funnel":
        """Make the funnel of a section of the configuration.

        Parameters
        ----------
        hopper : Hopper
            The section.
        outlet_height_mm : float
            Height of the outlet above the plate.
        """
        return cls(
            inlet_diameter_m=1e-3 * hopper.inlet_diameter_mm,
            outlet_diameter_m=1e-3 * hopper.outlet_diameter_mm,
            cone_angle_deg=hopper.cone_angle_deg,
            tube_length_m=1e-3 * hopper.tube_length_mm,
            rim_radius_m=1e-3 * hopper.rim_radius_mm,
            outlet_height_m=1e-3 * outlet_height_mm,
        )

    @property
    def inlet_height_m(self) -> float:
        """Height of the inlet's circle above the plate [m]."""
        _, foot_z = self._foot_point
        return self.cone_line().last * math.sin(self._slope) + foot_z

    @property
    def neck_height_m(self) -> float:
        """Height of the cone's lower end [m]: at the outlet or the tube's upper end."""
        return self.outlet_height_m + self.tube_length_m

    @property
    def _slope(self) -> float:
        """Slope of the cone [rad]."""
        return math.radians(self.cone_angle_deg)

    @property
    def _edge_circle_radius_m(self) -> float:
        """Radius [m] of the circle that is the centre line of all rounded edges."""
        return 0.5 * self.outlet_diameter_m + self.rim_radius_m

    @property
    def _offset(self) -> float:
        """Offset [m] of the line of the cone.

        The line touches the rounded edge below it.
        """
        return (
            math.sin(self._slope) * self._edge_circle_radius_m
            - math.cos(self._slope) * self.neck_height_m
            - self.rim_radius_m
        )

    @property
    def _foot_point(self) -> tuple[float, float]:
        """The point (r, z) [m] of the cone's line that is nearest to the origin.

        Distances along the line are measured from this point.
        """
        r = self._offset * math.sin(self._slope)
        z = -self._offset * math.cos(self._slope)
        return r, z

    def cone_line(self) -> ConeLine:
        """Compute the line of the cone, from the rounded edge below it to the inlet."""
        sin = math.sin(self._slope)
        cos = math.cos(self._slope)
        foot_r, foot_z = self._foot_point
        # `first` and `last` are distances along the line, from its foot point. A
        # distance is the component of a point (r, z) along the unit vector (cos, sin)
        # of the line. The line begins where it touches the rounded edge below it. That
        # point and the centre of the edge have the same component, because the radius
        # between them is perpendicular to the line.
        first = cos * self._edge_circle_radius_m + sin * self.neck_height_m
        # The line ends at the radius of the inlet. Along the line, r grows by cos for
        # each unit of distance. The distance of the foot point, `foot_place`, is 0
        # apart from rounding errors. It stays in the sum because the last bits of the
        # results depend on it.
        inlet_radius = 0.5 * self.inlet_diameter_m
        foot_place = cos * foot_r + sin * foot_z
        last = (inlet_radius - foot_r) / cos + foot_place
        # The normal is the direction of the line, turned by -90 degrees.
        return ConeLine(
            normal_r=sin,
            normal_z=-cos,
            offset=self._offset,
            first=first,
            last=last,
            up_r=cos,
            up_z=sin,
        )

    def walls(self, material: str) -> "dict[str, Cone | RingEdge]":
        """Make the walls of the funnel by name.

        They are the cone and the rounded edge of its outlet. A funnel with a tube also
        has the tube, and the rounded edge where the cone meets the tube, which is
        called the neck.

        Parameters
        ----------
        material : str
            Name of the material of all walls.

        Returns
        -------
        dict
            ``cone``, ``outlet`` and, with a tube, ``tube`` and ``neck``.
        """
        # Directions (r, z) in which the walls leave an edge. A rounded edge is touched
        # only where these walls do not hide it. A zero vector means that there is no
        # wall.
        along_cone = (math.cos(self._slope), math.sin(self._slope))
        up_tube = (0.0, 1.0)
        down_tube = (0.0, -1.0)
        no_wall = (0.0, 0.0)

        def make_edge(
            above: tuple[float, float], below: tuple[float, float], height_m: float
        ) -> "RingEdge":
            """Make the rounded edge at a height, between the walls above and below."""
            return dem.RingEdge(
                self._edge_circle_radius_m,
                self.rim_radius_m,
                material,
                (above, below),
                height_m,
            )

        cone = dem.Cone(self.cone_line(), material)
        if self.tube_length_m == 0.0:
            outlet = make_edge(along_cone, no_wall, self.outlet_height_m)
            return {"cone": cone, "outlet": outlet}
        # The tube is a vertical line at a constant radius r, so distances along it are
        # heights.
        tube_line = ConeLine(
            normal_r=1.0,
            normal_z=0.0,
            offset=0.5 * self.outlet_diameter_m,
            first=self.outlet_height_m,
            last=self.neck_height_m,
            up_r=0.0,
            up_z=1.0,
        )
        return {
            "cone": cone,
            "tube": dem.Cone(tube_line, material),
            "neck": make_edge(along_cone, down_tube, self.neck_height_m),
            "outlet": make_edge(up_tube, no_wall, self.outlet_height_m),
        }


def find_impossible_surfaces(hopper: Hopper, name: str) -> Contradictions:
    """Yield the settings with which a funnel cannot be built.

    The outlet must be narrower than the inlet, and its rounded edges must leave some of
    the cone between them.

    Parameters
    ----------
    hopper : Hopper
        A section of the configuration with a funnel.
    name : str
        Name of the section.

    Yields
    ------
    tuple of str
        A key of the configuration, and the values that are allowed for it.
    """
    inlet_mm = hopper.inlet_diameter_mm
    outlet_mm = hopper.outlet_diameter_mm
    if outlet_mm >= inlet_mm:
        yield (
            f"{name}.outlet_diameter_mm",
            f"below {name}.inlet_diameter_mm, {inlet_mm:g}",
        )
    # The distance between outlet and inlet, measured on one side of the axis, is half
    # of the difference of the diameters. Twice the radius of the edge (the rim) must
    # fit into it.
    largest_rim_mm = (inlet_mm - outlet_mm) / 4
    if hopper.rim_radius_mm > largest_rim_mm:
        yield (
            f"{name}.rim_radius_mm",
            f"at most {largest_rim_mm:g}, or no cone is left between inlet and outlet",
        )


def find_narrow_openings(
    section: Section, name: str, sizes_mm: Mapping[str, float]
) -> Contradictions:
    """Yield the keys of openings that are no wider than a grain.

    Parameters
    ----------
    section : Section
        A section of the configuration.
    name : str
        Name of the section.
    sizes_mm : mapping
        The size of the mean grain that must pass each opening, by the key of the
        opening.

    Yields
    ------
    tuple of str
        A key of the configuration, and the values that are allowed for it.
    """
    for key, grain_size_mm in sizes_mm.items():
        if getattr(section, key) <= grain_size_mm:
            yield (
                f"{name}.{key}",
                f"above {format_significant(grain_size_mm)}, the size of a mean grain",
            )
