"""A second renderer of piles, with NumPy, SciPy and OpenCV alone: a pinhole camera and ellipsoidal grains.

It shares no code with the measurement; the picture of the printed sheet is its input. The truth of a scene is the top
of the ellipses that grains are in a side view without perspective, and a least-squares line through each flank of it.

World: x right, y away from the camera, z up, in mm; the highest heap stands on x = y = 0, the plate is z = 0.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

LIGHT = np.array([-0.5, -0.6, 0.62]) / np.linalg.norm([-0.5, -0.6, 0.62])
FINER = 2  # rays a pixel of the pile, each way
LAYERS = 2  # of grains, below the surface of a heap
PLATE = 900.0  # mm from the middle to the edges of the plate's map, one pixel 2 mm


class Heap(NamedTuple):
    """A cone on the plate: place and height of its apex, angle of its flanks; lengths in mm."""

    x: float
    y: float
    height: float
    angle: float
    flat: float = 0.0  # radius of a level top
    foot: float = 0.0  # height over which the flank turns into the plate

    def top(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        slope = np.tan(np.radians(self.angle))
        z = self.height - slope * np.maximum(
            np.hypot(x - self.x, y - self.y) - self.flat, 0
        )
        return self.foot * np.logaddexp(0, z / self.foot) if self.foot else z

    @property
    def half(self) -> float:
        return self.flat + (self.height + 2 * self.foot) / np.tan(
            np.radians(self.angle)
        )


@dataclass
class Scene:
    """What is photographed, and how; lengths in mm, angles in degrees, colours blue first."""

    seed: int
    heaps: tuple = (Heap(0.0, 0.0, 55.0, 30.0),)
    axes: tuple = (6.8, 6.4, 6.0)  # of a grain
    colour: tuple = (60, 130, 190)
    wall: tuple = (190, 188, 186)
    plate: tuple = (150, 152, 155)
    eye: tuple = (0.0, -700.0, 55.0)
    aim: tuple = (-80.0, 0.0, 50.0)
    roll: float = 0.0
    size: tuple = (1000, 750)
    focal: float = 1000.0  # pixels
    wall_at: float = 300.0
    shadow: float = 0.4
    uneven: float = 0.2
    texture: float = 0.02
    noise: float = 2.0
    blur: float = 0.6
    loose: int = 0
    left: float = -300.0  # edge of the sheet; NaN is no sheet

    @cached_property
    def grains(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres (N, 3) of grains, and (N, 3, 3) matrices S with the unit sphere as S^-1 (x - centre)."""
        rng = np.random.default_rng([self.seed, 1])
        d = float(np.prod(self.axes) ** (1 / 3))
        found = []
        for heap in self.heaps:
            reach = heap.half + d
            for layer in range(LAYERS):
                at = np.arange(-reach, reach, 0.62 * d)
                x, y = (
                    axis.ravel() + middle + rng.uniform(-0.3, 0.3, axis.size) * d
                    for axis, middle in zip(np.meshgrid(at, at), heap[:2], strict=True)
                )
                surface = np.max([cone.top(x, y) for cone in self.heaps], axis=0)
                z = surface - (0.5 + 0.8 * layer) * d - rng.uniform(0, 0.5, x.size) * d
                lowest = (surface > 0.3 * d) & (z < 0.45 * d) & (layer == 0)
                z = np.where(lowest, 0.45 * d, z)
                found.append(np.column_stack([x, y, z])[z >= 0.44 * d])
        centres = np.concatenate(found)
        turn = rng.uniform(0, 2 * np.pi, self.loose)
        away = self.heaps[0].half * rng.uniform(1.2, 1.6, self.loose)
        strays = np.column_stack(
            [away * np.cos(turn), away * np.sin(turn), np.full(self.loose, 0.45 * d)]
        )
        self.strays = len(strays)
        centres = np.concatenate([centres, strays])
        turn = Rotation.from_quat(
            rng.normal(size=(len(centres), 4)), scalar_first=True
        ).as_matrix()
        sizes = rng.normal(1, 0.06, len(centres)).clip(0.85, 1.15)
        return centres, turn * (0.5 * np.array(self.axes) * sizes[:, None])[:, None, :]

    @property
    def grain_mm(self) -> float:
        """Edge of the cube with the volume of a grain's box."""
        return float(np.prod(self.axes) ** (1 / 3))


