"""Support functions fitted to a mesh: the sum of a few co-axial ellipsoids, or a single ellipsoid.

The support function h(n) of a body is its extent in direction n from its centre. An ellipsoid with half axes s has
h = sqrt(sum s_i^2 n_i^2), and a sum of support functions is that of a Minkowski sum: a body whose h is the sum of a few
ellipsoids with common axes is smooth, convex and closed-form.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from repose.dem.rotations import sphere_directions
from repose.grain.support import component_supports, support, support_point

# Vertices this near to a quadric (of the mean radius) lie on it, but for the rounding of a file; the coarsest
# facets that still count as an ellipsoid's may cut this deep (of the mean radius).
ON_ELLIPSOID = 1e-4
COARSEST_FACET = 0.03
COMPONENTS = (1, 2, 3)
GOOD_RMS = 2e-3
GOOD_DEVIATION = 0.01  # of the body's smallest extent
# Half axes of a fitted component, of the mean radius: a needle or a disc would have no radius of curvature,
# and the contact force would vanish with it.
AXIS_BOUNDS = (0.05, 10.0)


def recognise_ellipsoid(
    vertices: np.ndarray, radius: float, n: np.ndarray, measured: np.ndarray
) -> np.ndarray | None:
    """Half axes (1, 3) of the ellipsoid on which all vertices (V, 3) lie; None if there is none."""
    x = vertices / radius
    if len(x) < 12:
        return None
    # The general quadric x'Ax + b'x = 1, linear in its nine coefficients.
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    terms = [x[:, i] * x[:, j] * (1 if i == j else 2) for i, j in pairs]
    coefficients = np.linalg.lstsq(
        np.stack([*terms, *x.T], axis=1), np.ones(len(x)), rcond=None
    )[0]
    matrix = np.zeros((3, 3))
    for (i, j), value in zip(pairs, coefficients[:6], strict=True):
        matrix[i, j] = matrix[j, i] = value
    if np.linalg.eigvalsh(matrix).min() <= 0:
        return None
    centre = -0.5 * np.linalg.solve(matrix, coefficients[6:])
    values, vectors = np.linalg.eigh(matrix / (1 + centre @ matrix @ centre))
    # Smallest eigenvalue first: the longest axis.
    axes = 1 / np.sqrt(values)
    off_surface = (
        np.abs(np.linalg.norm((x - centre) @ vectors / axes, axis=1) - 1).max()
        * axes.max()
    )
    coarseness = np.abs(support(radius * axes[None], n) - measured).max()
    fits = off_surface <= ON_ELLIPSOID and coarseness <= COARSEST_FACET * radius
    return radius * axes[None] if fits else None


def fit_components(
    n: np.ndarray,
    measured: np.ndarray,
    radius: float,
    counts: Sequence[int] = COMPONENTS,
) -> np.ndarray:
    """Half axes (K, 3) of the co-axial ellipsoids whose sum is nearest to support values, the longest first."""
    best, best_rms = np.zeros((0, 3)), math.inf
    extents = measured[np.argmax(n, axis=0)]
    for count in counts:
        starts = _starts(count, extents, radius)
        fits = [_least_squares_fit(n, measured, radius, start) for start in starts]
        semi_axes, rms = min(fits, key=lambda fit: fit[1])
        # A further component has to improve the fit.
        if rms < 0.9 * best_rms:
            best, best_rms = semi_axes, rms
        if best_rms <= GOOD_RMS * radius:
            break
        if count > 1:
            even = _evened(n, measured, radius, best)
            if (
                np.abs(support(even, n) - measured).max()
                <= GOOD_DEVIATION * 2 * extents.min()
            ):
                best = even
                break
    return best[np.argsort(-best[:, 0], kind="stable")]


def _evened(
    n: np.ndarray, measured: np.ndarray, radius: float, semi_axes: np.ndarray
) -> np.ndarray:
    """Fit half axes (K, 3) near the given ones by sixth powers: a smaller largest deviation for a larger rms."""
    largest = np.abs(support(semi_axes, n) - measured).max()

    def residuals(logs: np.ndarray) -> np.ndarray:
        return (
            (support(np.exp(logs).reshape(-1, 3) * radius, n) - measured) / largest
        ) ** 3

    bounds = np.log(AXIS_BOUNDS)
    logs = np.clip(np.log(semi_axes / radius).ravel(), *bounds)
    return radius * np.exp(
        least_squares(residuals, logs, bounds=tuple(bounds), max_nfev=200).x
    ).reshape(-1, 3)


def _starts(count: int, extents: np.ndarray, radius: float) -> list[np.ndarray]:
    """Make start values (count, 3) for the fit: the body's extents shared out in several ways."""
    if count == 1:
        return [extents[None]]
    rng = np.random.default_rng(count)
    shares = [rng.dirichlet(np.full(count, 2.0), size=3).T for _ in range(3)]
    # Needles along one axis each beside a body: for fuller or more pointed shapes than an ellipsoid.
    for axis in range(3):
        share = np.full((count, 3), 0.1)
        share[0, axis] = 0.7
        share[-1] = 1 - share[:-1].sum(axis=0)
        shares.append(share)
    low, high = (1.01 * AXIS_BOUNDS[0] * radius, 0.99 * AXIS_BOUNDS[1] * radius)
    return [np.clip(share * extents, low, high) for share in shares]


