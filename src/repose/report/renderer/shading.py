"""Light and colours of a picture: soft shadow, ambient occlusion, grains, plate, walls of glass."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter

from repose.report.renderer import raster
from repose.report.renderer.backdrop import DrumInside
from repose.report.renderer.bodies import Bodies
from repose.report.renderer.scenery import Camera, Frustum, Setting
from repose.report.renderer.view import View, look

BACKGROUND = np.array([0.975, 0.977, 0.980])
PLATE = np.array([0.835, 0.842, 0.850])
FUNNEL = np.array([0.40, 0.50, 0.58])
GRAIN = "#cca86b"  # default grain colour
OTHERS = np.array(
    [[0.30, 0.42, 0.56], [0.45, 0.52, 0.26], [0.76, 0.125, 0.045]]
)  # second shape and on
PANEL_SHARE = 0.93  # of the plate's brightness
LIGHT = np.array([0.42, -0.38, 0.82]) / np.linalg.norm(
    [0.42, -0.38, 0.82]
)  # in the camera's heading, z up
LIGHT_PIXELS = 1400  # of the longer side of the depth map seen from the light


def tints_of(
    body: np.ndarray, shape: np.ndarray, count: int, shapes: int, colour: str = GRAIN
) -> np.ndarray:
    """Give colours (N, 3) of N bodies or parts, red, green, blue, about 0 to 1, slightly different for each body."""
    first = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    colours = np.array([first, *(OTHERS[k % len(OTHERS)] for k in range(shapes - 1))])
    ripeness, shade = np.random.RandomState(2026).uniform(-1, 1, (2, count))
    tint = colours[shape] * (1 + 0.16 * shade[body, None])
    return tint + np.array([0.045, 0.050, 0.004]) * ripeness[body, None]


class Seen(NamedTuple):
    """Some rows of a picture: the image to paint, the content of its pixels, their rays, light and sky."""

    image: np.ndarray  # (R, W, 3)
    view: View
    rays: np.ndarray  # (R, W, 3)
    lit: np.ndarray  # (R, W), shares of the light
    sky: np.ndarray  # (R, W), and of the sky

    def places(self, camera: Camera, where: np.ndarray) -> np.ndarray:
        """Give the places (M, 3) in m of the points that some pixels show."""
        return camera.eye_m + self.view.depth[where][:, None] * self.rays[where]

    def tone(self, where: np.ndarray) -> np.ndarray:
        """Give the brightness (M,) of a dull surface that some pixels show."""
        return (0.52 + 0.48 * self.lit[where]) * (0.35 + 0.65 * self.sky[where])


def paint(
    camera: Camera,
    bodies: Bodies,
    tints: np.ndarray,
    frame: np.ndarray,
    setting: Setting,
    supersample: int,
) -> np.ndarray:
    """Give the picture (H / supersample, W / supersample, 3), RGB, of a camera on bodies."""
    view = look(camera, bodies, setting)
    lit, sky = _light_and_sky(camera, bodies, view)
    height, width = camera.height // supersample, camera.width // supersample
    picture = np.empty((height, width, 3), np.uint8)
    order = _far_to_near(setting.frusta, camera)
    for rows in camera.bands(supersample):
        rays = camera.rays(rows)
        image = np.broadcast_to(BACKGROUND, rays.shape).copy()
        seen = Seen(image, view.rows(rows), rays, lit[rows], sky[rows])
        _paint_flat(seen, camera, frame, setting.backdrop)
        _paint_bodies(seen, camera, tints)
        _blend_walls(seen, camera, setting.frusta, order)
        fine = np.clip(image, 0, 1).reshape(-1, supersample, width, supersample, 3)
        picture[rows.start // supersample :][: len(fine)] = np.round(
            255 * fine.mean(axis=(1, 3))
        )
    return picture


def _light_and_sky(
    camera: Camera, bodies: Bodies, view: View
) -> tuple[np.ndarray, np.ndarray]:
    """Give the shares (H, W) of the light and of the sky that reach each visible point; 1 without a point."""
    if not len(bodies.vertices):
        lit, sky = np.ones((2, *view.depth.shape), np.float32)
        return lit, sky
    light, lens = (
        _light_axes(camera),
        (camera.eye_m, camera.axes, float(camera.focal_px)),
    )
    light_map, origin, pixel_m = _light_map(bodies, light)
    softness, bias, reach = (share * bodies.largest_m for share in (0.35, 0.03, 1.3))
    lit = raster.lit_fraction(
        view.depth,
        view.normal,
        lens,
        light_map,
        light,
        origin,
        pixel_m,
        softness,
        bias,
        24,
    )
    # Far from all bodies the walls see the whole sky.
    reach_px = math.ceil(
        reach * camera.focal_px / view.depth[view.hit].min(initial=np.inf)
    )
    near = maximum_filter(view.hit, size=2 * reach_px + 1)
    return lit, raster.openness(view.depth, view.normal, lens, near, reach, 20)


def _paint_bodies(seen: Seen, camera: Camera, tints: np.ndarray) -> None:
    """Paint the pixels that show a body: Lambert's law, a waxy highlight and a rim of sky light."""
    hit, towards = seen.view.hit, _light_axes(camera)[2]
    colour = np.clip(tints[seen.view.body[hit]], 0, 1)
    normal, lit, sky = seen.view.normal[hit], seen.lit[hit], seen.sky[hit]
    sight = seen.rays[hit] / np.linalg.norm(seen.rays[hit], axis=1, keepdims=True)
    diffuse = np.clip(normal @ towards, 0, 1) * lit
    half = towards - sight
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.clip(np.sum(normal * half, axis=1), 0, 1)
    gloss = (0.42 * shine**60 + 0.085 * shine**9) * lit
    rim = np.clip(1 + np.sum(normal * sight, axis=1), 0, 1) ** 3 * 0.10
    ambient = (0.26 + 0.24 * (0.5 + 0.5 * normal[:, 2])) * sky
    glow = (
        0.10 * sky
    )  # light that neighbours throw on each other has their colour and keeps the gaps warm
    base = colour * (0.93 * diffuse + ambient)[:, None] + colour * glow[:, None]
    seen.image[hit] = base + (gloss + rim * sky)[:, None]


