"""Find what each pixel of a picture shows: a body, a wall, the plate, the backdrop."""

from dataclasses import dataclass, fields

import numpy as np

from repose.report.renderer import raster
from repose.report.renderer.bodies import Bodies
from repose.report.renderer.scenery import Camera, Panel, Setting


@dataclass(frozen=True)
class View:
    """What each pixel (H, W) shows: a body, a wall, the plate, the backdrop, or nothing."""

    body: np.ndarray  # int32, number of the body or part, -1 if none
    plate: np.ndarray  # bool, whether the pixel shows the plate
    behind: np.ndarray  # bool, whether the pixel shows the backdrop
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
        """Return the view of some rows, which shares memory with this view."""
        return View(*(getattr(self, field.name)[rows] for field in fields(self)))


def compute_view(camera: Camera, bodies: Bodies, setting: Setting) -> View:
    """Find what each pixel of a camera shows of bodies in a setting.

    Parameters
    ----------
    camera : Camera
        The camera.
    bodies : Bodies
        The bodies.
    setting : Setting
        Walls, plate and backdrop.

    Returns
    -------
    View
        What each pixel shows.
    """
    shape = (camera.height, camera.width)
    x, y, near = camera.project(bodies.vertices)
    nearest, body, triangle, weights = raster.draw_triangles(
        x, y, near=near, triangles=bodies.triangles, shape=shape
    )
    view = View(
        body=body,
        plate=np.zeros(shape, bool),
        behind=np.zeros(shape, bool),
        depth=np.empty(shape, np.float32),
        normal=np.zeros((*shape, 3), np.float32),
    )
    for rows in camera.bands():
        band = view.rows(rows)
        _add_setting(
            band,
            nearest[rows],
            eye=camera.eye_m,
            rays=camera.rays(rows),
            setting=setting,
        )
        hit = band.hit
        band.normal[hit] = _compute_body_normals(
            bodies,
            band.body[hit],
            triangle=triangle[rows][hit],
            weights=weights[rows][hit],
        )
    return view


def _add_setting(
    view: View, nearest: np.ndarray, eye: np.ndarray, rays: np.ndarray, setting: Setting
) -> None:
    """Add panels, plate and backdrop to a view of bodies, in place.

    Parameters
    ----------
    view : View
        The view (H, W) with the numbers of the bodies. The function fills all other
        arrays, and removes bodies that are hidden.
    nearest : array (H, W)
        Inverse depth of the bodies. It is 0 or less if the pixel shows no body in front
        of the camera.
    eye : array (3,)
        Position of the camera in m.
    rays : array (H, W, 3)
        Directions of the rays, scaled to unit depth.
    setting : Setting
        Walls, plate and backdrop.
    """
    # A body behind the camera is not seen.
    view.body[nearest <= 0] = -1
    depth = np.where(view.hit, 1.0 / nearest, np.inf)
    view.normal[..., 2] = 1.0  # the normal of the plate; other surfaces replace it

    # A panel hides what is behind it.
    for panel in setting.panels:
        panel_depth = _compute_panel_depth(panel, eye, rays)
        is_in_front = panel_depth < depth
        depth[is_in_front] = panel_depth[is_in_front]
        view.normal[is_in_front] = panel.normal
        view.body[is_in_front] = -1

    # Show the plate, and then the backdrop, only in pixels that are still empty.
    if setting.plate_m is not None:
        plate_depth = _compute_plate_depth(setting.plate_m, eye, rays)
        view.plate[...] = np.isinf(depth) & np.isfinite(plate_depth)
        depth[view.plate] = plate_depth[view.plate]

    if setting.backdrop is not None:
        backdrop_depth, backdrop_normal = setting.backdrop.find_intersections(eye, rays)
        view.behind[...] = np.isinf(depth) & np.isfinite(backdrop_depth)
        depth[view.behind] = backdrop_depth[view.behind]
        view.normal[view.behind] = backdrop_normal[view.behind]

    view.depth[...] = depth


def _compute_body_normals(
    bodies: Bodies, part: np.ndarray, triangle: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Compute the normals of points on triangles of bodies.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    part : array (M,) of int
        Number of the body or part of each point.
    triangle : array (M,) of int
        Number of the triangle on which the point lies.
    weights : array (M, 2)
        Weights of the second and third corner of the triangle.

    Returns
    -------
    array (M, 3)
        Unit normals in the world.
    """
    # Interpolate between the normals at the corners.
    corners = bodies.triangles[triangle]
    shares = np.column_stack([1 - weights.sum(axis=1), weights])
    corner_normals = bodies.normals[bodies.shape_ids[part][:, None], corners]
    normals = np.einsum("mk,mki->mi", shares, corner_normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # Rotate each normal from the frame of its part to the world.
    return np.einsum("mij,mj->mi", bodies.rotations[part], normals)


def _compute_plate_depth(
    plate_m: float, eye: np.ndarray, rays: np.ndarray
) -> np.ndarray:
    """Compute the depth at which each ray meets the endless level plate.

    Parameters
    ----------
    plate_m : float
        Height of the plate in m.
    eye, rays
        As for `_compute_panel_depth`.

    Returns
    -------
    array (H, W)
        Depth in m, infinite for a ray that misses the plate.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (plate_m - eye[2]) / rays[..., 2]
        return np.where(depth > 0, depth, np.inf)


def _compute_panel_depth(panel: Panel, eye: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Compute the depth at which each ray meets a panel from its visible side.

    Parameters
    ----------
    panel : Panel
        The panel.
    eye : array (3,)
        Position of the camera in m.
    rays : array (H, W, 3)
        Directions of the rays, scaled to unit depth.

    Returns
    -------
    array (H, W)
        Depth in m, infinite for a ray that misses the panel.
    """
    normal = panel.normal
    corners = panel.corners_m
    next_corners = np.roll(corners, -1, axis=0)
    along_normal = rays @ normal
    # For a ray parallel to the panel, the division is by zero, but the comparisons
    # below reject such a ray.
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = ((corners[0] - eye) @ normal) / along_normal
        is_inside = (along_normal < 0) & (depth > 0)
        # A point is inside a convex polygon if it is on the inner side of each edge.
        for corner, next_corner in zip(corners, next_corners, strict=True):
            outwards = np.cross(next_corner - corner, normal)
            is_inside &= (eye - corner) @ outwards + depth * (rays @ outwards) <= 0
    return np.where(is_inside, depth, np.inf)
