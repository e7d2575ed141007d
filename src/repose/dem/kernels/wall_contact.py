"""Contact of a body with one exact curved wall: the inside of a cone or tube, or a rounded ring edge.

The inside of a cone or tube is convex, an intersection of half-spaces whose normals m(theta) turn about the axis. The
overlap of a body is therefore the maximum of phi(theta) = m.c + h(m) - k, a search in one variable; a long body in a
narrow tube has two maxima and two contacts. The edge at the end of a cone is a torus of a small radius, tangent to the
cone. The projection of the contact point onto the wall decides which of the two a body touches, so force and overlap
are continuous at the transition and no gap is left between cone and edge.

Cones and rings are solved in their own frame, whose z axis is theirs (`frames`). A sphere has a closed form.
"""

import math

from .contact import LONGEST_STEP
from .geometry import support_terms, tangents
from .jit import inlined, kernel

# Concave walls flatter than the body: the relative curvature keeps at least this share of the body's own.
LEAST_RELATIVE_CURVATURE = 0.1
NEAREST = 1e-30  # of two points, for a direction [m]


@inlined
def effective_radius(q11, q12, q22, k1, k2):
    """R* on a wall with principal curvatures k1, k2 along Q's axes, negative if concave: 1 / R*^2 = det(Q^-1 + K)."""
    det = q11 * q22 - q12 * q12
    relative = 1.0 + q11 * k1 + q22 * k2 + det * k1 * k2
    return math.sqrt(det / max(relative, LEAST_RELATIVE_CURVATURE))


@inlined
def write_contact(out, nx, ny, nz, gap, radius, h, x1, x2, ux, uy, uz, wx, wy, wz):
    """Fill `out`: normal (3), gap, R*, contact point relative to the centre (3)."""
    reach = h + 0.5 * gap
    out[0], out[1], out[2] = nx, ny, nz
    out[3], out[4] = gap, radius
    out[5] = reach * nx + x1 * ux + x2 * wx
    out[6] = reach * ny + x1 * uy + x2 * wy
    out[7] = reach * nz + x1 * uz + x2 * wz


@inlined
def cone_overlap(row, parts, cone, theta):
    """phi(theta), its first and second derivative, and the distance up the wall of the body's deepest point."""
    cos, sin = math.cos(theta), math.sin(theta)
    mr, mz = cone[0], cone[1]
    nx, ny, nz = mr * cos, mr * sin, mz
    ux, uy, uz = -sin, cos, 0.0
    wx, wy, wz = -mz * cos, -mz * sin, mr
    h, x1, x2, q11, _q12, _q22 = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    # the body's point: c + h n + x1 u + x2 w
    px = row[0] + h * nx + x1 * ux + x2 * wx
    py = row[1] + h * ny + x1 * uy + x2 * wy
    pz = row[2] + h * nz + x2 * wz
    value = nx * row[0] + ny * row[1] + nz * row[2] + h - cone[2]
    slope = mr * (ux * px + uy * py)
    bend = mr * mr * q11 - mr * (cos * px + sin * py)
    along = (cos * px + sin * py) * cone[5] + pz * cone[6]
    return value, slope, bend, along


@inlined
def climb_cone(row, parts, cone, theta):
    """One step towards the nearest maximum of phi."""
    _value, slope, bend, _along = cone_overlap(row, parts, cone, theta)
    # where phi is not concave, or nearly flat, a short step uphill
    step = -slope / bend if bend < -1e-7 else math.copysign(0.05, slope)
    return theta + min(max(step, -0.2), 0.2)


@kernel
def cone_contact(row, parts, cone, theta, out):
    """Contact of a body with a cone at a maximum theta of phi: fills `out`; returns whether it lies on the wall.

    out: normal (3), gap, R*, contact point relative to the centre (3).
    """
    cos, sin = math.cos(theta), math.sin(theta)
    mr, mz = cone[0], cone[1]
    nx, ny, nz = mr * cos, mr * sin, mz
    ux, uy, uz = -sin, cos, 0.0
    wx, wy, wz = -mz * cos, -mz * sin, mr
    h, x1, x2, q11, q12, q22 = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    gap = cone[2] - (nx * row[0] + ny * row[1] + nz * row[2] + h)
    write_contact(out, nx, ny, nz, gap, 0.0, h, x1, x2, ux, uy, uz, wx, wy, wz)
    px, py, pz = row[0] + out[5], row[1] + out[6], row[2] + out[7]
    across = max(cos * px + sin * py, 1e-6)
    # a cone curves towards the body with the radius across / m_r
    out[4] = effective_radius(q11, q12, q22, -mr / across, 0.0)
    along = across * cone[5] + pz * cone[6]
    return along >= cone[3] and along <= cone[4]


