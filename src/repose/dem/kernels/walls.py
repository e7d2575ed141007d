"""Search for contacts of smooth bodies with planes, cones and rings, and follow them.

`search_plane` and `search_curved_wall` look for new contacts of a body.
`follow_wall_contact` updates a contact with a cone or ring in each step (see
`wall_contact`). The search and the force use the same point of the body, the touching
point, to decide whether the body is on the wall or beyond its end.

A contact begins when a body in front of the wall reaches it. A body that overlaps the
wall's surface beyond the wall's end, or from behind, is "past the wall". A contact that
began with this overlap would throw the body away, so the body gets no contact until it
has been clear of the surface. `WallContacts.allowed_overlap` is the largest overlap
with which a contact may begin. It is infinite unless the body is past the wall. For a
body past a curved wall, it is the overlap with the other wall from which the body
slides onto this one. For a body past a plane, it is 0.0. However, a body may slide from
a curved wall onto the plane, with at most the overlap that it has with the curved wall.

Reads `Bodies.rows` and the rows of the walls. Writes the lists of `WallContacts` (body,
wall, data), its `limit` and `allowed_overlap`, and `counts`.
"""

import math

import numpy as np

from . import contact_geometry, state
from .frames import (
    contact_to_world,
    into_frame,
    normal_to_world,
    write_plane,
    write_row_in_frame,
)
from .geometry import extent, support_terms, tangents
from .jit import inlined, kernel
from .lists import move_contact, put_contact
from .neighbours import reserve_place
from .rows import LANES, set_vector, vector_at
from .state import bounding_radius
from .wall_contact import (
    climb_cone,
    make_ring_step,
    solve_cone,
    solve_ring,
    write_cone_contact,
    write_ring_contact,
    write_sphere_cone_contact,
    write_sphere_ring_contact,
)

COSINES = np.cos(2.0 * np.pi * np.arange(state.STARTS) / state.STARTS)
SINES = np.sin(2.0 * np.pi * np.arange(state.STARTS) / state.STARTS)
# A body that overlaps a curved wall or mesh by more than this fraction of its bounding
# radius must have come from behind, so no contact begins.
LARGEST_NEW_OVERLAP = 0.3
# Two contacts of a body with the same wall are the same contact if their azimuths
# differ by less than this [rad].
SAME_AZIMUTH = 0.12
# The next search comes after a body has moved by these fractions of its radius: if it
# overlaps the surface beyond the wall's end, and if it has a contact with the wall,
# from which a second contact may split off.
NEXT_SEARCH_BEYOND_END = 0.01
NEXT_SEARCH_IN_CONTACT = 0.1
# Newton steps for a contact that is followed from one time step to the next
FOLLOWING_STEPS = 2
FAR = 1e300  # no body moves by this distance [m]
X, Y, Z = state.POSITION, state.POSITION + 1, state.POSITION + 2  # columns of a body


@inlined
def direction_to_ring(row, ring, start):
    """Return direction and distance from a body's centre to a point on a ring's circle.

    Parameters
    ----------
    row : array
        The body in the frame of the ring, a row of `Bodies.rows`.
    ring : array (RING_COLUMNS,)
        The ring: a row of `Walls.rings`.
    start : int
        Index of the point, one of state.STARTS points at equal angles about the axis.

    Returns
    -------
    nx, ny, nz, distance : float
        Unit vector, and the distance [m].
    """
    x, y, z = vector_at(row, state.POSITION)
    dx = ring[state.RING_RADIUS] * COSINES[start] - x
    dy = ring[state.RING_RADIUS] * SINES[start] - y
    dz = ring[state.RING_HEIGHT] - z
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    return dx / distance, dy / distance, dz / distance, distance


@inlined
def angle_between(first, second):
    """Return the smaller angle between two azimuths [rad]."""
    full_turn = 2.0 * math.pi
    angle = (first - second) % full_turn
    return min(angle, full_turn - angle)


