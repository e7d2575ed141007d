"""Contacts of clumps with walls, which are contacts of their individual spheres.

A sphere touches a plane, the inside of a cone or a ring edge in at most one point.
Therefore one bit stores whether it touches, and the contact is computed in closed form
in each step. Contacts with meshes are followed like those of smooth bodies (`meshes`),
with a sphere as the body.

As in `walls`, `WallContacts.limit` holds one number for each wall and body. It is
determined by the sphere that is nearest to the wall without touching it.

Reads `Bodies.rows`, `Clumps` and the walls. Writes the lists of `WallContacts` (body,
wall, feature, data), its `touching_bits`, `past_bits` and `limit`, `counts`,
`Clumps.mesh_sphere`, and scratch arrays.
"""

import math

import numpy as np

from . import clump_tile, contact_geometry, state
from .clumps import SPHERE_RADIUS_ROW, clear_bit, is_set, set_bit
from .contact_geometry import normal_of, shift_arm, write_sphere_contact
from .frames import contact_to_world, mesh_frame, place_in_frame, write_plane
from .jit import inlined, kernel
from .meshes import follow_feature_contact, search_mesh
from .rows import LANES, lane_vector, set_vector, vector_at, write_vector
from .sphere_search import (
    SPHERES_A,
    read_sphere_centre,
    read_sphere_radius,
    write_sphere_positions,
)
from .state import MOST_SPHERES, PLANE_NORMAL, PLANE_POINT, PLANE_RADIUS, SHAPE
from .walls import add_wall_contact, write_sphere_contact_in_frame


@inlined
def sphere_arm(row, tile, lane):
    """Return the vector from a clump's centre to the centre of a sphere, in world axes.

    Parameters
    ----------
    row : array
        The clump, a row of `Bodies.rows`, with its quaternion.
    tile : array (rows * LANES,)
        The contact's tile of `WallContacts.data`: rows of LANES numbers, one for each
        contact. It holds the sphere's centre in the body's axes.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    """
    qw = row[SHAPE]
    qx, qy, qz = vector_at(row, SHAPE + 1)
    centre_x, centre_y, centre_z = lane_vector(tile, clump_tile.CENTRE, lane)
    return clump_tile.rotated_vector(qw, qx, qy, qz, centre_x, centre_y, centre_z)


@inlined
def write_sphere_plane_contact(x, y, z, radius, plane, geometry):
    """Fill `geometry` for a sphere and a plane, in world axes.

    The normal points from the sphere into the wall, so `height` is positive while the
    centre is in front of the plane.

    Parameters
    ----------
    x, y, z, radius : float
        Centre and radius of the sphere [m].
    plane : array
        The row of `Walls.planes`.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far the sphere's centre is beyond the edge of the plane's disc [m]; negative
        inside.
    """
    nx, ny, nz = vector_at(plane, PLANE_NORMAL)
    point_x, point_y, point_z = vector_at(plane, PLANE_POINT)
    # The vector from the sphere's centre to the centre of the disc, and its component
    # along the normal
    dx, dy, dz = point_x - x, point_y - y, point_z - z
    height = nx * dx + ny * dy + nz * dz
    # The effective radius of a sphere on a plane is the sphere's radius, so the radius
    # is passed twice.
    write_sphere_contact(geometry, nx, ny, nz, height - radius, radius, radius)
    # The distance of the centre from the axis of the disc, by Pythagoras' theorem.
    # Rounding could make the difference negative.
    squared_distance = max(dx * dx + dy * dy + dz * dz - height * height, 0.0)
    return math.sqrt(squared_distance) - plane[PLANE_RADIUS]


@inlined
def point_in_wall_frame(walls, frame, x, y, z):
    """Return a point of the world in the frame of a curved wall or mesh.

    Parameters
    ----------
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    frame : int
        Index of the frame in `Walls.frames`.
    x, y, z : float
        The point [m].
    """
    if walls.displaced[frame]:
        return place_in_frame(walls.frames[frame], x, y, z)
    return x, y, z


