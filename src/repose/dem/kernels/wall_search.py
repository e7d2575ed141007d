"""Search for new contacts with walls, for bodies that may have reached one.

The *path* of a body is its displacement plus that of the walls, both until now. The
search of a wall returns how far the body may move before the next search.
`WallContacts.limit` is the path at which this search is due. `Bodies.wall_check` is the
smallest limit of a body. `Bodies.wall_margin` is the smallest distance left until a
body of a tile is due. `clumps` is an empty tuple if all bodies are smooth, see
`forces`.

Reads `Bodies.rows` and the walls. Writes `Bodies.wall_check`, `wall_margin` and
`below_curved_walls`, the lists and limits of `WallContacts`, `counts`, and scratch
arrays.
"""

import math

from . import state
from .clump_walls import (
    find_sphere_mesh_contacts,
    find_sphere_wall_contacts,
    write_clump_spheres,
)
from .jit import inlined, kernel
from .meshes import find_body_mesh_contacts
from .rows import LANES
from .state import bounding_radius
from .walls import search_curved_wall, search_plane


@inlined
def find_plane_contacts(
    bodies,
    plane_contacts,
    curved_contacts,
    clumps,
    walls,
    counts,
    parts,
    wall,
    i,
    scratch,
):
    """Find new contacts of body i with a plane.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    plane_contacts : WallContacts
        The contacts with planes.
    curved_contacts : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    wall : int
        Index of the plane.
    i : int
        Index of the body.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    if len(clumps) == 0:
        plane = walls.planes[wall]
        geometry = scratch.geometry
        return search_plane(
            bodies,
            plane_contacts,
            curved_contacts,
            counts,
            parts,
            plane,
            wall,
            i,
            geometry,
        )
    return find_sphere_wall_contacts(
        bodies,
        plane_contacts,
        state.N_PLANE,
        clumps,
        walls,
        counts,
        wall,
        i,
        scratch.spheres,
        scratch.geometry,
    )


@inlined
def find_curved_wall_contacts(
    bodies, curved_contacts, clumps, walls, counts, parts, wall, i, path, scratch
):
    """Find new contacts of body i with a cone, tube or ring.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved_contacts : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
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
    if len(clumps) == 0:
        return search_curved_wall(
            bodies, curved_contacts, walls, counts, parts, wall, i, path, scratch
        )
    return find_sphere_wall_contacts(
        bodies,
        curved_contacts,
        state.N_CURVED,
        clumps,
        walls,
        counts,
        wall,
        i,
        scratch.spheres,
        scratch.geometry,
    )


@kernel
def search_due_walls(
    bodies,
    plane_contacts,
    curved_contacts,
    clumps,
    walls,
    counts,
    parts,
    i,
    path,
    curved_walls_above,
    scratch,
):
    """Find new contacts of body i with the planes and curved walls that are due.

    The path of a body is its displacement plus that of the walls until now. A wall is
    due when this path has reached `WallContacts.limit`, which is the path at which the
    body may touch the wall. A search gives the wall a new limit. Curved walls are
    cones, tubes and rings. A body that has once been entirely below all of them is
    marked, and they are never searched again for it.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    plane_contacts : WallContacts
        The contacts with planes.
    curved_contacts : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    i : int
        Index of the body.
    path : float
        Displacement of the body plus that of the walls until now [m].
    curved_walls_above : float
        All curved walls lie above this height [m]. Once a body has been entirely below
        it, its contacts with them are no longer searched for.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.

    Returns
    -------
    float
        The path at the body's next search [m].
    """
    # All searches for this body use the positions of its spheres.
    if len(clumps) > 0:
        write_clump_spheres(bodies, clumps, i, scratch.spheres)
    next_search = math.inf
    # Search the planes that are due. Each gets a new limit.
    for wall in range(walls.planes.shape[0]):
        if path >= plane_contacts.limit[wall, i]:
            # A body may slide from a curved wall onto a plane, so the search also needs
            # these contacts.
            free_distance = find_plane_contacts(
                bodies,
                plane_contacts,
                curved_contacts,
                clumps,
                walls,
                counts,
                parts,
                wall,
                i,
                scratch,
            )
            plane_contacts.limit[wall, i] = path + free_distance
        next_search = min(next_search, plane_contacts.limit[wall, i])
    # No point of the body is higher than this.
    highest_point = bodies.rows[i, state.POSITION + 2] + bounding_radius(bodies, i)
    if highest_point < curved_walls_above:
        bodies.below_curved_walls[i] = 1
    if bodies.below_curved_walls[i]:
        return next_search
    # Search the curved walls that are due.
    for wall in range(walls.cones.shape[0] + walls.rings.shape[0]):
        if path >= curved_contacts.limit[wall, i]:
            free_distance = find_curved_wall_contacts(
                bodies,
                curved_contacts,
                clumps,
                walls,
                counts,
                parts,
                wall,
                i,
                path,
                scratch,
            )
            curved_contacts.limit[wall, i] = path + free_distance
        next_search = min(next_search, curved_contacts.limit[wall, i])
    return next_search


