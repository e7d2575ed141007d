"""Find what each pixel of a picture shows: a body, a wall, the plate, the backdrop."""

from dataclasses import dataclass, fields

import numpy as np

from repose.report.renderer import raster
from repose.report.renderer.bodies import Bodies
from repose.report.renderer.scenery import Camera, Panel, Scenery


@dataclass(frozen=True)
class View:
    """What each pixel (H, W) shows: a body, a wall, the plate, the backdrop, or nothing."""

    body: np.ndarray  # int32, index of the part of a body, -1 if none
    plate: np.ndarray  # bool, whether the pixel shows the plate
    backdrop: np.ndarray  # bool, whether the pixel shows the backdrop
    depth: np.ndarray  # float32, in m along the view, infinite if nothing is seen
    normal: np.ndarray  # float32 (H, W, 3), unit normal

    @property
    def hit(self) -> np.ndarray:
        """Mask (H, W) of the bodies."""
        return self.body >= 0

    @property
    def panel(self) -> np.ndarray:
        """Mask (H, W) of the panels."""
        return np.isfinite(self.depth) & ~(self.hit | self.plate | self.backdrop)

    def rows(self, rows: slice) -> "View":
        """Return the view of some rows, which shares memory with this view."""
        return View(*(getattr(self, field.name)[rows] for field in fields(self)))


def compute_view(camera: Camera, bodies: Bodies, scenery: Scenery) -> View:
    """Find what each pixel of a camera shows: a part of a body, a wall, or the plate.

    Parameters
    ----------
    camera : Camera
        The camera.
    bodies : Bodies
        The bodies.
    scenery : Scenery
        Walls, plate and backdrop.

    Returns
    -------
    View
        What each pixel shows.
    """
    shape = (camera.height, camera.width)
    x, y, inverse_depths = camera.project(bodies.vertices)
    inverse_depth, body, triangle, weights = raster.draw_triangles(
        x, y, nearness=inverse_depths, triangles=bodies.triangles, shape=shape
    )
    view = View(
        body=body,
        plate=np.zeros(shape, bool),
        backdrop=np.zeros(shape, bool),
        depth=np.empty(shape, np.float32),
        normal=np.zeros((*shape, 3), np.float32),
    )
    # Fill the view in bands of rows, which saves memory. A band shares its arrays with
    # the view, so filling the band fills the view.
    for rows in camera.bands():
        band = view.rows(rows)
        _add_scenery(
            band,
            inverse_depth[rows],
            eye=camera.eye_m,
            rays=camera.rays(rows),
            scenery=scenery,
        )
        hit = band.hit  # only now, because a panel may hide bodies
        band.normal[hit] = _compute_body_normals(
            bodies,
            band.body[hit],
            triangle=triangle[rows][hit],
            weights=weights[rows][hit],
        )
    return view


def _add_scenery(
    view: View,
    inverse_depth: np.ndarray,
    eye: np.ndarray,
    rays: np.ndarray,
    scenery: Scenery,
) -> None:
    """Add panels, plate and backdrop to a view of bodies, in place.

    The order matters: panels may hide bodies, but the plate and then the backdrop only
    fill pixels that are still empty.

    Parameters
    ----------
    view : View
        The view (H, W), in which only `body` is filled. The function fills all other
        arrays except the normals of the bodies, and removes bodies that are hidden.
    inverse_depth : array (H, W)
        Inverse depth of the bodies. It is 0 or less if the pixel shows no body in front
        of the camera.
    eye : array (3,)
        Position of the camera in m.
    rays : array (H, W, 3)
        Directions of the rays, scaled to unit depth.
    scenery : Scenery
        Walls, plate and backdrop.
    """
    # A body behind the camera is not seen.
    view.body[inverse_depth <= 0] = -1
    depth = np.where(view.hit, 1.0 / inverse_depth, np.inf)
    view.normal[..., 2] = 1.0  # the normal of the plate; other surfaces replace it

    # A panel hides what is behind it.
    for panel in scenery.panels:
        panel_depth = _compute_panel_depth(panel, eye, rays)
        is_in_front = panel_depth < depth
        depth[is_in_front] = panel_depth[is_in_front]
        view.normal[is_in_front] = panel.normal
        view.body[is_in_front] = -1

    # Show the plate, and then the backdrop, only in pixels that are still empty.
    if scenery.plate_m is not None:
        plate_depth = _compute_plate_depth(scenery.plate_m, eye, rays)
        view.plate[...] = np.isinf(depth) & np.isfinite(plate_depth)
        depth[view.plate] = plate_depth[view.plate]

    if scenery.backdrop is not None:
        backdrop_depth, backdrop_normal = scenery.backdrop.find_intersections(eye, rays)
        view.backdrop[...] = np.isinf(depth) & np.isfinite(backdrop_depth)
        depth[view.backdrop] = backdrop_depth[view.backdrop]
        view.normal[view.backdrop] = backdrop_normal[view.backdrop]

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
        Index of the part of each point.
    triangle : array (M,) of int
        Index of the triangle on which each point lies.
    weights : array (M, 2)
        Weights of the second and third corner of the triangle.

    Returns
    -------
    array (M, 3)
        Unit normals in the world.
    """
    # Interpolate between the normals at the corners.
    corners = bodies.triangles[triangle]
    corner_weights = np.column_stack([1 - weights.sum(axis=1), weights])
    corner_normals = bodies.normals[bodies.shape_ids[part][:, None], corners]
    normals = np.einsum("mk,mki->mi", corner_weights, corner_normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # Rotate each normal from the frame of its part to the world.
    return np.einsum("mij,mj->mi", bodies.rotations[part], normals)


def _compute_plate_depth(
    plate_m: float, eye: np.ndarray, rays: np.ndarray
) -> np.ndarray:
    """Compute the depth at which each ray meets the infinite horizontal plate.

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
        # The corners of the panel run anticlockwise around a convex polygon. A point is
        # inside it if it is on the inner side of each edge. The point eye + depth * ray
        # is on this side if its offset from a corner does not point outwards. The
        # scalar product with the ray is computed first, which saves memory.
        for corner, next_corner in zip(corners, next_corners, strict=True):
            outwards = np.cross(next_corner - corner, normal)
            is_inside &= (eye - corner) @ outwards + depth * (rays @ outwards) <= 0
    return np.where(is_inside, depth, np.inf)
