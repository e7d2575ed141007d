"""Scenery of a picture of bodies: walls, and the camera."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from repose.bench.funnel import Funnel
from repose.dem import Simulation
from repose.dem.tessellation import cone_circles, endless, in_world, plane_polygon
from repose.dem.walls import Cone, Mesh
from repose.report.renderer.backdrop import DrumInside

FIELD_OF_VIEW_DEG = 24.0
BAND_PIXELS = 65_536  # per band: the temporary arrays of a band take tens of MB


@dataclass(frozen=True)
class Frustum:
    """A wall of revolution about the z axis of a frame."""

    z_low_m: float  # height and radius of the lower end
    r_low_m: float
    z_high_m: float  # height and radius of the upper end
    r_high_m: float
    frame: tuple[float, ...] = (
        0,
        0,
        0,
        1,
        0,
        0,
        0,
        1,
        0,
        0,
        0,
        1,
    )  # origin in m, rotation to the world by rows

    @property
    def slope(self) -> float:
        """Gain of radius over gain of height."""
        return (self.r_high_m - self.r_low_m) / (self.z_high_m - self.z_low_m)


@dataclass(frozen=True, eq=False)
class Panel:
    """A flat opaque wall, visible from one side only."""

    corners_m: np.ndarray  # (M, 3), convex, anticlockwise from the visible side

    @property
    def normal(self) -> np.ndarray:
        """Unit normal (3,) towards the visible side."""
        a, b = (
            self.corners_m[1] - self.corners_m[0],
            self.corners_m[-1] - self.corners_m[0],
        )
        normal = np.cross(a, b)
        return normal / np.linalg.norm(normal)


@dataclass(frozen=True)
class Setting:
    """Scenery around the bodies."""

    plate_m: float | None = 0.0  # height of an endless plate; None means no plate
    panels: tuple[Panel, ...] = ()  # opaque
    frusta: tuple[Frustum, ...] = ()  # translucent
    backdrop: DrumInside | None = None  # behind all of them


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; `width` and `height` are in pixels."""

    eye_m: np.ndarray  # (3,)
    axes: np.ndarray  # (3, 3), rows: right, up, forward
    focal_px: float
    width: int
    height: int

    def project(
        self, points_m: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Give the columns and rows of points in pixels, row 0 on top, and their inverse depth in 1/m."""
        seen = (points_m - self.eye_m) @ self.axes.T
        near = 1.0 / seen[..., 2]
        x = self.width / 2 + self.focal_px * seen[..., 0] * near
        y = self.height / 2 - self.focal_px * seen[..., 1] * near
        return x, y, near

    def rays(self, rows: slice = slice(None)) -> np.ndarray:
        """Give direction (R, width, 3) of each pixel's ray in the world, scaled to unit depth along the view."""
        x = (np.arange(self.width) + 0.5 - self.width / 2) / self.focal_px
        y = (self.height / 2 - np.arange(self.height)[rows] - 0.5) / self.focal_px
        right, up, forward = self.axes
        return x[None, :, None] * right + y[:, None, None] * up + forward

    def bands(self, multiple: int = 1) -> Iterator[slice]:
        """Give rows of the picture in bands, so that a large picture needs little memory."""
        step = multiple * max(1, BAND_PIXELS // (multiple * self.width))
        for first in range(0, self.height, step):
            yield slice(first, first + step)


def funnel_walls(funnel: Funnel) -> list[Frustum]:
    """Give the funnel's cone and, if it has one, its tube."""
    outlet, inlet, top = (
        funnel.outlet_diameter_m / 2,
        funnel.inlet_diameter_m / 2,
        funnel.inlet_height_m,
    )
    neck = funnel.outlet_height_m + funnel.tube_length_m
    # The rounded rim lets the cone end a little outside the outlet's own circle.
    cone_end = inlet - (top - neck) / math.tan(math.radians(funnel.cone_angle_deg))
    tube = (
        [Frustum(funnel.outlet_height_m, outlet, neck, outlet)]
        if funnel.tube_length_m > 0
        else []
    )
    return [*tube, Frustum(neck, cone_end, top, inlet)]


def look_at(
    points_m: np.ndarray,
    width: int,
    height: int,
    elevation_deg: float = 14.0,
    azimuth_deg: float = 20.0,
    margin: float = 1.06,
    field_of_view_deg: float = FIELD_OF_VIEW_DEG,
) -> Camera:
    """Give a `Camera` in a given direction with all points in view."""
    el, az = math.radians(elevation_deg), math.radians(azimuth_deg)
    back = np.array(
        [math.cos(az) * math.cos(el), math.sin(az) * math.cos(el), math.sin(el)]
    )
    right = np.array([-math.sin(az), math.cos(az), 0.0])
    axes = np.stack([right, np.cross(back, right), -back])
    focal = max(width, height) / 2 / math.tan(math.radians(field_of_view_deg / 2))
    seen = points_m @ axes.T
    centre = (seen.min(axis=0) + seen.max(axis=0)) / 2
    offset = seen - centre
    reach = margin * (np.abs(offset[:, :2]) * 2 / (width, height)).max(axis=1)
    return Camera(
        centre @ axes + np.max(reach * focal - offset[:, 2]) * back,
        axes,
        focal,
        width,
        height,
    )


def boxes(centres: np.ndarray, reach: float) -> np.ndarray:
    """Give the corners (8 N, 3) in m of a box about each centre (N, 3)."""
    spread = (
        np.array(np.meshgrid([-reach, reach], [-reach, reach], [-reach, reach]))
        .reshape(3, -1)
        .T
    )
    return (centres[:, None, :] + spread).reshape(-1, 3)


def outline(
    centres: np.ndarray,
    reach: float,
    walls: Sequence[Frustum],
    panels: Sequence[Panel] = (),
) -> np.ndarray:
    """Give points (M, 3) in m that a picture of bodies and walls must contain; without panels also the origin."""
    around = np.linspace(0, 2 * math.pi, 36, endpoint=False)
    points = [boxes(centres, reach), *(panel.corners_m for panel in panels)]
    for wall in walls:
        for radius, z in ((wall.r_low_m, wall.z_low_m), (wall.r_high_m, wall.z_high_m)):
            ring = np.column_stack(
                [radius * np.cos(around), radius * np.sin(around), np.full(36, z)]
            )
            points.append(in_world(np.asarray(wall.frame, float), ring))
    return np.concatenate(points if panels else [*points, [[0.0, 0.0, 0.0]]])


def setting_of(
    simulation: Simulation,
    planes: np.ndarray | None = None,
    frames: np.ndarray | None = None,
) -> Setting:
    """Give the `Setting` of a simulation's walls, at present or at places of a recorded frame.

    A level endless plane below all others is the plate; planes end at the simulation's box; rounded edges are not
    drawn. `planes` (P, 7) and the walls' `frames` (C, 12) come from `repose.dem.Recorder`; None means the present.
    """
    planes = simulation.walls.planes if planes is None else planes
    frames = simulation.walls.frames if frames is None else frames
    panels, plate, frusta = [], None, []
    for k, plane in enumerate(planes):
        others = planes[endless(planes) & (np.arange(len(planes)) != k)]
        if np.isinf(plane[6]) and plane[5] < -1 + 1e-9 and not len(others):
            plate = float(plane[2])
            continue
        corners = plane_polygon(plane, simulation.lower, simulation.upper, others)
        if len(corners) > 2:
            panels.append(Panel(corners))
    cones, meshes = simulation.wall_set.of(Cone), simulation.wall_set.of(Mesh)
    for cone, frame in zip(cones, frames, strict=False):
        (r_low, z_low), (r_high, z_high) = cone_circles(cone.line)
        frusta.append(Frustum(z_low, r_low, z_high, r_high, tuple(frame)))
    for mesh, frame in zip(meshes, frames[len(frames) - len(meshes) :], strict=True):
        corners = in_world(np.asarray(frame, float), mesh.vertices_m)
        panels += [Panel(corners[face]) for face in mesh.faces]
    return Setting(plate, tuple(panels), tuple(frusta))
