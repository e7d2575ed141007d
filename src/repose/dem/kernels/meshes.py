"""Contacts of bodies with triangle meshes: how they begin and are followed in time.

A contact stays on one feature of the mesh (`features`) as long as it lies inside it. A
contact that leaves its feature is handed over, with its spring, to the feature that the
body touches now. The solvers are those of `mesh_contact`.

A body is a smooth body, or the sphere of a clump (see `clump_walls`). `row` is its row
in the frame of the mesh. `contacts` is the list of contacts with meshes, `n` its
length. Reads `Bodies.rows` and `Meshes`. Writes the lists of `WallContacts` (body,
wall, feature, data), `counts`, and the marks `Meshes.seen` and `Meshes.stamp` of a
search.
"""

import math
from collections import namedtuple

from . import contact_geometry, state
from .contact_geometry import arm_of, copy_geometry, normal_of
from .features import EDGE, EDGE_ANGLE, EDGE_LENGTH, FACE
from .frames import contact_to_world, into_frame, mesh_frame, normal_to_world
from .geometry import extent, step_normal
from .jit import inlined, kernel
from .mesh_contact import (
    SLACK,
    climb_edge,
    solve_feature,
    vertex_gap_and_step,
    write_edge_contact,
    write_face_contact,
    write_vertex_contact,
)
from .rows import LANES, lane_vector, vector_at, write_vector
from .state import bounding_radius
from .walls import (
    FOLLOWING_STEPS,
    LARGEST_NEW_OVERLAP,
    NEXT_SEARCH_BEYOND_END,
    NEXT_SEARCH_IN_CONTACT,
    add_wall_contact,
    row_in_wall_frame,
)

# A search reaches this far beyond the body's box (share of its radius).
SEARCH_MARGIN = 0.5
# The next feature of a contact is sought this far about its place (share of the body's
# radius), among features whose normal differs by less than the angle of this cosine.
HAND_OVER_REACH = 0.05
LEAST_NORMAL_COSINE = 0.9

# The first and last cell of a block along each axis.
CellBlock = namedtuple("CellBlock", "x0 x1 y0 y1 z0 z1")


@inlined
def meet_in_gentle_kink(meshes, face, other):
    """Return whether a feature is a face that meets another in a gentle concave kink.

    Of such faces a body touches only the one that it overlaps most.

    Parameters
    ----------
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    face, other : int
        Numbers of the two features.
    """
    if meshes.kind[face] != FACE:
        return False
    # the neighbours of a face are one part of a list
    is_near = False
    for k in range(meshes.span[face, 0], meshes.span[face, 1]):
        is_near = is_near or meshes.near[k] == other
    return is_near


@inlined
def has_contact_with_feature(contacts, meshes, n, body, feature, ignored):
    """Return whether a body touches a feature or a gentle neighbour of it already.

    Parameters
    ----------
    contacts, meshes : WallContacts, Meshes
        The list of contacts with meshes, and the features.
    n : int
        Number of contacts in the list.
    body, feature : int
        Numbers of the body and of the feature.
    ignored : int
        Number of a contact that does not count, or -1.
    """
    for k in range(n):
        if contacts.body[k] == body and k != ignored:
            other = contacts.feature[k]
            if other == feature or meet_in_gentle_kink(meshes, other, feature):
                return True
    return False


@inlined
def cell_range(meshes, mesh, axis, low, high):
    """Return the first and last cell of a mesh that an interval of one axis meets.

    Cells beyond the mesh's box are left out.

    Parameters
    ----------
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    mesh, axis : int
        Number of the mesh, and the axis: 0, 1 or 2.
    low, high : float
        Ends of the interval, in the frame of the mesh [m].
    """
    edge = meshes.box[mesh, 6]
    lower = meshes.box[mesh, axis]
    # cells are cubes with the same edge along all axes
    first = math.floor((low - lower) / edge)
    last = math.floor((high - lower) / edge)
    return max(first, 0), min(last, meshes.cells[mesh, axis] - 1)


@inlined
def cells_in_box(meshes, mesh, x, y, z, reach_x, reach_y, reach_z):
    """Return the block of cells of a mesh that a box about a place meets.

    Parameters
    ----------
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    mesh : int
        Number of the mesh.
    x, y, z : float
        The place, in the frame of the mesh [m].
    reach_x, reach_y, reach_z : float
        Half the edges of the box [m].

    Returns
    -------
    CellBlock
        The first and last cell along each axis.
    """
    x0, x1 = cell_range(meshes, mesh, 0, x - reach_x, x + reach_x)
    y0, y1 = cell_range(meshes, mesh, 1, y - reach_y, y + reach_y)
    z0, z1 = cell_range(meshes, mesh, 2, z - reach_z, z + reach_z)
    return CellBlock(x0, x1, y0, y1, z0, z1)


