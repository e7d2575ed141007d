"""Forty photographs by a third renderer, which casts rays at ellipsoids and takes the light of many lamps.

A heap is a random packing, not a cone with grains on it; every shadow comes from the grains, by a depth map for each of
the lamps that make a soft light and a sky. `RANGES` and `JUDGED` were written down before one of the forty was drawn;
causes were looked for in other seeds. `pytest -n0 -m slow -s -k all_forty` prints the errors of the forty.

World: x right, y away from the camera, z up, in mm; the heap stands on x = y = 0, the plate is z = 0.
"""

from functools import cached_property
from pathlib import Path

import cv2
import numba
import numpy as np
import pinhole
import sixty
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from repose.measure.photographs import photograph as photographs
from repose.measure.photographs import sheet
from repose.measure.pile import measure_image
from repose.measure.settings import MeasureSettings

JUDGED = range(7001, 7041)
# columns and rows; rays a pixel each way, about the heap
SIZE = (1600, 1200)
FINER = 3
RANGES = {  # uniform
    "angle": (22.0, 36.0),  # degrees, of the packing's cone
    "grain_px": (11.0, 20.0),
    "away": (450.0, 560.0),  # mm, from lens to axis
    "focal": (1100.0, 1350.0),  # px; a grain's size in mm follows
    "above": (2.0, 8.0),  # degrees that the lens looks down at the crest
    "aside": (-60.0, 60.0),  # mm, of the lens from the middle between sheet and heap
    "roll": (-3.0, 3.0),  # degrees
    "flat": (0.65, 1.0),  # shortest over longest axis of a grain
    "lamp_turn": (170.0, 370.0),  # degrees about z; 270 is behind the camera
    "lamp_high": (30.0, 70.0),  # degrees over the plate
    "lamp_wide": (3.0, 20.0),  # degrees, half of its angle: how soft a shadow is
    "sky": (0.25, 0.6),  # share of the light
    "exposed": (95.0, 135.0),  # tones, of the mean light of the photograph
    "blur": (0.4, 1.0),  # px
    "noise": (1.0, 3.0),  # tones
    "texture": (0.4, 1.2),  # of wood and cloth
    "yaw": (-0.05, 0.05),  # rad, of the sheet
    "wall_at": (120.0, 400.0),  # mm behind the axis
}
# grains; a coarser heap gets more of them
MOST = 2000
LEAST = 500
LEAST_HIGH_PX = 115.0
PACKED = 0.58  # share of the cone that grains fill
STRAYS = (0, 4, 10)  # loose grains on the plate
GRAINS = {  # colour, blue first
    "lentil": (58, 92, 118),
    "green lentil": (70, 120, 120),
    "chickpea": (130, 175, 208),
    "pea": (75, 165, 120),
    "soybean": (110, 180, 210),
    "red bean": (45, 40, 120),
    "black bean": (38, 36, 40),
    "wheat": (90, 150, 196),
}
SURFACES = {  # kind and two colours between which it varies
    "paper": ("paper", (236, 238, 240), (230, 233, 236)),
    "oak": ("wood", (95, 140, 185), (70, 112, 158)),
    "walnut": ("wood", (55, 85, 120), (40, 62, 92)),
    "beech": ("wood", (140, 178, 212), (120, 160, 198)),
    "blue cloth": ("cloth", (150, 95, 50), (128, 80, 42)),
    "grey cloth": ("cloth", (135, 137, 140), (118, 120, 124)),
    "black cloth": ("cloth", (45, 44, 43), (34, 33, 33)),
    "green cloth": ("cloth", (85, 130, 75), (72, 112, 62)),
}
LEAST_DIFFERENCE = 18.0  # CIE 1976, of the lit and of the shaded grain from a surface: an eye sees the outline
LAMPS = 16
SKIES = 16
MAP_MM = 0.5
# colours here are those of a picture; light is mixed before a camera bends it
TONE_CURVE = 2.2


def cast(place, way, boxes, centres, to_unit, depth, which):
    """Nearest grain along each ray; a ray's place and way (3, 3) are first + column * second + row * third."""
    first = np.repeat(place[None], len(centres), axis=0)
    first[:, 0] -= centres
    turned = np.swapaxes(to_unit, 1, 2)
    cast_at_spheres(first @ turned, way @ turned, boxes, depth, which)


