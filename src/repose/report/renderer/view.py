"""Content of each pixel of a picture: a body, a flat wall, the plate, the backdrop or nothing."""

from dataclasses import dataclass, fields

import numpy as np

from repose.report.renderer import raster
from repose.report.renderer.bodies import Bodies
from repose.report.renderer.scenery import Camera, Panel, Setting


@dataclass(frozen=True)
class View:
    """Content of each pixel (H, W), in 22 bytes: a body, a flat wall, the plate, the backdrop, or nothing."""

    body: np.ndarray  # int32, number of the body or part, -1 if none
    plate: np.ndarray  # bool
    behind: np.ndarray  # bool, the backdrop
    depth: np.ndarray  # float32, in m along the view, infinite if nothing is seen
    normal: np.ndarray  # float32 (H, W, 3), unit normal

    @property
    def hit(self) -> np.ndarray:
        """Mask (H, W) of the bodies."""
        return self.body >= 0

    @property
    def panel(self) -> np.ndarray:
        """Mask (H, W) of the panels."""
        return np.isfinite(self.depth) & ~(self.hit | self.plate | self.behind)

    def rows(self, rows: slice) -> "View":
        """Give the view of some rows, in the same memory."""
        return View(*(getattr(self, field.name)[rows] for field in fields(self)))


def look(camera: Camera, bodies: Bodies, setting: Setting) -> View:
    """Give the view of a camera on bodies, from `place_bodies`, in a setting."""
    shape = (camera.height, camera.width)
    nearest, body, corner, weights = raster.draw(
        *camera.project(bodies.vertices), bodies.triangles, shape
    )
    plate, behind = np.zeros(shape, bool), np.zeros(shape, bool)
    view = View(
        body,
        plate,
        behind,
        np.empty(shape, np.float32),
        np.zeros((*shape, 3), np.float32),
    )
    for rows in camera.bands():
        band = view.rows(rows)
        _look_at(band, nearest[rows], camera.eye_m, camera.rays(rows), setting)
        hit = band.hit
        band.normal[hit] = _on_bodies(
            bodies, band.body[hit], corner[rows][hit], weights[rows][hit]
        )
    return view


def _look_at(
    view: View, nearest: np.ndarray, eye: np.ndarray, rays: np.ndarray, setting: Setting
) -> None:
    """Write depth, normal and kind of walls, plate and backdrop; `nearest` is the inverse depth of the bodies."""
    view.body[nearest <= 0] = -1  # behind the camera
    depth = np.where(view.hit, 1.0 / nearest, np.inf)
    view.normal[..., 2] = 1.0
    for panel in setting.panels:
        reached = _panel_depths(panel, eye, rays)
        before = reached < depth
        depth[before], view.normal[before], view.body[before] = (
            reached[before],
            panel.normal,
            -1,
        )
    if setting.plate_m is not None:
        with np.errstate(divide="ignore"):
            to_plate = (setting.plate_m - eye[2]) / rays[..., 2]
        view.plate[...] = np.isinf(depth) & (to_plate > 0) & np.isfinite(to_plate)
        depth[view.plate] = to_plate[view.plate]
    if setting.backdrop is not None:
        reached, facing = setting.backdrop.meet(eye, rays)
        view.behind[...] = np.isinf(depth) & np.isfinite(reached)
        depth[view.behind], view.normal[view.behind] = (
            reached[view.behind],
            facing[view.behind],
        )
    view.depth[...] = depth


def _on_bodies(
    bodies: Bodies, part: np.ndarray, triangle: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Give normals (M, 3) in the world of points on triangles of parts."""
    corners = bodies.triangles[triangle]
    share = np.column_stack([1 - weights.sum(axis=1), weights])
    own = np.einsum(
        "mk,mki->mi", share, bodies.normals[bodies.shape_ids[part][:, None], corners]
    )
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    return np.einsum("mij,mj->mi", bodies.turn[part], own)


def _panel_depths(panel: Panel, eye: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Give depth (H, W) at which each ray meets a panel from its visible side; infinite for a ray that misses it."""
    normal, corners = panel.normal, panel.corners_m
    towards = rays @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = ((corners[0] - eye) @ normal) / towards
        inside = (towards < 0) & (depth > 0)
        for here, there in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            outwards = np.cross(there - here, normal)
            inside &= (eye - here) @ outwards + depth * (rays @ outwards) <= 0
    return np.where(inside, depth, np.inf)
