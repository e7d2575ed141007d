"""Photographs of piles that are drawn, so that the pile in them is known.

A scene has a plate, a wall, the printed sheet, a pile of grains and what disturbs: texture, uneven light, shadows,
loose grains, a ruler. Its photograph is cast ray by ray through a camera with a lens that distorts. The truth is the
pile's own silhouette, orthographic and without anything else, measured like that of a simulated pile.

World: x right, y away from the camera, z up, in mm; the crest lies near x = y = 0, the plate at z = 0.
"""

import functools
import itertools
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from repose.dem.rotations import rotation_matrices
from repose.measure import pile
from repose.measure.photographs import sheet
from repose.measure.silhouette import Grains, draw_silhouette

LIGHT = np.array([-0.45, -0.55, 0.72]) / np.linalg.norm([-0.45, -0.55, 0.72])
GROUND_MM = 1400  # side of the square of plate that is drawn, one pixel a mm
CROPS = {  # albedo (blue first), axes of the mean grain [mm]
    "goji": ((38, 44, 190), (19.0, 11.0, 10.0)),
    "wheat": ((92, 150, 196), (6.6, 3.4, 3.0)),
    "maize": ((40, 165, 225), (11.0, 8.5, 5.5)),
    "soybean": ((120, 190, 215), (7.5, 6.8, 6.2)),
    "pea": ((70, 170, 110), (7.6, 7.4, 7.2)),
    "coffee": ((30, 45, 75), (10.5, 8.0, 5.5)),
}


@functools.cache
def heap(seed, crop, angle, height):
    """A scene's grains; scenes of other cameras and surfaces share them."""
    axes = np.array(CROPS[crop][1]) / 2
    rng = np.random.default_rng([seed, 1])
    big = 2 * float(np.prod(axes) ** (1 / 3))
    inset = 0.5 * big
    radius = height / np.tan(np.radians(angle))
    count = int(60 * radius**2 / big**2)
    turn = rng.uniform(0, 2 * np.pi, count)
    share = np.sqrt(rng.uniform(0, 1, count))
    low = rng.uniform(0, 1.6 * big, count)  # below the surface
    bent = (
        1
        + 0.04 * np.cos(turn - rng.uniform(0, 6))
        + 0.03 * np.cos(2 * turn - rng.uniform(0, 6))
    )
    away = share * (radius - inset) * bent
    z = height * (1 - share) - inset * (1 - share) + inset * share - low
    points = np.column_stack([away * np.cos(turn), away * np.sin(turn), z])
    points = points[z >= 0.45 * big]
    points = points[_apart(points, 0.72 * big)]
    quaternions = rng.normal(size=(len(points), 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return points, quaternions, rng.normal(1.0, 0.06, len(points)).clip(0.8, 1.2)


@dataclass
class Scene:
    """What is photographed, and how; lengths in mm, angles in degrees."""

    seed: int
    crop: str = "goji"
    angle: float = 30.0
    height: float = 62.0
    wall: tuple = (200, 190, 180)
    ground: tuple = (205, 200, 195)
    texture: str = "plain"  # of wall and plate: plain, cloth, wood, speckle
    position: tuple = (0.0, -650.0, 70.0)
    aim: tuple = (0.0, 0.0, 70.0)  # the camera looks there, then it is tilted
    rotation: tuple = (0.0, 0.0, 0.0)  # pitch, yaw, roll of the camera about itself
    distortion: tuple = (0.0, 0.0)  # k1, k2
    size: tuple = (1600, 1200)
    focal: float = 1300.0
    wall_at: float = 260.0
    uneven: float = 0.0  # share of light that the darkest corner lacks
    shadow: float = 0.35  # of the pile on the plate
    hand: float = 0.0  # of a hand
    loose: int = 0
    ruler: str = ""  # "", "standing", "lying"
    with_pile: bool = True
    with_sheet: bool = True
    sheet_left: float = -300.0
    sheet_yaw: float = 0.0
    # Centres, rotations and sizes of simulated grains, in place of an invented heap.
    simulated_grains: tuple | None = None

    @cached_property
    def rng(self):
        return np.random.default_rng(self.seed)

    @cached_property
    def axes(self):
        return np.array(CROPS[self.crop][1]) / 2

    @property
    def grains(self):
        """Centres (N, 3), quaternions (N, 4) and sizes (N,) of the pile's grains."""
        if self.simulated_grains is not None:
            return self.simulated_grains
        return heap(self.seed, self.crop, self.angle, self.height)

    @cached_property
    def loose_grains(self):
        rng = np.random.default_rng([self.seed, 2])
        turn = rng.uniform(0, 2 * np.pi, self.loose)
        away = (
            self.height
            / np.tan(np.radians(self.angle))
            * rng.uniform(1.15, 1.6, self.loose)
        )
        points = np.column_stack(
            [
                away * np.cos(turn),
                away * np.sin(turn),
                np.full(self.loose, self.axes[2]),
            ]
        )
        half = rng.uniform(0, np.pi, self.loose) / 2
        flat = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
        return points, flat, rng.normal(1.0, 0.06, self.loose).clip(0.8, 1.2)

    @property
    def berry_mm(self):
        return 2 * float(np.prod(self.axes) ** (1 / 3))


class Ellipsoids:
    """Stand-in for a particle: the sum of co-axial ellipsoids' support functions, half axes (K, 3) in metres."""

    def __init__(self, *half_axes_mm):
        self.half_axes = np.array(half_axes_mm) * 1e-3

    def support_point(self, n):
        total = np.zeros(np.shape(n))
        for a in self.half_axes:
            stretched = n * a
            total += stretched * a / np.linalg.norm(stretched, axis=-1, keepdims=True)
        return total


def truth(scene, settings):
    """The pile's own silhouette, seen from where the camera stands, measured."""
    centres, quaternions, sizes = scene.grains
    body = Ellipsoids(scene.axes)
    azimuth = np.degrees(np.arctan2(scene.position[0], -scene.position[1]))
    image = draw_silhouette(
        Grains(1e-3 * centres, quaternions, body, sizes), azimuth, 0.2
    )
    return pile.measure_image(image, 0.2, settings, base_row=image.shape[0] - 0.5)


def photograph(scene):
    width, height = scene.size
    camera = np.array(
        [
            [scene.focal, 0, width / 2 - 0.5],
            [0, scene.focal, height / 2 - 0.5],
            [0, 0, 1.0],
        ]
    )
    lens = np.array([*scene.distortion, 0, 0, 0], float)
    turn = _camera_rotation(scene)
    eye = np.array(scene.position, float)
    columns, rows = np.meshgrid(
        np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    )
    pixels = np.stack([columns, rows], -1).reshape(-1, 1, 2)
    ahead = cv2.undistortPoints(pixels, camera, lens).reshape(height, width, 2)
    rays = np.concatenate([ahead, np.ones((height, width, 1))], -1) @ turn
    colour, depth = _room(scene, eye, rays)
    if scene.with_pile:
        for grains, inside in ((scene.grains, True), (scene.loose_grains, False)):
            _cast(scene, grains, inside, eye, rays, (camera, lens, turn), colour, depth)
    colour *= _light(scene, height, width)[..., None]
    colour = cv2.GaussianBlur(colour, (0, 0), 0.7)
    image = np.clip(colour + scene.rng.normal(0, 2.2, colour.shape), 0, 255).astype(
        np.uint8
    )
    return cv2.imdecode(
        cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 92])[1], cv2.IMREAD_COLOR
    )