@numba.njit(cache=True)
def cast_at_spheres(places, all_ways, boxes, depth, which):
    """As `cast`, each grain in the axes (N, 3, 3) in which it is a unit sphere; without products, which BLAS makes."""
    for k in range(len(places)):
        starts = places[k]
        ways = all_ways[k]
        for row in range(boxes[k, 2], boxes[k, 3]):
            for column in range(boxes[k, 0], boxes[k, 1]):
                oo = od = dd = 0.0
                for i in range(3):
                    o = starts[0, i] + column * starts[1, i] + row * starts[2, i]
                    d = ways[0, i] + column * ways[1, i] + row * ways[2, i]
                    oo = oo + o * o
                    od = od + o * d
                    dd = dd + d * d
                root = od * od - dd * (oo - 1.0)
                if root > 0:
                    t = (-od - np.sqrt(root)) / dd
                    if t < depth[row, column]:
                        depth[row, column] = t
                        which[row, column] = k


@numba.njit(cache=True)
def lit(at, normal, lamps, frames, maps, left, step):
    """Light (N,) on points from lamps (M, 3) of one strength each, behind what their depth maps show."""
    light = np.zeros(len(at), np.float32)
    for i in range(len(at)):
        x, y, z = at[i]
        for k in range(len(lamps)):
            a, b, c = lamps[k]
            shine = a * normal[i, 0] + b * normal[i, 1] + c * normal[i, 2]
            if shine > 0:
                u = (
                    frames[k, 0, 0] * x
                    + frames[k, 0, 1] * y
                    + frames[k, 0, 2] * z
                    - left
                ) / step
                v = (
                    frames[k, 1, 0] * x
                    + frames[k, 1, 1] * y
                    + frames[k, 1, 2] * z
                    - left
                ) / step
                inside = 0 <= u < maps.shape[2] and 0 <= v < maps.shape[1]
                if not inside or maps[k, int(v), int(u)] < a * x + b * y + c * z + 0.25:
                    light[i] += shine
    return light


