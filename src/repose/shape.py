"""From a mesh to the particle the simulator takes: a support function fitted to the mesh, no multi-sphere.

The support function h(n) of a body is its extent in direction n from its centre. An ellipsoid with half
axes s has h = sqrt(sum s_i^2 n_i^2), and sums of support functions are Minkowski sums: a body whose h is the
sum of a few ellipsoids with common axes is smooth, convex and closed-form. A mesh is in millimetres, all else
in metres.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.optimize import least_squares

from repose.errors import InputError

MM = 1e-3
# Longest side a mesh may have; a berry in metres (0.02) or micrometres (20000) falls outside.
EXTENT_LIMITS_MM = (0.5, 2000.0)
CONVEX_SHARE = 0.95
# Vertices this near to a quadric (of the mean radius) lie on it, but for the rounding of a file; the coarsest
# facets that still count as an ellipsoid's may cut this deep (of the mean radius).
ON_ELLIPSOID = 1e-4
COARSEST_FACET = 0.03
COMPONENTS = (1, 2, 3)
GOOD_RMS = 2e-3
LARGEST_DEVIATION = 0.15
# Sharp edges cost a smooth body volume, and with it mass.
VOLUME_TOLERANCE = 0.1
# Half axes of a fitted component, of the mean radius: a needle or a disc would have no radius of curvature,
# and the contact force would vanish with it.
AXIS_BOUNDS = (0.05, 10.0)
DIRECTIONS = 2000


@dataclass(frozen=True, eq=False)
class Particle:
    """Rigid convex particle in its body frame: principal axes, x the longest, centre of mass at the origin.

    semi_axes_m (K, 3): half axes of the K co-axial ellipsoids whose support functions add up to the body's;
    K = 1 is an ellipsoid. inertia_kg_m2 (3,): principal moments. bounding_radius_m: distance of the farthest
    point from the centre. deviation_*_m: largest and rms difference of the support values from the mesh's.
    mesh_volume_m3: volume of the mesh itself, None without one; stl: name of its file.
    """

    kind: str
    semi_axes_m: np.ndarray
    density_kg_m3: float
    volume_m3: float
    mass_kg: float
    inertia_kg_m2: np.ndarray
    bounding_radius_m: float
    deviation_max_m: float
    deviation_rms_m: float
    mesh_volume_m3: float | None = None
    stl: str = ""

    def support(self, n):
        """Support values (...) in m for directions n (..., 3), unit vectors in the body frame."""
        return _support(self.semi_axes_m, np.asarray(n, dtype=float))

    def support_point(self, n):
        """Touching points grad h (..., 3) in m for directions n (..., 3), unit vectors in the body frame."""
        return _support_point(self.semi_axes_m, np.asarray(n, dtype=float))

    def save(self, path):
        """Write the particle as JSON (lengths in mm, mass in g)."""
        record = {
            "kind": self.kind,
            "semi_axes_mm": _rounded(self.semi_axes_m / MM),
            "density_kg_m3": self.density_kg_m3,
            "volume_mm3": _rounded(self.volume_m3 / MM**3),
            "mass_g": _rounded(self.mass_kg * 1e3),
            "inertia_g_mm2": _rounded(self.inertia_kg_m2 * 1e9),
            "bounding_radius_mm": _rounded(self.bounding_radius_m / MM),
            "deviation_max_mm": _rounded(self.deviation_max_m / MM),
            "deviation_rms_mm": _rounded(self.deviation_rms_m / MM),
            "mesh_volume_mm3": _rounded(self.mesh_volume_m3 / MM**3) if self.mesh_volume_m3 else None,
            "stl": self.stl,
        }
        Path(path).write_text(json.dumps(record, indent=2) + "\n")

    @classmethod
    def load(cls, path):
        """Read what `save` wrote; raises InputError for a missing file or key."""
        if not Path(path).is_file():
            raise InputError(path, "file", None, "an existing particle file")
        record = json.loads(Path(path).read_text())
        try:
            mesh_volume = record["mesh_volume_mm3"]
            return cls(
                kind=record["kind"],
                semi_axes_m=np.array(record["semi_axes_mm"]) * MM,
                density_kg_m3=record["density_kg_m3"],
                volume_m3=record["volume_mm3"] * MM**3,
                mass_kg=record["mass_g"] * 1e-3,
                inertia_kg_m2=np.array(record["inertia_g_mm2"]) * 1e-9,
                bounding_radius_m=record["bounding_radius_mm"] * MM,
                deviation_max_m=record["deviation_max_mm"] * MM,
                deviation_rms_m=record["deviation_rms_mm"] * MM,
                mesh_volume_m3=None if mesh_volume is None else mesh_volume * MM**3,
                stl=record["stl"],
            )
        except KeyError as missing:
            raise InputError(path, missing.args[0], None, "the key in a file of `repose shape`") from None


def ellipsoid_mesh(axes_mm, subdivisions=4):
    """Watertight mesh (mm) of the ellipsoid with these full axes (3,); its vertices lie on the ellipsoid."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.5)
    mesh.apply_scale(np.asarray(axes_mm, dtype=float))
    return mesh


