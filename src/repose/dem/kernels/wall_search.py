"""The search for new contacts with walls, for bodies that may have reached one.

The *path* of a body is the sum of its displacement and that of the walls so far. A search
of a wall returns how far the body may move before the next search; the path at which that
is used up is `WallContacts.limit`. The smallest of a body's limits is `Bodies.wall_check`,
and the least way left in a tile of bodies is `Bodies.wall_margin`. `clumps` is an empty
tuple in a simulation of smooth bodies, see `forces`.

Reads `Bodies.rows` and the walls. Writes `Bodies.wall_check`, `wall_margin` and `passed`,
the lists and limits of `WallContacts`, `counts`, and scratch arrays.
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
    bodies, flat, curved, clumps, walls, counts, parts, wall, i, scratch
):
    """Find new contacts of body i with a plane.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    flat : WallContacts
        The contacts with planes.
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists, and other counters. The constants `state.N_PAIRS` and so
        on are its indices.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
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
            bodies, flat, curved, counts, parts, plane, wall, i, geometry
        )
    return find_sphere_wall_contacts(
        bodies,
        flat,
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
    bodies, curved, clumps, walls, counts, parts, wall, i, path, scratch
):
    """Find new contacts of body i with a cone, tube or ring.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists, and other counters. The constants `state.N_PAIRS` and so
        on are its indices.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    wall : int
        Index of the wall: cones and tubes first, then rings.
    i : int
        Index of the body.
    path : float
        Displacement of the body and the walls so far [m].
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.

    Returns
    -------
    float
        How far the body may move before the next search [m].
    """
    if len(clumps) == 0:
        return search_curved_wall(
            bodies, curved, walls, counts, parts, wall, i, path, scratch
        )
    return find_sphere_wall_contacts(
        bodies,
        curved,
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
    flat,
    curved,
    clumps,
    walls,
    counts,
    parts,
    i,
    path,
    curved_walls_above,
    scratch,
):
    """Find new contacts of body i with those planes and curved walls that are due.

    A wall is due when the path of the body has reached `WallContacts.limit`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    flat : WallContacts
        The contacts with planes.
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists, and other counters. The constants `state.N_PAIRS` and so
        on are its indices.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    i : int
        Index of the body.
    path : float
        Displacement of the body and the walls so far [m].
    curved_walls_above : float
        All curved walls lie above this height [m]. A body that was once wholly below it
        is not searched against them again.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.

    Returns
    -------
    float
        The path at the body's next search [m].
    """
    # all searches of this body use the places of its spheres
    if len(clumps) > 0:
        write_clump_spheres(bodies, clumps, i, scratch.spheres)
    next_search = math.inf
    # planes that are due; each gets a new limit
    for wall in range(walls.planes.shape[0]):
        if path >= flat.limit[wall, i]:
            free_distance = find_plane_contacts(
                bodies, flat, curved, clumps, walls, counts, parts, wall, i, scratch
            )
            flat.limit[wall, i] = path + free_distance
        next_search = min(next_search, flat.limit[wall, i])
    # the highest point of the body at most
    highest_point = bodies.rows[i, state.POSITION + 2] + bounding_radius(bodies, i)
    if highest_point < curved_walls_above:
        bodies.below_curved_walls[i] = 1
    if bodies.below_curved_walls[i]:
        return next_search
    # curved walls that are due
    for wall in range(walls.cones.shape[0] + walls.rings.shape[0]):
        if path >= curved.limit[wall, i]:
            free_distance = find_curved_wall_contacts(
                bodies, curved, clumps, walls, counts, parts, wall, i, path, scratch
            )
            curved.limit[wall, i] = path + free_distance
        next_search = min(next_search, curved.limit[wall, i])
    return next_search