class Truth(NamedTuple):
    """A pile without perspective."""

    angle: float  # degrees, mean of both flanks
    height: float  # mm


def truth(scene: Scene, step: float = 0.1) -> Truth:
    """Angle and height of the side view that a camera at infinity would have, in the direction of the scene's."""
    centres, shapes = scene.grains
    kept = len(centres) - scene.strays
    away = np.array([-scene.eye[0], -scene.eye[1], 0.0]) / np.hypot(*scene.eye[:2])
    side = np.array([away[1], -away[0], 0.0])
    seen = np.stack([side @ shapes[:kept], shapes[:kept, 2]], axis=1)
    a = np.einsum("ni,ni->n", seen[:, 0], seen[:, 0])
    b = np.einsum("ni,ni->n", seen[:, 0], seen[:, 1])
    c = np.einsum("ni,ni->n", seen[:, 1], seen[:, 1])
    u = centres[:kept] @ side
    z = centres[:kept, 2]
    first = u.min() - scene.grain_mm
    heights = np.zeros(int((u.max() + scene.grain_mm - first) / step) + 2)
    reach = np.sqrt(a)
    across = np.arange(
        -np.ceil(reach.max() / step) - 1, np.ceil(reach.max() / step) + 2
    )
    for part in np.array_split(np.arange(kept), 1 + kept // 4000):
        column = np.rint((u[part] - first) / step).astype(int)[:, None] + across.astype(
            int
        )
        offset = first + step * column - u[part, None]
        inside = np.abs(offset) < reach[part, None]
        root = np.sqrt(
            np.maximum((c - b * b / a)[part, None] * (1 - offset**2 / a[part, None]), 0)
        )
        top = z[part, None] + (b / a)[part, None] * offset + root
        np.maximum.at(heights, column[inside], top[inside])
    crest = int(heights.argmax())
    high = heights[crest]
    angles = []
    for flank in (heights[: crest + 1], heights[crest:][::-1]):
        at = np.flatnonzero(flank)
        angles.append(np.degrees(np.arctan(np.polyfit(step * at, flank[at], 1)[0])))
    return Truth(float(np.mean(angles)), float(high))


def photograph(
    scene: Scene, sheet: np.ndarray, sheet_mm: tuple[float, float]
) -> np.ndarray:
    """The photograph (H, W, 3) uint8; `sheet` is a grey picture of the printed sheet, `sheet_mm` its sides."""
    rng = np.random.default_rng([scene.seed, 2])
    width, height = scene.size
    eye = np.array(scene.eye)
    middle = np.array([width / 2 - 0.5, height / 2 - 0.5])
    turn = turn_of(eye, scene.aim, scene.roll)
    columns, rows = np.meshgrid(
        np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    )
    ahead = np.stack(
        [
            (columns - middle[0]) / scene.focal,
            (rows - middle[1]) / scene.focal,
            np.ones_like(rows),
        ],
        -1,
    )
    colour = _room(
        scene, rng, eye, (ahead @ turn.astype(np.float32)).astype(np.float32)
    )
    if np.isfinite(scene.left):
        _paste(scene, sheet, sheet_mm, eye, turn, scene.focal, middle, colour)
    corner, end = _part(scene, eye, turn, middle)
    if (end > corner).all():
        window = np.s_[corner[1] : end[1], corner[0] : end[0]]
        sides = end - corner
        part = cv2.resize(colour[window], FINER * sides, interpolation=cv2.INTER_LINEAR)
        _grains(
            scene,
            rng,
            eye,
            turn,
            FINER * scene.focal,
            FINER * (middle - corner + 0.5) - 0.5,
            part,
        )
        colour[window] = cv2.resize(part, sides, interpolation=cv2.INTER_AREA)
    y, x = np.mgrid[-1 : 1 : scene.size[1] * 1j, -1 : 1 : scene.size[0] * 1j]
    way = rng.uniform(0, 2 * np.pi)
    colour *= (
        1 - scene.uneven * (0.5 + 0.5 * (x * np.cos(way) + y * np.sin(way)) / 1.42)
    )[..., None]
    colour = cv2.GaussianBlur(colour, (0, 0), scene.blur) + rng.normal(
        0, scene.noise, colour.shape
    )
    return np.clip(np.rint(colour), 0, 255).astype(np.uint8)


def _part(scene, eye, turn, middle):
    centres, _ = scene.grains
    ahead = (centres - eye) @ turn.T
    place = scene.focal * ahead[:, :2] / ahead[:, 2:] + middle
    reach = scene.focal * max(scene.axes) / ahead[:, 2].min()
    return (
        np.clip(edge, 0, scene.size).astype(int)
        for edge in (place.min(axis=0) - reach, place.max(axis=0) + reach)
    )


def turn_of(eye, aim, roll):
    """From the world to the camera: x right, y down, z ahead."""
    ahead = np.array(aim, float) - eye
    ahead /= np.linalg.norm(ahead)
    right = np.array([ahead[1], -ahead[0], 0]) / np.hypot(ahead[0], ahead[1])
    down = np.cross(ahead, right)
    c = np.cos(np.radians(roll))
    s = np.sin(np.radians(roll))
    return np.array([c * right - s * down, s * right + c * down, ahead])


def warped(page, corners, size):
    """A page as it lies in a picture of a size, by where its corners are there from the upper left; and its share."""
    rows, columns = page.shape
    edges = (
        np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], np.float32) - 0.5
    )
    to_picture = cv2.getPerspectiveTransform(edges, corners.astype(np.float32))
    return (
        cv2.warpPerspective(part, to_picture, size)[..., None]
        for part in (page, np.ones_like(page))
    )