def load_mesh(path):
    """Mesh of a file (STL and what else trimesh reads, mm), centred and turned to its principal axes.

    Raises InputError where the file is no mesh, or the mesh is not closed, inside out, of implausible size,
    or so far from convex that no convex particle could stand for it.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "file", None, "an existing mesh file, such as an STL in millimetres")
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        raise InputError(path, "file", str(error), "a mesh that trimesh can read, such as an STL") from None
    check_mesh(mesh, path)
    return principal_pose(mesh)


def check_mesh(mesh, source):
    """InputError unless the mesh (mm) is closed, faces outwards, has a plausible size, is near-convex."""
    if len(mesh.faces) < 4:
        raise InputError(source, "faces", len(mesh.faces), "a closed surface of at least 4 faces")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(source, "vertices", "not finite", "finite coordinates in millimetres")
    longest = float(mesh.extents.max())
    low, high = EXTENT_LIMITS_MM
    if not low <= longest <= high:
        allowed = f"from {low:g} to {high:g}: is the mesh in millimetres?"
        raise InputError(source, "longest side in mm", longest, allowed)
    if not mesh.is_watertight or not mesh.is_winding_consistent:
        allowed = "a watertight surface with consistent faces; close the holes first"
        raise InputError(source, "surface", "open or inconsistent", allowed)
    if mesh.volume <= 0:
        raise InputError(
            source, "volume in mm3", float(mesh.volume), "positive; the faces must look outwards"
        )
    share = float(mesh.volume / mesh.convex_hull.volume)
    if share < CONVEX_SHARE:
        allowed = f"at least {CONVEX_SHARE:g}; the particle is convex and cannot stand for dents this deep"
        raise InputError(source, "share of its convex hull that the mesh fills", round(share, 4), allowed)


def principal_pose(mesh):
    """Copy of the mesh, centre of mass at the origin, principal axes along x (the longest), y and z."""
    # Ascending moments: the smallest belongs to the longest axis.
    axes = np.linalg.eigh(mesh.moment_inertia).eigenvectors.T
    for k in range(2):
        # One of the two signs, so that the pose does not hang on the eigenvector routine.
        axes[k] *= np.sign(axes[k, np.argmax(np.abs(axes[k]))])
    axes[2] = np.cross(axes[0], axes[1])
    posed = mesh.copy()
    posed.vertices = (mesh.vertices - mesh.center_mass) @ axes.T
    return posed


def fit_particle(mesh, density_kg_m3, stl="", source="mesh"):
    """Particle fitted to a mesh (mm, in its principal pose as `load_mesh` gives it).

    A mesh whose vertices lie on an ellipsoid is recognised as it: its facets cut into the ellipsoid, so
    volume, mass and inertia are the ellipsoid's, a little above the mesh's own. Any other is fitted by the
    sum of as few co-axial ellipsoids (up to 3) as bring the rms deviation of the support values under 0.2 %
    of the mean radius, or the best of them. Deviations include what the facets cut off.
    density_kg_m3 > 0; stl: file name to keep with the particle; source: what error messages call the mesh.
    Raises InputError where even the best is off by more than 15 % of the mean radius or 10 % of the volume.
    """
    if not (math.isfinite(density_kg_m3) and density_kg_m3 > 0):
        raise InputError(source, "density_kg_m3", density_kg_m3, "a positive number")
    n = sphere_directions(DIRECTIONS)
    measured = mesh_support(mesh, n) * MM
    radius = np.cbrt(mesh.volume * 3 / (4 * math.pi)) * MM
    semi_axes = _recognise_ellipsoid(mesh.vertices * MM, radius, n, measured)
    if semi_axes is None:
        semi_axes = _fit_components(n, measured, radius)
    # Below a nanometre lies only the rounding of the file.
    semi_axes = np.round(semi_axes, 9)
    deviation = np.abs(_support(semi_axes, n) - measured)
    volume, second_moments = _volume_integrals(semi_axes)
    _check_fit(deviation.max() / radius, volume / (mesh.volume * MM**3), source)
    inertia = density_kg_m3 * (second_moments.sum() - second_moments)
    return Particle(
        kind="ellipsoid" if len(semi_axes) == 1 else "sum_of_ellipsoids",
        semi_axes_m=semi_axes,
        density_kg_m3=float(density_kg_m3),
        volume_m3=volume,
        mass_kg=density_kg_m3 * volume,
        inertia_kg_m2=inertia,
        bounding_radius_m=_bounding_radius(semi_axes),
        deviation_max_m=float(deviation.max()),
        deviation_rms_m=float(np.sqrt(np.mean(deviation**2))),
        mesh_volume_m3=float(mesh.volume * MM**3),
        stl=str(stl),
    )


def run(berry_json, stl=None, out_dir="results/berry"):
    """Write berry.stl (mm, principal pose) and particle.json to out_dir; return the Particle.

    The mesh is the user's stl, or else the ellipsoid of the mean axes in berry_json. Either way the particle
    is fitted to the file berry.stl. Raises InputError for a bad file or mesh.
    """
    if not Path(berry_json).is_file():
        raise InputError(berry_json, "file", None, "an existing file, written by `repose berry`")
    berry = json.loads(Path(berry_json).read_text())
    axes_mm = [berry[name] for name in ("long_mm", "major_mm", "minor_mm")]
    mesh = ellipsoid_mesh(axes_mm) if stl is None else load_mesh(stl)
    out_dir = Path(out_dir)
    out_dir.mkdir(parents=True, exist_ok=True)
    target = out_dir / "berry.stl"
    mesh.export(target, file_type="stl")
    particle = fit_particle(
        load_mesh(target), berry["density_kg_m3"], stl=target.name, source=target if stl is None else stl
    )
    particle.save(out_dir / "particle.json")
    return particle


def _check_fit(relative_deviation, volume_ratio, source):
    """InputError where the fitted particle is no fair stand-in for the mesh."""
    if relative_deviation > LARGEST_DEVIATION:
        key = "largest deviation of the particle over the mesh's mean radius"
        allowed = f"at most {LARGEST_DEVIATION:g}: the particle is smooth and symmetric to three planes"
        raise InputError(source, key, round(float(relative_deviation), 3), allowed)
    if abs(volume_ratio - 1) > VOLUME_TOLERANCE:
        low, high = 1 - VOLUME_TOLERANCE, 1 + VOLUME_TOLERANCE
        allowed = f"from {low:g} to {high:g}: the particle is smooth, without edges"
        raise InputError(
            source, "volume of the particle over the mesh's", round(float(volume_ratio), 3), allowed
        )


def sphere_directions(count):
    """Evenly spread unit vectors, (count, 3): a Fibonacci lattice."""
    index = np.arange(count)
    z = 1 - (2 * index + 1) / count
    azimuth = index * math.pi * (3 - math.sqrt(5))
    ring = np.sqrt(1 - z**2)
    return np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=1)


def mesh_support(mesh, n):
    """Support values (N,) of a mesh in directions n (N, 3), in the mesh's unit."""
    vertices = np.asarray(mesh.convex_hull.vertices)
    # In chunks: a scan's hull times all directions would fill gigabytes.
    return np.concatenate([(part @ vertices.T).max(axis=1) for part in np.array_split(n, 1 + len(n) // 500)])


def _rounded(values):
    """Twelve significant digits, as float or nested lists: enough for the particle, readable in a file."""
    values = np.asarray(values, dtype=float)
    rounded = [float(f"{value:.12g}") for value in values.ravel()]
    return np.reshape(rounded, values.shape).tolist()


def _component_supports(semi_axes, n):
    """Support value of each component, (..., K); semi_axes (K, 3), n (..., 3)."""
    return np.sqrt(np.square(n) @ np.square(semi_axes).T)


def _support(semi_axes, n):
    """Support values (...) of the sum of components."""
    return _component_supports(semi_axes, n).sum(axis=-1)


def _support_point(semi_axes, n):
    """Gradient of the support function: sum over components of s^2 n / h_k; (..., 3)."""
    return n * ((1.0 / _component_supports(semi_axes, n)) @ np.square(semi_axes))


def _recognise_ellipsoid(vertices, radius, n, measured):
    """Half axes (1, 3) of the ellipsoid on which all vertices lie, None where there is none."""
    x = vertices / radius
    if len(x) < 12:
        return None
    # The general quadric x'Ax + b'x = 1, linear in its nine coefficients.
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    terms = [x[:, i] * x[:, j] * (1 if i == j else 2) for i, j in pairs]
    coefficients = np.linalg.lstsq(np.stack([*terms, *x.T], axis=1), np.ones(len(x)), rcond=None)[0]
    matrix = np.zeros((3, 3))
    for (i, j), value in zip(pairs, coefficients[:6], strict=True):
        matrix[i, j] = matrix[j, i] = value
    if np.linalg.eigvalsh(matrix).min() <= 0:
        return None
    centre = -0.5 * np.linalg.solve(matrix, coefficients[6:])
    values, vectors = np.linalg.eigh(matrix / (1 + centre @ matrix @ centre))
    # Smallest eigenvalue first: the longest axis.
    axes = 1 / np.sqrt(values)
    scaled = np.linalg.norm((x - centre) @ vectors / axes, axis=1)
    off_surface = np.abs(scaled - 1).max() * axes.max()
    coarseness = np.abs(_support(radius * axes[None], n) - measured).max()
    if off_surface > ON_ELLIPSOID or coarseness > COARSEST_FACET * radius:
        return None
    return radius * axes[None]


def _fit_components(n, measured, radius):
    """Half axes (K, 3) of the sum of co-axial ellipsoids nearest to the measured support values."""
    best, best_rms = None, math.inf
    extents = measured[np.argmax(n, axis=0)]
    for count in COMPONENTS:
        starts = _starts(count, extents, radius)
        fits = [_least_squares_fit(n, measured, radius, start) for start in starts]
        semi_axes, rms = min(fits, key=lambda fit: fit[1])
        # A further component has to earn its place.
        if rms < 0.9 * best_rms:
            best, best_rms = semi_axes, rms
        if best_rms <= GOOD_RMS * radius:
            break
    return best[np.argsort(-best[:, 0], kind="stable")]


def _starts(count, extents, radius):
    """Start values (count, 3) for the fit: the body's extents shared out in several ways."""
    if count == 1:
        return [extents[None]]
    rng = np.random.default_rng(count)
    shares = [rng.dirichlet(np.full(count, 2.0), size=3).T for _ in range(3)]
    # Needles along one axis each beside a body: what fuller or more pointed shapes than an ellipsoid want.
    for axis in range(3):
        share = np.full((count, 3), 0.1)
        share[0, axis] = 0.7
        share[-1] = 1 - share[:-1].sum(axis=0)
        shares.append(share)
    low, high = (1.01 * AXIS_BOUNDS[0] * radius, 0.99 * AXIS_BOUNDS[1] * radius)
    return [np.clip(share * extents, low, high) for share in shares]


def _least_squares_fit(n, measured, radius, start):
    """(half axes (K, 3), rms deviation) of the local fit from start, over the logarithms of the axes."""
    squares = np.square(n)

    def residuals(logs):
        return _support(np.exp(logs).reshape(start.shape), n) - measured / radius

    def jacobian(logs):
        semi_axes = np.exp(logs).reshape(start.shape)
        values = _component_supports(semi_axes, n)
        # d h_k / d log s_ki = s_ki^2 n_i^2 / h_k
        return (np.square(semi_axes)[None] * squares[:, None, :] / values[:, :, None]).reshape(len(n), -1)

    bounds = np.log(AXIS_BOUNDS)
    logs = np.clip(np.log(start / radius).ravel(), *bounds)
    fit = least_squares(residuals, logs, jac=jacobian, bounds=tuple(bounds), max_nfev=200)
    return radius * np.exp(fit.x).reshape(start.shape), radius * math.sqrt(np.mean(fit.fun**2))


def _surface_quadrature(latitudes=200, longitudes=250):
    """(directions (N, 3), weights of dOmega (N,)) for functions that are even in x, y and z.

    Gauss-Legendre along x, equal steps around it. One octant stands for all eight.
    """
    u, du = np.polynomial.legendre.leggauss(latitudes)
    u, du = (u + 1) / 2, du / 2
    azimuth = 0.5 * math.pi * (np.arange(longitudes) + 0.5) / longitudes
    ring = np.sqrt(1 - u**2)[:, None]
    n = np.stack(np.broadcast_arrays(u[:, None], ring * np.cos(azimuth), ring * np.sin(azimuth)), axis=-1)
    weights = np.repeat(du * 4 * math.pi / longitudes, longitudes)
    return n.reshape(-1, 3), weights


def _volume_integrals(semi_axes):
    """(volume (m3), integrals of x_i^2 over the body (3,) (m5)); semi_axes (K, 3) in m.

    The body is the union of cones from its centre over the surface x(n) = grad h, whose element of area is
    det Q dOmega, Q = grad grad h on the tangent plane: V = 1/3 int h det Q dOmega, and the integral of x_i^2
    is 1/5 int x_i^2 h det Q dOmega.
    """
    if len(semi_axes) == 1:
        volume = 4 / 3 * math.pi * float(semi_axes[0].prod())
        return volume, volume / 5 * np.square(semi_axes[0])
    n, weights = _surface_quadrature()
    values = _component_supports(semi_axes, n)
    points = n[:, None, :] * np.square(semi_axes) / values[:, :, None]
    # Q = sum over components of (S - x x') / h; as Q n = 0, its determinant is (tr^2 - tr Q^2) / 2.
    q = np.einsum("nk,ki,ij->nij", 1 / values, np.square(semi_axes), np.eye(3))
    q -= np.einsum("nki,nkj,nk->nij", points, points, 1 / values)
    determinant = (np.einsum("nii->n", q) ** 2 - np.einsum("nij,nji->n", q, q)) / 2
    element = values.sum(axis=1) * determinant * weights
    return float(element.sum() / 3), element @ np.square(points.sum(axis=1)) / 5


def _bounding_radius(semi_axes):
    """Distance of the farthest surface point from the centre: the maximum of h over all directions."""
    n = np.concatenate([np.eye(3), sphere_directions(1000)])
    n = n[np.argsort(-_support(semi_axes, n))[:50]]
    # h is convex and homogeneous, so moving n to its own support point never lowers h.
    for _ in range(200):
        n = _support_point(semi_axes, n)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
    return float(_support(semi_axes, n).max())
