"""A mesh filled with spheres: the rigid clump of multi-sphere programs.

"smooth": few large overlapping balls, inscribed in the mesh. A greedy search adds the ball that lowers the mean squared
distance of the mesh's surface from the balls most, then exchanges single balls for better ones; at last all radii grow
by one length until the union has the mesh's volume. "rough": balls of one smaller radius that touch the surface from
inside, as far apart as possible, with bumps between them; their union holds less than the mesh. "rough_full": the same,
grown until the union has the mesh's volume. Nothing is random.

"fewest" sets the number of spheres: the fewest, from 14 to 60, whose union is within 2 % of the mesh's volume and
within 3 % of its shortest axis; they grow no further than these 3 % allow. Spheres that act at the same place add up in
stiffness, so a clump of many spheres needs a shorter time step, see `repose.dem.time_steps`.
"""

import math
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from scipy.stats import qmc

from repose.common.errors import InputError, require
from repose.dem.kernels.state import MOST_SPHERES
from repose.grain.particle import MM, SURFACES

FEWEST = "fewest"
FEWEST_FROM, FEWEST_TO = 14, 60
NEAR_VOLUME, NEAR_SHORTEST_AXIS = 0.02, 0.03
# A further sphere has to lower the rms distance of the surface by this share of the mean radius.
SMALLEST_GAIN = 1e-4
ROUGH_SHARE = 0.62  # radius of a rough clump's spheres over the radius of the largest inscribed ball
CANDIDATES, SURFACE_POINTS, VOLUME_POINTS = 3000, 1500, 2**17
# A union whose volume is further off than this, by a sixteenth of the points, is not calculated with all points.
SCREENED = 0.03
# Centres of a smooth packing keep this distance, over the radius of the largest inscribed ball: spheres side by side
# would act as one stiffer sphere.
SPACING = 0.35


@dataclass(frozen=True, eq=False)
class Packing:
    """A clump of spheres that fills a mesh."""

    spheres_m: np.ndarray  # (M, 4), x, y, z, radius
    volume_m3: float  # of the union of the spheres
    deviation_max_m: float  # distance of the mesh's surface from the union
    deviation_rms_m: float  # likewise


def pack(
    mesh: trimesh.Trimesh,
    count: int | str = 14,
    surface: str = "smooth",
    source: object = "mesh",
) -> Packing:
    """Fill a mesh (mm, nearly convex, centred) with spheres."""
    allowed = f"a whole number from 1 to {MOST_SPHERES} or {FEWEST}"
    good = count == FEWEST or (isinstance(count, int) and 1 <= count <= MOST_SPHERES)
    require(good, source, "spheres", count, allowed)
    require(surface in SURFACES, source, "surface", surface, ", ".join(SURFACES))
    filling = _Filling(mesh, surface)
    spheres = filling.grown(count) if isinstance(count, int) else filling.fewest(source)
    gaps = distances(spheres, filling.points)
    return Packing(
        spheres_m=np.round(spheres * MM, 9),
        volume_m3=union_volume(spheres, filling.box) * MM**3,
        deviation_max_m=float(np.abs(gaps).max()) * MM,
        deviation_rms_m=float(np.sqrt(np.mean(gaps**2))) * MM,
    )