@inlined
def search_due_bodies(
    bodies,
    plane_contacts,
    curved_contacts,
    clumps,
    walls,
    counts,
    parts,
    curved_walls_above,
    scratch,
    begin,
    end,
):
    """Find new contacts with walls for the bodies of a range that are due.

    A body is due when its displacement plus that of the walls until now has reached
    `bodies.wall_check`, the smallest path at which it may touch a wall.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    plane_contacts : WallContacts
        The contacts with planes.
    curved_contacts : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    curved_walls_above : float
        All curved walls lie above this height [m].
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.
    begin, end : int
        First body of the range, and its end.
    """
    wall_path = walls.approach[state.WALL_PATH]
    for i in range(begin, end):
        # Body and wall may have approached each other by this path in total.
        path = bodies.displacement[i] + wall_path
        if path >= bodies.wall_check[i]:
            bodies.wall_check[i] = search_due_walls(
                bodies,
                plane_contacts,
                curved_contacts,
                clumps,
                walls,
                counts,
                parts,
                i,
                path,
                curved_walls_above,
                scratch,
            )


@inlined
def smallest_wall_margin(bodies, wall_path, begin, end):
    """Return the smallest path left until a body of a range is due for a search [m].

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    wall_path : float
        How far any wall may have approached a body until now [m].
    begin, end : int
        First body of the range, and its end.
    """
    margin = math.inf
    for i in range(begin, end):
        path = bodies.displacement[i] + wall_path
        margin = min(margin, bodies.wall_check[i] - path)
    return margin


@kernel
def find_new_wall_contacts(
    bodies,
    plane_contacts,
    curved_contacts,
    clumps,
    walls,
    counts,
    parts,
    curved_walls_above,
    scratch,
):
    """Find new contacts with planes, cones, tubes and rings for bodies that are due.

    A body is due when its displacement plus that of the walls has reached its next
    search. In a large simulation whose walls stand still, a tile of LANES consecutive
    bodies is skipped while its bodies cannot be due: `Bodies.wall_margin` is how far
    they may still move. Each step reduces it by the path of the bodies.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    plane_contacts : WallContacts
        The contacts with planes.
    curved_contacts : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    curved_walls_above : float
        All curved walls lie above this height [m]. Once a body has been entirely below
        it, only its contacts with planes are searched for.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.
    """
    n_bodies = counts[state.N_BODIES]
    # Only a large simulation divides its loads into several arrays of partial sums, so
    # the number of these arrays tells whether it is large.
    if bodies.load.shape[0] == 1 or walls.approach[state.WALLS_MOVE] > 0.0:
        search_due_bodies(
            bodies,
            plane_contacts,
            curved_contacts,
            clumps,
            walls,
            counts,
            parts,
            curved_walls_above,
            scratch,
            0,
            n_bodies,
        )
        return
    # Handle one tile of bodies after another.
    for first_body in range(0, n_bodies, LANES):
        tile = first_body // LANES
        if bodies.wall_margin[tile] > state.ROUNDING:
            continue
        end = min(first_body + LANES, n_bodies)
        search_due_bodies(
            bodies,
            plane_contacts,
            curved_contacts,
            clumps,
            walls,
            counts,
            parts,
            curved_walls_above,
            scratch,
            first_body,
            end,
        )
        # How far the bodies of this tile may move until one of them is due
        wall_path = walls.approach[state.WALL_PATH]
        bodies.wall_margin[tile] = smallest_wall_margin(
            bodies, wall_path, first_body, end
        )


@inlined
def find_mesh_contacts(
    bodies, mesh_contacts, clumps, walls, meshes, counts, parts, mesh, i, scratch
):
    """Find new contacts of body i with a mesh.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    mesh_contacts : WallContacts
        The contacts with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    mesh : int
        Index of the mesh.
    i : int
        Index of the body.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    geometry = scratch.geometry
    other_geometry = scratch.other_geometry
    local_row = scratch.local_row
    if len(clumps) == 0:
        return find_body_mesh_contacts(
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
        )
    return find_sphere_mesh_contacts(
        bodies,
        mesh_contacts,
        clumps,
        walls,
        meshes,
        counts,
        mesh,
        i,
        scratch.spheres,
        geometry,
        other_geometry,
        local_row,
    )


@kernel
def find_new_mesh_contacts(
    bodies, mesh_contacts, clumps, walls, meshes, counts, parts, scratch
):
    """Find new contacts with meshes for all present bodies that are due.

    The path of a body is its displacement plus that of the walls until now. A mesh is
    due when this path has reached `WallContacts.limit`, which is the path at which the
    body may touch the mesh. The search gives it a new limit.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    mesh_contacts : WallContacts
        The contacts with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.
    """
    wall_path = walls.approach[state.WALL_PATH]
    for mesh in range(meshes.box.shape[0]):
        for i in range(counts[state.N_BODIES]):
            # Body and mesh may have approached each other by this path in total.
            path = bodies.displacement[i] + wall_path
            if (
                path < mesh_contacts.limit[mesh, i]
                or bodies.presence[i] != state.PRESENT
            ):
                continue
            free_distance = find_mesh_contacts(
                bodies,
                mesh_contacts,
                clumps,
                walls,
                meshes,
                counts,
                parts,
                mesh,
                i,
                scratch,
            )
            mesh_contacts.limit[mesh, i] = path + free_distance