def _least_squares_fit(
    n: np.ndarray, measured: np.ndarray, radius: float, start: np.ndarray
) -> tuple[np.ndarray, float]:
    """Fit half axes (K, 3) from a start, over the logarithms of the axes; also return the rms deviation."""
    squares = np.square(n)

    def residuals(logs: np.ndarray) -> np.ndarray:
        return support(np.exp(logs).reshape(start.shape), n) - measured / radius

    def jacobian(logs: np.ndarray) -> np.ndarray:
        semi_axes = np.exp(logs).reshape(start.shape)
        values = component_supports(semi_axes, n)
        # d h_k / d log s_ki = s_ki^2 n_i^2 / h_k
        return (
            np.square(semi_axes)[None] * squares[:, None, :] / values[:, :, None]
        ).reshape(len(n), -1)

    bounds = np.log(AXIS_BOUNDS)
    logs = np.clip(np.log(start / radius).ravel(), *bounds)
    fit = least_squares(
        residuals, logs, jac=jacobian, bounds=tuple(bounds), max_nfev=200
    )
    return radius * np.exp(fit.x).reshape(start.shape), radius * math.sqrt(
        np.mean(fit.fun**2)
    )


def _surface_quadrature(
    latitudes: int = 200, longitudes: int = 250
) -> tuple[np.ndarray, np.ndarray]:
    """Return directions (N, 3) in one octant and weights of dOmega (N,) for all eight, for functions even in x, y, z.

    Gauss-Legendre along x, equal steps around it.
    """
    u, du = np.polynomial.legendre.leggauss(latitudes)
    u, du = (u + 1) / 2, du / 2
    azimuth = 0.5 * math.pi * (np.arange(longitudes) + 0.5) / longitudes
    ring = np.sqrt(1 - u**2)[:, None]
    n = np.stack(
        np.broadcast_arrays(u[:, None], ring * np.cos(azimuth), ring * np.sin(azimuth)),
        axis=-1,
    )
    return n.reshape(-1, 3), np.repeat(du * 4 * math.pi / longitudes, longitudes)


def volume_integrals(semi_axes: np.ndarray) -> tuple[float, np.ndarray]:
    """Volume [m3] of a body with half axes (K, 3) [m], and the integrals (3,) of x_i^2 over it [m5].

    The body is the union of cones from its centre over the surface x(n) = grad h, whose element of area is det Q
    dOmega, Q = grad grad h on the tangent plane: V = 1/3 int h det Q dOmega, and the integral of x_i^2 is 1/5 int x_i^2
    h det Q dOmega.
    """
    if len(semi_axes) == 1:
        volume = 4 / 3 * math.pi * float(semi_axes[0].prod())
        return volume, volume / 5 * np.square(semi_axes[0])
    n, weights = _surface_quadrature()
    values = component_supports(semi_axes, n)
    points = n[:, None, :] * np.square(semi_axes) / values[:, :, None]
    # Q = sum over components of (S - x x') / h; as Q n = 0, its determinant is (tr^2 - tr Q^2) / 2.
    q = np.einsum("nk,ki,ij->nij", 1 / values, np.square(semi_axes), np.eye(3))
    q -= np.einsum("nki,nkj,nk->nij", points, points, 1 / values)
    determinant = (np.einsum("nii->n", q) ** 2 - np.einsum("nij,nji->n", q, q)) / 2
    element = values.sum(axis=1) * determinant * weights
    return float(element.sum() / 3), element @ np.square(points.sum(axis=1)) / 5


def bounding_radius(semi_axes: np.ndarray) -> float:
    """Distance of the farthest surface point from the centre: the maximum of h; half axes (K, 3)."""
    n = np.concatenate([np.eye(3), sphere_directions(1000)])
    n = n[np.argsort(-support(semi_axes, n))[:50]]
    # h is convex and homogeneous, so moving n to its own support point never lowers h.
    for _ in range(200):
        n = support_point(semi_axes, n)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
    return float(support(semi_axes, n).max())
