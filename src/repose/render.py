"""Shaded pictures of berries, drawn in software: no graphics card, no window, the same picture everywhere.

Every body is tessellated once by its support points x(n), whose normal is n itself, so the shading is as
smooth as the body. Triangles go through a z-buffer; a second z-buffer seen from the light gives soft shadows,
and the hemisphere above each visible point, sampled in the picture, darkens the gaps of the pile.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter

from . import raster
from .backdrop import PLATE
from .scenes import Funnel

BACKGROUND = np.array([0.975, 0.977, 0.980])
FUNNEL = np.array([0.40, 0.50, 0.58])
SKIN = np.array([0.76, 0.125, 0.045])
CALYX = np.array([0.33, 0.19, 0.055])
LIGHT = np.array([0.42, -0.38, 0.82]) / np.linalg.norm([0.42, -0.38, 0.82])  # in the camera's heading, z up
FIELD_OF_VIEW_DEG = 24.0
LENGTHS = ("inlet_diameter", "outlet_diameter", "tube_length", "rim_radius", "outlet_height")


@dataclass(frozen=True)
class Frustum:
    """A wall of revolution about the z axis, from (z_low_m, r_low_m) up to (z_high_m, r_high_m)."""

    z_low_m: float
    r_low_m: float
    z_high_m: float
    r_high_m: float


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: `axes` rows are right, up, forward; the picture is (height, width) pixels."""

    eye_m: np.ndarray
    axes: np.ndarray
    focal_px: float
    width: int
    height: int

    def project(self, points_m):
        """Screen x, y (px, row 0 on top) and inverse depth (1/m) of points (..., 3)."""
        seen = (points_m - self.eye_m) @ self.axes.T
        near = 1.0 / seen[..., 2]
        x = self.width / 2 + self.focal_px * seen[..., 0] * near
        y = self.height / 2 - self.focal_px * seen[..., 1] * near
        return x, y, near

    def rays(self):
        """World direction of each pixel's ray, (height, width, 3), scaled to unit depth along the view."""
        x = (np.arange(self.width) + 0.5 - self.width / 2) / self.focal_px
        y = (self.height / 2 - np.arange(self.height) - 0.5) / self.focal_px
        right, up, forward = self.axes
        return x[None, :, None] * right + y[:, None, None] * up + forward


def funnel_walls(heap):
    """The funnel's walls as `Frustum`s from the configuration's `heap` section (mm and degrees there)."""
    funnel = Funnel(
        **{f"{key}_m": heap[f"{key}_mm"] / 1e3 for key in LENGTHS}, cone_angle_deg=heap["cone_angle_deg"]
    )
    outlet, inlet, top = funnel.outlet_diameter_m / 2, funnel.inlet_diameter_m / 2, funnel.inlet_height_m
    neck = funnel.outlet_height_m + funnel.tube_length_m
    # The rounded rim lets the cone end a little outside the outlet's own circle.
    cone_end = inlet - (top - neck) / math.tan(math.radians(funnel.cone_angle_deg))
    tube = [Frustum(funnel.outlet_height_m, outlet, neck, outlet)] if funnel.tube_length_m > 0 else []
    return [*tube, Frustum(neck, cone_end, top, inlet)]


def look_at(
    points_m,
    width,
    height,
    elevation_deg=14.0,
    azimuth_deg=0.0,
    margin=1.06,
    field_of_view_deg=FIELD_OF_VIEW_DEG,
):
    """A `Camera` that sees all of points_m (M, 3) from the given direction, with a margin around them."""
    el, az = math.radians(elevation_deg), math.radians(azimuth_deg)
    back = np.array([math.cos(az) * math.cos(el), math.sin(az) * math.cos(el), math.sin(el)])
    right = np.array([-math.sin(az), math.cos(az), 0.0])
    axes = np.stack([right, np.cross(back, right), -back])
    focal = max(width, height) / 2 / math.tan(math.radians(field_of_view_deg / 2))
    seen = points_m @ axes.T
    centre = (seen.min(axis=0) + seen.max(axis=0)) / 2
    offset = seen - centre
    reach = margin * np.maximum(np.abs(offset[:, 0]) * 2 / width, np.abs(offset[:, 1]) * 2 / height)
    distance = np.max(reach * focal - offset[:, 2])
    return Camera(centre @ axes + distance * back, axes, focal, width, height)


