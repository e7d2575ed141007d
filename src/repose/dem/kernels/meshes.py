"""Search for contacts of bodies with triangle meshes, and follow them in time.

A contact stays on one feature of the mesh (`features`) as long as it lies inside this
feature. A contact that leaves its feature moves, with its spring, to the feature that
the body touches now. The solvers are in `mesh_contact`.

A body is a smooth body or the sphere of a clump (see `clump_walls`). `row` is its row
in the frame of the mesh. `contacts` is the list of contacts with meshes, and
`n_contacts` its length. Reads `Bodies.rows` and `Meshes`. Writes the lists of
`WallContacts` (body, wall, feature, data), `counts`, and the marks of a search,
`Meshes.seen` and `Meshes.stamp`.
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

# A search extends this far beyond the body's box (as a fraction of the body's radius).
SEARCH_MARGIN = 0.5
# A contact that leaves its feature may move to features within this distance of the
# contact point (as a fraction of the body's radius) if the cosine of the angle between
# both normals is above the second constant.
HAND_OVER_REACH = 0.05
LEAST_NORMAL_COSINE = 0.9

# The first and last cell of a block along each axis
CellBlock = namedtuple("CellBlock", "first_x last_x first_y last_y first_z last_z")


@inlined
def meet_in_gentle_kink(meshes, face, other):
    """Return whether two features are faces that meet in a gentle kink.

    Such a kink is concave, with an angle below the limit in `features`. Of two such
    faces, a body touches only the one that it overlaps more.

    Parameters
    ----------
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    face, other : int
        Indices of the two features.
    """
    if meshes.kind[face] != FACE:
        return False
    # The neighbours of a face are consecutive in `Meshes.near`.
    is_neighbour = False
    for k in range(meshes.span[face, 0], meshes.span[face, 1]):
        is_neighbour = is_neighbour or meshes.near[k] == other
    return is_neighbour


@inlined
def has_contact_with_feature(contacts, meshes, n_contacts, body, feature, ignored):
    """Return whether the list has a contact of a body with a feature of a mesh.

    A contact with a face that meets this feature in a gentle kink, a concave edge with
    a small angle, counts as well: of such faces, a body touches only one.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with meshes.
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    n_contacts : int
        Number of contacts in the list.
    body, feature : int
        Indices of the body and of the feature.
    ignored : int
        Index of a contact that is left out, or -1.
    """
    for k in range(n_contacts):
        if contacts.body[k] == body and k != ignored:
            other = contacts.feature[k]
            if other == feature or meet_in_gentle_kink(meshes, other, feature):
                return True
    return False


@inlined
def cell_range(meshes, mesh, axis, low, high):
    """Return the first and last cell of a mesh that an interval on one axis overlaps.

    Cells beyond the mesh's box are left out.

    Parameters
    ----------
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    mesh, axis : int
        Index of the mesh, and the axis: 0, 1 or 2.
    low, high : float
        Ends of the interval, in the frame of the mesh [m].
    """
    cell_edge = meshes.box[mesh, 6]
    lower = meshes.box[mesh, axis]
    # Cells are cubes. `Meshes.box` has the corners of the box, then the edge of a cell.
    first = math.floor((low - lower) / cell_edge)
    last = math.floor((high - lower) / cell_edge)
    return max(first, 0), min(last, meshes.cells[mesh, axis] - 1)


@inlined
def cells_in_box(meshes, mesh, x, y, z, half_x, half_y, half_z):
    """Return the block of cells of a mesh that a box around a point overlaps.

    Parameters
    ----------
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    mesh : int
        Index of the mesh.
    x, y, z : float
        The point, in the frame of the mesh [m].
    half_x, half_y, half_z : float
        Half of the lengths of the box along the axes [m].

    Returns
    -------
    CellBlock
        The first and last cell along each axis.
    """
    first_x, last_x = cell_range(meshes, mesh, 0, x - half_x, x + half_x)
    first_y, last_y = cell_range(meshes, mesh, 1, y - half_y, y + half_y)
    first_z, last_z = cell_range(meshes, mesh, 2, z - half_z, z + half_z)
    return CellBlock(first_x, last_x, first_y, last_y, first_z, last_z)


@inlined
def cell_index(meshes, mesh, cell_x, cell_y, cell_z):
    """Return the index in `Meshes.begin` of cell (cell_x, cell_y, cell_z) of a mesh.

    `Meshes.begin` has the index of the first feature of each cell. It lists the cells
    of one mesh after another.
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

    It is 0.0 if the bounding boxes of the body and of the mesh overlap. Two boxes are
    apart by at least their gap along any axis, so the largest of these gaps is the
    bound.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    meshes : Meshes
        The features of all meshes, with the bounding box of each mesh
        (`features.Meshes`).
    mesh : int
        Index of the mesh.
    """
    distance = 0.0
    for axis in range(3):
        # Half of the body's length along this axis: its extent along the unit vector of
        # the axis
        reach = extent(
            row,
            parts,
            1.0 if axis == 0 else 0.0,
            1.0 if axis == 1 else 0.0,
            1.0 if axis == 2 else 0.0,
        )
        # The gap between the two boxes along this axis, on either side of the mesh. The
        # first three columns of a row are the position of the body.
        lower = meshes.box[mesh, axis]
        upper = meshes.box[mesh, 3 + axis]
        distance = max(distance, lower - row[axis] - reach)
        distance = max(distance, row[axis] - reach - upper)
    return distance


@inlined
def add_feature_contact_if_new(
    row, contacts, counts, parts, walls, meshes, mesh, feature, i, radius, geometry
):
    """Add the contact of body i with a feature of a mesh, unless the list has it.

    A feature is a face, a convex edge or a convex vertex. No contact is added if the
    body does not touch the feature, or if it overlaps the mesh so much that it must
    have come from behind. The function may change `contacts` and `counts`.

    Parameters
    ----------
    row : array
        Row of the body, or of a clump's sphere, in the frame of the mesh.
    contacts : WallContacts
        The list of contacts with meshes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_MESHED`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    mesh, feature, i : int
        Indices of the mesh, the feature and the body.
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
    # The body is still away from the feature, by at least `free_distance`.
    if free_distance > 0.0 and gap > 0.0:
        return free_distance
    # The contact point lies outside this feature, so the body may only touch another
    # one. Search again after a short distance.
    if inside_distance < 0.0:
        return max(free_distance, NEXT_SEARCH_BEYOND_END * radius)
    if gap < -LARGEST_NEW_OVERLAP * radius:
        # The body is inside the mesh, not at its surface. It gets no contact.
        return max(-gap - LARGEST_NEW_OVERLAP * radius, NEXT_SEARCH_BEYOND_END * radius)
    # Add the contact with a relaxed spring. The -1 leaves no contact out of the
    # comparison. If the list is full, k is -1. The row AZIMUTH keeps the angle about an
    # edge.
    if not has_contact_with_feature(
        contacts, meshes, counts[state.N_MESHED], i, feature, -1
    ):
        normal_to_world(walls, mesh_frame(walls, mesh), geometry)
        k = add_wall_contact(contacts, counts, state.N_MESHED, i, mesh, geometry)
        if k >= 0:
            contacts.feature[k] = feature
            contacts.data[k // LANES, state.AZIMUTH + k % LANES] = angle
    # Search again soon, because the body may also touch neighbouring features.
    return NEXT_SEARCH_IN_CONTACT * radius


@kernel
def search_mesh(row, contacts, counts, parts, walls, meshes, mesh, i, radius, geometry):
    """Search for contacts of body i with a mesh, in the cells around the body.

    Each mesh has a grid of cells. `meshes.items` lists the features (faces, edges and
    vertices) in each cell, from the index `meshes.begin[cell]` on. New contacts are
    added to `contacts` and `counts`. The arrays `meshes.seen` and `meshes.stamp`, the
    working memory of the search, are overwritten.

    Parameters
    ----------
    row : array
        Row of the body, or of a clump's sphere, in the frame of the mesh.
    contacts : WallContacts
        The list of contacts with meshes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_MESHED`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    mesh, i : int
        Indices of the mesh and of the body.
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

    # Find the cells that overlap the body's box, enlarged by SEARCH_MARGIN on each
    # side. Features outside these cells are at least this margin away.
    free_distance = SEARCH_MARGIN * radius
    half_x = extent(row, parts, 1.0, 0.0, 0.0) + free_distance
    half_y = extent(row, parts, 0.0, 1.0, 0.0) + free_distance
    half_z = extent(row, parts, 0.0, 0.0, 1.0) + free_distance
    x, y, z = vector_at(row, state.POSITION)
    block = cells_in_box(meshes, mesh, x, y, z, half_x, half_y, half_z)

    # A feature may lie in several cells. Features that this search has already met are
    # marked with its stamp.
    meshes.stamp[0] += 1
    stamp = meshes.stamp[0]
    for cell_x in range(block.first_x, block.last_x + 1):
        for cell_y in range(block.first_y, block.last_y + 1):
            for cell_z in range(block.first_z, block.last_z + 1):
                cell = cell_index(meshes, mesh, cell_x, cell_y, cell_z)
                for index in range(meshes.begin[cell], meshes.begin[cell + 1]):
                    feature = meshes.items[index]
                    if meshes.seen[feature] == stamp:
                        continue
                    meshes.seen[feature] = stamp
                    feature_distance = add_feature_contact_if_new(
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
                    free_distance = min(free_distance, feature_distance)
    return free_distance


@inlined
def solve_last_feature(
    row, parts, meshes, contact_tile, lane, feature, nx, ny, nz, geometry
):
    """Compute the contact with the feature of the previous step, from its last normal.

    The feature is a face, edge or vertex of the mesh. A fixed number of Newton steps is
    enough for the small motion in one time step, as in `walls.follow_wall_contact`. A
    vertex starts from the last normal, an edge from the last angle in the tile, and a
    face needs no start.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    contact_tile : array (rows * LANES,)
        The contact's tile of `WallContacts.data`: rows of LANES numbers, one for each
        contact. The angle about an edge in it is updated.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    feature : int
        Index of the feature.
    nx, ny, nz : float
        The last normal, in the frame of the mesh.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far inside the feature the contact lies; negative outside. For a face it is
        a length [m], for an edge the smaller of a length [m] and an angle [rad], for a
        vertex a sine. Only the sign is used.
    """
    data = meshes.data[feature]
    if meshes.kind[feature] == FACE:
        return write_face_contact(row, parts, data, geometry)
    if meshes.kind[feature] == EDGE:
        # Climb to the largest gap along the arc of normals about the edge, from the
        # last angle.
        angle = contact_tile[state.AZIMUTH + lane]
        for _ in range(FOLLOWING_STEPS):
            angle = climb_edge(row, parts, data, angle)
        contact_tile[state.AZIMUTH + lane] = angle
        distance_along = write_edge_contact(row, parts, data, angle, geometry)
        # The contact must lie within the arc of normals, and between the ends of the
        # edge.
        inside_arc = min(angle, data[EDGE_ANGLE] - angle)
        inside_ends = min(distance_along, data[EDGE_LENGTH] - distance_along)
        return min(inside_arc, inside_ends)
    # The feature is a vertex. The step is along the two tangents of the normal.
    for _ in range(FOLLOWING_STEPS):
        _gap, step_u, step_w = vertex_gap_and_step(row, parts, data, nx, ny, nz)
        nx, ny, nz = step_normal(nx, ny, nz, step_u, step_w)
    return write_vertex_contact(row, parts, meshes, feature, nx, ny, nz, geometry)


@kernel
def hand_over_contact(
    row,
    parts,
    meshes,
    contacts,
    n_contacts,
    k,
    radius,
    end_gap,
    geometry,
    other_geometry,
):
    """Move contact k, with its spring, to the feature that the body touches now.

    The contact has left its feature (face, edge or vertex). The new feature is the one
    whose normal is nearest to the last normal, among all features that the body touches
    around the contact point. The function overwrites `geometry`, and changes
    `contacts.feature` and the angle about an edge in `contacts.data`.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    contacts : WallContacts
        The list of contacts with meshes.
    n_contacts, k : int
        Number of contacts in the list, and index of this one.
    radius : float
        Bounding radius of the body [m]: the distance of its farthest point from its
        centre.
    end_gap : float
        The contact ends if its gap exceeds this [m].
    geometry : array (8,)
        The contact with the old feature; overwritten by the contact with the new one.
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.

    Returns
    -------
    bool
        Whether there is such a feature.
    """
    # Find the cells around the contact point.
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
    for cell_x in range(block.first_x, block.last_x + 1):
        for cell_y in range(block.first_y, block.last_y + 1):
            for cell_z in range(block.first_z, block.last_z + 1):
                cell = cell_index(meshes, mesh, cell_x, cell_y, cell_z)
                for index in range(meshes.begin[cell], meshes.begin[cell + 1]):
                    feature = meshes.items[index]
                    if feature == old_feature:
                        continue
                    angle, inside_distance, _free_distance = solve_feature(
                        row, parts, meshes, feature, radius, other_geometry
                    )
                    gap = other_geometry[contact_geometry.GAP]
                    # Skip a contact that lies outside this feature, that has ended, or
                    # that lies far inside the mesh.
                    if (
                        inside_distance < -SLACK
                        or gap > end_gap
                        or gap < -LARGEST_NEW_OVERLAP * radius
                    ):
                        continue
                    other_nx, other_ny, other_nz = normal_of(other_geometry)
                    # Keep the feature whose normal is nearest to the last normal,
                    # unless another contact of the body has this feature.
                    cosine = nx * other_nx + ny * other_ny + nz * other_nz
                    if cosine > best_cosine and not has_contact_with_feature(
                        contacts, meshes, n_contacts, contacts.body[k], feature, k
                    ):
                        best_cosine = cosine
                        has_feature = True
                        contacts.feature[k] = feature
                        contacts.data[k // LANES, state.AZIMUTH + k % LANES] = angle
                        copy_geometry(other_geometry, geometry)
    return has_feature


@inlined
def keep_deepest_face(row, parts, meshes, contacts, k, geometry, other_geometry):
    """Move contact k to a neighbouring face if the body overlaps that face more.

    The contact must be with a face. Its neighbours here are the faces that meet this
    face in a gentle kink, a concave edge with a small angle. A body touches only the
    one of them that it overlaps most. They are listed in `meshes.near`, in the range
    that `meshes.span` gives for the face. The function changes `contacts.feature` and
    `geometry`.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    contacts : WallContacts
        The list of contacts with meshes.
    k : int
        Index of the contact in its list.
    geometry : array (8,)
        The contact in the frame of the mesh (`contact_geometry`).
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.
    """
    face = contacts.feature[k]
    for index in range(meshes.span[face, 0], meshes.span[face, 1]):
        neighbour = meshes.near[index]
        data = meshes.data[neighbour]
        # Compute the contact that the body would have with the neighbour. It counts if
        # the contact point lies inside the triangle (0 or more) and the gap is smaller.
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
    n_contacts,
    k,
    end_gap,
    geometry,
    other_geometry,
):
    """Follow contact k with a mesh by one time step.

    A contact stays with one feature (face, edge or vertex) while it lies inside this
    feature. Otherwise it moves, with its spring, to the feature that the body touches
    now. The function may change `contacts.feature` and the angle about an edge in
    `contacts.data`. The caller writes the new normal to `contacts.data`.

    Parameters
    ----------
    row : array
        Row of the body, or of a clump's sphere, in the frame of the mesh.
    radius : float
        Bounding radius of the body [m].
    parts : int
        Number of ellipsoids in the body, or SPHERES.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    frame : int
        Index of the frame of the mesh in `Walls.frames`.
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    contacts : WallContacts
        The list of contacts with meshes.
    n_contacts, k : int
        Number of contacts in the list, and index of this one.
    end_gap : float
        The contact ends if its gap exceeds this [m].
    geometry : array (8,)
        Overwritten with the contact (`contact_geometry`) in world axes.
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.

    Returns
    -------
    bool
        Whether the contact continues.
    """
    contact_tile = contacts.data[k // LANES]
    lane = k % LANES
    # The last normal, rotated into the frame of the mesh if this differs from the
    # world's
    nx, ny, nz = lane_vector(contact_tile, state.NORMAL, lane)
    if walls.displaced[frame]:
        nx, ny, nz = into_frame(walls.frames[frame], nx, ny, nz)
    inside_distance = solve_last_feature(
        row,
        parts,
        meshes,
        contact_tile,
        lane,
        contacts.feature[k],
        nx,
        ny,
        nz,
        geometry,
    )
    # A negative distance means that the contact lies outside its feature.
    has_feature = inside_distance >= 0.0
    # A contact that has left its feature continues on another one, if there is one.
    # This overwrites `geometry` and may change `contacts.feature[k]`, which is read
    # below.
    if not has_feature:
        has_feature = hand_over_contact(
            row,
            parts,
            meshes,
            contacts,
            n_contacts,
            k,
            radius,
            end_gap,
            geometry,
            other_geometry,
        )
    # Faces may meet in a gentle kink, a concave edge with a small angle. Of such faces,
    # only the one with the largest overlap has the contact.
    is_face = meshes.kind[contacts.feature[k]] == FACE
    if has_feature and geometry[contact_geometry.GAP] < 0.0 and is_face:
        keep_deepest_face(row, parts, meshes, contacts, k, geometry, other_geometry)
    contact_to_world(walls, frame, geometry)
    return has_feature and geometry[contact_geometry.GAP] <= end_gap


@inlined
def follow_mesh_contact(
    bodies,
    parts,
    walls,
    meshes,
    contacts,
    n_contacts,
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
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    contacts : WallContacts
        The list of contacts with meshes.
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
        n_contacts,
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
    """Update features and normals of the contacts of body i with a mesh.

    Afterwards, a search does not take these contacts for new ones.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    contacts : WallContacts
        The list of contacts with meshes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    mesh, i : int
        Indices of the mesh and of the body.
    geometry, other_geometry : array (8,)
        Working memory for two contacts; it is overwritten.
    local_row : array
        Working memory for the row of a body in the frame of a wall; it is overwritten.
    """
    n_contacts = counts[state.N_MESHED]
    for k in range(n_contacts):
        if contacts.body[k] == i and contacts.wall[k] == mesh:
            follow_mesh_contact(
                bodies,
                parts,
                walls,
                meshes,
                contacts,
                n_contacts,
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
    mesh_contacts,
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
    mesh_contacts : WallContacts
        The contacts with meshes.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    mesh, i : int
        Indices of the mesh and of the body.
    geometry, other_geometry : array (8,)
        Working memory for two contacts; it is overwritten.
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
        mesh_contacts,
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
        row, mesh_contacts, counts, parts, walls, meshes, mesh, i, radius, geometry
    )
