"""Fill the mesh of a grain with overlapping spheres: a clump for the simulation."""

import math
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from scipy.stats import qmc

from repose.common.errors import InputError
from repose.dem.kernels.state import MOST_SPHERES
from repose.grain.particle import MM, SURFACES

# Search for the fewest spheres: the range of numbers to try, and the allowed relative
# differences from the volume and the shortest axis of the mesh
FEWEST = "fewest"
LOWEST_COUNT = 14
HIGHEST_COUNT = 60
VOLUME_TOLERANCE = 0.02
SHORTEST_AXIS_TOLERANCE = 0.03
# A volume is quick to estimate if the number of points is divided by
# `SCREENING_REDUCTION`. The estimate is accurate enough to reject a packing whose
# volume differs by more than `SCREENING_TOLERANCE`.
SCREENING_TOLERANCE = 0.03
SCREENING_REDUCTION = 16

# Placement of spheres; the unit of length is the radius of the largest inscribed ball
# A further sphere must lower the mean squared gap by the square of this length.
SMALLEST_GAIN = 1e-4
SMALLEST_BALL = 0.25  # smallest radius in a smooth packing
ROUGH_RADIUS = 0.62  # radius of all spheres in a rough packing
# Smallest distance between centres in a smooth packing. Two spheres at nearly the same
# place would act like a single stiffer sphere.
SPACING = 0.35
MAX_EXCHANGES = 3  # largest number of rounds in which single balls are exchanged
# Margin around a mesh for the growth of its spheres, over the mesh's largest coordinate
GROWTH_MARGIN = 0.2

N_CANDIDATES = 3000  # approximate number of balls from which a packing is chosen
N_SURFACE_POINTS = 1500
N_VOLUME_POINTS = 2**17
# Number of parts in which the points for a volume are processed, to save memory
N_CHUNKS = 16
# Largest number of distances between points and faces that are computed at once
DISTANCES_PER_CHUNK = 2_000_000


@dataclass(frozen=True, eq=False)
class Packing:
    """A clump of spheres that fills a mesh."""

    spheres_m: np.ndarray  # (M, 4), x, y, z, radius
    volume_m3: float  # of the union of the spheres
    deviation_max_m: float  # largest distance between the surfaces of mesh and union
    deviation_rms_m: float  # root mean square of these distances


def pack(
    mesh: trimesh.Trimesh,
    count: int | str = 14,
    surface: str = "smooth",
    source: object = "mesh",
) -> Packing:
    """Fill a mesh with overlapping spheres, so that their union represents the grain.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm, nearly convex, with its centre at the origin.
    count : int or str
        Number of spheres, or "fewest" for as few as represent the mesh.
    surface : str
        Kind of surface. "smooth": balls of any radius are placed inside the mesh, and
        then all radii grow by the same amount, so that the union has the volume of the
        mesh. "rough": balls of equal radius touch the surface from inside.
        "rough_full": balls as for "rough", which then grow as for "smooth".
    source : object
        The mesh's file, for messages.

    Returns
    -------
    Packing
        The spheres in m, and their deviations from the mesh.

    Raises
    ------
    InputError
        If `count` or `surface` is not an allowed value, or if no number of spheres is
        enough for "fewest".
    """
    is_number = isinstance(count, int) and 1 <= count <= MOST_SPHERES
    if not is_number and count != FEWEST:
        # The message names the key `spheres` of the configuration.
        allowed = f"a whole number from 1 to {MOST_SPHERES} or {FEWEST}"
        raise InputError(source, "spheres", count, allowed)
    if surface not in SURFACES:
        raise InputError(source, "surface", surface, ", ".join(SURFACES))

    packer = _SpherePacker(mesh, surface)
    if isinstance(count, int):
        spheres = packer.pack(count)
    else:
        spheres = packer.pack_fewest(source)

    # Measure how far points on the surface of the mesh are from that of the union.
    gaps = compute_union_distances(spheres, packer.surface_points)
    # Round to nanometres, because further digits depend on rounding errors.
    return Packing(
        spheres_m=np.round(spheres * MM, 9),
        volume_m3=compute_union_volume(spheres, packer.box) * MM**3,
        deviation_max_m=float(np.abs(gaps).max()) * MM,
        deviation_rms_m=float(np.sqrt(np.mean(gaps**2))) * MM,
    )