def _apart(points, distance):
    """Indices of points that keep a distance from those kept before them."""
    kept = []
    cells = {}
    for i, point in enumerate(points):
        cell = tuple((point // distance).astype(int))
        around = itertools.product(*(range(place - 1, place + 2) for place in cell))
        near = [j for neighbour in around for j in cells.get(neighbour, ())]
        if not near or ((points[near] - point) ** 2).sum(1).min() > distance**2:
            kept.append(i)
            cells.setdefault(cell, []).append(i)
    return kept


def _camera_rotation(scene):
    pitch, yaw, roll = np.radians(scene.rotation)
    ahead = np.array(scene.aim, float) - scene.position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    level = np.array([right, np.cross(ahead, right), ahead])
    turns = [
        cv2.Rodrigues(np.array(v, float))[0]
        for v in ([pitch, 0, 0], [0, yaw, 0], [0, 0, roll])
    ]
    return turns[2] @ turns[0] @ turns[1] @ level


def _noise(rng, shape, scale):
    """Smooth noise of standard deviation 1."""
    small = rng.normal(
        size=(max(2, int(shape[0] / scale)), max(2, int(shape[1] / scale)))
    )
    big = cv2.resize(
        small.astype(np.float32), shape[::-1], interpolation=cv2.INTER_CUBIC
    )
    return big / big.std()


def _surface(scene, base, key):
    """A square of coloured texture, one pixel a mm."""
    rng = np.random.default_rng([scene.seed, key])
    shape = (GROUND_MM, GROUND_MM)
    tone = np.zeros(shape, np.float32)
    if scene.texture == "cloth":
        x = np.arange(GROUND_MM)
        tone += 0.05 * (
            np.sin(x / 1.1)[:, None] + np.sin(x / 1.3)[None, :]
        ) + 0.04 * _noise(rng, shape, 60)
    elif scene.texture == "wood":
        wave = _noise(rng, shape, 120) * 6 + np.arange(GROUND_MM)[:, None] / 7
        tone += (
            0.07 * np.sin(wave)
            + 0.05 * np.sin(3.1 * wave)
            + 0.02 * _noise(rng, shape, 3)
        )
        tone[::140] -= 0.3
    elif scene.texture == "speckle":
        tone += 0.07 * _noise(rng, shape, 2) + 0.05 * _noise(rng, shape, 9)
    else:
        tone += 0.015 * _noise(rng, shape, 80)
    return (np.array(base, np.float32) * (1 + tone[..., None])).astype(np.float32)


def _sample(texture, u, v):
    """Colours at places in mm from the texture's middle."""
    u, v = (np.float32(at + texture.shape[0] / 2) for at in (u, v))
    return cv2.remap(texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)


def _room(scene, eye, rays):
    with np.errstate(divide="ignore", invalid="ignore"):
        to_wall = (scene.wall_at - eye[1]) / rays[..., 1]
        to_ground = np.where(rays[..., 2] < 0, -eye[2] / rays[..., 2], np.inf)
    at = eye + np.minimum(to_wall, 1e5)[..., None] * rays
    colour = _sample(_surface(scene, scene.wall, 3), at[..., 0], at[..., 2] - 300)
    depth = to_wall.copy()
    ground = _surface(scene, scene.ground, 4) * _ground_light(scene)[..., None]
    near = to_ground < depth
    at = eye + np.where(near, to_ground, 0)[..., None] * rays
    colour[near] = _sample(ground, at[..., 0], at[..., 1])[near]
    depth[near] = to_ground[near]
    if scene.with_sheet:
        mm = 8
        page = sheet.draw_sheet(20.0, mm)
        turn = np.radians(scene.sheet_yaw)
        along = np.array([np.cos(turn), np.sin(turn), 0])
        _stand(
            page,
            mm,
            np.array([scene.sheet_left, 0, 0]),
            along,
            eye,
            rays,
            colour,
            depth,
        )
    if scene.ruler == "standing":
        _stand(
            _ruler(200),
            4,
            np.array([165.0, 20.0, 0]),
            np.array([1.0, 0, 0]),
            eye,
            rays,
            colour,
            depth,
        )
    return colour, depth


def _stand(page, per_mm, corner, along, eye, rays, colour, depth):
    """Draw an upright page into the picture where its rays meet it before anything else; `along` is its lower edge."""
    page = cv2.cvtColor(page, cv2.COLOR_GRAY2BGR) if page.ndim == 2 else page
    normal = np.cross(along, [0, 0, 1.0])
    to_page = ((corner - eye) @ normal) / (rays @ normal)
    at = eye + to_page[..., None] * rays - corner
    u = (at @ along) * per_mm
    v = page.shape[0] - at[..., 2] * per_mm
    inside = (
        (u >= 0)
        & (u < page.shape[1])
        & (v >= 0)
        & (v < page.shape[0])
        & (to_page > 0)
        & (to_page < depth)
    )
    seen = cv2.remap(
        cv2.GaussianBlur(page, (0, 0), 1.2),
        np.float32(u - 0.5),
        np.float32(v - 0.5),
        cv2.INTER_LINEAR,
    )
    colour[inside] = 0.93 * seen[inside] + 5
    depth[inside] = to_page[inside]


def _ruler(long_mm):
    """A ruler, four pixels a mm, upright."""
    picture = np.full((4 * long_mm, 4 * 28, 3), (90, 200, 230), np.uint8)
    for mm in range(long_mm):
        wide = 60 if mm % 10 == 0 else 40 if mm % 5 == 0 else 24
        cv2.line(
            picture,
            (0, 4 * (long_mm - mm)),
            (wide, 4 * (long_mm - mm)),
            (20, 20, 20),
            1,
        )
        if mm % 10 == 0 and mm:
            place = (62, 4 * (long_mm - mm) + 8)
            cv2.putText(
                picture,
                str(mm // 10),
                place,
                cv2.FONT_HERSHEY_SIMPLEX,
                0.8,
                (20, 20, 20),
                2,
            )
    return picture


def _ground_light(scene):
    shade = np.zeros((GROUND_MM, GROUND_MM), np.float32)
    half = GROUND_MM // 2
    if scene.with_pile:
        for centres, _, sizes in (scene.grains, scene.loose_grains):
            for (x, y, z), size in zip(centres, sizes, strict=True):
                fall = -LIGHT[:2] / LIGHT[2] * z
                radius = max(1, round(size * scene.berry_mm / 2))
                cv2.circle(
                    shade,
                    (round(half + x + fall[0]), round(half + y + fall[1])),
                    radius,
                    1,
                    -1,
                )
    wide = cv2.GaussianBlur(shade, (0, 0), 6)
    close = cv2.GaussianBlur(shade, (0, 0), 2)
    return 1 - scene.shadow * (0.5 * wide + 0.5 * close)


def _cast(scene, grains, inside, eye, rays, camera, colour, depth):
    """Draw ellipsoids: colour by light, by depth in the pile and by a texture of their own."""
    matrix, lens, turn = camera
    centres, quaternions, sizes = grains
    if inside:  # grains of the far side that the near side hides cost time only
        deep = (
            scene.height
            - np.tan(np.radians(scene.angle)) * np.abs(centres[:, 0])
            - centres[:, 2]
        )
        seen = (centres[:, 1] < 0) | (deep < 2.5 * scene.berry_mm)
        centres = centres[seen]
        quaternions = quaternions[seen]
        sizes = sizes[seen]
    rng = np.random.default_rng([scene.seed, 5])
    albedo = np.array(CROPS[scene.crop][0], float)
    rotations = rotation_matrices(quaternions)
    steep = np.tan(np.radians(scene.angle))
    for centre, rotation, size in zip(centres, rotations, sizes, strict=True):
        grain_colour = albedo * rng.normal(1, 0.10) * rng.normal(1, 0.03, 3)
        axes = scene.axes * size
        ahead = turn @ (centre - eye)
        place = cv2.projectPoints(ahead[None], np.zeros(3), np.zeros(3), matrix, lens)[
            0
        ].ravel()
        reach = int(matrix[0, 0] * axes.max() / ahead[2] * 1.2 + 3)
        left, top = (int(p) - reach for p in place)
        window = np.s_[
            max(top, 0) : max(top + 2 * reach, 0),
            max(left, 0) : max(left + 2 * reach, 0),
        ]
        ray = rays[window]
        if not ray.size:
            continue
        to_unit = (rotation / axes).T
        d = ray @ to_unit.T
        o = to_unit @ (eye - centre)
        a = (d * d).sum(-1)
        b = d @ o
        c = o @ o - 1
        root = b * b - a * c
        t = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
        hit = t < depth[window]
        if not hit.any():
            continue
        at = o + t[hit][:, None] * d[hit]
        normal = at @ to_unit
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        world = eye + t[hit][:, None] * ray[hit]
        deep = (
            scene.height - steep * np.hypot(world[:, 0], world[:, 1]) - world[:, 2]
            if inside
            else 0 * at[:, 0]
        )
        open_sky = np.clip(1.05 - deep / (1.3 * scene.berry_mm), 0.12, 1) * (
            0.75 + 0.25 * normal[:, 2]
        )
        lit = np.maximum(normal @ LIGHT, 0)
        waves = 0.10 * np.sin(7 * at[:, 0] + 5 * at[:, 1]) * np.cos(6 * at[:, 2])
        grain_texture = 1 + waves - 0.25 * (np.abs(at[:, 1]) < 0.08)
        shine = 40 * np.maximum(normal @ ((LIGHT - np.array([0, 1, 0])) / 1.8), 0) ** 20
        tone = (0.45 + 0.75 * lit) * open_sky * grain_texture
        colour[window][hit] = grain_colour * tone[:, None] + (shine * open_sky)[:, None]
        depth[window][hit] = t[hit]


def _light(scene, height, width):
    """Light over the picture: uneven, and a hand's soft shadow that comes in from one side."""
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    turn = np.random.default_rng([scene.seed, 6]).uniform(0, 2 * np.pi)
    light = 1 - scene.uneven * (
        0.5
        + 0.35 * (x * np.cos(turn) + y * np.sin(turn))
        + 0.15 * (x * x + y * y)
        - 0.15
    )
    if scene.hand:
        shade = np.zeros((height, width), np.float32)
        w = width
        h = height
        across = (0.75, 1, 1, 0.72, 0.56, 0.55, 0.68, 0.52, 0.5, 0.68, 0.55, 0.56, 0.74)
        down = (0, 0, 0.55, 0.50, 0.56, 0.50, 0.42, 0.43, 0.37, 0.33, 0.28, 0.22, 0.22)
        palm = [(a * w, b * h) for a, b in zip(across, down, strict=True)]
        cv2.fillPoly(shade, [np.array(palm, np.int32)], 1)
        light = light * (1 - scene.hand * cv2.GaussianBlur(shade, (0, 0), 0.012 * w))
    return light