@inlined
def ring_newton(row, parts, ring, theta, nx, ny, nz):
    """One Newton step for the distance to a circle: the new theta and n, the distance before, and the step's length."""
    cos, sin = math.cos(theta), math.sin(theta)
    radius = ring[0]
    dx, dy, dz = radius * cos - row[0], radius * sin - row[1], ring[1] - row[2]
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    h, x1, x2, q11, q12, q22 = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    f = nx * dx + ny * dy + nz * dz - h
    g1, g2 = dx * ux + dy * uy + dz * uz - x1, dx * wx + dy * wy + dz * wz - x2
    # derivatives along the circle
    tx, ty = -radius * sin, radius * cos
    slope = nx * tx + ny * ty
    bend = -radius * (nx * cos + ny * sin)
    c1, c2 = ux * tx + uy * ty, wx * tx + wy * ty
    a, c = q11 + f, q22 + f
    trace = q11 + q22
    det = a * c - q12 * q12
    if not (a > 0.0 and c > 0.0 and det > 1e-3 * trace * trace):
        a = c = trace
        q12 = 0.0
        det = a * c
    # eliminate n: s = A^-1 (g + c dtheta), then the reduced equation for theta
    k1, k2 = (c * c1 - q12 * c2) / det, (a * c2 - q12 * c1) / det
    reduced = bend + c1 * k1 + c2 * k2
    pull = slope + g1 * k1 + g2 * k2
    turn = -pull / reduced if reduced > 1e-7 else -math.copysign(0.05, pull)
    turn = min(max(turn, -0.2), 0.2)
    g1, g2 = g1 + c1 * turn, g2 + c2 * turn
    s1, s2 = (c * g1 - q12 * g2) / det, (a * g2 - q12 * g1) / det
    length = math.sqrt(s1 * s1 + s2 * s2)
    if length > LONGEST_STEP:
        s1 *= LONGEST_STEP / length
        s2 *= LONGEST_STEP / length
    mx, my, mz = nx + s1 * ux + s2 * wx, ny + s1 * uy + s2 * wy, nz + s1 * uz + s2 * wz
    inv = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
    return theta + turn, mx * inv, my * inv, mz * inv, f, abs(turn) + length


@kernel
def ring_contact(row, parts, ring, theta, nx, ny, nz, out):
    """Contact with a ring edge at a solved (theta, n): fills `out`; returns whether no adjoining wall hides it."""
    cos, sin = math.cos(theta), math.sin(theta)
    # frame: u along the edge as far as it is tangent to the body, w across it
    ux, uy, uz = -sin, cos, 0.0
    un = ux * nx + uy * ny
    ux, uy, uz = ux - un * nx, uy - un * ny, uz - un * nz
    inv = 1.0 / math.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux * inv, uy * inv, uz * inv
    wx, wy, wz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    h, x1, x2, q11, q12, q22 = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    edge = ring[2]
    gap = (
        nx * (ring[0] * cos - row[0])
        + ny * (ring[0] * sin - row[1])
        + nz * (ring[1] - row[2])
        - h
        - edge
    )
    outward = nx * cos + ny * sin
    radius = effective_radius(
        q11, q12, q22, -outward / max(ring[0] - edge * outward, edge), 1.0 / edge
    )
    write_contact(out, nx, ny, nz, gap, radius, h, x1, x2, ux, uy, uz, wx, wy, wz)
    return (
        outward * ring[3] + nz * ring[4] >= 0.0
        and outward * ring[5] + nz * ring[6] >= 0.0
    )


@inlined
def solve_cone(row, parts, cone, theta):
    """Climb to a maximum of phi from a start."""
    for _ in range(40):
        step = climb_cone(row, parts, cone, theta) - theta
        theta += step
        if abs(step) < 1e-9:
            break
    return theta


@inlined
def solve_ring(row, parts, ring, theta, nx, ny, nz):
    """Solve for the nearest point of a circle from a start; returns theta and n."""
    for _ in range(40):
        theta, nx, ny, nz, _f, step = ring_newton(row, parts, ring, theta, nx, ny, nz)
        if step < 1e-9:
            break
    return theta, nx, ny, nz


@inlined
def fill_contact(out, nx, ny, nz, gap, curvature, radius):
    """Write normal (3), gap, R* and the contact point relative to the sphere's centre (3)."""
    reach = radius + 0.5 * gap
    out[0], out[1], out[2] = nx, ny, nz
    out[3], out[4] = gap, curvature
    out[5], out[6], out[7] = reach * nx, reach * ny, reach * nz


@inlined
def sphere_on_cone(x, y, z, radius, cone, out):
    """Contact of a sphere with a cone in its frame: fills `out`; returns how far it is beyond the wall's ends [m]."""
    across = math.sqrt(x * x + y * y)
    inv = 1.0 / max(across, NEAREST)
    cos, sin = (x * inv, y * inv) if across > NEAREST else (1.0, 0.0)
    mr, mz = cone[0], cone[1]
    gap = cone[2] - mr * across - mz * z - radius
    # a cone curves towards the body with the radius of its circle over m_r
    circle = max(across + (radius + 0.5 * gap) * mr, 1e-6)
    curvature = effective_radius(radius, 0.0, radius, -mr / circle, 0.0)
    fill_contact(out, mr * cos, mr * sin, mz, gap, curvature, radius)
    along = across * cone[5] + z * cone[6]
    return max(cone[3] - along, along - cone[4])


@inlined
def sphere_on_ring(x, y, z, radius, ring, out):
    """Contact of a sphere with a ring in its frame: fills `out`; returns a lower bound of its way to the open part."""
    across = math.sqrt(x * x + y * y)
    inv = 1.0 / max(across, NEAREST)
    cos, sin = (x * inv, y * inv) if across > NEAREST else (1.0, 0.0)
    dr, dz = ring[0] - across, ring[1] - z
    distance = math.sqrt(dr * dr + dz * dz)
    inv = 1.0 / max(distance, NEAREST)
    nr, nz = dr * inv, dz * inv
    edge = ring[2]
    curvature = effective_radius(
        radius, 0.0, radius, -nr / max(ring[0] - edge * nr, edge), 1.0 / edge
    )
    fill_contact(
        out, nr * cos, nr * sin, nz, distance - radius - edge, curvature, radius
    )
    return -min(dr * ring[3] + dz * ring[4], dr * ring[5] + dz * ring[6])
