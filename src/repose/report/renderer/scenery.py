"""Describe the walls around bodies in a picture, and the camera."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from repose.bench.funnel import Funnel
from repose.dem import Simulation
from repose.dem.tessellation import (
    are_endless,
    compute_cone_circles,
    find_plane_polygon,
    transform_to_world,
)
from repose.dem.walls import Cone, Mesh
from repose.report.renderer.backdrop import DrumInside

FIELD_OF_VIEW_DEG = 24.0
# Number of pixels in a band of rows. The temporary arrays of a band take tens of MB.
BAND_PIXELS = 65_536
CIRCLE_POINTS = 36
# A unit vector whose z component is below this number points straight down, up to
# rounding errors.
DOWNWARD_Z = -1 + 1e-9
# Columns of the table of planes: z of the plane's point, and z of its normal
POINT_Z = 2
NORMAL_Z = 5
# Origin in m, followed by the rows of the rotation matrix to the world.
WORLD_FRAME = (0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)


@dataclass(frozen=True)
class Frustum:
    """A wall of revolution about the z axis of a frame."""

    z_low_m: float  # height and radius of the lower end
    r_low_m: float
    z_high_m: float  # height and radius of the upper end
    r_high_m: float
    frame: tuple[float, ...] = WORLD_FRAME

    @property
    def slope(self) -> float:
        """Increase of the radius over increase of the height."""
        return (self.r_high_m - self.r_low_m) / (self.z_high_m - self.z_low_m)

    @property
    def origin_m(self) -> np.ndarray:
        """Origin (3,) of the frame in the world."""
        return np.array(self.frame[:3], float)

    @property
    def rotation(self) -> np.ndarray:
        """Rotation (3, 3) from the frame to the world."""
        return np.reshape(self.frame[3:], (3, 3)).astype(float)


@dataclass(frozen=True, eq=False)
class Panel:
    """A flat opaque wall, visible from one side only."""

    corners_m: np.ndarray  # (M, 3), convex, anticlockwise as seen from the visible side

    @property
    def normal(self) -> np.ndarray:
        """Unit normal (3,) towards the visible side."""
        first_side = self.corners_m[1] - self.corners_m[0]
        last_side = self.corners_m[-1] - self.corners_m[0]
        normal = np.cross(first_side, last_side)
        return normal / np.linalg.norm(normal)


@dataclass(frozen=True)
class Scenery:
    """Scenery around the bodies."""

    plate_m: float | None = 0.0  # height of an infinite plate; None means no plate
    panels: tuple[Panel, ...] = ()  # opaque
    frusta: tuple[Frustum, ...] = ()  # translucent
    backdrop: DrumInside | None = None  # behind all of them


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; `width` and `height` are in pixels."""

    eye_m: np.ndarray  # (3,), position
    axes: np.ndarray  # (3, 3), rows: right, up, forward
    focal_px: float
    width: int
    height: int

    def project(
        self, points_m: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute where points of the world lie in the picture.

        Parameters
        ----------
        points_m : array (..., 3)
            The points, in front of the camera.

        Returns
        -------
        x, y : array (...,)
            Columns and rows in pixels, with row 0 at the top.
        inverse_depth : array (...,)
            Inverse of the depth, in 1/m. It is larger for a nearer point.
        """
        view_points = (points_m - self.eye_m) @ self.axes.T
        inverse_depth = 1.0 / view_points[..., 2]
        x = self.width / 2 + self.focal_px * view_points[..., 0] * inverse_depth
        y = self.height / 2 - self.focal_px * view_points[..., 1] * inverse_depth
        return x, y, inverse_depth

    def rays(self, rows: slice = slice(None)) -> np.ndarray:
        """Compute the direction in the world of the ray through each pixel.

        Parameters
        ----------
        rows : slice
            Rows of the picture; all by default.

        Returns
        -------
        array (R, width, 3)
            Directions, scaled to unit depth along the view.
        """
        x = (np.arange(self.width) + 0.5 - self.width / 2) / self.focal_px
        y = (self.height / 2 - np.arange(self.height)[rows] - 0.5) / self.focal_px
        right, up, forward = self.axes
        return x[None, :, None] * right + y[:, None, None] * up + forward

    def bands(self, multiple: int = 1) -> Iterator[slice]:
        """Yield the rows of the picture in bands, to save memory.

        Parameters
        ----------
        multiple : int
            Number of which the number of rows in a band is a multiple.

        Yields
        ------
        slice
            The rows of a band.
        """
        step = multiple * max(1, BAND_PIXELS // (multiple * self.width))
        for first in range(0, self.height, step):
            yield slice(first, first + step)


def look_at(
    points_m: np.ndarray,
    width: int,
    height: int,
    elevation_deg: float = 14.0,
    azimuth_deg: float = 20.0,
    margin: float = 1.06,
    field_of_view_deg: float = FIELD_OF_VIEW_DEG,
) -> Camera:
    """Place a camera so that its picture contains all points.

    Parameters
    ----------
    points_m : array (M, 3)
        The points.
    width, height : int
        Size of the picture in pixels.
    elevation_deg, azimuth_deg : float
        Direction from the points to the camera: angle above the horizontal plane, and
        angle about the z axis from the x axis.
    margin : float
        Size of the picture, as a multiple of the smallest one that contains the points.
        The default leaves a little space at the edges.
    field_of_view_deg : float
        Angle that the longer side of the picture subtends at the camera.

    Returns
    -------
    Camera
        The camera.
    """
    axes = _compute_camera_axes(elevation_deg, azimuth_deg)
    _, _, forward = axes
    focal_px = max(width, height) / 2 / math.tan(math.radians(field_of_view_deg / 2))

    # Look at the middle of the points from the smallest distance at which the picture
    # contains each of them. A point with the offsets x and z from the middle, across
    # the view and forward, has the depth distance + z. The picture contains it if
    #     focal_px * x / (distance + z) <= width / 2,
    # and the same holds for y and the height. Solve this for the distance.
    view_points = points_m @ axes.T
    middle = (view_points.min(axis=0) + view_points.max(axis=0)) / 2
    offset = view_points - middle
    fraction_of_half_size = np.abs(offset[:, :2]) * 2 / (width, height)
    largest_fraction = margin * fraction_of_half_size.max(axis=1)
    distance = np.max(largest_fraction * focal_px - offset[:, 2])
    return Camera(
        middle @ axes + distance * -forward,
        axes,
        focal_px=focal_px,
        width=width,
        height=height,
    )


def _compute_camera_axes(elevation_deg: float, azimuth_deg: float) -> np.ndarray:
    """Compute the axes of a camera from the direction towards it.

    The parameters are those of `look_at`.

    Returns
    -------
    array (3, 3)
        Rows: the unit vectors right, up and forward of the camera in the world.
    """
    elevation = math.radians(elevation_deg)
    azimuth = math.radians(azimuth_deg)
    towards_camera = np.array(
        [
            math.cos(azimuth) * math.cos(elevation),
            math.sin(azimuth) * math.cos(elevation),
            math.sin(elevation),
        ]
    )
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    up = np.cross(towards_camera, right)
    return np.stack([right, up, -towards_camera])


def make_box_corners(centres: np.ndarray, reach: float) -> np.ndarray:
    """Compute the corners of a cube around each of N centres.

    Parameters
    ----------
    centres : array (N, 3)
        The centres in m.
    reach : float
        Half the side of a cube in m.

    Returns
    -------
    array (8 N, 3)
        The corners in m.
    """
    ends = [-reach, reach]
    corners = np.array(np.meshgrid(ends, ends, ends)).reshape(3, -1).T
    return (centres[:, None, :] + corners).reshape(-1, 3)


def find_frame_points(
    centres: np.ndarray,
    reach: float,
    walls: Sequence[Frustum],
    panels: Sequence[Panel] = (),
) -> np.ndarray:
    """Find points that a picture of bodies and walls must contain.

    Parameters
    ----------
    centres : array (N, 3)
        Centres of the bodies in m.
    reach : float
        Radius of the largest body in m.
    walls : sequence of Frustum
        Walls of revolution.
    panels : sequence of Panel
        Flat walls. If there are none, the points include the origin.

    Returns
    -------
    array (M, 3)
        The points in m.
    """
    points = [make_box_corners(centres, reach), *(panel.corners_m for panel in panels)]
    for wall in walls:
        for radius, z in ((wall.r_low_m, wall.z_low_m), (wall.r_high_m, wall.z_high_m)):
            circle = _make_circle(radius, z)
            points.append(transform_to_world(np.asarray(wall.frame, float), circle))
    if not panels:
        points.append(np.zeros((1, 3)))
    return np.concatenate(points)


def _make_circle(radius: float, z: float) -> np.ndarray:
    """Make `CIRCLE_POINTS` points (N, 3) on a horizontal circle about the z axis."""
    angle = np.linspace(0, 2 * math.pi, CIRCLE_POINTS, endpoint=False)
    return np.column_stack(
        [radius * np.cos(angle), radius * np.sin(angle), np.full(CIRCLE_POINTS, z)]
    )


def make_funnel_walls(funnel: Funnel) -> list[Frustum]:
    """Make the walls of a funnel: its cone and, if it has one, its tube.

    Parameters
    ----------
    funnel : Funnel
        The funnel.

    Returns
    -------
    list of Frustum
        The tube, if there is one, and then the cone.
    """
    outlet_radius = funnel.outlet_diameter_m / 2
    inlet_radius = funnel.inlet_diameter_m / 2
    top_height_m = funnel.inlet_height_m
    neck_height_m = funnel.outlet_height_m + funnel.tube_length_m
    # Because of the rounded rim, the cone ends a little outside the circle of the
    # outlet.
    slope = math.tan(math.radians(funnel.cone_angle_deg))
    neck_radius = inlet_radius - (top_height_m - neck_height_m) / slope
    cone = Frustum(
        neck_height_m, neck_radius, z_high_m=top_height_m, r_high_m=inlet_radius
    )
    if funnel.tube_length_m <= 0:
        return [cone]
    tube = Frustum(
        funnel.outlet_height_m,
        outlet_radius,
        z_high_m=neck_height_m,
        r_high_m=outlet_radius,
    )
    return [tube, cone]


def make_scenery(
    simulation: Simulation,
    planes: np.ndarray | None = None,
    wall_frames: np.ndarray | None = None,
) -> Scenery:
    """Convert the walls of a simulation to scenery, at present or at a recorded time.

    An infinite horizontal plane becomes the plate if no other plane is infinite. All
    other planes are cut off at the box of the simulation. Rounded edges are not drawn.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    planes : array (P, 7), optional
        Planes at a time recorded by `repose.dem.Recorder`; by default the present
        planes.
    wall_frames : array (C, 12), optional
        Frames of reference of the other walls at this time: the origin in m, followed
        by the rows of the rotation matrix. By default, they are the present ones.

    Returns
    -------
    Scenery
        The walls to draw.
    """
    if planes is None:
        planes = simulation.walls.planes
    if wall_frames is None:
        wall_frames = simulation.walls.frames
    plate_m, panels = _split_planes(simulation, planes)

    # The simulation lists the frames of the cones first, then those of other walls, and
    # those of the meshes last.
    cones = simulation.wall_set.list_walls(Cone)
    meshes = simulation.wall_set.list_walls(Mesh)
    frames_of_cones = wall_frames[: len(cones)]
    frames_of_meshes = wall_frames[len(wall_frames) - len(meshes) :]
    frusta = [
        _make_frustum(cone, frame)
        for cone, frame in zip(cones, frames_of_cones, strict=True)
    ]
    for mesh, frame in zip(meshes, frames_of_meshes, strict=True):
        corners = transform_to_world(np.asarray(frame, float), mesh.vertices_m)
        panels += [Panel(corners[face]) for face in mesh.faces]
    return Scenery(plate_m, tuple(panels), tuple(frusta))


def _split_planes(
    simulation: Simulation, planes: np.ndarray
) -> tuple[float | None, list[Panel]]:
    """Split the planes of a simulation into its plate and other flat walls.

    Parameters
    ----------
    simulation : Simulation
        The simulation, whose box limits the planes.
    planes : array (P, 7)
        A row for each plane: a point in m, the normal pointing away from the grains,
        and a radius, which is infinite for an infinite plane.

    Returns
    -------
    plate_m : float or None
        Height of the plate, or None if there is no plate.
    panels : list of Panel
        The other planes.
    """
    plate_m = None
    panels = []
    is_infinite = are_endless(planes)
    for index, plane in enumerate(planes):
        is_other = np.arange(len(planes)) != index
        other_infinite_planes = planes[is_infinite & is_other]
        # The grains lie on top of a plate. Its normal points away from them, so down.
        is_below_grains = plane[NORMAL_Z] < DOWNWARD_Z
        if is_infinite[index] and is_below_grains and not len(other_infinite_planes):
            plate_m = float(plane[POINT_Z])
            continue
        corners = find_plane_polygon(
            plane,
            simulation.lower,
            upper=simulation.upper,
            others=other_infinite_planes,
        )
        # A plane outside the box of the simulation has no polygon inside the box.
        if len(corners) > 2:
            panels.append(Panel(corners))
    return plate_m, panels


def _make_frustum(cone: Cone, frame: np.ndarray) -> Frustum:
    """Convert a cone of a simulation to a wall that can be drawn.

    Parameters
    ----------
    cone : Cone
        The cone in its own frame.
    frame : array (12,)
        Origin in m, followed by the rows of the rotation matrix to the world.

    Returns
    -------
    Frustum
        The wall.
    """
    (r_low, z_low), (r_high, z_high) = compute_cone_circles(cone.line)
    return Frustum(z_low, r_low, z_high_m=z_high, r_high_m=r_high, frame=tuple(frame))
