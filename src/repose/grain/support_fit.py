"""Fit a particle's shape to a mesh: a sum of ellipsoids, or a single one."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from repose.dem.rotations import sphere_directions
from repose.grain.support import component_supports, support, support_point

# Recognition of an ellipsoid; lengths are in mean radii of the mesh
MIN_VERTICES = 12
ON_ELLIPSOID = 1e-4  # distance of a vertex that lies on it, but for a file's rounding
COARSEST_FACET = 0.03  # depth at most of the cut that a facet makes
# Terms of a quadric: pairs of coordinates that are multiplied
QUADRIC_PAIRS = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]

# Fit of several ellipsoids
COMPONENTS = (1, 2, 3)
GOOD_RMS = 2e-3  # in mean radii; with it no further component is tried
GOOD_DEVIATION = 0.01  # the largest deviation, in units of the body's smallest extent
IMPROVEMENT = 0.9  # a further component has to lower the rms to this share
# Half axes of a component, in mean radii. A needle or a disc would have a vanishing
# radius of curvature, and the contact force would vanish with it.
AXIS_BOUNDS = (0.05, 10.0)
MAX_EVALUATIONS = 200


class _Fit(NamedTuple):
    """A fitted sum of ellipsoids."""

    semi_axes: np.ndarray  # (K, 3)
    rms: float  # root mean square deviation of the support values


def recognise_ellipsoid(
    vertices: np.ndarray, radius: float, n: np.ndarray, measured: np.ndarray
) -> np.ndarray | None:
    """Find the ellipsoid on which all vertices of a mesh lie, if there is one.

    Parameters
    ----------
    vertices : ndarray
        The vertices (V, 3).
    radius : float
        Mean radius of the mesh.
    n : ndarray
        Directions (N, 3).
    measured : ndarray
        Support values (N,) of the mesh.

    Returns
    -------
    ndarray or None
        The half axes (1, 3), the longest first; None if there is no such ellipsoid.
    """
    # The quadric through the points is an ellipsoid if its matrix is positive.
    points = vertices / radius
    if len(points) < MIN_VERTICES:
        return None
    matrix, linear = _fit_quadric(points)
    if np.linalg.eigvalsh(matrix).min() <= 0:
        return None

    # Move its centre to the origin, which leaves x'Bx = 1. The eigenvectors of B are
    # its axes, and the eigenvalues ascend, so the longest axis comes first.
    centre = -0.5 * np.linalg.solve(matrix, linear)
    centred_matrix = matrix / (1 + centre @ matrix @ centre)
    eigenvalues, axes = np.linalg.eigh(centred_matrix)
    semi_axes = 1 / np.sqrt(eigenvalues)

    # Stretched to the unit sphere, all points must lie on it.
    sphere_points = (points - centre) @ axes / semi_axes
    heights = np.linalg.norm(sphere_points, axis=1) - 1
    distance = np.abs(heights).max() * semi_axes.max()
    deviation = np.abs(support(radius * semi_axes[None], n) - measured).max()
    if distance > ON_ELLIPSOID or deviation > COARSEST_FACET * radius:
        return None
    return radius * semi_axes[None]


def _fit_quadric(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit the quadric x'Ax + b'x = 1 to points.

    The equation is linear in its nine coefficients: six of the symmetric A, three of b.

    Parameters
    ----------
    points : ndarray
        The points (N, 3).

    Returns
    -------
    matrix : ndarray
        The matrix A (3, 3).
    linear : ndarray
        The vector b (3,).
    """
    # A coefficient beside the diagonal of A occurs twice.
    terms = []
    for i, j in QUADRIC_PAIRS:
        factor = 1 if i == j else 2
        terms.append(points[:, i] * points[:, j] * factor)
    columns = np.stack([*terms, *points.T], axis=1)
    coefficients, *_ = np.linalg.lstsq(columns, np.ones(len(points)), rcond=None)
    matrix = np.zeros((3, 3))
    for (i, j), value in zip(QUADRIC_PAIRS, coefficients[:6], strict=True):
        matrix[i, j] = value
        matrix[j, i] = value
    return matrix, coefficients[6:]