@inlined
def contact_azimuth(data, k):
    """Return the azimuth of contact k with a curved wall, about the wall's axis [rad].

    `data` is `WallContacts.data`.
    """
    return data[k // LANES, state.AZIMUTH + k % LANES]


@inlined
def has_contact_near(contacts, n_contacts, body, wall, theta):
    """Return whether a body has a contact with a curved wall near an azimuth.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    n_contacts : int
        Number of contacts in the list.
    body, wall : int
        Indices of the body and of the wall.
    theta : float
        The azimuth [rad]. A contact is near if it is less than SAME_AZIMUTH away.
    """
    for k in range(n_contacts):
        if (
            contacts.body[k] == body
            and contacts.wall[k] == wall
            and angle_between(contact_azimuth(contacts.data, k), theta) < SAME_AZIMUTH
        ):
            return True
    return False


@inlined
def add_wall_contact(contacts, counts, length_index, body, wall, geometry):
    """Append a contact to a list of contacts with walls.

    All rows of the contact except its normal are set to zero. In every force law, zeros
    mean that the tangential spring is relaxed, so that it exerts no force.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    length_index : int
        Index in `counts` of the length of this list, such as state.N_PLANE.
    body, wall : int
        Indices of the body and of the wall.
    geometry : array (8,)
        The contact (`contact_geometry`), whose normal is in world axes.

    Returns
    -------
    int
        Index of the contact; -1 if the list is full. The caller must check for -1
        before it writes to the contact.
    """
    # This also sets `counts[FULL]` if there is no room.
    k = reserve_place(counts, length_index, contacts.body.shape[0])
    if k >= 0:
        contacts.body[k] = body
        contacts.wall[k] = wall
        nx, ny, nz = contact_geometry.normal_of(geometry)
        # This sets the spring and all other rows to zero.
        put_contact(contacts.data, k, nx, ny, nz)
    return k


@inlined
def drop_wall_contact(contacts, counts, length_index, k, ghost):
    """Remove contact k from a list and move the last contact to its index.

    The element that becomes free gets the ghost, an absent body without mass, in place
    of its body. It also gets a relaxed spring and a plane without an edge, so that no
    force acts there.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    length_index : int
        Index in `counts` of the length of this list, such as state.N_PLANE.
    k : int
        Index of the contact in its list.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    last = counts[length_index] - 1
    counts[length_index] = last
    # The last contact moves to index k.
    contacts.body[k] = contacts.body[last]
    contacts.wall[k] = contacts.wall[last]
    contacts.feature[k] = contacts.feature[last]
    move_contact(contacts.data, last, k)
    # The old element of the last contact gets the ghost, with any unit normal, on a
    # plane without an edge. Its wall and feature are not reset, because nothing reads
    # them.
    contacts.body[last] = ghost
    put_contact(contacts.data, last, 0.0, 0.0, 1.0)
    contacts.data[last // LANES, state.SQUARED_RADIUS + last % LANES] = math.inf


@inlined
def has_other_contact(contacts, n_contacts, body, ignored):
    """Return whether a body has a contact in a list, leaving out one contact.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    n_contacts : int
        Number of contacts in the list.
    body : int
        Index of the body.
    ignored : int
        Index of the contact that is left out; -1 for none.
    """
    for k in range(n_contacts):  # noqa: SIM110  (kernels have no generators)
        if contacts.body[k] == body and k != ignored:
            return True
    return False


@inlined
def overlap_with_other_walls(contacts, n_contacts, body, wall):
    """Return the largest overlap of a body with all curved walls but one [m], or 0.0.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with cones, tubes and rings.
    n_contacts : int
        Number of contacts in the list.
    body : int
        Index of the body.
    wall : int
        Index of the wall that is left out; -1 for none.
    """
    overlap = 0.0
    for k in range(n_contacts):
        if contacts.body[k] == body and contacts.wall[k] != wall:
            # Contacts with curved walls keep their gap.
            gap = contacts.data[k // LANES, state.GAP + k % LANES]
            overlap = max(overlap, -gap)
    return overlap


@inlined
def record_slide_off(bodies, contacts, walls, n_contacts, k, overlap):
    """Update a body's searches after contact k slid over the end of a curved wall.

    `contacts.allowed_overlap[wall, i]` is the largest overlap with which body i may
    begin a contact with a wall. It is infinite unless the body is past the wall: it
    overlaps the wall's surface from behind or beyond the wall's end.
    `contacts.limit[wall, i]` is the path at which the next search for contacts is due.
    Both are changed in place.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    n_contacts : int
        Number of contacts in the list.
    k : int
        Index of the contact in its list.
    overlap : float
        Overlap with which the body slid off [m]. The contact with the next wall, which
        is searched in the next step, may begin with at most this overlap.
    """
    wall = contacts.wall[k]
    i = contacts.body[k]
    # The path is the displacement of the body plus that of the walls. A search of a
    # wall is due when the path reaches `limit`.
    path = bodies.displacement[i] + walls.approach[state.WALL_PATH]
    # The body may slide onto any other wall. Let it begin a contact with the overlap
    # that it had here, and search all other walls in the next step.
    for other in range(contacts.allowed_overlap.shape[0]):
        contacts.allowed_overlap[other, i] = max(
            contacts.allowed_overlap[other, i], overlap
        )
        if other != wall:
            contacts.limit[other, i] = min(contacts.limit[other, i], path)
    # Without another contact, the body is past this wall. If it slides back, it may
    # begin a contact with the overlap that it had at the end. This overwrites the value
    # of the loop.
    if not has_other_contact(contacts, n_contacts, i, k):
        contacts.allowed_overlap[wall, i] = overlap
        # The last search, during the contact, has set the limit this far ahead. Take it
        # back, since a second contact may have split off since then.
        contacts.limit[wall, i] -= NEXT_SEARCH_IN_CONTACT * bounding_radius(bodies, i)


@inlined
def add_contact_if_new(
    contacts,
    counts,
    walls,
    body,
    wall,
    theta,
    is_on_wall,
    radius,
    allowed_overlap,
    distance_moved,
    geometry,
):
    """Add the contact found by a search of a curved wall, or mark the body as past it.

    The contact is added if it lies on the wall, if its overlap is allowed, and if the
    list does not have it already. A body that overlaps the wall's surface from behind
    or beyond the wall's end is past the wall. It gets no contact, because this would
    begin with a large force. Instead, `contacts.allowed_overlap[wall, body]` becomes
    finite. The caller must have set it to infinity before.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    body, wall : int
        Indices of the body and of the wall.
    theta : float
        Azimuth of the contact [rad].
    is_on_wall : bool
        Whether the contact lies on the wall, not beyond its end.
    radius : float
        Bounding radius of the body [m]: the distance of its farthest point from its
        centre.
    allowed_overlap : float
        Largest overlap with which a contact may begin [m]. It is infinite unless the
        previous search found that the body was past the wall.
    distance_moved : float
        How far the body may have moved since its last search [m].
    geometry : array (8,)
        The contact in the frame of the wall (`contact_geometry`). The normal of a new
        contact is rotated into world axes, in place.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    n_contacts = counts[state.N_CURVED]
    gap = geometry[contact_geometry.GAP]
    # Without an overlap, the body cannot touch before it has moved by the gap.
    if gap > 0.0:
        return gap
    # A body that was past the wall may slide onto it from another wall, with the
    # overlap that it has with that wall.
    if allowed_overlap < math.inf:
        allowed_overlap = max(
            allowed_overlap, overlap_with_other_walls(contacts, n_contacts, body, wall)
        )
    # Reject a contact beyond the wall's end, or with too large an overlap. The allowed
    # overlap grows by the distance that the body may have moved since its last search.
    if not is_on_wall or gap < -min(
        LARGEST_NEW_OVERLAP * radius, allowed_overlap + distance_moved
    ):
        # The body is past the wall. If it has just come there and touches no curved
        # wall (-1 leaves no contact out), no overlap is allowed.
        if allowed_overlap == math.inf and not has_other_contact(
            contacts, n_contacts, body, -1
        ):
            allowed_overlap = 0.0
        contacts.allowed_overlap[wall, body] = allowed_overlap
        return NEXT_SEARCH_BEYOND_END * radius
    # Add the contact unless the list already has one at this azimuth. Nothing can be
    # written if the list is full, where k is -1.
    if not has_contact_near(contacts, n_contacts, body, wall, theta):
        normal_to_world(walls, wall, geometry)
        k = add_wall_contact(contacts, counts, state.N_CURVED, body, wall, geometry)
        if k >= 0:
            contacts.data[k // LANES, state.AZIMUTH + k % LANES] = theta
    return NEXT_SEARCH_IN_CONTACT * radius


@kernel
def search_cone(
    row,
    contacts,
    counts,
    parts,
    walls,
    wall,
    i,
    radius,
    allowed_overlap,
    distance_moved,
    profile,
    geometry,
):
    """Search for contacts of body i with a cone, and add those that are new.

    The overlap phi of the body with the cone is a function of the angle about the
    cone's axis. It is positive where the body reaches into the wall. First, it is
    computed at STARTS equally spaced angles. The solver then starts at each angle whose
    overlap is not smaller than that of either neighbour.

    Parameters
    ----------
    row : array
        The body in the frame of the cone, a row of `Bodies.rows`.
    contacts : WallContacts
        The list of contacts with curved walls.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_CURVED`.
    parts : int
        Number of ellipsoids of the body.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    wall : int
        Index of the cone.
    i : int
        Index of the body.
    radius, allowed_overlap, distance_moved : float
        Bounding radius of the body, largest overlap with which a contact may begin, and
        how far the body may have moved since its last search [m]; see
        `add_contact_if_new`.
    profile : array (STARTS,)
        Working memory for the overlaps; it is overwritten.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    cone = walls.cones[wall]
    spacing = 2.0 * math.pi / state.STARTS
    # Compute the overlap phi at equally spaced angles. Do not read `row` and `cone`
    # outside the loop: the compiler would combine other products, which changes the
    # last bits of the result (see `jit`).
    for start in range(state.STARTS):
        nx = cone[state.CONE_NORMAL_R] * COSINES[start]
        ny = cone[state.CONE_NORMAL_R] * SINES[start]
        profile[start] = (
            nx * row[X]
            + ny * row[Y]
            + cone[state.CONE_NORMAL_Z] * row[Z]
            + extent(row, parts, nx, ny, cone[state.CONE_NORMAL_Z])
            - cone[state.CONE_OFFSET]
        )
    shortest_distance = FAR
    for start in range(state.STARTS):
        overlap = profile[start]
        # The angles form a circle, so profile[-1], the last one, comes before
        # profile[0].
        if (
            overlap < profile[start - 1]
            or overlap < profile[(start + 1) % state.STARTS]
        ):
            continue
        # Find the local maximum near this angle, and compute the contact there.
        theta = solve_cone(row, parts, cone, start * spacing)
        is_on_wall = write_cone_contact(row, parts, cone, theta, geometry)
        free_distance = add_contact_if_new(
            contacts,
            counts,
            walls,
            i,
            wall,
            theta,
            is_on_wall,
            radius,
            allowed_overlap,
            distance_moved,
            geometry,
        )
        shortest_distance = min(shortest_distance, free_distance)
    # There is always a largest overlap, so FAR should not remain. If it did, 0.0 would
    # repeat the search in the next step.
    return shortest_distance if shortest_distance < FAR else 0.0


@kernel
def search_ring(
    row,
    contacts,
    counts,
    parts,
    walls,
    wall,
    i,
    radius,
    allowed_overlap,
    distance_moved,
    profile,
    geometry,
):
    """Search for contacts of body i with a ring edge, and add those that are new.

    A ring edge is a torus about the rounded end of a wall. The distance between the
    body and the central circle of the torus is computed at STARTS equally spaced
    angles. The solver starts at each angle whose distance is not larger than that of
    either neighbour.

    Parameters
    ----------
    row : array
        The body in the frame of the ring, a row of `Bodies.rows`.
    contacts : WallContacts
        The list of contacts with curved walls.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_CURVED`.
    parts : int
        Number of ellipsoids of the body.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    wall : int
        Index of the ring among the curved walls, where the cones come first.
    i : int
        Index of the body.
    radius, allowed_overlap, distance_moved : float
        Bounding radius of the body, largest overlap with which a contact may begin, and
        how far the body may have moved since its last search [m]; see
        `add_contact_if_new`.
    profile : array (STARTS,)
        Working memory for the distances; it is overwritten.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    # Rings are numbered after the cones.
    ring = walls.rings[wall - walls.cones.shape[0]]
    # Return early if the body's bounding sphere does not reach the ring.
    x, y, z = vector_at(row, state.POSITION)
    axial = abs(z - ring[state.RING_HEIGHT])
    radial = abs(math.sqrt(x * x + y * y) - ring[state.RING_RADIUS])
    clearance = math.sqrt(axial * axial + radial * radial)
    clearance = clearance - ring[state.RING_EDGE_RADIUS] - radius
    if clearance > 0.0:
        return clearance
    spacing = 2.0 * math.pi / state.STARTS
    # Compute the distance of the body from points on the circle at equal angles.
    for start in range(state.STARTS):
        nx, ny, nz, distance = direction_to_ring(row, ring, start)
        profile[start] = distance - extent(row, parts, nx, ny, nz)
    shortest_distance = FAR
    for start in range(state.STARTS):
        start_distance = profile[start]
        # The angles form a circle, so profile[-1], the last one, comes before
        # profile[0].
        if (
            start_distance > profile[start - 1]
            or start_distance > profile[(start + 1) % state.STARTS]
        ):
            continue
        # Find the point on the circle that is nearest to the body. The solver starts
        # from this angle and direction, and returns its own normal (nx, ny, nz).
        nx, ny, nz, _distance = direction_to_ring(row, ring, start)
        theta, nx, ny, nz = solve_ring(row, parts, ring, start * spacing, nx, ny, nz)
        is_open = write_ring_contact(row, parts, ring, theta, nx, ny, nz, geometry)
        free_distance = add_contact_if_new(
            contacts,
            counts,
            walls,
            i,
            wall,
            theta,
            is_open,
            radius,
            allowed_overlap,
            distance_moved,
            geometry,
        )
        shortest_distance = min(shortest_distance, free_distance)
    # There is always a smallest distance, so FAR should not remain. If it did, 0.0
    # would repeat the search in the next step.
    return shortest_distance if shortest_distance < FAR else 0.0


@inlined
def distance_from_disc_axis(row, parts, nx, ny, nz, dx, dy, dz):
    """Return the distance of a body's touching point from the axis of a disc [m].

    The touching point is the body's outermost point along the normal. The force uses
    the same point (`tile.write_plane_geometry`).

    Parameters
    ----------
    row : array
        The body: a row of `Bodies.rows`, whose columns `state` names.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    nx, ny, nz : float
        Unit normal of the disc.
    dx, dy, dz : float
        Vector from the body's centre to the centre of the disc [m].
    """
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    _h, along_u, along_w, _q_uu, _q_uw, _q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    # Measure from the axis of the disc instead of the body's centre.
    along_u -= ux * dx + uy * dy + uz * dz
    along_w -= wx * dx + wy * dy + wz * dz
    return math.sqrt(along_u * along_u + along_w * along_w)


@kernel
def search_plane(
    bodies, plane_contacts, curved_contacts, counts, parts, plane, wall, i, geometry
):
    """Search for the contact of body i with a plane, and add it if the body touches.

    A body is past the plane if it overlaps the plane's surface from behind, or beyond
    the edge of its disc. It gets no contact until it is clear of the surface.
    `plane_contacts.allowed_overlap[wall, i]` stores this as one of two values: 0.0 if
    the body is past the plane, otherwise infinity.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    plane_contacts, curved_contacts : WallContacts
        The lists of contacts with planes, and with cones and rings.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    plane : array
        The row of `Walls.planes`.
    wall : int
        Index of the plane.
    i : int
        Index of the body.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m]. While a contact lasts,
        this is FAR: no search is needed.
    """
    row = bodies.rows[i]
    nx, ny, nz = vector_at(plane, state.PLANE_NORMAL)
    point_x, point_y, point_z = vector_at(plane, state.PLANE_POINT)
    x, y, z = vector_at(row, state.POSITION)
    # (dx, dy, dz) is the vector from the body's centre to the point of the plane.
    dx, dy, dz = point_x - x, point_y - y, point_z - z
    height = nx * dx + ny * dy + nz * dz  # distance of the centre from the plane
    gap = height - extent(row, parts, nx, ny, nz)
    if gap > 0.0:
        plane_contacts.allowed_overlap[wall, i] = math.inf
        return gap
    distance = distance_from_disc_axis(row, parts, nx, ny, nz, dx, dy, dz)
    is_on_disc = distance <= plane[state.PLANE_RADIUS]
    # The body is past the plane if its touching point is beyond the edge of the disc,
    # or if its centre is behind the disc.
    if height < 0.0 or not is_on_disc:
        plane_contacts.allowed_overlap[wall, i] = 0.0
    if plane_contacts.allowed_overlap[wall, i] == 0.0:
        # The body stays past the plane unless it slides onto the disc from a curved
        # wall that ends there, as from the inside of a cylinder onto its lid. Then it
        # overlaps the curved wall by at least as much as the disc. The -1 leaves no
        # wall out.
        overlap = overlap_with_other_walls(
            curved_contacts, counts[state.N_CURVED], i, -1
        )
        if height < 0.0 or not is_on_disc or -gap > overlap:
            # The body must move at least by its overlap to be clear of the surface.
            return -gap
        plane_contacts.allowed_overlap[wall, i] = math.inf
    # Add a new contact, which stores a copy of the plane.
    set_vector(geometry, contact_geometry.NORMAL, nx, ny, nz)
    k = add_wall_contact(plane_contacts, counts, state.N_PLANE, i, wall, geometry)
    if k >= 0:
        write_plane(plane_contacts.data[k // LANES], k % LANES, plane)
    return FAR


@inlined
def row_in_wall_frame(walls, frame, row, parts, local_row):
    """Return the row of a body in the frame of a curved wall or mesh.

    If the frame is that of the world, the result is `row` itself. Otherwise it is
    `local_row`, which is overwritten.

    Parameters
    ----------
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    frame : int
        Index of the frame in `Walls.frames`.
    row : array
        The body: a row of `Bodies.rows`, whose columns `state` names.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    local_row : array
        Working memory for the row in the frame; it may be overwritten.
    """
    if walls.displaced[frame]:
        write_row_in_frame(row, parts, walls.frames[frame], local_row)
        return local_row
    return row


@inlined
def write_sphere_contact_in_frame(x, y, z, radius, walls, wall, geometry):
    """Compute the contact of a sphere with a cone or ring, in the frame of the wall.

    Parameters
    ----------
    x, y, z, radius : float
        Centre of the sphere in this frame, and its radius [m].
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    wall : int
        Index of the wall: cones and tubes first, then rings.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far the sphere is beyond the wall's end [m]; not positive on the wall.
    """
    n_cones = walls.cones.shape[0]
    if wall < n_cones:
        return write_sphere_cone_contact(x, y, z, radius, walls.cones[wall], geometry)
    return write_sphere_ring_contact(
        x, y, z, radius, walls.rings[wall - n_cones], geometry
    )


@inlined
def write_sphere_body_contact(row, walls, wall, geometry):
    """Compute the contact of a spherical body, and return whether it is on the wall.

    Parameters
    ----------
    row : array
        The sphere in the frame of the wall, a row of `Bodies.rows`.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    wall : int
        Index of the wall: cones and tubes first, then rings.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).
    """
    x, y, z = vector_at(row, state.POSITION)
    radius = row[state.SPHERE_RADIUS]
    distance_beyond = write_sphere_contact_in_frame(
        x, y, z, radius, walls, wall, geometry
    )
    return distance_beyond <= 0.0


@inlined
def search_sphere(
    row,
    contacts,
    counts,
    walls,
    wall,
    i,
    radius,
    allowed_overlap,
    distance_moved,
    geometry,
):
    """Search for the only contact of a sphere with a cone or ring.

    Parameters
    ----------
    row : array
        The sphere in the frame of the wall, a row of `Bodies.rows`.
    contacts : WallContacts
        The list of contacts with curved walls.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_CURVED`.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    wall : int
        Index among the curved walls: cones and tubes first, then rings.
    i : int
        Index of the body.
    radius, allowed_overlap, distance_moved : float
        Radius of the sphere, largest overlap with which a contact may begin, and how
        far the sphere may have moved since its last search [m]; see
        `add_contact_if_new`.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m]; FAR while the contact
        lasts.
    """
    is_on_wall = write_sphere_body_contact(row, walls, wall, geometry)
    if geometry[contact_geometry.GAP] > 0.0:
        return geometry[contact_geometry.GAP]
    free_distance = add_contact_if_new(
        contacts,
        counts,
        walls,
        i,
        wall,
        0.0,
        is_on_wall,
        radius,
        allowed_overlap,
        distance_moved,
        geometry,
    )
    return (
        FAR
        if has_contact_near(contacts, counts[state.N_CURVED], i, wall, 0.0)
        else free_distance
    )


@inlined
def search_curved_wall(
    bodies, curved_contacts, walls, counts, parts, wall, i, path, scratch
):
    """Search for contacts of smooth body i with a cone or ring.

    A smooth body is a sphere or a sum of ellipsoids, not a clump. The search decides
    again whether the body is past the wall: it overlaps the wall's surface from behind
    or beyond the wall's end, and may not begin a contact. Therefore `allowed_overlap`
    of body and wall is reset to infinity, which means that the body is not past the
    wall. `add_contact_if_new` makes it finite again if it is.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved_contacts : WallContacts
        The contacts with cones, tubes and rings.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    wall : int
        Index of the wall: cones and tubes first, then rings.
    i : int
        Index of the body.
    path : float
        Displacement of the body plus that of the walls until now [m].
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    profile = scratch.profile
    geometry = scratch.geometry
    radius = bounding_radius(bodies, i)
    # If the last search found the body past the wall, its limit is the path at that
    # search plus NEXT_SEARCH_BEYOND_END * radius. So this is how far the body has moved
    # since then. Otherwise the distance has no effect, because the allowed overlap is
    # infinite.
    allowed_overlap = curved_contacts.allowed_overlap[wall, i]
    distance_moved = (
        path - curved_contacts.limit[wall, i] + NEXT_SEARCH_BEYOND_END * radius
    )
    # From here on, the body counts as not past the wall, unless the search below finds
    # that it is.
    curved_contacts.allowed_overlap[wall, i] = math.inf
    row = row_in_wall_frame(walls, wall, bodies.rows[i], parts, scratch.local_row)
    if parts == state.SPHERES:
        return search_sphere(
            row,
            curved_contacts,
            counts,
            walls,
            wall,
            i,
            radius,
            allowed_overlap,
            distance_moved,
            geometry,
        )
    # Cones and tubes are numbered before rings.
    if wall < walls.cones.shape[0]:
        return search_cone(
            row,
            curved_contacts,
            counts,
            parts,
            walls,
            wall,
            i,
            radius,
            allowed_overlap,
            distance_moved,
            profile,
            geometry,
        )
    return search_ring(
        row,
        curved_contacts,
        counts,
        parts,
        walls,
        wall,
        i,
        radius,
        allowed_overlap,
        distance_moved,
        profile,
        geometry,
    )


@inlined
def follow_wall_contact(
    parts, row, walls, wall, contact_tile, lane, geometry, local_row
):
    """Follow a contact of a smooth body with a cone or ring by one time step.

    The solver starts from the azimuth (the angle theta about the wall's axis) of the
    last step, and for a ring also from the last normal. A body moves so little in a
    time step that FOLLOWING_STEPS Newton steps are enough. Their number is fixed,
    without a test for convergence, so that every contact takes the same time.

    The function writes the azimuth to the tile, and the contact to `geometry`. The
    caller writes the new normal to the tile.

    Parameters
    ----------
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    row : array
        The body: a row of `Bodies.rows`, whose columns `state` names.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    wall : int
        Index among the curved walls: cones and tubes first, then rings.
    contact_tile : array (rows * LANES,)
        The contact's tile of `WallContacts.data`: rows of LANES numbers, one for each
        contact. The azimuth in it is updated.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    geometry : array (8,)
        Overwritten with the contact (`contact_geometry`) in world axes.
    local_row : array
        Working memory for the row in the frame of the wall; it is overwritten.

    Returns
    -------
    bool
        Whether the contact lies on the wall, not beyond its end.
    """
    n_cones = walls.cones.shape[0]
    theta = contact_tile[state.AZIMUTH + lane]
    row = row_in_wall_frame(walls, wall, row, parts, local_row)
    # A sphere has a closed solution, which needs no azimuth.
    if parts == state.SPHERES:
        is_on_wall = write_sphere_body_contact(row, walls, wall, geometry)
    elif wall < n_cones:
        cone = walls.cones[wall]
        for _ in range(FOLLOWING_STEPS):
            theta = climb_cone(row, parts, cone, theta)
        is_on_wall = write_cone_contact(row, parts, cone, theta, geometry)
    else:
        ring = walls.rings[wall - n_cones]
        # Read the last normal number by number. With `lane_vector` the compiler would
        # combine other products, which changes the last bits of the result (see `jit`).
        first = state.NORMAL + lane
        nx, ny, nz = (
            contact_tile[first],
            contact_tile[first + LANES],
            contact_tile[first + 2 * LANES],
        )
        # The tile has the normal in world axes. Rotate it into the wall's frame if this
        # differs from the world's.
        if walls.displaced[wall]:
            nx, ny, nz = into_frame(walls.frames[wall], nx, ny, nz)
        for _ in range(FOLLOWING_STEPS):
            theta, nx, ny, nz, _step = make_ring_step(
                row, parts, ring, theta, nx, ny, nz
            )
        is_on_wall = write_ring_contact(row, parts, ring, theta, nx, ny, nz, geometry)
    contact_tile[state.AZIMUTH + lane] = theta
    contact_to_world(walls, wall, geometry)
    return is_on_wall
