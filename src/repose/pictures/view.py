"""What each pixel of a picture shows: a body, a flat wall, the plate, the backdrop or nothing."""

from dataclasses import dataclass

import numpy as np

from repose.pictures import raster
from repose.pictures.bodies import Bodies
from repose.pictures.scenery import Camera, Panel, Setting


@dataclass(frozen=True)
class View:
    """What each pixel of a picture (H, W) shows: a body, a flat wall, the plate, the backdrop, or nothing.

    Attributes
    ----------
    rays : numpy.ndarray, (H, W, 3)
        Directions of the pixels' rays, scaled to unit depth along the view.
    hit : numpy.ndarray of bool, (H, W)
        Whether it is a body; M pixels show one.
    flat : numpy.ndarray of bool, (H, W)
        Whether it is the plate, a panel or the backdrop.
    plate, behind : numpy.ndarray of bool, (H, W)
        Whether it is the plate; whether it is the backdrop.
    body : numpy.ndarray of int, (H, W)
        Number of the body or part, -1 where there is none.
    depth : numpy.ndarray, (H, W)
        In m along the view, infinite where nothing is.
    place, normal : numpy.ndarray, (H, W, 3)
        Place in m, and unit normal there.
    along : numpy.ndarray, (M,)
        Place along the body's long axis, -1 to 1.
    """

    rays: np.ndarray
    hit: np.ndarray
    flat: np.ndarray
    plate: np.ndarray
    behind: np.ndarray
    body: np.ndarray
    depth: np.ndarray
    place: np.ndarray
    normal: np.ndarray
    along: np.ndarray


def look(camera: Camera, bodies: Bodies, setting: Setting) -> View:
    """What each pixel of a camera shows of bodies in a setting.

    Parameters
    ----------
    camera : Camera
        That looks.
    bodies : Bodies
        As `place_bodies` gives them.
    setting : Setting
        Walls and backdrop.

    Returns
    -------
    View
        Of the camera's pixels.
    """
    nearest, which, corner, weights = raster.draw(
        *camera.project(bodies.vertices), bodies.triangles, (camera.height, camera.width)
    )
    rays = camera.rays()
    depth = np.full(which.shape, np.inf)
    depth[which >= 0] = 1.0 / nearest[which >= 0]
    normal = np.zeros(rays.shape)
    normal[..., 2] = 1.0
    flat = np.zeros(which.shape, bool)
    for panel in setting.panels:
        reached = _panel_depths(panel, camera.eye_m, rays)
        before = reached < depth
        depth[before], normal[before] = reached[before], panel.normal
        flat |= before
    hit = (which >= 0) & ~flat
    plate = np.zeros(which.shape, bool)
    if setting.plate_m is not None:
        with np.errstate(divide="ignore"):
            to_plate = (setting.plate_m - camera.eye_m[2]) / rays[..., 2]
        plate = ~hit & ~flat & (to_plate > 0) & np.isfinite(to_plate)
        depth[plate] = to_plate[plate]
    normal[hit], along = _on_bodies(bodies, which[hit], corner[hit], weights[hit])
    behind = np.zeros(which.shape, bool)
    if setting.backdrop is not None:
        reached, facing = setting.backdrop.meet(camera.eye_m, rays)
        behind = ~hit & ~flat & ~plate & np.isfinite(reached)
        depth[behind], normal[behind] = reached[behind], facing[behind]
    seen = hit | flat | plate | behind
    place = camera.eye_m + np.where(seen, depth, 0.0)[..., None] * rays
    return View(rays, hit, flat | plate | behind, plate, behind, which, depth, place, normal, along)


def _on_bodies(
    bodies: Bodies, part: np.ndarray, triangle: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Normals (M, 3) in the world, and places (M,) along the long axis, of points on triangles of parts."""
    corners = bodies.triangles[triangle]
    share = np.column_stack([1 - weights.sum(axis=1), weights])
    shape = bodies.shape_ids[part]
    own = np.einsum("mk,mki->mi", share, bodies.normals[shape[:, None], corners])
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    normal = np.einsum("mij,mj->mi", bodies.turn[part], own)
    places = bodies.points[shape[:, None], corners][..., 0]
    along = np.einsum("mk,mk->m", share, places) / bodies.points[shape, :, 0].max(axis=1)
    return normal, bodies.middle[part] + bodies.share[part] * along


def _panel_depths(panel: Panel, eye: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Depth (H, W) at which each ray meets a panel from its good side, infinite where it does not."""
    normal, corners = panel.normal, panel.corners_m
    towards = rays @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = ((corners[0] - eye) @ normal) / towards
        inside = (towards < 0) & (depth > 0)
        for here, there in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            outwards = np.cross(there - here, normal)
            inside &= (eye - here) @ outwards + depth * (rays @ outwards) <= 0
    return np.where(inside, depth, np.inf)
