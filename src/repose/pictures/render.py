"""Shaded pictures of berries, drawn in software: no graphics card, no window, the same picture everywhere.

Every shape is tessellated once by its support points x(n), whose normal is n itself, so the shading is as
smooth as the body. Triangles go through a z-buffer; a second z-buffer seen from the light gives soft shadows,
and the hemisphere above each visible point, sampled in the picture, darkens the gaps of the pile.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter

from repose.dem.rotations import rotation_matrices
from repose.dem.tessellation import tessellate
from repose.pictures import raster
from repose.pictures.scenery import FIELD_OF_VIEW_DEG, Setting, look_at, outline, setting_of

BACKGROUND = np.array([0.975, 0.977, 0.980])
PLATE = np.array([0.835, 0.842, 0.850])
FUNNEL = np.array([0.40, 0.50, 0.58])
SKIN = np.array([0.76, 0.125, 0.045])
CALYX = np.array([0.33, 0.19, 0.055])
OTHER_SKINS = np.array([[0.80, 0.66, 0.42], [0.30, 0.42, 0.56], [0.45, 0.52, 0.26]])  # second shape and on
PANEL_SHARE = 0.93  # of the plate's brightness
LIGHT = np.array([0.42, -0.38, 0.82]) / np.linalg.norm([0.42, -0.38, 0.82])  # in the camera's heading, z up


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


def _skin(body, along, shape, count, skins):
    """Colour (M, 3) of bodies `body` (M,) at place `along` (M,) of their axis, -1 to 1; no two bodies alike.

    shape (M,): of those bodies, the first shape being the berry with its calyx; skins (S, 3): colour of each shape.
    """
    random = np.random.RandomState(2026)
    ripeness, shade = random.uniform(-1, 1, (2, count))
    tint = skins[shape] * (1 + 0.16 * shade[body, None])
    tint += np.array([0.045, 0.050, 0.004]) * ripeness[body, None]
    berry = (shape == 0)[:, None]
    calyx = np.clip((along - 0.955) / 0.03, 0, 1)[:, None] * berry
    tip = 1 - 0.25 * np.clip((np.abs(along) - 0.7) / 0.3, 0, 1)[:, None] ** 2 * berry
    return np.clip(tint * tip * (1 - calyx) + CALYX * calyx, 0, 1)


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
    layers = []
    for wall in walls:
        turn = np.reshape(wall.frame[3:], (3, 3)).astype(float)
        eye, own_rays = (camera.eye_m - wall.frame[:3]) @ turn, rays @ turn
        slope = (wall.r_high_m - wall.r_low_m) / (wall.z_high_m - wall.z_low_m)
        r_eye = wall.r_low_m + slope * (eye[2] - wall.z_low_m)
        r_step = slope * own_rays[..., 2]
        a = own_rays[..., 0] ** 2 + own_rays[..., 1] ** 2 - r_step**2
        b = own_rays[..., 0] * eye[0] + own_rays[..., 1] * eye[1] - r_step * r_eye
        root = np.sqrt(np.maximum(b * b - a * (eye[0] ** 2 + eye[1] ** 2 - r_eye**2), 0))
        for sign in (1.0, -1.0):
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = (-b + sign * root) / a
            layers.append((wall, slope, distance, root > 0))
    for wall, slope, distance, met in sorted(layers, key=lambda layer: -np.nanmedian(layer[2])):
        turn = np.reshape(wall.frame[3:], (3, 3)).astype(float)
        light = _light_axes(camera)[2] @ turn
        point = (camera.eye_m - wall.frame[:3] + distance[..., None] * rays) @ turn
        z = point[..., 2]
        where = met & (distance > 0) & (distance < depth) & (z >= wall.z_low_m) & (z <= wall.z_high_m)
        if not where.any():
            continue
        outward = np.stack([point[where][:, 0], point[where][:, 1], np.zeros(where.sum())], -1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        outward[:, 2] = -slope
        outward /= math.hypot(1.0, slope)
        view = rays[where] @ turn / np.linalg.norm(rays[where], axis=1, keepdims=True)
        grazing = 1 - np.abs(np.sum(outward * view, axis=1))
        edge = np.minimum(z[where] - wall.z_low_m, wall.z_high_m - z[where])
        alpha = 0.07 + 0.45 * grazing**3 + 0.45 * (edge < 0.0012)
        shine = 0.35 * np.clip(np.abs(outward @ light), 0, 1) ** 12
        _over(image, FUNNEL + shine[:, None], np.clip(alpha, 0, 0.75), where)


@dataclass(frozen=True)
class _View:
    """What each pixel (H, W) shows: a body (`hit`), a flat wall, the plate, or nothing; M of them show a body."""

    rays: np.ndarray  # (H, W, 3)
    hit: np.ndarray
    flat: np.ndarray  # the plate and the panels
    plate: np.ndarray
    behind: np.ndarray  # the backdrop
    body: np.ndarray  # (H, W), -1 where there is none
    depth: np.ndarray  # m along the view, infinite where nothing is
    place: np.ndarray  # (H, W, 3) m
    normal: np.ndarray  # (H, W, 3)
    along: np.ndarray  # (M,) place along the body's long axis, -1 to 1


def _panel_depths(panel, eye, rays):
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


def _look(camera, bodies, setting):
    """The `_View` of `_Bodies` in a `Setting`."""
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
    corners = bodies.triangles[corner[hit]]
    share = np.column_stack([1 - weights[hit].sum(axis=1), weights[hit]])
    shape = bodies.shape_ids[which[hit]]
    own = np.einsum("mk,mki->mi", share, bodies.normals[shape[:, None], corners])
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    normal[hit] = np.einsum("mij,mj->mi", bodies.turn[which[hit]], own)
    places = bodies.points[shape[:, None], corners][..., 0]
    part = which[hit]
    along = np.einsum("mk,mk->m", share, places) / bodies.points[shape, :, 0].max(axis=1)
    along = bodies.middle[part] + bodies.share[part] * along
    behind = np.zeros(which.shape, bool)
    if setting.backdrop is not None:
        reached, facing = setting.backdrop.meet(camera.eye_m, rays)
        behind = ~hit & ~flat & ~plate & np.isfinite(reached)
        depth[behind], normal[behind] = reached[behind], facing[behind]
    seen = hit | flat | plate | behind
    place = camera.eye_m + np.where(seen, depth, 0.0)[..., None] * rays
    return _View(rays, hit, flat | plate | behind, plate, behind, which, depth, place, normal, along)


@dataclass(frozen=True)
class _Bodies:
    """The N bodies to be drawn, of S shapes with V points each."""

    points: np.ndarray  # (S, V, 3) m
    normals: np.ndarray  # (S, V, 3)
    triangles: np.ndarray  # (T, 3), the same for all shapes
    shape_ids: np.ndarray  # (N,)
    turn: np.ndarray  # (N, 3, 3)
    vertices: np.ndarray  # (N, V, 3) m, in the world
    owner: np.ndarray  # (N,): the body to which a part belongs, itself for a body of one part
    middle: np.ndarray  # (N,): place of the part along the body's long axis, -1 to 1
    share: np.ndarray  # (N,): half length of the part over that of the body


class _Ball:
    """A sphere of radius 1, of which bodies of spheres are made up."""

    def support(self, n):
        return np.ones(np.shape(n)[:-1])

    def support_point(self, n):
        return n


def _place_bodies(centres, quaternions, shapes, shape_ids, scales):
    """The `_Bodies` at these places: each sphere of a body of spheres is a part of its own."""
    if any(_spheres(shape) is not None for shape in shapes):
        return _place_parts(centres, quaternions, shapes, shape_ids, scales)
    whole = np.arange(len(centres)), np.zeros(len(centres)), np.ones(len(centres))
    return _tessellated(centres, quaternions, shapes, shape_ids, scales, whole)


def _spheres(shape):
    """Spheres (M, 4) of a shape that is made of them, or None."""
    spheres = getattr(shape, "spheres_m", None)
    return spheres if spheres is not None and len(spheres) else None


def _place_parts(centres, quaternions, shapes, shape_ids, scales):
    """The same where a shape consists of spheres."""
    turn = rotation_matrices(quaternions)
    parts = []
    for kind, shape in enumerate(shapes):
        members, spheres = np.flatnonzero(shape_ids == kind), _spheres(shape)
        if spheres is None:
            sizes, ids = scales[members], np.full(len(members), kind)
            parts.append((centres[members], sizes, ids, members, 0.0 * sizes, 0.0 * sizes + 1.0))
            continue
        own = np.tile(spheres, (len(members), 1))
        owner = np.repeat(members, len(spheres))
        places = centres[owner] + scales[owner, None] * np.einsum("nij,nj->ni", turn[owner], own[:, :3])
        length = (np.abs(spheres[:, 0]) + spheres[:, 3]).max()
        ids = np.full(len(owner), len(shapes))
        parts.append((places, scales[owner] * own[:, 3], ids, owner, own[:, 0] / length, own[:, 3] / length))
    places, sizes, ids, owner, middle, share = (np.concatenate(column) for column in zip(*parts, strict=True))
    drawn = [_Ball() if _spheres(shape) is not None else shape for shape in shapes] + [_Ball()]
    whole = owner, middle, share
    return _tessellated(places, quaternions[owner], drawn, ids, sizes, whole)


def _tessellated(centres, quaternions, shapes, shape_ids, scales, whole):
    """`_Bodies` of convex parts; whole: the last three fields."""
    points, normals, triangles = zip(*(tessellate(shape) for shape in shapes), strict=True)
    points, normals = np.array(points), np.array(normals)
    turn = rotation_matrices(quaternions)
    vertices = np.einsum("nij,nvj->nvi", turn, scales[:, None, None] * points[shape_ids])
    return _Bodies(points, normals, triangles[0], shape_ids, turn, centres[:, None, :] + vertices, *whole)


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
    backdrop=None,
    field_of_view_deg=FIELD_OF_VIEW_DEG,
    scales=None,
):
    """A shaded picture of berries of one shape; see `render_bodies`.

    particle: `build.Particle`; walls: sequence of `Frustum`, drawn translucent; backdrop: what stands behind
    the berries instead of a plate at z = 0, such as `repose.pictures.backdrop.DrumInside`; scales (N,), by default 1.
    """
    setting = Setting(None if backdrop else 0.0, frusta=tuple(walls or ()), backdrop=backdrop)
    view = (elevation_deg, azimuth_deg, width, height, frame_m, supersample, field_of_view_deg)
    return render_bodies(centres_m, quaternions, [particle], None, scales, setting, *view)


def render_bodies(
    centres_m,
    quaternions,
    shapes,
    shape_ids=None,
    scales=None,
    setting=None,
    elevation_deg=14.0,
    azimuth_deg=20.0,
    width=1000,
    height=None,
    frame_m=None,
    supersample=2,
    field_of_view_deg=FIELD_OF_VIEW_DEG,
):
    """A shaded picture of bodies of several shapes and sizes.

    centres_m: (N, 3) m; quaternions: (N, 4) w, x, y, z, body to world; shapes: sequence of `repose.dem.Shape` or
    `build.Particle`, convex or of spheres, the first drawn as berries, each of the others in a colour of its
    own; shape_ids (N,): place in that sequence, by default the first; scales (N,), by default 1; bodies with a NaN
    centre are not drawn. setting: a `Setting`, by default a plate at z = 0. frame_m: points (M, 3) that the picture
    has to hold, by default what is there. width, height: pixels (height by default 0.6 of the width). Returns RGB
    uint8 of shape (height, width, 3). The same input gives the same picture.
    """
    setting = setting or Setting()
    height = height or round(0.6 * width)
    count = len(centres_m)
    shown = np.flatnonzero(np.isfinite(centres_m).all(axis=1))
    centres = np.asarray(centres_m, float)[shown]
    kinds = np.zeros(len(shown), int) if shape_ids is None else np.asarray(shape_ids)[shown]
    sizes = np.ones(len(shown)) if scales is None else np.asarray(scales, float)[shown]
    radii = np.array([shape.bounding_radius_m for shape in shapes])
    size = float((radii[kinds] * sizes).max(initial=0.0)) or float(radii[0])
    frame = frame_m if frame_m is not None else outline(centres, size, setting.frusta, setting.panels)
    camera = look_at(
        frame,
        width * supersample,
        height * supersample,
        elevation_deg,
        azimuth_deg,
        field_of_view_deg=field_of_view_deg,
    )
    bodies = _place_bodies(centres, np.asarray(quaternions, float)[shown], shapes, kinds, sizes)
    view = _look(camera, bodies, setting)
    lit, sky = _light(camera, bodies, view, size)

    image = np.broadcast_to(BACKGROUND, view.place.shape).copy()
    _paint_flat(image, view, lit, sky, frame, setting.backdrop)
    hit, rays = view.hit, view.rays
    sight = rays[hit] / np.linalg.norm(rays[hit], axis=1, keepdims=True)
    skins = np.array([SKIN, *(OTHER_SKINS[k % len(OTHER_SKINS)] for k in range(len(shapes) - 1))])
    owner = bodies.owner[view.body[hit]]
    skin = _skin(shown[owner], view.along, kinds[owner], count, skins)
    towards = _light_axes(camera)[2]
    image[hit] = _shade_berries(skin, view.normal[hit], sight, towards, lit[hit], sky[hit])
    _blend_walls(image, setting.frusta, camera, rays, view.depth)
    smooth = np.clip(image, 0, 1).reshape(height, supersample, width, supersample, 3).mean(axis=(1, 3))
    return np.round(255 * smooth).astype(np.uint8)


def _light(camera, bodies, view, size):
    """Shares (H, W) of the light and of the sky that reach each pixel; size: of the largest body [m]."""
    lit, sky = np.ones(view.hit.shape), np.ones(view.hit.shape)
    if not len(bodies.vertices):
        return lit, sky
    light, seen = _light_axes(camera), view.hit | view.flat
    light_map, origin, pixel_m = _light_map(bodies.vertices, bodies.triangles, light)
    lit = raster.lit_fraction(
        view.place, view.normal, seen, light_map, light, origin, pixel_m, 0.35 * size, 0.03 * size, 24
    )
    reach = np.where(seen, 1.3 * size * camera.focal_px / np.where(seen, view.depth, 1.0), 0.0)
    # Far from all bodies the walls see the whole sky.
    near = maximum_filter(view.hit, size=2 * math.ceil(reach[view.hit].max(initial=0.0)) + 1)
    sky = raster.openness(view.place, view.normal, seen, seen & near, reach, 1.3 * size, 20)
    return lit, sky


def _paint_flat(image, view, lit, sky, frame, backdrop):
    """Paint the plate, which fades out far from the middle, and the panels, the darker the steeper."""
    if view.plate.any():
        low, high = np.min(frame, axis=0)[:2], np.max(frame, axis=0)[:2]
        away = np.linalg.norm(view.place[view.plate][:, :2] - (low + high) / 2, axis=1)
        fade = np.clip((2.6 - 2 * away / np.linalg.norm(high - low)) / 1.6, 0, 1) ** 1.5
        tone = (0.52 + 0.48 * lit[view.plate]) * (0.35 + 0.65 * sky[view.plate])
        image[view.plate] += fade[:, None] * (PLATE * 1.13 * tone[:, None] - image[view.plate])
    if view.behind.any():
        there = view.behind
        image[there] = backdrop.paint(view.place[there], view.normal[there], lit[there], sky[there])
    panels = view.flat & ~view.plate & ~view.behind
    steepness = 0.80 + 0.20 * np.clip(view.normal[panels][:, 2], 0, 1)
    tone = (0.52 + 0.48 * lit[panels]) * (0.35 + 0.65 * sky[panels]) * steepness
    image[panels] = PLATE * 1.13 * PANEL_SHARE * tone[:, None]


def render_simulation(simulation, **view):
    """A shaded picture of a `repose.dem.Simulation` as it is now; see `render_bodies` for the view and the result."""
    centres = np.where(simulation.present[:, None], simulation.positions, np.nan)
    shapes = list(simulation.shapes.values())
    ids, scales = simulation.shape_ids, simulation.scales
    return render_bodies(centres, simulation.quaternions, shapes, ids, scales, setting_of(simulation), **view)