class _SpherePacker:
    """Packer of spheres for one mesh and one kind of surface. All lengths are in mm.

    Parameters
    ----------
    mesh : Trimesh
        The mesh, nearly convex, with its centre at the origin.
    surface : str
        Kind of surface, see `pack`.
    """

    def __init__(self, mesh: trimesh.Trimesh, surface: str) -> None:
        """Sample the surface, and find the balls from which a packing is chosen."""
        self.mesh = mesh
        self.surface = surface
        self.surface_points, self.normals = sample_surface(mesh)
        self.centres, self.depths = _find_candidate_balls(mesh, self.surface_points)
        self.box = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])

    def place_spheres(self, count: int) -> np.ndarray:
        """Return at most `count` spheres (M, 4) inside the mesh, before they grow."""
        if self.surface == "smooth":
            return _choose_balls(self.centres, self.depths, self.surface_points, count)
        radius = ROUGH_RADIUS * self.depths.max()
        return _place_equal_balls(self.surface_points, self.normals, radius, count)

    def pack(self, count: int) -> np.ndarray:
        """Pack at most `count` spheres (M, 4), whose union has the volume of the mesh.

        To reach this volume, the spheres grow, unless the surface is "rough".
        """
        spheres = self.place_spheres(count)
        if self.surface != "rough":
            spheres[:, 3] += _find_growth(spheres, self.mesh, self.box)
        return spheres

    def pack_fewest(self, source: object) -> np.ndarray:
        """Find the fewest spheres whose union nearly has the size of the mesh.

        Its volume and its extent along the shortest axis must be within the tolerances.
        The numbers of spheres from `LOWEST_COUNT` to `HIGHEST_COUNT` are tried in
        ascending order. The spheres of the result have been enlarged already, unless
        the surface is "rough".

        Parameters
        ----------
        source : object
            The mesh's file, for messages.

        Returns
        -------
        ndarray
            Centres and radii (M, 4) in mm.

        Raises
        ------
        InputError
            If none of these numbers of spheres is enough.
        """
        for count in range(LOWEST_COUNT, HIGHEST_COUNT + 1):
            spheres = self.place_spheres(count)
            # In a smooth packing, there may be no room for that many spheres. Then
            # larger numbers need not be tried.
            if len(spheres) < count:
                break
            grown = self._grow_within_tolerances(spheres)
            if grown is not None:
                return grown
        allowed = (
            f"a number: no union of {LOWEST_COUNT} to {HIGHEST_COUNT} {self.surface} "
            f"spheres is within {VOLUME_TOLERANCE:.0%} of the mesh's volume and "
            f"{SHORTEST_AXIS_TOLERANCE:.0%} of its shortest axis"
        )
        raise InputError(source, "spheres", FEWEST, allowed)

    def _grow_within_tolerances(self, spheres: np.ndarray) -> np.ndarray | None:
        """Enlarge spheres to the volume of the mesh, and check the result.

        They are enlarged less if their union would become too thick along the shortest
        axis of the mesh. If the surface is "rough", nothing is enlarged, and the given
        spheres are checked.

        Parameters
        ----------
        spheres : ndarray
            Centres and radii (M, 4) in mm.

        Returns
        -------
        ndarray or None
            The enlarged spheres; None if the volume of their union, or its extent along
            the shortest axis, is outside the tolerances.
        """
        mesh_extents = np.ptp(self.box, axis=0)
        shortest_axis = int(mesh_extents.argmin())
        shortest_extent = mesh_extents[shortest_axis]
        mesh_volume = abs(self.mesh.volume)

        # Find the growth at which the union reaches the largest allowed extent along
        # the shortest axis. When all radii grow, the union grows at both ends of the
        # axis.
        largest_extent = (1 + SHORTEST_AXIS_TOLERANCE) * shortest_extent
        largest_growth = (largest_extent - _measure_extent(spheres, shortest_axis)) / 2

        # Estimate the volume with few points first. This is much faster and is enough
        # to reject most packings. The second pass uses all points, and its spheres are
        # the result.
        for n_points, tolerance in (
            (N_VOLUME_POINTS // SCREENING_REDUCTION, SCREENING_TOLERANCE),
            (N_VOLUME_POINTS, VOLUME_TOLERANCE),
        ):
            grown_spheres = spheres.copy()
            if self.surface != "rough":
                growth = _find_growth(spheres, self.mesh, self.box, n_points)
                grown_spheres[:, 3] += min(growth, largest_growth)
            volume = compute_union_volume(grown_spheres, self.box, n_points)
            if abs(volume / mesh_volume - 1) > tolerance:
                return None

        # If the growth was limited, the extent is exactly at its limit. The 1e-9 allows
        # for rounding errors.
        extent = _measure_extent(grown_spheres, shortest_axis)
        if abs(extent / shortest_extent - 1) > SHORTEST_AXIS_TOLERANCE + 1e-9:
            return None
        return grown_spheres


def _measure_extent(spheres: np.ndarray, axis: int) -> float:
    """Measure the length of a union of spheres (M, 4) along an axis."""
    upper = np.max(spheres[:, axis] + spheres[:, 3])
    lower = np.min(spheres[:, axis] - spheres[:, 3])
    return float(upper - lower)


def sample_surface(
    mesh: trimesh.Trimesh, count: int = N_SURFACE_POINTS
) -> tuple[np.ndarray, np.ndarray]:
    """Distribute points evenly over the surface of a mesh.

    The points are the same in each call. All faces get points in proportion to their
    area.

    Parameters
    ----------
    mesh : Trimesh
        The mesh.
    count : int
        Number of points.

    Returns
    -------
    points : ndarray
        The points, an array (count, 3).
    normals : ndarray
        The outward normals of the surface at these points, an array (count, 3).
    """
    # The Halton sequence gives evenly spread numbers (count, 3) between 0 and 1. Skip
    # its first row, which is three zeros.
    numbers = qmc.Halton(3, scramble=False).random(count + 1)[1:]
    # The first number chooses the face, in proportion to its area. Because of rounding
    # errors, the search could return one face too many, so limit the index.
    cumulated_areas = np.cumsum(mesh.area_faces)
    chosen_faces = np.searchsorted(cumulated_areas, numbers[:, 0] * cumulated_areas[-1])
    faces = np.minimum(chosen_faces, len(cumulated_areas) - 1)
    # The other two numbers give the weights of the corners of the face. Because of the
    # square root, the points lie evenly over the area of the face.
    root = np.sqrt(numbers[:, 1:2])
    share = numbers[:, 2:]
    weights = np.hstack([1 - root, root * (1 - share), root * share])
    points = np.einsum("nk,nki->ni", weights, mesh.triangles[faces])
    return points, mesh.face_normals[faces]


def _find_candidate_balls(
    mesh: trimesh.Trimesh, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the largest ball inside a mesh around each point of a grid.

    Only points inside the mesh get a ball. The mesh must be nearly convex, because
    distances are measured from its convex hull.

    Parameters
    ----------
    mesh : Trimesh
        The mesh, nearly convex, with its centre at the origin.
    points : ndarray
        Points (P, 3) on the surface of the mesh, close to each other.

    Returns
    -------
    centres : ndarray
        Centres (N, 3) of the balls.
    radii : ndarray
        Radii (N,) of the balls.
    """
    # Make a grid of points in the box around the mesh, one of which is the origin.
    # About `N_CANDIDATES` points lie inside the mesh.
    spacing = np.cbrt(mesh.volume / N_CANDIDATES)
    lowest = mesh.vertices.min(axis=0) / spacing
    highest = mesh.vertices.max(axis=0) / spacing
    coordinates = [
        spacing * np.arange(math.ceil(low), math.floor(high) + 1)
        for low, high in zip(lowest, highest, strict=True)
    ]
    grid = np.stack(np.meshgrid(*coordinates, indexing="ij"), axis=-1).reshape(-1, 3)

    # The depth of a point is its distance below the nearest face of the convex hull. It
    # is negative outside the hull. Process the points in chunks, because an array of
    # all points times all faces of a scan would take gigabytes.
    hull = mesh.convex_hull
    # Distances of the planes of the faces from the origin, along their normals
    plane_distances = np.einsum("fi,fi->f", hull.face_normals, hull.triangles[:, 0])
    n_chunks = 1 + len(grid) * len(plane_distances) // DISTANCES_PER_CHUNK
    chunk_depths = [
        (plane_distances - chunk @ hull.face_normals.T).min(axis=1)
        for chunk in np.array_split(grid, n_chunks)
    ]
    depths = np.concatenate(chunk_depths)
    is_inside = depths > 0
    centres = grid[is_inside]

    # In a dent, the surface of the mesh is nearer than the hull. The distance from the
    # surface points limits the radii there.
    surface_distances, _ = cKDTree(points).query(centres)
    return centres, np.minimum(depths[is_inside], surface_distances)


def compute_union_distances(spheres: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Compute the signed distances of points from the surface of a union of spheres.

    Parameters
    ----------
    spheres : ndarray
        Centres and radii (M, 4).
    points : ndarray
        The points (N, 3).

    Returns
    -------
    ndarray
        The distances (N,). They are negative inside the union, where their absolute
        values are only lower bounds of the true distances.
    """
    offsets = points[:, None, :] - spheres[None, :, :3]
    return (np.linalg.norm(offsets, axis=2) - spheres[:, 3]).min(axis=1)


def compute_union_volume(
    spheres: np.ndarray, box: np.ndarray, count: int = N_VOLUME_POINTS
) -> float:
    """Estimate the volume of a union of spheres by counting the points inside it.

    The points fill a box evenly, and are the same in each call. With the default number
    of points, the error is below 0.2 % for unions of up to 60 spheres, as a test shows.

    Parameters
    ----------
    spheres : ndarray
        Centres and radii (M, 4).
    box : ndarray
        Lower and upper corner (2, 3) of a box. If it does not contain the whole union,
        it is enlarged.
    count : int
        Number of points.

    Returns
    -------
    float
        The volume, in the unit of the spheres cubed.
    """
    centres = spheres[:, :3]
    radii = spheres[:, 3:]
    low = np.minimum(box[0], (centres - radii).min(axis=0))
    high = np.maximum(box[1], (centres + radii).max(axis=0))
    points = low + (high - low) * qmc.Halton(3, scramble=False).random(count)
    n_inside = 0
    for chunk in np.array_split(points, N_CHUNKS):
        n_inside += int(np.count_nonzero(compute_union_distances(spheres, chunk) < 0))
    return n_inside / count * float(np.prod(high - low))


def _find_growth(
    spheres: np.ndarray,
    mesh: trimesh.Trimesh,
    box: np.ndarray,
    count: int = N_VOLUME_POINTS,
) -> float:
    """Find the growth of all radii that gives the union the volume of the mesh.

    The grown union contains exactly those points whose distance from the original union
    is less than the growth. Points are spread evenly over a box around the mesh. The
    fraction of these points in the grown union must equal the fraction of the box that
    the mesh fills. Therefore the growth is a quantile of the distances.

    Parameters
    ----------
    spheres : ndarray
        Centres and radii (M, 4) in mm.
    mesh : Trimesh
        The mesh in mm.
    box : ndarray
        Lower and upper corner (2, 3) of the mesh.
    count : int
        Number of points. They are the same in each call.

    Returns
    -------
    float
        The growth in mm; negative if the radii must shrink.
    """
    # The grown spheres may extend beyond the mesh, so the box gets a margin.
    margin = GROWTH_MARGIN * np.abs(box).max()
    low = box[0] - margin
    high = box[1] + margin
    points = low + (high - low) * qmc.Halton(3, scramble=False).random(count)
    # An array of all points times all spheres would take much memory.
    chunk_distances = [
        compute_union_distances(spheres, chunk)
        for chunk in np.array_split(points, N_CHUNKS)
    ]
    distances = np.concatenate(chunk_distances)
    mesh_share = mesh.volume / np.prod(high - low)
    return float(np.quantile(distances, mesh_share))


def _choose_balls(
    centres: np.ndarray, radii: np.ndarray, points: np.ndarray, count: int
) -> np.ndarray:
    """Choose inscribed balls whose union has a surface near that of a mesh.

    Parameters
    ----------
    centres : ndarray
        Centres (N, 3) of the candidates.
    radii : ndarray
        Radii (N,) of the candidates.
    points : ndarray
        Points (P, 3) on the surface of the mesh.
    count : int
        Largest number of balls. Fewer are chosen if a further ball would gain little.

    Returns
    -------
    ndarray
        Centres and radii (M, 4) of the chosen balls.
    """
    # Leave out small balls.
    largest_radius = radii.max()
    is_large = radii > SMALLEST_BALL * largest_radius
    centres = centres[is_large]
    radii = radii[is_large]

    # Compute the gap between each surface point and each ball (P, N), and find out
    # which pairs of balls are far enough apart (N, N).
    gaps = np.linalg.norm(points[:, None, :] - centres[None], axis=2) - radii
    squared_gaps = np.square(gaps).astype(np.float32)
    centre_distances = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    is_separated = centre_distances >= SPACING * largest_radius

    # Add the best remaining ball again and again, until a further one would gain
    # little.
    smallest_gain = (SMALLEST_GAIN * largest_radius) ** 2
    chosen: list[int] = []
    best_score = np.inf
    for _ in range(count):
        scores = _score_candidates(squared_gaps, is_separated, chosen)
        if best_score - scores.min() < smallest_gain:
            break
        best_score = scores.min()
        chosen.append(int(scores.argmin()))

    # Replace single balls by better ones, until a round changes nothing.
    for _ in range(MAX_EXCHANGES):
        previously_chosen = list(chosen)
        for index in range(len(chosen)):
            other_balls = chosen[:index] + chosen[index + 1 :]
            scores = _score_candidates(squared_gaps, is_separated, other_balls)
            if scores.min() < scores[chosen[index]]:
                chosen[index] = int(scores.argmin())
        if chosen == previously_chosen:
            break
    return np.column_stack([centres[chosen], radii[chosen]])


def _score_candidates(
    squared_gaps: np.ndarray, is_separated: np.ndarray, chosen: list[int]
) -> np.ndarray:
    """Compute the score of each candidate for the next ball; the lowest is the best.

    The score is the mean squared gap between the surface and the nearest ball after the
    candidate has joined the chosen balls. It is infinite for a candidate that is too
    close to a chosen ball.

    Parameters
    ----------
    squared_gaps : ndarray
        Squared gap (P, N) between each surface point and each candidate.
    is_separated : ndarray
        Whether two candidates (N, N) are far enough apart.
    chosen : list of int
        Indices of the balls chosen so far.

    Returns
    -------
    ndarray
        The scores (N,).
    """
    if not chosen:
        return squared_gaps.mean(axis=0)
    smallest_chosen_gap = squared_gaps[:, chosen].min(axis=1)[:, None]
    scores = np.minimum(smallest_chosen_gap, squared_gaps).mean(axis=0)
    return np.where(is_separated[chosen].all(axis=0), scores, np.inf)


def _place_equal_balls(
    points: np.ndarray, normals: np.ndarray, radius: float, count: int
) -> np.ndarray:
    """Place balls of one radius so that each of them touches a surface from inside.

    The first ball is the one whose centre has the largest x. The centre of each further
    ball is as far as possible from all previous centres.

    Parameters
    ----------
    points, normals : ndarray
        Points and outward normals (P, 3) of the surface.
    radius : float
        Radius of the balls.
    count : int
        Number of balls.

    Returns
    -------
    ndarray
        Centres and radii (count, 4).
    """
    # A ball whose centre is one radius below a surface point touches the surface there.
    centres = points - radius * normals
    first = int(np.argmax(centres[:, 0]))
    chosen = [first]
    # Distance of each possible centre from the nearest chosen centre
    distances = np.linalg.norm(centres - centres[first], axis=1)
    while len(chosen) < count:
        farthest = int(distances.argmax())
        chosen.append(farthest)
        distances_from_new = np.linalg.norm(centres - centres[farthest], axis=1)
        distances = np.minimum(distances, distances_from_new)
    return np.column_stack([centres[chosen], np.full(count, radius)])