@inlined
def cell_index(meshes, mesh, cell_x, cell_y, cell_z):
    """Return the place in `Meshes.begin` of cell (x, y, z) of a mesh.

    `Meshes.begin` has the first feature of each cell, for all meshes one after another.
    """
    first = meshes.cells[mesh, 3]
    return (
        first
        + (cell_x * meshes.cells[mesh, 1] + cell_y) * meshes.cells[mesh, 2]
        + cell_z
    )


@inlined
def distance_from_box(row, parts, meshes, mesh):
    """Return a lower bound of the distance of a body from the box of a mesh [m].

    It is 0.0 where the body's own box and that of the mesh overlap.

    Parameters
    ----------
    row, parts : array, int
        Row of the body in the frame of the mesh, laid out as in `Bodies.rows`; and its
        number of ellipsoids, or SPHERES.
    meshes, mesh : Meshes, int
        The features with the boxes of all meshes, and the number of the mesh.
    """
    distance = 0.0
    for axis in range(3):
        # half the body's length along this axis
        reach = extent(
            row,
            parts,
            1.0 if axis == 0 else 0.0,
            1.0 if axis == 1 else 0.0,
            1.0 if axis == 2 else 0.0,
        )
        # the gap between both boxes along this axis, on either side
        lower = meshes.box[mesh, axis]
        upper = meshes.box[mesh, 3 + axis]
        distance = max(distance, lower - row[axis] - reach)
        distance = max(distance, row[axis] - reach - upper)
    return distance


@inlined
def add_feature_contact_if_new(
    row, contacts, counts, parts, walls, meshes, mesh, feature, i, radius, geometry
):
    """Add the contact of body i with a feature of a mesh, if there is a new one.

    Parameters
    ----------
    row : array
        The body, or the sphere of one, in the frame of the mesh.
    contacts, counts : WallContacts, array
        The list of contacts with meshes, and the lengths of all lists.
    parts : int
        Number of ellipsoids of the body; SPHERES, -1, for a sphere.
    walls, meshes : Walls, Meshes
        The walls, and the features of the meshes.
    mesh, feature, i : int
        Numbers of the mesh, the feature and the body.
    radius : float
        Bounding radius of the body [m]: the distance of its farthest point from its
        centre.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    angle, inside_distance, free_distance = solve_feature(
        row, parts, meshes, feature, radius, geometry
    )
    gap = geometry[contact_geometry.GAP]
    # there is a gap
    if free_distance > 0.0 and gap > 0.0:
        return free_distance
    # the body touches another feature, if any
    if inside_distance < 0.0:
        return max(free_distance, NEXT_SEARCH_BEYOND_END * radius)
    if gap < -LARGEST_NEW_OVERLAP * radius:
        # the body is inside the mesh
        return max(-gap - LARGEST_NEW_OVERLAP * radius, NEXT_SEARCH_BEYOND_END * radius)
    # a new contact with a relaxed spring
    if not has_contact_with_feature(
        contacts, meshes, counts[state.N_MESHED], i, feature, -1
    ):
        normal_to_world(walls, mesh_frame(walls, mesh), geometry)
        k = add_wall_contact(contacts, counts, state.N_MESHED, i, mesh, geometry)
        if k >= 0:
            contacts.feature[k] = feature
            contacts.data[k // LANES, state.AZIMUTH + k % LANES] = angle
    return NEXT_SEARCH_IN_CONTACT * radius


@kernel
def search_mesh(row, contacts, counts, parts, walls, meshes, mesh, i, radius, geometry):
    """Search for contacts of body i with a mesh, in the cells about the body.

    Parameters
    ----------
    row : array
        The body, or the sphere of one, in the frame of the mesh.
    contacts, counts : WallContacts, array
        The list of contacts with meshes, and the lengths of all lists.
    parts : int
        Number of ellipsoids of the body; SPHERES, -1, for a sphere.
    walls, meshes : Walls, Meshes
        The walls, and the features of the meshes.
    mesh, i : int
        Index of the mesh among the meshes, and index of the body.
    radius : float
        Bounding radius of the body [m]: the distance of its farthest point from its
        centre.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    distance = distance_from_box(row, parts, meshes, mesh)
    if distance > 0.0:
        return distance

    # The cells that a box about the body meets, which is SEARCH_MARGIN larger than the body.
    free_distance = SEARCH_MARGIN * radius
    reach_x = extent(row, parts, 1.0, 0.0, 0.0) + free_distance
    reach_y = extent(row, parts, 0.0, 1.0, 0.0) + free_distance
    reach_z = extent(row, parts, 0.0, 0.0, 1.0) + free_distance
    x, y, z = vector_at(row, state.POSITION)
    block = cells_in_box(meshes, mesh, x, y, z, reach_x, reach_y, reach_z)

    # A feature lies in several cells. The stamp of this search marks it as seen.
    meshes.stamp[0] += 1
    stamp = meshes.stamp[0]
    for cx in range(block.x0, block.x1 + 1):
        for cy in range(block.y0, block.y1 + 1):
            for cz in range(block.z0, block.z1 + 1):
                cell = cell_index(meshes, mesh, cx, cy, cz)
                for item in range(meshes.begin[cell], meshes.begin[cell + 1]):
                    feature = meshes.items[item]
                    if meshes.seen[feature] == stamp:
                        continue
                    meshes.seen[feature] = stamp
                    feature_free = add_feature_contact_if_new(
                        row,
                        contacts,
                        counts,
                        parts,
                        walls,
                        meshes,
                        mesh,
                        feature,
                        i,
                        radius,
                        geometry,
                    )
                    free_distance = min(free_distance, feature_free)
    return free_distance