class Scene:
    """What is photographed, and how: all of it follows from the seed; `change` replaces drawn values."""

    def __init__(self, seed: int, **change: object) -> None:
        rng = np.random.default_rng([2041, seed])
        self.seed = seed
        for name, ends in RANGES.items():
            setattr(self, name, float(rng.uniform(*ends)))
        self.d = self.grain_px * self.away / self.focal  # height of a grain
        slope = np.tan(np.radians(self.angle))
        # number of grains of such a cone
        lowest = (LEAST_HIGH_PX / self.grain_px) ** 3 * 2 * PACKED / slope**2
        self.number = int(
            np.exp(rng.uniform(np.log(np.clip(lowest, LEAST, MOST)), np.log(MOST)))
        )
        self.grain, self.plate, self.wall = self._colours(rng)
        self.strays = int(rng.choice(STRAYS))
        self.stated = bool(rng.integers(2))
        self.__dict__.update(change)
        self.high = self.d * (self.number * slope**2 / (2 * PACKED)) ** (1 / 3)
        self.half = self.high / slope

    def _colours(self, rng: np.random.Generator) -> tuple[str, str, str]:
        """Draw grains, plate and wall until an eye can tell them apart."""
        while True:
            names = rng.choice(list(GRAINS)), *rng.choice(list(SURFACES), 2)
            rows = [[share * np.array(GRAINS[names[0]]) for share in (0.9, 0.6)]]
            rows += [
                [np.array(colour) for colour in SURFACES[name][1:]]
                for name in names[1:]
            ]
            lab = cv2.cvtColor(np.array(rows, np.float32) / 255, cv2.COLOR_BGR2Lab)
            if (
                min(
                    np.linalg.norm(a - b)
                    for a in lab[0]
                    for b in lab[1:].reshape(-1, 3)
                )
                > LEAST_DIFFERENCE
            ):
                return names

    @cached_property
    def grains(self) -> tuple[np.ndarray, np.ndarray, int]:
        """Centres (N, 3), matrices to the unit sphere (N, 3, 3), and how many of them are the heap."""
        rng = np.random.default_rng([self.seed, 1])
        radius = 0.5 * self.d
        slope = self.high / self.half
        turn = rng.uniform(0, 2 * np.pi, self.number)
        share = np.cbrt(rng.uniform(0, 1, self.number))
        away = self.half * share * np.sqrt(rng.uniform(0, 1, self.number))
        at = np.column_stack(
            [away * np.cos(turn), away * np.sin(turn), self.high * (1 - share)]
        )
        inset = (
            self.high
            - radius * np.hypot(1, slope)
            + rng.normal(0, 0.2 * radius, self.number)
        )
        for _ in range(150):
            a, b = cKDTree(at).query_pairs(self.d, output_type="ndarray").T
            way = at[a] - at[b]
            length = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
            push = 0.45 * ((self.d - length) / length)[:, None] * way
            np.add.at(at, a, push)
            np.add.at(at, b, -push)
            at[:, 2] = np.maximum(at[:, 2] - 0.02 * radius, 0.9 * radius)
            out = np.maximum(
                at[:, 2] + slope * np.hypot(at[:, 0], at[:, 1]) - inset, 0
            ) / (1 + slope**2)
            outward = (
                at[:, :2] / np.maximum(np.hypot(at[:, 0], at[:, 1]), 1e-9)[:, None]
            )
            at -= out[:, None] * np.column_stack(
                [slope * outward, np.ones(self.number)]
            )
            at[:, 2] = np.maximum(at[:, 2], 0.9 * radius)
        turn = rng.uniform(0, 2 * np.pi, self.strays)
        distances = rng.uniform(1.2, 1.6, self.strays) * self.half + self.d
        loose = np.column_stack(
            [
                distances * np.cos(turn),
                distances * np.sin(turn),
                np.full(self.strays, 0.9 * radius),
            ]
        )
        at = np.concatenate([at, loose])
        axes = np.column_stack(
            [np.ones((len(at), 2)), np.full(len(at), self.flat)]
        ) * self.flat ** (-1 / 3)
        axes[:, 1] *= rng.uniform(0.9, 1.0, len(at))
        axes *= radius * rng.normal(1, 0.05, (len(at), 1)).clip(0.85, 1.15)
        q, _ = np.linalg.qr(rng.normal(size=(len(at), 3, 3)))
        return at, q / axes[:, :, None], self.number

    @property
    def facing(self) -> np.ndarray:
        """Level unit vector from the lens to the axis."""
        return np.array([-self.eye[0], -self.eye[1], 0.0]) / np.hypot(*self.eye[:2])

    @property
    def left(self) -> float:
        """Left edge of the sheet."""
        return -self.half - 20.0 - sheet.compute_size_mm()[0] - self.d

    @property
    def eye(self) -> np.ndarray:
        """Place of the lens."""
        across = 0.5 * (self.left + self.half) + self.aside
        return np.array(
            [
                across,
                -self.away,
                self.high
                + np.tan(np.radians(self.above)) * np.hypot(across, self.away),
            ]
        )

    @property
    def turn(self) -> np.ndarray:
        """Right, down and ahead of the camera, which looks at the middle of sheet and heap."""
        return pinhole.turn_of(
            self.eye, (0.5 * (self.left + self.half), 0.0, 60.0), -self.roll
        )

    def seen(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows (N, 2) of places in the photograph, and how far ahead they lie (N,)."""
        ahead = (at - self.eye) @ self.turn.T
        return self.focal * ahead[:, :2] / ahead[:, 2:] + 0.5 * np.array(
            SIZE
        ) - 0.5, ahead[:, 2]

    def light(self, at: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Light (N,) on points: lamps in a cone about one direction, and lamps all over the sky."""
        rng = np.random.default_rng([self.seed, 3])
        turn, high = np.radians([self.lamp_turn, self.lamp_high])
        middle = np.array(
            [np.cos(turn) * np.cos(high), np.sin(turn) * np.cos(high), np.sin(high)]
        )
        spread = rng.normal(size=(LAMPS, 3))
        spread *= (
            np.tan(np.radians(self.lamp_wide))
            * (rng.uniform(0, 1, LAMPS) ** (1 / 3) / np.linalg.norm(spread, axis=1))[
                :, None
            ]
        )
        sky = rng.normal(size=(SKIES, 3))
        sky[:, 2] = np.abs(sky[:, 2]) + 0.3
        total = 0.0
        for lamps, share in ((middle + spread, 1 - self.sky), (sky, self.sky)):
            lamps /= np.linalg.norm(lamps, axis=1, keepdims=True)
            seen = [self.parallel(-lamp, MAP_MM, len(self.grains[0])) for lamp in lamps]
            maps = np.stack([-picture[0] for picture in seen])
            frames = np.stack([picture[1] for picture in seen])
            total = (
                total
                + share
                * lit(at, normal, lamps, frames, maps, seen[0][2], MAP_MM)
                / lamps[:, 2].sum()
            )
        return total.astype(np.float32)

    def parallel(
        self, ahead: np.ndarray, step: float, kept: int
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Depth (H, W) of grains along parallel rays, `step` mm apart, their frame, and the first place."""
        centres, to_unit, _ = self.grains
        right = np.cross(ahead, [0, 0, 1.0]) / np.hypot(*ahead[:2])
        frame = np.array([right, np.cross(ahead, right)])
        left = -(1.7 * self.half + 4 * self.d)
        depth = np.full((int(-2 * left / step),) * 2, np.inf)
        rays = (
            np.array([left * frame.sum(axis=0), *(step * frame)]),
            np.array([ahead, 0 * ahead, 0 * ahead]),
        )
        middle = (centres[:kept] @ frame.T - left) / step
        which = np.full(depth.shape, -1)
        cast(
            *rays,
            boxes(middle, 0.8 * self.d / step, depth),
            centres[:kept],
            to_unit[:kept],
            depth,
            which,
        )
        return depth, frame, left


def boxes(
    middle: np.ndarray, reach: np.ndarray | float, picture: np.ndarray
) -> np.ndarray:
    """First and end of the columns and of the rows (N, 4) in which grains can be."""
    ends = (
        middle[:, :, None]
        + np.multiply.outer(reach, [-1, 1]).reshape(-1, 1, 2)
        + [0, 1]
    )
    return (
        np.clip(ends, 0, np.array(picture.shape[1::-1])[:, None])
        .astype(np.int64)
        .reshape(-1, 4)
    )


def truth(
    scene: Scene, settings: MeasureSettings, step: float = 0.2
) -> tuple[float, float, float]:
    """Angle by the program's own measurement of the side view without perspective, by a fit of our own, and Height."""
    depth, _, left = scene.parallel(scene.facing, step, scene.grains[2])
    plate = round(-left / step)
    seen = np.isfinite(depth[:plate])
    tops = np.where(seen.any(axis=0), plate - seen.argmax(axis=0), 0)
    crest = int(tops.argmax())
    at = np.arange(len(tops))
    sides = [np.flatnonzero((tops > 0) & part) for part in (at <= crest, at >= crest)]
    refitted = float(
        np.degrees(
            np.arctan([abs(np.polyfit(side, tops[side], 1)[0]) for side in sides])
        ).mean()
    )
    measurement = measure_image(
        np.where(seen, 40, 255).astype(np.uint8), step, settings, base_row=plate - 0.5
    )
    return measurement.aor_deg, refitted, measurement.height_mm


def surface(
    scene: Scene, name: str, u: np.ndarray, v: np.ndarray, key: int
) -> np.ndarray:
    """Colours (N, 3) of paper, wood or cloth at places in mm."""
    rng = np.random.default_rng([scene.seed, key])
    kind, first, second = SURFACES[name]
    turn = rng.uniform(0, np.pi)
    x = np.cos(turn) * u + np.sin(turn) * v
    y = np.cos(turn) * v - np.sin(turn) * u
    broad, long, fine = (  # between -1 and 1, over lattices without ends
        map_coordinates(
            rng.uniform(-1, 1, (97, 89)).astype(np.float32),
            (x / a, y / b),
            order=1,
            mode="grid-wrap",
        )
        for a, b in ((60, 40), (40, 6), (12, 0.8))
    )
    if kind == "wood":
        share = 0.5 + 0.5 * np.sin(y / 4 + 4 * broad + long)
        tone = 1 + scene.texture * (0.08 * long + 0.07 * fine)
    elif kind == "cloth":
        weave = np.sin(2 * np.pi * x / 1.6) * np.sin(2 * np.pi * y / 1.6)
        share = 0.5 + 0.5 * fine
        tone = 1 + scene.texture * (0.12 * weave + 0.08 * broad)
    else:
        share = 0.5 + 0.5 * broad
        tone = 1 + 0.01 * long
    return (
        light_of(np.array(first) + share[:, None] * np.subtract(second, first))
        * tone[:, None]
    )


def light_of(tones: np.ndarray) -> np.ndarray:
    """Light, 0 to 255, that a camera turns into tones."""
    return 255 * (np.asarray(tones) / 255) ** TONE_CURVE


def traced(
    scene: Scene, first: np.ndarray, step: float, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Light (H, W, 3) that comes along rays `step` pixels apart from pixel `first`, and which grain shows."""
    eye = scene.eye
    turn = scene.turn
    still = np.zeros(3)
    across = (first - 0.5 * np.array(SIZE) + 0.5) / scene.focal
    way = np.array([turn[2] + across @ turn[:2], *(step / scene.focal * turn[:2])])
    columns, rows = np.meshgrid(*map(np.arange, size))
    rays = way[0] + columns[..., None] * way[1] + rows[..., None] * way[2]
    to_plate = -eye[2] / np.minimum(rays[..., 2], -1e-9)
    to_wall = (scene.wall_at - eye[1]) / rays[..., 1]
    depth = np.minimum(to_plate, to_wall)
    which = np.where(to_plate < to_wall, -1, -2)
    centres, to_unit, _ = scene.grains
    place, distances = scene.seen(centres)
    parts = boxes(
        (place - first) / step, 0.9 * scene.d * scene.focal / distances / step, depth
    )
    cast(np.array([eye, still, still]), way, parts, centres, to_unit, depth, which)
    at = (eye + depth[..., None] * rays).reshape(-1, 3)
    which = which.ravel()
    normal = np.array([[0, -1.0, 0], [0, 0, 1.0]])[np.minimum(which, -1) + 2]
    colour = np.empty(at.shape)
    for code, name, axes in ((-1, scene.plate, [0, 1]), (-2, scene.wall, [0, 2])):
        colour[which == code] = surface(
            scene, name, *at[which == code][:, axes].T, 3 - code
        )
    rng = np.random.default_rng([scene.seed, 6])
    on = which >= 0
    tints = (
        light_of(GRAINS[scene.grain])
        * rng.normal(1, (0.09,) + 3 * (0.03,), (len(centres), 4))[:, 1:]
    )
    local = np.einsum("nij,nj->ni", to_unit[which[on]], at[on] - centres[which[on]])
    colour[on] = tints[which[on]] * (
        1 + 0.08 * np.sin(5 * local[:, :1] + 4 * local[:, 1:2])
    )
    normal[on] = np.einsum("nij,ni->nj", to_unit[which[on]], local)
    normal[on] /= np.linalg.norm(normal[on], axis=1, keepdims=True)
    shape = size[::-1]
    return (colour * scene.light(at, normal)[:, None]).reshape(*shape, 3).astype(
        np.float32
    ), which.reshape(shape)


def photograph(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """The photograph (H, W, 3) uint8, blue first, and the share of each pixel that shows the heap."""
    rng = np.random.default_rng([scene.seed, 2])
    picture, _ = traced(scene, np.zeros(2), 1, np.array(SIZE))
    gain = min(
        light_of(scene.exposed) / picture.mean(),
        240 / np.quantile(picture[::9, ::9], 0.995),
    )
    page = sheet.draw_sheet()
    wide, tall = sheet.compute_size_mm()
    turn = [np.cos(scene.yaw), np.sin(scene.yaw), 0]
    corners = np.array([scene.left, 0, 0]) + np.outer(
        [0, 1, 1, 0], np.multiply(wide, turn)
    )
    corners[:2, 2] = tall
    page = cv2.GaussianBlur(
        page, (0, 0), 0.5 * len(page) * scene.away / (tall * scene.focal)
    ) * np.float32(0.75 / gain)
    page, is_page = pinhole.warped(page, scene.seen(corners)[0], SIZE)
    picture = (1 - is_page) * picture + page + 6 * is_page
    place, _ = scene.seen(scene.grains[0][: scene.number])
    # the part of the photograph with the heap, which is traced finer
    first = (place.min(0) - 2 * scene.grain_px).astype(int)
    end = (place.max(0) + 2 * scene.grain_px).astype(int)
    fine, which = traced(
        scene, first - 0.5 + 0.5 / FINER, 1 / FINER, FINER * (end - first)
    )
    heap = np.zeros(SIZE[::-1], np.float32)
    window = np.s_[first[1] : end[1], first[0] : end[0]]
    for whole, part in (
        (picture, fine),
        (heap, np.float32((which >= 0) & (which < scene.number))),
    ):
        whole[window] = cv2.resize(part, end - first, interpolation=cv2.INTER_AREA)
    light = cv2.GaussianBlur(gain * picture, (0, 0), scene.blur)
    picture = 255 * (np.maximum(light, 0) / 255) ** (1 / TONE_CURVE) + rng.normal(
        0, scene.noise, picture.shape
    )
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8), heap


def outcome(
    scene: Scene, folder: Path
) -> tuple[photographs.Photograph, tuple[float, float, float]]:
    """The photograph of a scene, measured, and the truth; what was found in it lies beside it."""
    settings = MeasureSettings.with_defaults(berry_height_mm=scene.d)
    # half of the cameras state their focal length
    focal = scene.focal / SIZE[0] if scene.stated else None
    path = sixty.saved(
        folder / f"{scene.seed}.jpg", lambda: photograph(scene)[0], focal, quality=92
    )
    found = photographs.measure_photographs([path], settings, photographs.Scale())[0]
    sixty.show(found, path)
    return found, truth(scene, settings)