def _room(scene, rng, eye, rays):
    """Wall and plate, with the shadow of the heaps, as float32 (H, W, 3)."""
    size = int(PLATE)  # 2 mm a pixel
    maps = []
    for base in (scene.wall, scene.plate):
        soft = cv2.resize(
            rng.normal(size=(size // 4, size // 4)).astype(np.float32), (size, size)
        )
        fine = cv2.GaussianBlur(
            rng.normal(size=(size, size)).astype(np.float32), (0, 0), 1
        )
        grain = soft / soft.std() + fine / fine.std()
        maps.append(
            (
                np.array(base, np.float32) * (1 + scene.texture * grain[..., None])
            ).astype(np.float32)
        )
    at = np.linspace(-PLATE, PLATE, size // 4)
    x, y = np.meshgrid(at, at)
    dark = np.zeros(x.shape, np.float32)
    for way in (
        np.linspace(0, 1, 25)[1:] * max(heap.height for heap in scene.heaps) / LIGHT[2]
    ):
        surface = np.max(
            [heap.top(x + way * LIGHT[0], y + way * LIGHT[1]) for heap in scene.heaps],
            axis=0,
        )
        dark = np.maximum(dark, surface > way * LIGHT[2])
    dark = cv2.GaussianBlur(
        cv2.resize(dark.astype(np.float32), (size, size)), (0, 0), 3
    )
    with np.errstate(divide="ignore"):
        to_wall = (scene.wall_at - eye[1]) / rays[..., 1]
        to_plate = -eye[2] / np.minimum(rays[..., 2], -1e-9)
    to_wall = np.where(to_wall > 0, to_wall, 1e6)
    shown = []
    for way, other, texture in ((to_wall, 2, maps[0]), (to_plate, 1, maps[1])):
        u = (eye[0] + way * rays[..., 0] + PLATE) / 2
        v = (eye[other] + way * rays[..., other] + PLATE) / 2
        u, v = (np.clip(axis, -1e5, 1e5).astype(np.float32) for axis in (u, v))
        shown.append(
            cv2.remap(
                texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101
            )
        )
    shown[1] *= 1 - scene.shadow * cv2.remap(dark, u, v, cv2.INTER_LINEAR)[..., None]
    return np.where((to_plate < to_wall)[..., None], shown[1], shown[0])


def _paste(scene, sheet, sheet_mm, eye, turn, focal, middle, colour):
    wide, high = sheet_mm
    corners = np.array([[0, 0, high], [wide, 0, high], [wide, 0, 0], [0, 0, 0]])
    seen = (corners + np.array([scene.left, 0, 0]) - eye) @ turn.T
    at = (focal * seen[:, :2] / seen[:, 2:] + middle).astype(np.float32)
    page = cv2.GaussianBlur(
        sheet, (0, 0), 0.5 * max(1.0, len(sheet) / np.ptp(at[:, 1]))
    ).astype(np.float32)
    page, inside = warped(page, at, colour.shape[1::-1])
    colour[:] = (1 - inside) * colour + 0.9 * page + 8 * inside


def _grains(scene, rng, eye, turn, focal, middle, colour):
    """Draw the grains: all rays of a window about each grain at once, the nearest hit of a pixel wins."""
    centres, shapes = scene.grains
    surface = np.max(
        [heap.top(centres[:, 0], centres[:, 1]) for heap in scene.heaps], axis=0
    )
    # What lies behind the crest's line and far below it is hidden.
    line = np.max(
        [
            heap.top(centres[:, 0], np.full(len(centres), heap.y))
            for heap in scene.heaps
        ],
        axis=0,
    )
    tints = (
        rng.normal(1, 0.09, (len(centres), 1))
        * rng.normal(1, 0.03, (len(centres), 3))
        * scene.colour
    )
    seen = (centres[:, 1] < 0) | (line - centres[:, 2] < 3 * scene.grain_mm)
    centres = centres[seen]
    shapes = shapes[seen]
    tints = tints[seen]
    surface = surface[seen]
    to_unit = np.linalg.inv(shapes)
    ahead = (centres - eye) @ turn.T
    place = focal * ahead[:, :2] / ahead[:, 2:] + middle
    reach = (
        int(np.ceil(1.1 * focal * 0.5 * max(scene.axes) * 1.15 / ahead[:, 2].min())) + 1
    )
    window = np.stack(np.meshgrid(*2 * [np.arange(-reach, reach + 1)]), -1).reshape(
        -1, 2
    )
    rows, columns = colour.shape[:2]
    depth = np.full(rows * columns, np.inf, np.float32)
    flat = colour.reshape(-1, 3)
    origin = np.einsum("nij,nj->ni", to_unit, eye - centres).astype(np.float32)
    order = np.argsort(-ahead[:, 2])  # from far to near
    for part in np.array_split(order, 1 + len(order) * len(window) // 400_000):
        at = np.rint(place[part]).astype(int)[:, None] + window
        ray = np.concatenate(
            [(at - middle) / focal, np.ones((*at.shape[:2], 1))], -1
        ).astype(np.float32)
        way = np.matmul(
            ray, np.swapaxes(to_unit[part] @ turn.T, 1, 2).astype(np.float32)
        )
        # From the ray's nearest point to the centre: from the eye, single precision loses a grain at 5 m.
        square = np.einsum("nkj,nkj->nk", way, way)
        middle_at = -np.einsum("nkj,nj->nk", way, origin[part]) / square
        nearest = origin[part][:, None] + middle_at[..., None] * way
        inside = 1 - np.einsum("nkj,nkj->nk", nearest, nearest)
        hit = inside > 0
        hit &= (
            (at[..., 0] >= 0)
            & (at[..., 1] >= 0)
            & (at[..., 0] < columns)
            & (at[..., 1] < rows)
        )
        back = np.sqrt(inside[hit] / square[hit])
        t = middle_at[hit] - back
        which = np.nonzero(hit)[0]
        pixel = at[hit][:, 1] * columns + at[hit][:, 0]
        # the last of several that are written to one pixel stays
        near = np.argsort(-t, kind="stable")
        near = near[t[near] < depth[pixel[near]]]
        t = t[near]
        which = which[near]
        pixel = pixel[near]
        unit = nearest[hit][near] - back[near][:, None] * way[hit][near]
        normal = np.einsum("ni,nij->nj", unit, to_unit[part][which])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        z = eye[2] + t * (ray[hit][near] @ turn[:, 2].astype(np.float32))
        sky = np.clip(
            1.05 - (surface[part][which] - z) / (1.4 * scene.grain_mm), 0.12, 1
        )
        tone = (
            (0.5 + 0.65 * np.maximum(normal @ LIGHT, 0))
            * sky
            * (0.8 + 0.2 * normal[:, 2])
        )
        flat[pixel] = (
            tints[part][which] * tone[:, None]
            + 14 * sky[:, None] * (normal @ LIGHT > 0.97)[:, None]
        )
        depth[pixel] = t