def _paint_flat(
    seen: Seen, camera: Camera, frame: np.ndarray, backdrop: DrumInside | None
) -> None:
    """Paint the plate, which fades out far from the middle, and the panels, the darker the steeper."""
    view, image = seen.view, seen.image
    if view.plate.any():
        low, high = np.min(frame, axis=0)[:2], np.max(frame, axis=0)[:2]
        away = np.hypot(*(seen.places(camera, view.plate)[:, :2] - (low + high) / 2).T)
        fade = np.clip((2.6 - 2 * away / np.linalg.norm(high - low)) / 1.6, 0, 1) ** 1.5
        plate = PLATE * 1.13 * seen.tone(view.plate)[:, None]
        image[view.plate] = BACKGROUND + fade[:, None] * (plate - BACKGROUND)
    there = view.behind
    if backdrop is not None and there.any():
        image[there] = backdrop.paint(
            seen.places(camera, there),
            view.normal[there],
            seen.lit[there],
            seen.sky[there],
        )
    panels = view.panel
    steepness = 0.80 + 0.20 * np.clip(view.normal[panels][:, 2], 0, 1)
    image[panels] = (
        PLATE * 1.13 * PANEL_SHARE * (seen.tone(panels) * steepness)[:, None]
    )


def _far_to_near(walls: Sequence[Frustum], camera: Camera) -> list[int]:
    """Give the numbers of the frusta's sides, far ones first, by their median distance along some thousands of rays."""
    step = max(1, camera.height // 100)
    rays = camera.rays(slice(None, None, step))[:, ::step]
    medians = [
        np.nanmedian(distance)
        for wall in walls
        for _, distance, _ in _sides(wall, camera, rays)
    ]
    return sorted(range(len(medians)), key=lambda side: -medians[side])


def _blend_walls(
    view: Seen, camera: Camera, walls: Sequence[Frustum], order: Sequence[int]
) -> None:
    """Draw translucent frusta over the picture: far sides first, each where no body is in front of it."""
    image, rays, depth = view.image, view.rays, view.view.depth
    sides = [side for wall in walls for side in _sides(wall, camera, rays)]
    for side in order:
        wall, distance, met = sides[side]
        turn = np.reshape(wall.frame[3:], (3, 3)).astype(float)
        light = _light_axes(camera)[2] @ turn
        where = met & (distance > 0) & (distance < depth)
        z = (camera.eye_m - wall.frame[:3]) @ turn[:, 2] + distance * (
            rays @ turn[:, 2]
        )
        where &= (z >= wall.z_low_m) & (z <= wall.z_high_m)
        if not where.any():
            continue
        seen, z = rays[where], z[where]
        point = (camera.eye_m - wall.frame[:3] + distance[where][:, None] * seen) @ turn
        outward = point / np.hypot(point[:, 0], point[:, 1])[:, None]
        outward[:, 2] = -wall.slope
        outward /= math.hypot(1.0, wall.slope)
        sight = seen @ turn / np.linalg.norm(seen, axis=1, keepdims=True)
        grazing = 1 - np.abs(np.sum(outward * sight, axis=1))
        edge = np.minimum(z - wall.z_low_m, wall.z_high_m - z)
        alpha = np.clip(0.07 + 0.45 * grazing**3 + 0.45 * (edge < 0.0012), 0, 0.75)
        shine = 0.35 * np.clip(np.abs(outward @ light), 0, 1) ** 12
        image[where] += alpha[..., None] * (FUNNEL + shine[:, None] - image[where])


def _sides(
    wall: Frustum, camera: Camera, rays: np.ndarray
) -> list[tuple[Frustum, np.ndarray, np.ndarray]]:
    """Give far and near side of a frustum's endless cone: distance (H, W) along each ray, mask of the rays that hit."""
    turn = np.reshape(wall.frame[3:], (3, 3)).astype(float)
    eye, own_rays = (camera.eye_m - wall.frame[:3]) @ turn, rays @ turn
    r_eye = wall.r_low_m + wall.slope * (eye[2] - wall.z_low_m)
    r_step = wall.slope * own_rays[..., 2]
    a = own_rays[..., 0] ** 2 + own_rays[..., 1] ** 2 - r_step**2
    b = own_rays[..., 0] * eye[0] + own_rays[..., 1] * eye[1] - r_step * r_eye
    root = np.sqrt(np.maximum(b * b - a * (eye[0] ** 2 + eye[1] ** 2 - r_eye**2), 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return [(wall, (-b + sign * root) / a, root > 0) for sign in (1.0, -1.0)]


def _light_axes(camera: Camera) -> np.ndarray:
    """Give rows: two axes across the light, then towards it; the light turns with the camera."""
    heading = camera.axes[2] * (1.0, 1.0, 0.0)
    length = np.linalg.norm(heading)
    heading = heading / length if length > 1e-9 else camera.axes[1]
    towards = (
        LIGHT[0] * camera.axes[0]
        + LIGHT[1] * heading
        + LIGHT[2] * np.array([0.0, 0.0, 1.0])
    )
    across = np.cross([0.0, 0.0, 1.0], towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])


def _light_map(
    bodies: Bodies, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Give the depth map seen from the light (largest height towards the light), its origin and pixel size [m]."""
    place = bodies.vertices @ axes.T
    low = place[..., :2].min(axis=(0, 1))
    pixel_m = float((place[..., :2].max(axis=(0, 1)) - low).max() / LIGHT_PIXELS)
    x, y = (place[..., 0] - low[0]) / pixel_m, (place[..., 1] - low[1]) / pixel_m
    shape = (int(y.max()) + 2, int(x.max()) + 2)
    # its rows count upwards, so what is anticlockwise in a picture is clockwise here
    return (
        raster.draw(x, y, place[..., 2], bodies.triangles[:, ::-1], shape)[0],
        low,
        pixel_m,
    )