@inlined
def solve_last_feature(
    row, parts, meshes, history, lane, feature, nx, ny, nz, geometry
):
    """Solve for the contact with the feature of the last step, from its last normal.

    As in `walls.follow_wall_contact`, a fixed number of Newton steps is enough for the small
    motion of one time step.

    Parameters
    ----------
    row, parts : array, int
        Row of the body in the frame of the mesh, laid out as in `Bodies.rows`; and its
        number of ellipsoids, or SPHERES.
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    history, lane : array, int
        The contact's tile of `WallContacts.data` and its lane; the angle about an edge
        is updated.
    feature : int
        Number of the feature.
    nx, ny, nz : float
        The last normal, in the frame of the mesh.
    geometry : array (8,)
        Overwritten by the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far inside the feature the contact lies; negative outside. It is a length
        [m], of an edge the smaller of a length and an angle, of a vertex a sine.
    """
    data = meshes.data[feature]
    if meshes.kind[feature] == FACE:
        return write_face_contact(row, parts, data, geometry)
    if meshes.kind[feature] == EDGE:
        # climb along the arc of normals about the edge, from the last angle
        angle = history[state.AZIMUTH + lane]
        for _ in range(FOLLOWING_STEPS):
            angle = climb_edge(row, parts, data, angle)
        history[state.AZIMUTH + lane] = angle
        place_along = write_edge_contact(row, parts, data, angle, geometry)
        # inside both the arc of normals and the two ends of the edge
        inside_arc = min(angle, data[EDGE_ANGLE] - angle)
        inside_ends = min(place_along, data[EDGE_LENGTH] - place_along)
        return min(inside_arc, inside_ends)
    # a vertex
    for _ in range(FOLLOWING_STEPS):
        _f, step_u, step_w = vertex_gap_and_step(row, parts, data, nx, ny, nz)
        nx, ny, nz = step_normal(nx, ny, nz, step_u, step_w)
    return write_vertex_contact(row, parts, meshes, feature, nx, ny, nz, geometry)