@inlined
def search_due_bodies(
    bodies,
    flat,
    curved,
    clumps,
    walls,
    counts,
    parts,
    curved_walls_above,
    scratch,
    begin,
    end,
):
    """Search the walls for those bodies of a range that are due.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    flat : WallContacts
        The contacts with planes.
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists, and other counters. The constants `state.N_PAIRS` and so
        on are its indices.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    curved_walls_above : float
        All curved walls lie above this height [m].
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.
    begin, end : int
        First body of the range, and its end.
    """
    approach = walls.approach[state.WALL_PATH]
    for i in range(begin, end):
        # body and wall may have come nearer by this path in all
        path = bodies.displacement[i] + approach
        if path >= bodies.wall_check[i]:
            bodies.wall_check[i] = search_due_walls(
                bodies,
                flat,
                curved,
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
def smallest_wall_margin(bodies, approach, begin, end):
    """Return the least way left until one of some bodies is due for walls [m].

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    approach : float
        How far any wall may have come nearer until now [m].
    begin, end : int
        First of these bodies, and their end.
    """
    margin = math.inf
    for i in range(begin, end):
        path = bodies.displacement[i] + approach
        margin = min(margin, bodies.wall_check[i] - path)
    return margin


@kernel
def find_new_wall_contacts(
    bodies, flat, curved, clumps, walls, counts, parts, curved_walls_above, scratch
):
    """Find new contacts with planes, cones, tubes and rings, of bodies that are due.

    In a large simulation whose walls stand still, a tile of LANES bodies is skipped
    until the paths of its fastest bodies may have used up its `wall_margin`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    flat : WallContacts
        The contacts with planes.
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists, and other counters. The constants `state.N_PAIRS` and so
        on are its indices.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    curved_walls_above : float
        All curved walls lie above this height [m]; a body that was once wholly below it
        is searched on planes only.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.
    """
    n_bodies = counts[state.N_BODIES]
    # A large simulation has several shares of the loads.
    if bodies.load.shape[0] == 1 or walls.approach[state.WALLS_MOVE] > 0.0:
        search_due_bodies(
            bodies,
            flat,
            curved,
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
    # One tile of bodies after another; `first_body` is the number of its first body.
    for first_body in range(0, n_bodies, LANES):
        tile = first_body // LANES
        if bodies.wall_margin[tile] > state.ROUNDING:
            continue
        end = min(first_body + LANES, n_bodies)
        search_due_bodies(
            bodies,
            flat,
            curved,
            clumps,
            walls,
            counts,
            parts,
            curved_walls_above,
            scratch,
            first_body,
            end,
        )
        # how far the bodies of this tile may move until one of them is due again
        approach = walls.approach[state.WALL_PATH]
        bodies.wall_margin[tile] = smallest_wall_margin(
            bodies, approach, first_body, end
        )


@inlined
def find_mesh_contacts(
    bodies, meshed, clumps, walls, meshes, counts, parts, mesh, i, scratch
):
    """Find new contacts of body i with a mesh.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    meshed : WallContacts
        The contacts with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists, and other counters. The constants `state.N_PAIRS` and so
        on are its indices.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
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
        )
    return find_sphere_mesh_contacts(
        bodies,
        meshed,
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
    bodies, meshed, clumps, walls, meshes, counts, parts, scratch
):
    """Find new contacts with meshes, of all present bodies that are due.

    A mesh is due when the path of a body has reached `WallContacts.limit`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    meshed : WallContacts
        The contacts with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists, and other counters. The constants `state.N_PAIRS` and so
        on are its indices.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.
    """
    approach = walls.approach[state.WALL_PATH]
    for mesh in range(meshes.box.shape[0]):
        for i in range(counts[state.N_BODIES]):
            # body and mesh may have come nearer by this path in all
            path = bodies.displacement[i] + approach
            if path < meshed.limit[mesh, i] or bodies.presence[i] != state.PRESENT:
                continue
            free_distance = find_mesh_contacts(
                bodies, meshed, clumps, walls, meshes, counts, parts, mesh, i, scratch
            )
            meshed.limit[mesh, i] = path + free_distance