class _Filling:
    """Fillings of one mesh with one kind of surface."""

    def __init__(self, mesh: trimesh.Trimesh, surface: str) -> None:
        self.mesh, self.surface = mesh, surface
        self.points, self.normals = surface_points(mesh)
        self.centres, self.depths = _inside(mesh, self.points)
        self.box = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])

    def placed(self, count: int) -> np.ndarray:
        """Place spheres (M, 4) inside the mesh, before they grow."""
        if self.surface == "smooth":
            return _cover(self.centres, self.depths, self.points, count)
        return _bumps(self.points, self.normals, ROUGH_SHARE * self.depths.max(), count)

    def grown(self, count: int) -> np.ndarray:
        """Fill the mesh with at most `count` spheres (M, 4)."""
        spheres = self.placed(count)
        if self.surface != "rough":
            spheres[:, 3] += _growth(spheres, self.mesh, self.box)
        return spheres

    def fewest(self, source: object) -> np.ndarray:
        """Find the fewest spheres (M, 4) with about the mesh's volume and shortest axis."""
        extents = np.ptp(self.box, axis=0)
        shortest, volume = int(extents.argmin()), abs(self.mesh.volume)
        for count in range(FEWEST_FROM, FEWEST_TO + 1):
            spheres = self.placed(count)
            if len(spheres) < count:
                break
            room = (1 + NEAR_SHORTEST_AXIS) * extents[shortest] - _extent(
                spheres, shortest
            )
            for points, near in (
                (VOLUME_POINTS // 16, SCREENED),
                (VOLUME_POINTS, NEAR_VOLUME),
            ):
                tried = spheres.copy()
                if self.surface != "rough":
                    tried[:, 3] += min(
                        _growth(spheres, self.mesh, self.box, points), room / 2
                    )
                if abs(union_volume(tried, self.box, points) / volume - 1) > near:
                    break
            else:
                if (
                    abs(_extent(tried, shortest) / extents[shortest] - 1)
                    <= NEAR_SHORTEST_AXIS + 1e-9
                ):
                    return tried
        allowed = (
            f"a number: no union of {FEWEST_FROM} to {FEWEST_TO} {self.surface} spheres is within "
            f"{NEAR_VOLUME:.0%} of the mesh's volume and {NEAR_SHORTEST_AXIS:.0%} of its shortest axis"
        )
        raise InputError(source, "spheres", FEWEST, allowed)


def _extent(spheres: np.ndarray, axis: int) -> float:
    """Measure the length of a union of spheres along an axis."""
    return float(
        np.max(spheres[:, axis] + spheres[:, 3])
        - np.min(spheres[:, axis] - spheres[:, 3])
    )


def surface_points(
    mesh: trimesh.Trimesh, count: int = SURFACE_POINTS
) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals (count, 3) evenly over a mesh's area; the same every time."""
    cumulated = np.cumsum(mesh.area_faces)
    draws = qmc.Halton(3, scramble=False).random(count + 1)[1:]
    face = np.minimum(
        np.searchsorted(cumulated, draws[:, 0] * cumulated[-1]), len(cumulated) - 1
    )
    root = np.sqrt(draws[:, 1:2])
    weights = np.hstack([1 - root, root * (1 - draws[:, 2:]), root * draws[:, 2:]])
    return np.einsum("nk,nki->ni", weights, mesh.triangles[face]), mesh.face_normals[
        face
    ]


def _inside(mesh: trimesh.Trimesh, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find candidate centres (N, 3) in a mesh, on a grid symmetric about the origin, and their depths (N,)."""
    spacing = np.cbrt(mesh.volume / CANDIDATES)
    ends = zip(
        mesh.vertices.min(axis=0) / spacing,
        mesh.vertices.max(axis=0) / spacing,
        strict=True,
    )
    lines = [
        spacing * np.arange(math.ceil(first), math.floor(last) + 1)
        for first, last in ends
    ]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    hull = mesh.convex_hull
    offsets = np.einsum("fi,fi->f", hull.face_normals, hull.triangles[:, 0])
    # In chunks: all centres times all faces of a scan would fill gigabytes.
    parts = np.array_split(grid, 1 + len(grid) * len(offsets) // 2_000_000)
    inwards = np.concatenate(
        [(offsets - part @ hull.face_normals.T).min(axis=1) for part in parts]
    )
    grid, inwards = grid[inwards > 0], inwards[inwards > 0]
    # Where the surface lies below its hull, the hull's distance is too large.
    return grid, np.minimum(inwards, cKDTree(points).query(grid)[0])


def distances(spheres: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances (N,) of points (N, 3) from the union of spheres (M, 4); negative inside, where the value is a bound."""
    return (
        np.linalg.norm(points[:, None, :] - spheres[None, :, :3], axis=2)
        - spheres[:, 3]
    ).min(axis=1)


def union_volume(
    spheres: np.ndarray, box: np.ndarray, count: int = VOLUME_POINTS
) -> float:
    """Volume of the union of spheres (M, 4), by a regular sequence of points in a box (2, 3) that holds most of it.

    With the default number of points the error is below 0.2 % for unions of up to 60 spheres (tested).
    """
    reach = np.stack(
        [
            (spheres[:, :3] - spheres[:, 3:]).min(axis=0),
            (spheres[:, :3] + spheres[:, 3:]).max(axis=0),
        ]
    )
    low, high = np.minimum(box[0], reach[0]), np.maximum(box[1], reach[1])
    points = low + (high - low) * qmc.Halton(3, scramble=False).random(count)
    inside = sum(
        np.count_nonzero(distances(spheres, part) < 0)
        for part in np.array_split(points, 16)
    )
    return inside / count * float(np.prod(high - low))


def _growth(
    spheres: np.ndarray,
    mesh: trimesh.Trimesh,
    box: np.ndarray,
    count: int = VOLUME_POINTS,
) -> float:
    """Find the growth of all radii with which the union has the mesh's volume."""
    margin = 0.2 * np.abs(box).max()
    low, high = box[0] - margin, box[1] + margin
    points = low + (high - low) * qmc.Halton(3, scramble=False).random(count)
    away = np.concatenate(
        [distances(spheres, part) for part in np.array_split(points, 16)]
    )
    return float(np.quantile(away, mesh.volume / np.prod(high - low)))


def _cover(
    centres: np.ndarray, depths: np.ndarray, points: np.ndarray, count: int
) -> np.ndarray:
    """Choose at most `count` inscribed balls (M, 4) whose union comes near the surface points."""
    wide = depths > 0.25 * depths.max()
    centres, depths = centres[wide], depths[wide]
    gaps = np.linalg.norm(points[:, None, :] - centres[None], axis=2) - depths
    squares = np.square(gaps).astype(np.float32)
    separated = (
        np.linalg.norm(centres[:, None] - centres[None], axis=2)
        >= SPACING * depths.max()
    )
    least = (SMALLEST_GAIN * depths.max()) ** 2
    chosen: list[int] = []
    reached = np.inf
    for _ in range(count):
        score = _scores(squares, separated, chosen)
        if reached - score.min() < least:
            break
        reached = score.min()
        chosen.append(int(score.argmin()))
    for _ in range(3):
        before = list(chosen)
        for place in range(len(chosen)):
            score = _scores(squares, separated, chosen[:place] + chosen[place + 1 :])
            if score.min() < score[chosen[place]]:
                chosen[place] = int(score.argmin())
        if chosen == before:
            break
    return np.column_stack([centres[chosen], depths[chosen]])


def _scores(
    squares: np.ndarray, separated: np.ndarray, chosen: list[int]
) -> np.ndarray:
    """Average the squared distance of the surface from the chosen balls and each candidate (N,); inf where too near."""
    if not chosen:
        return squares.mean(axis=0)
    score = np.minimum(squares[:, chosen].min(axis=1)[:, None], squares).mean(axis=0)
    return np.where(separated[chosen].all(axis=0), score, np.inf)


def _bumps(
    points: np.ndarray, normals: np.ndarray, radius: float, count: int
) -> np.ndarray:
    """Place balls (count, 4) of one radius below the surface, each as far as possible from those before it."""
    below = points - radius * normals
    chosen = [int(np.argmax(below[:, 0]))]
    away = np.linalg.norm(below - below[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(below - below[chosen[-1]], axis=1))
    return np.column_stack([below[chosen], np.full(count, radius)])