def tessellate(particle, rings=18, sectors=36):
    """Support points and normals of a body on a latitude-longitude grid about its first axis.

    Returns points (V, 3) m, normals (V, 3), triangles (T, 3) that run anticlockwise seen from outside.
    """
    polar, turn = np.meshgrid(
        np.linspace(0, math.pi, rings + 1),
        np.linspace(0, 2 * math.pi, sectors, endpoint=False),
        indexing="ij",
    )
    sphere = np.stack([np.cos(polar), np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn)], axis=-1)
    # Normals spread evenly over the surface, not over the directions: a slim body has its tips well resolved.
    extent = np.array([particle.support(axis) for axis in np.eye(3)])
    normals = (sphere / extent).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    here, there = np.meshgrid(np.arange(rings) * sectors, np.arange(sectors), indexing="ij")
    after = (there + 1) % sectors
    a, b, c, d = here + there, here + after, here + sectors + there, here + sectors + after
    triangles = np.concatenate(
        [np.stack([a, c, b], -1).reshape(-1, 3), np.stack([b, c, d], -1).reshape(-1, 3)]
    )
    return particle.support_point(normals), normals, triangles


def rotation_matrices(quaternions):
    """Rotation matrices (N, 3, 3), body to world, of quaternions (N, 4) as w, x, y, z."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        axis=1,
    )


def _light_axes(camera):
    """Rows: two axes across the light, then towards it; the light turns with the camera."""
    heading = np.array([camera.axes[2][0], camera.axes[2][1], 0.0])
    length = np.linalg.norm(heading)
    heading = heading / length if length > 1e-9 else camera.axes[1]
    towards = LIGHT[0] * camera.axes[0] + LIGHT[1] * heading + LIGHT[2] * np.array([0.0, 0.0, 1.0])
    across = np.cross([0.0, 0.0, 1.0], towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])


def _light_map(vertices, triangles, axes, size=1400):
    """Depth map seen from the light (largest height towards the light), its origin and pixel size (m)."""
    place = vertices @ axes.T
    low = place[..., :2].min(axis=(0, 1))
    pixel_m = float((place[..., :2].max(axis=(0, 1)) - low).max() / size)
    x, y = (place[..., 0] - low[0]) / pixel_m, (place[..., 1] - low[1]) / pixel_m
    shape = (int(y.max()) + 2, int(x.max()) + 2)
    return raster.draw(x, y, place[..., 2], triangles, shape)[0], low, pixel_m


def _skin(body, along, count):
    """Colour (M, 3) of berry `body` (M,) at place `along` (M,) of its axis, -1 to 1; no two berries alike."""
    random = np.random.RandomState(2026)
    ripeness, shade = random.uniform(-1, 1, (2, count))
    tint = SKIN * (1 + 0.16 * shade[:, None]) + np.array([0.045, 0.050, 0.004]) * ripeness[:, None]
    calyx = np.clip((along - 0.955) / 0.03, 0, 1)[:, None]
    tip = 1 - 0.25 * np.clip((np.abs(along) - 0.7) / 0.3, 0, 1)[:, None] ** 2
    return np.clip(tint[body] * tip * (1 - calyx) + CALYX * calyx, 0, 1)


def _shade_berries(colour, normal, view, towards, lit, sky):
    """Lambert, a waxy highlight and a rim of sky light; arrays (M, 3) and (M,)."""
    diffuse = np.clip(normal @ towards, 0, 1) * lit
    half = towards - view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.clip(np.sum(normal * half, axis=1), 0, 1)
    gloss = (0.42 * shine**60 + 0.085 * shine**9) * lit
    rim = np.clip(1 + np.sum(normal * view, axis=1), 0, 1) ** 3 * 0.10
    ambient = (0.26 + 0.24 * (0.5 + 0.5 * normal[:, 2])) * sky
    glow = 0.10 * sky  # light that went through neighbouring flesh keeps the gaps warm
    base = colour * (0.93 * diffuse + ambient)[:, None] + colour**0.8 * glow[:, None] * np.array(
        [1.0, 0.35, 0.2]
    )
    return base + (gloss + rim * sky)[:, None]


def _over(image, colour, alpha, where):
    image[where] += alpha[..., None] * (colour - image[where])


def _blend_walls(image, walls, camera, rays, depth):
    """Draw translucent frusta over the picture: far side first, each only where nothing stands before it."""
    eye, light = camera.eye_m, _light_axes(camera)[2]
    layers = []
    for wall in walls:
        slope = (wall.r_high_m - wall.r_low_m) / (wall.z_high_m - wall.z_low_m)
        r_eye = wall.r_low_m + slope * (eye[2] - wall.z_low_m)
        r_step = slope * rays[..., 2]
        a = rays[..., 0] ** 2 + rays[..., 1] ** 2 - r_step**2
        b = rays[..., 0] * eye[0] + rays[..., 1] * eye[1] - r_step * r_eye
        root = np.sqrt(np.maximum(b * b - a * (eye[0] ** 2 + eye[1] ** 2 - r_eye**2), 0))
        for sign in (1.0, -1.0):
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = (-b + sign * root) / a
            layers.append((wall, slope, distance, root > 0))
    for wall, slope, distance, met in sorted(layers, key=lambda layer: -np.nanmedian(layer[2])):
        point = eye + distance[..., None] * rays
        z = point[..., 2]
        where = met & (distance > 0) & (distance < depth) & (z >= wall.z_low_m) & (z <= wall.z_high_m)
        if not where.any():
            continue
        outward = np.stack([point[where][:, 0], point[where][:, 1], np.zeros(where.sum())], -1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        outward[:, 2] = -slope
        outward /= math.hypot(1.0, slope)
        view = rays[where] / np.linalg.norm(rays[where], axis=1, keepdims=True)
        grazing = 1 - np.abs(np.sum(outward * view, axis=1))
        edge = np.minimum(z[where] - wall.z_low_m, wall.z_high_m - z[where])
        alpha = 0.07 + 0.45 * grazing**3 + 0.45 * (edge < 0.0012)
        shine = 0.35 * np.clip(np.abs(outward @ light), 0, 1) ** 12
        _over(image, FUNNEL + shine[:, None], np.clip(alpha, 0, 0.75), where)


def outline(centres, reach, walls):
    """Points (M, 3) that a picture of these berries and walls has to hold."""
    spread = np.array(np.meshgrid([-reach, reach], [-reach, reach], [-reach, reach])).reshape(3, -1).T
    around = np.linspace(0, 2 * math.pi, 36, endpoint=False)
    rings = [
        np.column_stack([radius * np.cos(around), radius * np.sin(around), np.full(36, z)])
        for wall in walls
        for radius, z in ((wall.r_low_m, wall.z_low_m), (wall.r_high_m, wall.z_high_m))
    ]
    berries = (centres[:, None, :] + spread).reshape(-1, 3)
    return np.concatenate([berries, *rings, [[0.0, 0.0, 0.0]]])


@dataclass(frozen=True)
class _View:
    """What each pixel (H, W) shows: a berry (`hit`), what is `behind`, or neither; M of them show a berry."""

    rays: np.ndarray  # (H, W, 3)
    hit: np.ndarray
    behind: np.ndarray
    body: np.ndarray  # (H, W), -1 where there is none
    depth: np.ndarray  # m along the view, infinite where nothing is
    place: np.ndarray  # (H, W, 3) m
    normal: np.ndarray  # (H, W, 3)
    along: np.ndarray  # (M,) place along the berry's long axis, -1 to 1


def _look(camera, vertices, body, turn, backdrop):
    """The `_View` of bodies: vertices (N, V, 3) m, tessellation `body`, rotations turn (N, 3, 3)."""
    points, normals, triangles = body
    nearest, which, corner, weights = raster.draw(
        *camera.project(vertices), triangles, (camera.height, camera.width)
    )
    rays, hit = camera.rays(), which >= 0
    depth, normal = backdrop.meet(camera.eye_m, rays)
    behind = ~hit & np.isfinite(depth)
    depth[hit] = 1.0 / nearest[hit]
    corners = triangles[corner[hit]]
    share = np.column_stack([1 - weights[hit].sum(axis=1), weights[hit]])
    own = np.einsum("mk,mki->mi", share, normals[corners])
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    normal[hit] = np.einsum("mij,mj->mi", turn[which[hit]], own)
    along = np.einsum("mk,mk->m", share, points[corners][..., 0]) / points[:, 0].max()
    place = camera.eye_m + np.where(hit | behind, depth, 0.0)[..., None] * rays
    return _View(rays, hit, behind, which, depth, place, normal, along)


def render_pile(
    centres_m,
    quaternions,
    particle,
    elevation_deg=14.0,
    azimuth_deg=20.0,
    width=1000,
    height=None,
    walls=None,
    frame_m=None,
    supersample=2,
    backdrop=PLATE,
    field_of_view_deg=FIELD_OF_VIEW_DEG,
):
    """A shaded picture of berries before a backdrop, by default on a plate at z = 0.

    centres_m: (N, 3) m; quaternions: (N, 4) w, x, y, z, body to world; particle: `repose.shape.Particle`;
    bodies with a NaN centre are not drawn. walls: sequence of `Frustum`, drawn translucent. frame_m: points
    (M, 3) that the picture has to hold, by default what is there. width, height: pixels (height by default
    0.6 of the width). backdrop: `Plate` or `DrumInside` of `repose.backdrop`; field_of_view_deg: of the longer side.
    Returns RGB uint8 of shape (height, width, 3). The same input gives the same picture.
    """
    walls = list(walls or [])
    height = height or round(0.6 * width)
    count = len(centres_m)
    known = np.isfinite(centres_m).all(axis=1)
    shown = np.flatnonzero(known)
    centres = np.asarray(centres_m, float)[shown]
    frame = frame_m if frame_m is not None else outline(centres, particle.bounding_radius_m, walls)
    camera = look_at(
        frame,
        width * supersample,
        height * supersample,
        elevation_deg,
        azimuth_deg,
        field_of_view_deg=field_of_view_deg,
    )

    body = tessellate(particle)
    turn = rotation_matrices(np.asarray(quaternions, float)[shown])
    vertices = centres[:, None, :] + np.einsum("nij,vj->nvi", turn, body[0])
    view = _look(camera, vertices, body, turn, backdrop)
    light = _light_axes(camera)
    lit, sky = np.ones(view.hit.shape), np.ones(view.hit.shape)
    if len(shown):
        size, seen = particle.bounding_radius_m, view.hit | view.behind
        light_map, origin, pixel_m = _light_map(vertices, body[2], light)
        lit = raster.lit_fraction(
            view.place, view.normal, seen, light_map, light, origin, pixel_m, 0.35 * size, 0.03 * size, 24
        )
        reach = np.where(seen, 1.3 * size * camera.focal_px / np.where(seen, view.depth, 1.0), 0.0)
        # Far from all berries the plate sees the whole sky.
        near = maximum_filter(view.hit, size=2 * math.ceil(reach[view.hit].max(initial=0.0)) + 1)
        sky = raster.openness(view.place, view.normal, seen, seen & near, reach, 1.3 * size, 20)

    image = np.broadcast_to(BACKGROUND, view.place.shape).copy()
    behind = view.behind
    if behind.any():
        colour, alpha = backdrop.paint(
            view.place[behind], view.normal[behind], lit[behind], sky[behind], frame
        )
        _over(image, colour, alpha, behind)
    hit, rays = view.hit, view.rays
    sight = rays[hit] / np.linalg.norm(rays[hit], axis=1, keepdims=True)
    skin = _skin(shown[view.body[hit]], view.along, count)
    image[hit] = _shade_berries(skin, view.normal[hit], sight, light[2], lit[hit], sky[hit])
    _blend_walls(image, walls, camera, rays, view.depth)
    smooth = np.clip(image, 0, 1).reshape(height, supersample, width, supersample, 3).mean(axis=(1, 3))
    return np.round(255 * smooth).astype(np.uint8)