def fit_components(
    n: np.ndarray,
    measured: np.ndarray,
    radius: float,
    counts: Sequence[int] = COMPONENTS,
) -> np.ndarray:
    """Fit a sum of co-axial ellipsoids to the support values of a body.

    More ellipsoids are tried until the fit is good. The best fit is kept.

    Parameters
    ----------
    n : ndarray
        Directions (N, 3).
    measured : ndarray
        Support values (N,).
    radius : float
        Mean radius of the body.
    counts : sequence of int
        Numbers of ellipsoids that are tried, until one of them fits well.

    Returns
    -------
    ndarray
        The half axes (K, 3), the longest first.
    """
    best = _Fit(np.zeros((0, 3)), math.inf)
    half_extents = measured[np.argmax(n, axis=0)]  # along the three axes
    for count in counts:
        starts = _starts(count, half_extents, radius)
        fits = [_least_squares_fit(n, measured, radius, start) for start in starts]
        fit = min(fits, key=lambda fit: fit.rms)
        # One more ellipsoid must improve the fit clearly.
        if fit.rms < IMPROVEMENT * best.rms:
            best = fit
        if best.rms <= GOOD_RMS * radius:
            break
        if count > 1:
            # A larger rms is accepted if the largest deviation becomes small.
            even_axes = _even_deviations(n, measured, radius, best.semi_axes)
            deviation = np.abs(support(even_axes, n) - measured).max()
            if deviation <= GOOD_DEVIATION * 2 * half_extents.min():
                best = _Fit(even_axes, best.rms)
                break
    order = np.argsort(-best.semi_axes[:, 0], kind="stable")
    return best.semi_axes[order]


def _even_deviations(
    n: np.ndarray, measured: np.ndarray, radius: float, semi_axes: np.ndarray
) -> np.ndarray:
    """Change the half axes of a fit so that its largest deviation becomes smaller.

    The sum of the sixth powers of the deviations is minimised, which raises their rms.

    Parameters
    ----------
    n, measured, radius
        As of `fit_components`.
    semi_axes : ndarray
        Half axes (K, 3) of the fit.

    Returns
    -------
    ndarray
        The changed half axes (K, 3).
    """
    # The third powers are squared by the fit. The logarithms keep the axes positive.
    largest = np.abs(support(semi_axes, n) - measured).max()

    def residuals(logs: np.ndarray) -> np.ndarray:
        values = support(np.exp(logs).reshape(-1, 3) * radius, n)
        return ((values - measured) / largest) ** 3

    bounds = np.log(AXIS_BOUNDS)
    logs = np.clip(np.log(semi_axes / radius).ravel(), *bounds)
    fit = least_squares(residuals, logs, bounds=tuple(bounds), max_nfev=MAX_EVALUATIONS)
    return radius * np.exp(fit.x).reshape(-1, 3)


def _starts(count: int, extents: np.ndarray, radius: float) -> list[np.ndarray]:
    """Make several start values for a fit with a number of ellipsoids.

    Each divides the half extents of the body among the ellipsoids in another way.

    Parameters
    ----------
    count : int
        Number of ellipsoids.
    extents : ndarray
        Half extents (3,) of the body.
    radius : float
        Mean radius of the body.

    Returns
    -------
    list of ndarray
        Half axes (count, 3) to start from; the same each time.
    """
    if count == 1:
        return [extents[None]]
    rng = np.random.default_rng(count)
    shares = [rng.dirichlet(np.full(count, 2.0), size=3).T for _ in range(3)]
    # A needle along one axis, and a body with the rest: for shapes that are fuller or
    # more pointed than an ellipsoid.
    for axis in range(3):
        share = np.full((count, 3), 0.1)
        share[0, axis] = 0.7
        share[-1] = 1 - share[:-1].sum(axis=0)
        shares.append(share)
    smallest = 1.01 * AXIS_BOUNDS[0] * radius
    largest = 0.99 * AXIS_BOUNDS[1] * radius
    return [np.clip(share * extents, smallest, largest) for share in shares]


def _least_squares_fit(
    n: np.ndarray, measured: np.ndarray, radius: float, start: np.ndarray
) -> _Fit:
    """Fit half axes to support values by least squares, from a start.

    The unknowns are the logarithms of the axes, which keeps the axes positive.

    Parameters
    ----------
    n, measured, radius
        As of `fit_components`.
    start : ndarray
        Half axes (K, 3) from which the fit begins.

    Returns
    -------
    _Fit
        Half axes (K, 3), and the rms of the deviations.
    """
    squared_n = np.square(n)

    def residuals(logs: np.ndarray) -> np.ndarray:
        return support(np.exp(logs).reshape(start.shape), n) - measured / radius

    def jacobian(logs: np.ndarray) -> np.ndarray:
        # d h_k / d log s_ki = s_ki^2 n_i^2 / h_k
        semi_axes = np.exp(logs).reshape(start.shape)
        values = component_supports(semi_axes, n)
        numerator = np.square(semi_axes)[None] * squared_n[:, None, :]
        return (numerator / values[:, :, None]).reshape(len(n), -1)

    bounds = np.log(AXIS_BOUNDS)
    logs = np.clip(np.log(start / radius).ravel(), *bounds)
    fit = least_squares(
        residuals, logs, jac=jacobian, bounds=tuple(bounds), max_nfev=MAX_EVALUATIONS
    )
    semi_axes = radius * np.exp(fit.x).reshape(start.shape)
    return _Fit(semi_axes, radius * math.sqrt(np.mean(fit.fun**2)))


