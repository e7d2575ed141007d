"""Fit a particle's shape to a mesh: a sum of ellipsoids, or a single one."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from repose.dem.rotations import sphere_directions
from repose.grain.support import component_supports, support, support_point

# Recognition of an ellipsoid; the unit of length is the mean radius of the mesh
FEWEST_VERTICES = 12  # more than the nine coefficients of a quadric
# Largest distance of a vertex from the ellipsoid, which allows for rounding in the file
ELLIPSOID_TOLERANCE = 1e-4
DEEPEST_CUT = 0.03  # largest depth of the slices that the facets cut off
# Quadratic terms of a quadric, as pairs of coordinates that are multiplied
QUADRIC_PAIRS = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]

# Fit of several ellipsoids
COMPONENT_COUNTS = (1, 2, 3)
# Largest root mean square deviation, in mean radii, of a fit that is good enough
GOOD_RMS = 2e-3
# A fit is also good enough if its largest deviation, over the smallest extent of the
# body, is at most this.
GOOD_DEVIATION = 0.01
# A further component is kept only if it lowers the rms to this fraction or less.
LARGEST_RMS_RATIO = 0.9
# Limits of the half axes of a component, in mean radii. A needle or a disc would have a
# vanishing radius of curvature, and the contact force would vanish with it.
AXIS_BOUNDS = (0.05, 10.0)
MAX_EVALUATIONS = 200  # of a fit by least squares
# Number of random divisions of the extents of a body from which fits begin
N_RANDOM_STARTS = 3


class _Fit(NamedTuple):
    """A fitted sum of ellipsoids."""

    semi_axes: np.ndarray  # (K, 3), half axes
    rms: float  # root mean square deviation of the support values


def recognise_ellipsoid(
    vertices: np.ndarray,
    radius: float,
    directions: np.ndarray,
    support_values: np.ndarray,
) -> np.ndarray | None:
    """Find out whether a mesh is an ellipsoid, and compute its half axes.

    All vertices must lie on the ellipsoid up to rounding errors, and the facets between
    them must be close to its surface. A support value is the extent of the mesh from
    its centre in one direction.

    Parameters
    ----------
    vertices : ndarray
        The vertices (V, 3) of the mesh, in any unit of length.
    radius : float
        Mean radius of the mesh, in the unit of the vertices.
    directions : ndarray
        Unit vectors (N, 3) in which the fit is compared with the mesh.
    support_values : ndarray
        Support values (N,) of the mesh in these directions, in the unit of the
        vertices.

    Returns
    -------
    ndarray or None
        The half axes (1, 3) of the ellipsoid, the longest first. None if the mesh is
        not an ellipsoid. The first axis of the array stands for the number of
        ellipsoids, as in `fit_components`.
    """
    # Fit a quadric x'Ax + b'x = 1 to the points. It is an ellipsoid if A is positive
    # definite.
    points = vertices / radius
    if len(points) < FEWEST_VERTICES:
        return None
    matrix, linear = _fit_quadric(points)
    if np.linalg.eigvalsh(matrix).min() <= 0:
        return None

    # Relative to the centre of the ellipsoid, the equation is x'Bx = 1. The
    # eigenvectors of B are the axes, and each eigenvalue is 1 over the square of a half
    # axis. The eigenvalues ascend, so the longest axis comes first.
    centre = -0.5 * np.linalg.solve(matrix, linear)
    centred_matrix = matrix / (1 + centre @ matrix @ centre)
    eigenvalues, axes = np.linalg.eigh(centred_matrix)
    relative_axes = 1 / np.sqrt(eigenvalues)

    # Map the ellipsoid to the unit sphere, on which all vertices must lie. A distance
    # from the sphere, times the longest half axis, is the largest distance from the
    # ellipsoid that it can stand for. The tolerance only allows for rounding.
    sphere_points = (points - centre) @ axes / relative_axes
    heights = np.linalg.norm(sphere_points, axis=1) - 1
    if np.abs(heights).max() * relative_axes.max() > ELLIPSOID_TOLERANCE:
        return None

    # The facets of a coarse mesh cut slices off the ellipsoid. Only thin slices are
    # allowed, so this tolerance is much larger.
    semi_axes = radius * relative_axes[None]
    deviations = support(semi_axes, directions) - support_values
    if np.abs(deviations).max() > DEEPEST_CUT * radius:
        return None
    return semi_axes


def _fit_quadric(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit the quadric x'Ax + b'x = 1 to points.

    The equation is linear in its nine coefficients: six of the symmetric matrix A and
    three of the vector b.

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
    # Because A is symmetric, a coefficient off its diagonal occurs twice.
    quadratic_terms = []
    for i, j in QUADRIC_PAIRS:
        factor = 1 if i == j else 2
        quadratic_terms.append(points[:, i] * points[:, j] * factor)
    columns = np.stack([*quadratic_terms, *points.T], axis=1)
    right_side = np.ones(len(points))
    coefficients, *_ = np.linalg.lstsq(columns, right_side, rcond=None)

    # The coefficients are in the order of the columns: first those of A, then those of
    # b.
    matrix = np.zeros((3, 3))
    for (i, j), value in zip(QUADRIC_PAIRS, coefficients[:6], strict=True):
        matrix[i, j] = value
        matrix[j, i] = value
    return matrix, coefficients[6:]


def fit_components(
    directions: np.ndarray,
    support_values: np.ndarray,
    radius: float,
    counts: Sequence[int] = COMPONENT_COUNTS,
) -> np.ndarray:
    """Fit a sum of ellipsoids with common axes to the support values of a body.

    A support value is the extent of the body from its centre in one direction. The
    numbers of ellipsoids in `counts` are tried in turn until a fit is good enough. If
    none is, the best fit is returned.

    Parameters
    ----------
    directions : ndarray
        Unit vectors (N, 3).
    support_values : ndarray
        Support values (N,) of the body in these directions.
    radius : float
        Mean radius of the body, in the unit of the support values.
    counts : sequence of int
        Numbers of ellipsoids to try, the smallest first.

    Returns
    -------
    ndarray
        The half axes (K, 3) of the ellipsoids. The ellipsoid that is longest along x
        comes first.
    """
    semi_axes = np.zeros((0, 3))
    rms = math.inf
    # Approximate half extents of the body: the support values in the directions nearest
    # to the three axes
    half_extents = support_values[np.argmax(directions, axis=0)]
    # `GOOD_DEVIATION` is a fraction of the smallest full extent.
    allowed_deviation = GOOD_DEVIATION * 2 * half_extents.min()
    for count in counts:
        fits = [
            _fit_by_least_squares(directions, support_values, radius, start)
            for start in _make_starts(count, half_extents, radius)
        ]
        best_fit = min(fits, key=lambda fit: fit.rms)
        # A further ellipsoid must improve the fit clearly. The first one always does,
        # because the rms before it is infinite.
        if best_fit.rms < LARGEST_RMS_RATIO * rms:
            semi_axes = best_fit.semi_axes
            rms = best_fit.rms
        # The fit is good enough if its root mean square deviation is small.
        if rms <= GOOD_RMS * radius:
            break
        if count == 1:
            continue
        # It is also good enough if a second fit, which begins with the best half axes
        # so far, can make its largest deviation small enough. This is not tried for a
        # single ellipsoid. If the second fit fails, its half axes are dropped.
        changed_axes = _reduce_largest_deviation(
            directions, support_values, radius, semi_axes
        )
        deviations = support(changed_axes, directions) - support_values
        if np.abs(deviations).max() <= allowed_deviation:
            semi_axes = changed_axes
            break
    # Sort by the first half axis, in descending order.
    order = np.argsort(-semi_axes[:, 0], kind="stable")
    return semi_axes[order]


def _reduce_largest_deviation(
    directions: np.ndarray,
    support_values: np.ndarray,
    radius: float,
    semi_axes: np.ndarray,
) -> np.ndarray:
    """Change the half axes of a fit so that its largest deviation becomes smaller.

    A second fit minimises the sum of the sixth powers of the deviations, in which the
    largest deviations count most. The root mean square of the deviations becomes
    larger.

    Parameters
    ----------
    directions : ndarray
        Unit vectors (N, 3).
    support_values : ndarray
        Support values (N,) of the body in these directions.
    radius : float
        Mean radius of the body. The limits of the half axes (`AXIS_BOUNDS`) are given
        in mean radii.
    semi_axes : ndarray
        Half axes (K, 3) of the fit.

    Returns
    -------
    ndarray
        The changed half axes (K, 3).
    """
    deviations = support(semi_axes, directions) - support_values
    largest = np.abs(deviations).max()

    # The unknowns are logarithms of relative half axes, which keeps the axes positive.
    def compute_cubed_deviations(logarithms: np.ndarray) -> np.ndarray:
        axes = np.exp(logarithms).reshape(-1, 3) * radius
        # `least_squares` squares these third powers.
        return ((support(axes, directions) - support_values) / largest) ** 3

    # The start of a fit must lie within the bounds, but rounding errors could move it
    # out.
    lower, upper = np.log(AXIS_BOUNDS)
    start = np.clip(np.log(semi_axes / radius).ravel(), lower, upper)
    fit = least_squares(
        compute_cubed_deviations,
        start,
        bounds=(lower, upper),
        max_nfev=MAX_EVALUATIONS,
    )
    return radius * np.exp(fit.x).reshape(-1, 3)


def _make_starts(
    count: int, half_extents: np.ndarray, radius: float
) -> list[np.ndarray]:
    """Make the half axes with which fits of a given number of ellipsoids begin.

    A fit may end in a poor local minimum, so it is repeated with several starts. Each
    start divides the half extents of the body among the ellipsoids in a different way.
    The starts are the same in each call.

    Parameters
    ----------
    count : int
        Number of ellipsoids.
    half_extents : ndarray
        Half extents (3,) of the body along its axes.
    radius : float
        Mean radius of the body, in the unit of the half extents. It sets the limits of
        the half axes.

    Returns
    -------
    list of ndarray
        Half axes (count, 3) of each start.
    """
    # A single ellipsoid has the extents of the body, which lie far within the bounds.
    if count == 1:
        return [half_extents[None]]
    # A division (count, 3) is the fraction of each ellipsoid in each half extent. The
    # first divisions are random, with the number of ellipsoids as the seed.
    rng = np.random.default_rng(count)
    divisions = [
        rng.dirichlet(np.full(count, 2.0), size=3).T for _ in range(N_RANDOM_STARTS)
    ]
    # In the other divisions the first ellipsoid is a needle: it gets 0.7 of one half
    # extent, but 0.1 of the others. The last ellipsoid gets what the others leave.
    # These starts lead to good fits of bodies that are blunter or more pointed than an
    # ellipsoid.
    for axis in range(3):
        shares = np.full((count, 3), 0.1)
        shares[0, axis] = 0.7
        shares[-1] = 1 - shares[:-1].sum(axis=0)
        divisions.append(shares)
    # A fit cannot begin on its bounds, so keep the half axes slightly within them.
    smallest = 1.01 * AXIS_BOUNDS[0] * radius
    largest = 0.99 * AXIS_BOUNDS[1] * radius
    return [np.clip(shares * half_extents, smallest, largest) for shares in divisions]


def _fit_by_least_squares(
    directions: np.ndarray,
    support_values: np.ndarray,
    radius: float,
    start: np.ndarray,
) -> _Fit:
    """Fit the half axes of ellipsoids to the support values of a body.

    The unknowns are logarithms of the half axes divided by the mean radius, which keeps
    the axes positive. All lengths inside the fit, such as `relative_values`, are
    divided by the mean radius, too.

    Parameters
    ----------
    directions : ndarray
        Unit vectors (N, 3).
    support_values : ndarray
        Support values (N,) of the body in these directions.
    radius : float
        Mean radius of the body.
    start : ndarray
        Half axes (K, 3) of K ellipsoids, from which the fit begins.

    Returns
    -------
    _Fit
        Half axes (K, 3), and the root mean square of the deviations.
    """
    relative_values = support_values / radius
    squared_directions = np.square(directions)

    def compute_axes(logarithms: np.ndarray) -> np.ndarray:
        return np.exp(logarithms).reshape(start.shape)

    def compute_deviations(logarithms: np.ndarray) -> np.ndarray:
        return support(compute_axes(logarithms), directions) - relative_values

    def compute_derivatives(logarithms: np.ndarray) -> np.ndarray:
        # Ellipsoid k with the half axes s_ki has in the direction n the support value
        # h_k = sqrt(sum_i s_ki^2 n_i^2). Therefore its derivative is
        # d h_k / d log s_ki = s_ki^2 n_i^2 / h_k.
        axes = compute_axes(logarithms)
        numerators = np.square(axes)[None] * squared_directions[:, None, :]
        values = component_supports(axes, directions)
        return (numerators / values[:, :, None]).reshape(len(directions), -1)

    # The start of a fit must lie within the bounds, but rounding errors could move it
    # out.
    lower, upper = np.log(AXIS_BOUNDS)
    start_logarithms = np.clip(np.log(start / radius).ravel(), lower, upper)
    fit = least_squares(
        compute_deviations,
        start_logarithms,
        jac=compute_derivatives,
        bounds=(lower, upper),
        max_nfev=MAX_EVALUATIONS,
    )
    # Convert the relative lengths back to the unit of the support values.
    rms = radius * math.sqrt(np.mean(fit.fun**2))
    return _Fit(radius * compute_axes(fit.x), rms)


def _make_quadrature(
    n_latitudes: int = 200, n_longitudes: int = 250
) -> tuple[np.ndarray, np.ndarray]:
    """Make directions and weights for integrals over the solid angle.

    The integral of a function is the sum of its values in these directions, times the
    weights. The function must be even in x, y and z. Therefore the directions fill only
    one octant, and the weights account for all eight. The directions lie on rings
    around the x axis. The positions of the rings along x are the nodes of a
    Gauss-Legendre rule, and the directions on a ring are equally spaced.

    Parameters
    ----------
    n_latitudes, n_longitudes : int
        Number of rings, and number of directions on each ring.

    Returns
    -------
    directions : ndarray
        Unit vectors (N, 3).
    weights : ndarray
        Weights (N,) of the directions. Their sum is 4 pi.
    """
    # Move the nodes from the interval (-1, 1) to the interval (0, 1).
    nodes, node_weights = np.polynomial.legendre.leggauss(n_latitudes)
    x = (nodes + 1) / 2
    x_weights = node_weights / 2
    # Divide the quarter of each ring into equal steps. A direction lies in the middle
    # of each step.
    azimuths = 0.5 * math.pi * (np.arange(n_longitudes) + 0.5) / n_longitudes
    ring_radii = np.sqrt(1 - x**2)[:, None]
    y = ring_radii * np.cos(azimuths)
    z = ring_radii * np.sin(azimuths)
    ring_x = np.broadcast_to(x[:, None], y.shape)
    directions = np.stack([ring_x, y, z], axis=-1).reshape(-1, 3)
    # All directions of a ring have the same weight. The weights `x_weights` add up to
    # 1, and the solid angle to 4 pi.
    ring_weights = x_weights * 4 * math.pi / n_longitudes
    return directions, np.repeat(ring_weights, n_longitudes)


def volume_integrals(semi_axes: np.ndarray) -> tuple[float, np.ndarray]:
    """Compute the volume and the second moments of a sum of ellipsoids.

    The second moments are the integrals of x^2, y^2 and z^2 over the body.

    Parameters
    ----------
    semi_axes : ndarray
        Half axes (K, 3) of the ellipsoids in m. All ellipsoids have their axes along x,
        y and z, and the sum is their Minkowski sum.

    Returns
    -------
    tuple
        The volume [m3], and the second moments (3,) [m5].

    Notes
    -----
    The support function h(n) is the extent of the body along the direction n. The
    surface point with the normal n is x(n) = grad h. The matrix Q is that of the second
    derivatives of h; it maps a change of n to the change of x. Therefore an element
    dOmega of the solid angle belongs to an element of the surface with the area det Q
    dOmega, where the determinant is taken on the tangent plane.

    The body consists of the cones from its centre to these elements. Such a cone has
    the height h. So the volume is 1/3 int h det Q dOmega, and the integral of x_i^2 is
    1/5 int x_i^2 h det Q dOmega.
    """
    # A single ellipsoid has the exact volume 4/3 pi a b c, and the exact second moments
    # V a^2 / 5, V b^2 / 5 and V c^2 / 5.
    if len(semi_axes) == 1:
        volume = 4 / 3 * math.pi * float(semi_axes[0].prod())
        return volume, volume / 5 * np.square(semi_axes[0])

    # The points (N, K, 3) on the surface of each ellipsoid follow from its support
    # values h (N, K).
    directions, weights = _make_quadrature()
    values = component_supports(semi_axes, directions)
    squared_axes = np.square(semi_axes)
    points = directions[:, None, :] * squared_axes / values[:, :, None]
    # Q (N, 3, 3) is the sum of (S - x x') / h over the ellipsoids, where S is the
    # diagonal matrix of the squared half axes.
    q = np.einsum("nk,ki,ij->nij", 1 / values, squared_axes, np.eye(3))
    q -= np.einsum("nki,nkj,nk->nij", points, points, 1 / values)
    # Because Q n = 0, the determinant on the tangent plane is (tr(Q)^2 - tr(Q^2)) / 2.
    trace = np.einsum("nii->n", q)
    trace_of_square = np.einsum("nij,nji->n", q, q)
    determinant = (trace**2 - trace_of_square) / 2
    # The integrand h det Q, times the weight dOmega of each direction. The support
    # values and the surface points of the body are sums over its ellipsoids.
    integrands = values.sum(axis=1) * determinant * weights
    volume = float(integrands.sum() / 3)
    second_moments = integrands @ np.square(points.sum(axis=1)) / 5
    return volume, second_moments


def bounding_radius(semi_axes: np.ndarray) -> float:
    """Compute the distance of the farthest point of a body from its centre.

    This distance is the maximum of the support function h, the extent of the body as a
    function of the direction.

    Parameters
    ----------
    semi_axes : ndarray
        Half axes (K, 3) of the ellipsoids whose sum is the body.

    Returns
    -------
    float
        The distance, in the unit of the half axes.
    """
    # Begin with the 50 directions of largest support values among the axes and 1000
    # directions that cover the sphere. The maximum lies near one of them.
    trial_directions = np.concatenate([np.eye(3), sphere_directions(1000)])
    order = np.argsort(-support(semi_axes, trial_directions))
    directions = trial_directions[order[:50]]
    # Repeatedly replace each direction by that of its support point. Because h is
    # convex and homogeneous, its value never decreases in such a step. In 200 steps it
    # converges.
    for _ in range(200):
        points = support_point(semi_axes, directions)
        directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    return float(support(semi_axes, directions).max())