@inlined
def write_sphere_contact_in_world(walls, wall, x, y, z, radius, geometry):
    """Compute the contact of a sphere with a cone or ring, in world axes.

    Parameters
    ----------
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    wall : int
        Index of the wall: cones and tubes first, then rings.
    x, y, z, radius : float
        Centre of the sphere in the world, and its radius [m].
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far the sphere is beyond the wall's end [m]; not positive on the wall.
    """
    x, y, z = point_in_wall_frame(walls, wall, x, y, z)
    distance_beyond = write_sphere_contact_in_frame(
        x, y, z, radius, walls, wall, geometry
    )
    contact_to_world(walls, wall, geometry)
    return distance_beyond


@inlined
def write_contact_sphere(contacts, clumps, k, i, sphere):
    """Write centre and radius of a sphere of body i to the lane of contact k.

    Both are in the axes of the body. `Clumps.spheres` holds the spheres of each shape
    at scale 1, so they are multiplied by the scale of the body. Contact k is lane k %
    LANES of tile k // LANES; a row of the tile holds one quantity of LANES contacts.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    k, i, sphere : int
        Indices of the contact, of the body, and of the sphere in the body.
    """
    tile = contacts.data[k // LANES]
    lane = k % LANES
    spheres = clumps.spheres[clumps.shape[i]]
    scale = clumps.scale[i]
    for axis in range(3):
        tile[clump_tile.CENTRE + axis * LANES + lane] = scale * spheres[axis, sphere]
    tile[clump_tile.RADIUS + lane] = scale * spheres[SPHERE_RADIUS_ROW, sphere]


@inlined
def add_sphere_wall_contact(
    contacts, counts, length_index, clumps, i, wall, sphere, geometry
):
    """Append the contact of a sphere of body i with a plane, cone or ring.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    length_index : int
        Index in `counts` of the length of this list: state.N_PLANE or state.N_CURVED.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    i, wall, sphere : int
        Indices of the body, of the wall, and of the sphere in the body.
    geometry : array (8,)
        The contact (`contact_geometry`), in world axes.

    Returns
    -------
    int
        Index of the contact, or -1 if there is no room.
    """
    k = add_wall_contact(contacts, counts, length_index, i, wall, geometry)
    if k >= 0:
        contacts.feature[k] = sphere
        write_contact_sphere(contacts, clumps, k, i, sphere)
        # Record that the sphere touches this wall. The slice is a view of one word of
        # bits.
        set_bit(contacts.touching_bits[wall, i : i + 1], sphere)
    return k


@inlined
def forget_sphere_contact(contacts, clumps, counts, length_index, k):
    """Record that the sphere of contact k no longer touches the wall.

    The caller then removes the contact. For planes, cones and rings, the bit that marks
    the sphere as touching is cleared. For meshes, the function only copies the sphere
    of the last contact to index k, because the bits of meshes are rewritten in every
    step.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    length_index : int
        Index in `counts` of the length of this list, such as state.N_PLANE.
    k : int
        Index of the contact in its list.
    """
    if length_index == state.N_MESHED:
        clumps.mesh_sphere[k] = clumps.mesh_sphere[counts[length_index] - 1]
    else:
        # Clear the bit of this sphere.
        bit = np.uint64(1) << np.uint64(contacts.feature[k])
        contacts.touching_bits[contacts.wall[k], contacts.body[k]] &= ~bit


@inlined
def find_free_distance(gap, distance_beyond, radius, past_bits, sphere, is_leaning):
    """Return how far a sphere may move before it touches a wall [m]; 0.0 for contact.

    A sphere is past the wall if it overlaps the wall's surface beyond the wall's end,
    or if its centre is behind the surface. It gets no contact, because this would begin
    with a large force, and it remains past the wall until it is clear of the surface.
    This is recorded in `past_bits`. A sphere of a body that leans on a curved wall does
    not become past the wall, because it may slide from that wall onto this one.

    Parameters
    ----------
    gap : float
        Gap to the surface of the wall, which is continued beyond the wall's end [m]. It
        is negative for an overlap.
    distance_beyond : float
        How far the sphere is beyond the end of the wall [m]; negative on the wall.
    radius : float
        Radius of the sphere [m].
    past_bits : array (1,)
        Bits that mark the spheres of the body that are past the wall. They are updated.
    sphere : int
        Index of the sphere.
    is_leaning : bool
        Whether the body leans on a curved wall: one of its spheres touches a cone, tube
        or ring. It is False in a search of a plane.
    """
    # The sphere is clear of the surface, so it is no longer past the wall.
    if gap > 0.0:
        clear_bit(past_bits, sphere)
        return gap
    # Take the larger of two distances: that beyond the wall's end, and that of the
    # centre behind the surface. If neither is positive, the sphere touches the wall.
    distance_outside = max(distance_beyond, -gap - radius)
    if distance_outside > 0.0 and not is_leaning:
        set_bit(past_bits, sphere)
    # A sphere that is past the wall must move by its overlap to become clear. Otherwise
    # it touches the wall (0.0), or must first move onto the wall.
    return -gap if is_set(past_bits, sphere) else max(distance_outside, 0.0)


@inlined
def find_touching_spheres(touching_bits, i):
    """Return which spheres of body i touch any wall of one kind, as bits of a word.

    Parameters
    ----------
    touching_bits : array of uint64 (walls, bodies)
        `WallContacts.touching_bits`: bits that mark the touching spheres, for each wall
        and body.
    i : int
        Index of the body.
    """
    bits = np.uint64(0)
    for wall in range(touching_bits.shape[0]):
        bits |= touching_bits[wall, i]
    return bits


@inlined
def record_sphere_slide_off(bodies, contacts, walls, k):
    """Let a sphere that slid over the end of a curved wall touch the next wall.

    The sphere is that of contact k. If the bit of a sphere is set in
    `contacts.past_bits`, the sphere is past the wall: it overlaps the wall's surface
    beyond the wall's end or from behind, and no contact begins. The bit is cleared
    here, because the sphere may slide onto any of these walls. They are searched in the
    next step: `contacts.limit` is the path of the body at which the next search is due.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    k : int
        Index of the contact in its list.
    """
    # Each wall of this kind that the sphere was past may be the next wall.
    i = contacts.body[k]
    # For clumps, the feature of a contact is the index of the sphere.
    sphere = contacts.feature[k]
    for wall in range(contacts.limit.shape[0]):
        # The slice is a view of one word, because `clear_bit` takes a row of words.
        past_bits = contacts.past_bits[wall, i : i + 1]
        if is_set(past_bits, sphere):
            clear_bit(past_bits, sphere)
            # The limit becomes the present path, the displacement of the body plus that
            # of the walls, so the search is due.
            contacts.limit[wall, i] = (
                bodies.displacement[i] + walls.approach[state.WALL_PATH]
            )


@kernel
def find_sphere_wall_contacts(
    bodies,
    contacts,
    length_index,
    clumps,
    walls,
    counts,
    wall,
    i,
    sphere_scratch,
    geometry,
):
    """Find the spheres of body i that begin to touch a wall, and add their contacts.

    The wall is a plane, cone, tube or ring. A sphere that overlaps the wall's surface
    beyond the wall's end or from behind is past the wall. It gets no contact until it
    is clear of the surface. The function updates the bits in `contacts.past_bits` that
    mark these spheres, and adds to `contacts` and `counts`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    length_index : int
        Index in `counts` of the length of this list. It also says which kind of wall is
        searched: state.N_PLANE or state.N_CURVED.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    wall : int
        Index of the wall among those of its kind.
    i : int
        Index of the body.
    sphere_scratch : array
        The spheres of the body in the world, see `write_clump_spheres`.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    shortest_distance = math.inf
    # Bits of the spheres that touch any cone, tube or ring. In a search of a plane they
    # are not needed.
    if length_index == state.N_CURVED:
        touching_bits = find_touching_spheres(contacts.touching_bits, i)
    else:
        touching_bits = np.uint64(0)
    # A body leans on the curved walls that it touches. Its other spheres may slide from
    # these walls onto this one.
    is_leaning = touching_bits != np.uint64(0)
    for sphere in range(clumps.sizes[clumps.shape[i]]):
        # A sphere that touches the wall already has a contact. The slice is a view of
        # one word, because `is_set` takes a row of words.
        if is_set(contacts.touching_bits[wall, i : i + 1], sphere):
            continue
        # Compute the contact that the sphere would have, and how far it is beyond the
        # wall's end.
        x, y, z = read_sphere_centre(sphere_scratch, SPHERES_A, sphere)
        radius = read_sphere_radius(sphere_scratch, SPHERES_A, sphere)
        if length_index == state.N_CURVED:
            distance_beyond = write_sphere_contact_in_world(
                walls, wall, x, y, z, radius, geometry
            )
        else:
            distance_beyond = write_sphere_plane_contact(
                x, y, z, radius, walls.planes[wall], geometry
            )
        # Bits that mark the spheres of the body that are past this wall
        past_bits = contacts.past_bits[wall, i : i + 1]
        if (touching_bits >> np.uint64(sphere)) & np.uint64(1) != np.uint64(0):
            # The sphere itself touches another curved wall and may slide from it onto
            # this one. `touching_bits` is a single word, for which `is_set` cannot be
            # used.
            clear_bit(past_bits, sphere)
        free_distance = find_free_distance(
            geometry[contact_geometry.GAP],
            distance_beyond,
            radius,
            past_bits,
            sphere,
            is_leaning,
        )
        # The sphere does not touch the wall yet.
        if free_distance > 0.0:
            shortest_distance = min(shortest_distance, free_distance)
            continue
        k = add_sphere_wall_contact(
            contacts, counts, length_index, clumps, i, wall, sphere, geometry
        )
        # The contact with a plane stores a copy of the plane. If the list is full, k is
        # -1.
        if length_index == state.N_PLANE and k >= 0:
            write_plane(contacts.data[k // LANES], k % LANES, walls.planes[wall])
    return shortest_distance


@inlined
def write_clump_spheres(bodies, clumps, i, sphere_scratch):
    """Write centres and radii of the spheres of body i, in world axes, to an array.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    i : int
        Index of the body.
    sphere_scratch : array
        The array `Scratch.spheres`; its rows SPHERES_A are overwritten.
    """
    shape = clumps.shape[i]
    row = bodies.rows[i]
    spheres = clumps.spheres[shape]
    size = clumps.sizes[shape]
    write_sphere_positions(
        row, spheres, size, clumps.scale[i], 0.0, 0.0, 0.0, sphere_scratch, SPHERES_A
    )


@inlined
def write_sphere_as_body(walls, frame, x, y, z, radius, local_row):
    """Write a sphere as the row of a body of one ellipsoid, in the frame of a wall.

    The functions of `meshes` need this form of a body.

    Parameters
    ----------
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    frame : int
        Index of the frame in `Walls.frames`.
    x, y, z, radius : float
        Centre of the sphere in the world, and its radius [m].
    local_row : array
        Overwritten by the position and the shape.
    """
    x, y, z = point_in_wall_frame(walls, frame, x, y, z)
    set_vector(local_row, state.POSITION, x, y, z)
    # The matrix of a sphere has the squared radius on its diagonal.
    squared_radius = radius * radius
    set_vector(local_row, SHAPE, squared_radius, 0.0, 0.0)
    set_vector(local_row, SHAPE + 3, squared_radius, 0.0, squared_radius)


@inlined
def contacts_by_sphere(mesh_contacts, clumps):
    """Return the contacts with meshes, with indices of spheres in place of bodies.

    With these, a search can treat a sphere of a clump like a body. The arrays are not
    copied.

    Parameters
    ----------
    mesh_contacts : WallContacts
        The contacts with meshes.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    """
    return state.WallContacts(
        clumps.mesh_sphere,
        mesh_contacts.wall,
        mesh_contacts.feature,
        mesh_contacts.data,
        mesh_contacts.limit,
        mesh_contacts.ended,
        mesh_contacts.allowed_overlap,
        mesh_contacts.touching_bits,
        mesh_contacts.past_bits,
    )


@inlined
def follow_sphere_contact(
    bodies,
    walls,
    meshes,
    mesh_contacts,
    clumps,
    n_contacts,
    k,
    end_gap,
    geometry,
    other_geometry,
    local_row,
):
    """Follow contact k of a clump's sphere with a mesh by one step.

    The sphere is treated as a body of its own by `meshes.follow_feature_contact`.
    Afterwards, the arm in `geometry`, which is the vector to the contact point, is
    shifted so that it begins at the centre of the clump. Contact k is lane k % LANES of
    tile k // LANES.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    mesh_contacts : WallContacts
        The contacts with meshes.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    n_contacts, k : int
        Number of contacts in the list, and index of this one.
    end_gap : float
        The contact ends if its gap exceeds this [m].
    geometry : array (8,)
        Overwritten with the contact (`contact_geometry`) in world axes.
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.
    local_row : array
        Working memory for the row of a body in the frame of a wall; it is overwritten.

    Returns
    -------
    bool
        Whether the contact continues.
    """
    contacts = contacts_by_sphere(mesh_contacts, clumps)
    frame = mesh_frame(walls, mesh_contacts.wall[k])
    # Find the sphere's centre and radius in the contact's tile, and write the sphere to
    # `local_row` in the frame of the mesh.
    tile = mesh_contacts.data[k // LANES]
    lane = k % LANES
    row = bodies.rows[mesh_contacts.body[k]]
    arm_x, arm_y, arm_z = sphere_arm(row, tile, lane)
    radius = tile[clump_tile.RADIUS + lane]
    x, y, z = vector_at(row, state.POSITION)
    write_sphere_as_body(
        walls, frame, x + arm_x, y + arm_y, z + arm_z, radius, local_row
    )
    # Follow the sphere as a body of one ellipsoid: the third argument is its number of
    # ellipsoids.
    contact_continues = follow_feature_contact(
        local_row,
        radius,
        1,
        walls,
        frame,
        meshes,
        contacts,
        n_contacts,
        k,
        end_gap,
        geometry,
        other_geometry,
    )
    # The arm of the contact, from the clump's centre
    shift_arm(geometry, arm_x, arm_y, arm_z)
    return contact_continues


@inlined
def find_sphere_mesh_contacts(
    bodies,
    mesh_contacts,
    clumps,
    walls,
    meshes,
    counts,
    mesh,
    i,
    sphere_scratch,
    geometry,
    other_geometry,
    local_row,
):
    """Find the spheres of body i that begin to touch a mesh, and add their contacts.

    The search treats each sphere as a body of its own, with the index MOST_SPHERES * i
    + sphere. `Clumps.mesh_sphere` holds this index for each contact, and
    `contacts_by_sphere` returns the list of contacts with these indices in place of
    those of bodies.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    mesh_contacts : WallContacts
        The contacts with meshes.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    mesh, i : int
        Indices of the mesh and of the body.
    sphere_scratch : array
        The scratch array `Scratch.spheres`; it is overwritten.
    geometry, other_geometry : array (8,)
        Working memory for two contacts (`contact_geometry`); it is overwritten.
    local_row : array
        Working memory for the row of a body in the frame of a wall; it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    n_contacts = counts[state.N_MESHED]
    contacts = contacts_by_sphere(mesh_contacts, clumps)
    # Update features and normals of the body's contacts, so that the search does not
    # find these contacts again as new ones. The end gap 0.0 has no effect, because the
    # result is not used.
    for k in range(n_contacts):
        if mesh_contacts.body[k] == i and mesh_contacts.wall[k] == mesh:
            follow_sphere_contact(
                bodies,
                walls,
                meshes,
                mesh_contacts,
                clumps,
                n_contacts,
                k,
                0.0,
                geometry,
                other_geometry,
                local_row,
            )
            nx, ny, nz = normal_of(geometry)
            write_vector(
                mesh_contacts.data[k // LANES], state.NORMAL, k % LANES, nx, ny, nz
            )
    write_clump_spheres(bodies, clumps, i, sphere_scratch)
    frame = mesh_frame(walls, mesh)
    shortest_distance = math.inf
    for sphere in range(clumps.sizes[clumps.shape[i]]):
        x, y, z = read_sphere_centre(sphere_scratch, SPHERES_A, sphere)
        radius = read_sphere_radius(sphere_scratch, SPHERES_A, sphere)
        # The sphere in the frame of the mesh, as a body of one ellipsoid
        write_sphere_as_body(walls, frame, x, y, z, radius, local_row)
        # Contacts from this index on belong to this sphere.
        n_before = counts[state.N_MESHED]
        # The search needs a single index for the sphere, like the index of a body. The
        # argument 1 is the number of ellipsoids.
        sphere_index = MOST_SPHERES * i + sphere
        free_distance = search_mesh(
            local_row,
            contacts,
            counts,
            1,
            walls,
            meshes,
            mesh,
            sphere_index,
            radius,
            geometry,
        )
        shortest_distance = min(shortest_distance, free_distance)
        # In a new contact, the search wrote the sphere's index to `contacts.body`,
        # which is the array `Clumps.mesh_sphere`. Write the body's index and the sphere
        # itself to the list.
        for k in range(n_before, counts[state.N_MESHED]):
            mesh_contacts.body[k] = i
            write_contact_sphere(mesh_contacts, clumps, k, i, sphere)
    return shortest_distance