def _surface_quadrature(
    n_latitudes: int = 200, n_longitudes: int = 250
) -> tuple[np.ndarray, np.ndarray]:
    """Make directions and weights for integrals over the solid angle.

    They are for functions that are even in x, y and z: the directions fill one octant,
    and the weights stand for all eight. Along x the rule is Gauss-Legendre, around x
    the steps are equal.

    Parameters
    ----------
    n_latitudes, n_longitudes : int
        Numbers of directions along and around x.

    Returns
    -------
    directions : ndarray
        Unit vectors (N, 3).
    weights : ndarray
        Their weights (N,), with the sum 4 pi.
    """
    # Move the nodes from the interval (-1, 1) to (0, 1).
    nodes, node_weights = np.polynomial.legendre.leggauss(n_latitudes)
    x = (nodes + 1) / 2
    x_weights = node_weights / 2
    azimuth = 0.5 * math.pi * (np.arange(n_longitudes) + 0.5) / n_longitudes
    ring_radius = np.sqrt(1 - x**2)[:, None]
    coordinates = np.broadcast_arrays(
        x[:, None], ring_radius * np.cos(azimuth), ring_radius * np.sin(azimuth)
    )
    directions = np.stack(coordinates, axis=-1).reshape(-1, 3)
    # All directions of a ring have the same weight.
    weights = np.repeat(x_weights * 4 * math.pi / n_longitudes, n_longitudes)
    return directions, weights


def volume_integrals(semi_axes: np.ndarray) -> tuple[float, np.ndarray]:
    """Integrate over the volume of a sum of ellipsoids.

    The body is the union of cones from its centre over the surface x(n) = grad h, whose
    element of area is det Q dOmega, where Q = grad grad h on the tangent plane. So the
    volume is 1/3 int h det Q dOmega, and the integral of x_i^2 is
    1/5 int x_i^2 h det Q dOmega.

    Parameters
    ----------
    semi_axes : ndarray
        Half axes (K, 3) in m.

    Returns
    -------
    tuple
        The volume [m3] and the integrals (3,) of x_i^2 [m5].
    """
    if len(semi_axes) == 1:
        volume = 4 / 3 * math.pi * float(semi_axes[0].prod())
        return volume, volume / 5 * np.square(semi_axes[0])

    # Surface points x(n) of each component, from its support values h
    n, weights = _surface_quadrature()
    values = component_supports(semi_axes, n)
    squares = np.square(semi_axes)
    points = n[:, None, :] * squares / values[:, :, None]
    # Q = sum over components of (S - x x') / h, where S has the squared half axes.
    q = np.einsum("nk,ki,ij->nij", 1 / values, squares, np.eye(3))
    q -= np.einsum("nki,nkj,nk->nij", points, points, 1 / values)
    # As Q n = 0, the determinant on the tangent plane is (tr^2 - tr Q^2) / 2.
    trace = np.einsum("nii->n", q)
    trace_of_square = np.einsum("nij,nji->n", q, q)
    determinant = (trace**2 - trace_of_square) / 2
    # h det Q dOmega for each direction
    elements = values.sum(axis=1) * determinant * weights
    volume = float(elements.sum() / 3)
    second_moments = elements @ np.square(points.sum(axis=1)) / 5
    return volume, second_moments


def bounding_radius(semi_axes: np.ndarray) -> float:
    """Compute the distance of the farthest surface point of a body from its centre.

    It is the maximum of the support function h.

    Parameters
    ----------
    semi_axes : ndarray
        Half axes (K, 3) of the ellipsoids whose sum is the body.
    """
    # Begin at the best of many directions.
    trial_directions = np.concatenate([np.eye(3), sphere_directions(1000)])
    order = np.argsort(-support(semi_axes, trial_directions))
    n = trial_directions[order[:50]]
    # Go from each direction to that of its support point. As h is convex and
    # homogeneous, it never falls on the way.
    for _ in range(200):
        n = support_point(semi_axes, n)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
    return float(support(semi_axes, n).max())