@kernel
def hand_over_contact(
    row, parts, meshes, contacts, n, k, radius, end_gap, geometry, other_geometry
):
    """Find the feature to which contact k has moved, and hand it over with its spring.

    Among the features about the contact point that the body touches, this is the one
    whose normal is nearest to the last normal.

    Parameters
    ----------
    row, parts : array, int
        Row of the body in the frame of the mesh, laid out as in `Bodies.rows`; and its
        number of ellipsoids, or SPHERES.
    meshes, contacts : Meshes, WallContacts
        The features, and the list of contacts with meshes.
    n, k : int
        Number of contacts in the list, and index of this contact.
    radius : float
        Bounding radius of the body [m]: the distance of its farthest point from its
        centre.
    end_gap : float
        The contact ends if its gap exceeds this [m].
    geometry : array (8,)
        The contact with the old feature; the one with the new feature is written to it.
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.

    Returns
    -------
    bool
        Whether there is such a feature. Then feature and angle of the contact are its.
    """
    # the cells about the contact point
    mesh = contacts.wall[k]
    old_feature = contacts.feature[k]
    reach = HAND_OVER_REACH * radius
    x, y, z = vector_at(row, state.POSITION)
    arm_x, arm_y, arm_z = arm_of(geometry)
    point_x, point_y, point_z = x + arm_x, y + arm_y, z + arm_z
    block = cells_in_box(meshes, mesh, point_x, point_y, point_z, reach, reach, reach)
    nx, ny, nz = normal_of(geometry)
    best_cosine = LEAST_NORMAL_COSINE
    has_feature = False
    for cx in range(block.x0, block.x1 + 1):
        for cy in range(block.y0, block.y1 + 1):
            for cz in range(block.z0, block.z1 + 1):
                cell = cell_index(meshes, mesh, cx, cy, cz)
                for item in range(meshes.begin[cell], meshes.begin[cell + 1]):
                    feature = meshes.items[item]
                    if feature == old_feature:
                        continue
                    angle, inside_distance, _free_distance = solve_feature(
                        row, parts, meshes, feature, radius, other_geometry
                    )
                    gap = other_geometry[contact_geometry.GAP]
                    # a contact outside this feature, or one that has ended, or is far
                    # inside the mesh
                    if (
                        inside_distance < -SLACK
                        or gap > end_gap
                        or gap < -LARGEST_NEW_OVERLAP * radius
                    ):
                        continue
                    other_nx, other_ny, other_nz = normal_of(other_geometry)
                    # keep the one whose normal is nearest to the last one, unless
                    # another contact has it
                    cosine = nx * other_nx + ny * other_ny + nz * other_nz
                    if cosine > best_cosine and not has_contact_with_feature(
                        contacts, meshes, n, contacts.body[k], feature, k
                    ):
                        best_cosine = cosine
                        has_feature = True
                        contacts.feature[k] = feature
                        contacts.data[k // LANES, state.AZIMUTH + k % LANES] = angle
                        copy_geometry(other_geometry, geometry)
    return has_feature


@inlined
def keep_deepest_face(row, parts, meshes, contacts, k, geometry, other_geometry):
    """Where faces meet in a gentle concave kink, keep the face of the largest overlap.

    Contact k is with a face. Its feature and `geometry` are replaced by those of a
    neighbour of this face that the body overlaps more.

    Parameters
    ----------
    row, parts : array, int
        Row of the body in the frame of the mesh, laid out as in `Bodies.rows`; and its
        number of ellipsoids, or SPHERES.
    meshes, contacts : Meshes, WallContacts
        The features, and the list of contacts with meshes.
    k : int
        Index of the contact in its list.
    geometry : array (8,)
        The contact in the frame of the mesh (`contact_geometry`).
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.
    """
    face = contacts.feature[k]
    for place in range(meshes.span[face, 0], meshes.span[face, 1]):
        neighbour = meshes.near[place]
        data = meshes.data[neighbour]
        # the contact that the body would have with the neighbour
        inside_distance = write_face_contact(row, parts, data, other_geometry)
        if (
            inside_distance >= 0.0
            and other_geometry[contact_geometry.GAP] < geometry[contact_geometry.GAP]
        ):
            contacts.feature[k] = neighbour
            copy_geometry(other_geometry, geometry)


@inlined
def follow_feature_contact(
    row,
    radius,
    parts,
    walls,
    frame,
    meshes,
    contacts,
    n,
    k,
    end_gap,
    geometry,
    other_geometry,
):
    """Follow contact k with a mesh by one time step.

    Parameters
    ----------
    row : array
        The body, or the sphere of one, in the frame of the mesh.
    radius : float
        Its bounding radius [m].
    parts : int
        Its number of ellipsoids, or SPHERES.
    walls, frame : Walls, int
        The walls, and the number of the frame of the mesh.
    meshes, contacts : Meshes, WallContacts
        The features of the meshes, and the list of contacts with meshes.
    n, k : int
        Number of contacts in the list, and index of this contact.
    end_gap : float
        The contact ends if its gap exceeds this [m].
    geometry : array (8,)
        Overwritten by the contact (`contact_geometry`), in world axes.
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.

    Returns
    -------
    bool
        Whether the contact lasts.
    """
    history = contacts.data[k // LANES]
    lane = k % LANES
    nx, ny, nz = lane_vector(history, state.NORMAL, lane)
    if walls.displaced[frame]:
        nx, ny, nz = into_frame(walls.frames[frame], nx, ny, nz)
    inside_distance = solve_last_feature(
        row, parts, meshes, history, lane, contacts.feature[k], nx, ny, nz, geometry
    )
    is_touching = inside_distance >= 0.0
    # A contact that has left its feature goes on with another one, if there is one.
    if not is_touching:
        is_touching = hand_over_contact(
            row,
            parts,
            meshes,
            contacts,
            n,
            k,
            radius,
            end_gap,
            geometry,
            other_geometry,
        )
    # where faces meet in a gentle kink, only one of them has the contact
    is_face = meshes.kind[contacts.feature[k]] == FACE
    if is_touching and geometry[contact_geometry.GAP] < 0.0 and is_face:
        keep_deepest_face(row, parts, meshes, contacts, k, geometry, other_geometry)
    contact_to_world(walls, frame, geometry)
    return is_touching and geometry[contact_geometry.GAP] <= end_gap


@inlined
def follow_mesh_contact(
    bodies,
    parts,
    walls,
    meshes,
    contacts,
    n,
    k,
    end_gap,
    geometry,
    other_geometry,
    local_row,
):
    """Follow contact k of a smooth body with a mesh by one time step.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    walls : Walls
        Shapes, places and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    contacts : WallContacts
        The list of contacts with meshes.
    n, k : int
        Number of contacts in the list, and index of this contact.
    end_gap : float
        The contact ends if its gap exceeds this [m].
    geometry : array (8,)
        Overwritten by the contact (`contact_geometry`), in world axes.
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.
    local_row : array
        Working memory for the row of a body in the frame of a wall; it is overwritten.

    Returns
    -------
    bool
        Whether the contact lasts.
    """
    i = contacts.body[k]
    frame = mesh_frame(walls, contacts.wall[k])
    row = row_in_wall_frame(walls, frame, bodies.rows[i], parts, local_row)
    radius = bounding_radius(bodies, i)
    return follow_feature_contact(
        row,
        radius,
        parts,
        walls,
        frame,
        meshes,
        contacts,
        n,
        k,
        end_gap,
        geometry,
        other_geometry,
    )


@inlined
def refresh_mesh_contacts(
    bodies,
    parts,
    walls,
    meshes,
    contacts,
    counts,
    mesh,
    i,
    geometry,
    other_geometry,
    local_row,
):
    """Bring the contacts of body i with a mesh to their present features and normals.

    A search after this does not find them as new contacts.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    walls : Walls
        Shapes, places and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    contacts : WallContacts
        The list of contacts with meshes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    mesh, i : int
        Index of the mesh among the meshes, and index of the body.
    geometry, other_geometry : array (8,)
        Scratch for two contacts; is overwritten.
    local_row : array
        Working memory for the row of a body in the frame of a wall; it is overwritten.
    """
    n = counts[state.N_MESHED]
    for k in range(n):
        if contacts.body[k] == i and contacts.wall[k] == mesh:
            follow_mesh_contact(
                bodies,
                parts,
                walls,
                meshes,
                contacts,
                n,
                k,
                0.0,
                geometry,
                other_geometry,
                local_row,
            )
            nx, ny, nz = normal_of(geometry)
            write_vector(contacts.data[k // LANES], state.NORMAL, k % LANES, nx, ny, nz)


@inlined
def find_body_mesh_contacts(
    bodies,
    meshed,
    walls,
    meshes,
    counts,
    parts,
    mesh,
    i,
    geometry,
    other_geometry,
    local_row,
):
    """Find new contacts of smooth body i with a mesh.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    meshed : WallContacts
        The contacts with meshes.
    walls : Walls
        Shapes, places and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    mesh, i : int
        Index of the mesh among the meshes, and index of the body.
    geometry, other_geometry : array (8,)
        Scratch for two contacts; is overwritten.
    local_row : array
        Working memory for the row of a body in the frame of a wall; it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    frame = mesh_frame(walls, mesh)
    refresh_mesh_contacts(
        bodies,
        parts,
        walls,
        meshes,
        meshed,
        counts,
        mesh,
        i,
        geometry,
        other_geometry,
        local_row,
    )
    row = row_in_wall_frame(walls, frame, bodies.rows[i], parts, local_row)
    radius = bounding_radius(bodies, i)
    return search_mesh(
        row, meshed, counts, parts, walls, meshes, mesh, i, radius, geometry
    )
