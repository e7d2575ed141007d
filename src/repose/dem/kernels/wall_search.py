"""The search for new contacts with walls: which bodies are searched, and which walls.

The *reading* of a body is its displacement plus that of the walls. A search of a wall
returns how far the body may move before the next search; the reading at which that is
used up is `WallContacts.limit`. The least of a body's limits is `Bodies.wall_check`, and
the least way left in a tile of bodies is `Bodies.wall_margin`. `clumps` is an empty tuple
in a simulation of smooth bodies, see `forces`.

Reads `Bodies.rows` and the walls. Writes `Bodies.wall_check`, `wall_margin` and `passed`,
the lists and limits of `WallContacts`, `counts`, and scratch arrays.
"""

import math

from . import state as st
from .clump_walls import place_clump, spheres_at_mesh, spheres_at_wall
from .jit import inlined, kernel
from .meshes import body_at_mesh
from .rows import L
from .state import bounding_radius
from .walls import search_curved, search_plane


@inlined
def find_on_plane(bodies, flat, curved, clumps, walls, counts, parts, wall, i, scratch):
    """Find new contacts of body i with a plane.

    Returns how far the body may move before the next search [m].
    """
    if len(clumps) == 0:
        plane = walls.planes[wall]
        geometry = scratch.geometry
        return search_plane(
            bodies, flat, curved, counts, parts, plane, wall, i, geometry
        )
    return spheres_at_wall(
        bodies,
        flat,
        st.N_PLANE,
        clumps,
        walls,
        counts,
        wall,
        i,
        scratch.spheres,
        scratch.geometry,
    )


@inlined
def find_on_curved(
    bodies, curved, clumps, walls, counts, parts, wall, i, reading, scratch
):
    """Find new contacts of body i with a cone, tube or ring.

    Returns how far the body may move before the next search [m].
    """
    if len(clumps) == 0:
        return search_curved(
            bodies, curved, walls, counts, parts, wall, i, reading, scratch
        )
    return spheres_at_wall(
        bodies,
        curved,
        st.N_CURVED,
        clumps,
        walls,
        counts,
        wall,
        i,
        scratch.spheres,
        scratch.geometry,
    )


@kernel
def search_walls(
    bodies, flat, curved, clumps, walls, counts, parts, i, reading, lowest, scratch
):
    """Find new contacts of body i with planes and curved walls that are due.

    A body that is below `lowest` once is searched on planes only from then on. Returns
    the reading at the body's next search.
    """
    if len(clumps) > 0:
        place_clump(bodies, clumps, i, scratch.spheres)
    next_search = math.inf
    for wall in range(walls.planes.shape[0]):
        if reading >= flat.limit[wall, i]:
            free_distance = find_on_plane(
                bodies, flat, curved, clumps, walls, counts, parts, wall, i, scratch
            )
            flat.limit[wall, i] = reading + free_distance
        next_search = min(next_search, flat.limit[wall, i])
    top = bodies.rows[i, st.POSITION + 2] + bounding_radius(bodies, i)
    if top < lowest:
        bodies.passed[i] = 1
    if bodies.passed[i]:
        return next_search
    for wall in range(walls.cones.shape[0] + walls.rings.shape[0]):
        if reading >= curved.limit[wall, i]:
            free_distance = find_on_curved(
                bodies, curved, clumps, walls, counts, parts, wall, i, reading, scratch
            )
            curved.limit[wall, i] = reading + free_distance
        next_search = min(next_search, curved.limit[wall, i])
    return next_search


@inlined
def search_bodies(
    bodies, flat, curved, clumps, walls, counts, parts, lowest, scratch, begin, end
):
    """Search the walls for those of bodies `begin` to `end` that are due."""
    approach = walls.approach[st.WALL_PATH]
    for i in range(begin, end):
        reading = bodies.displacement[i] + approach
        if reading >= bodies.wall_check[i]:
            bodies.wall_check[i] = search_walls(
                bodies,
                flat,
                curved,
                clumps,
                walls,
                counts,
                parts,
                i,
                reading,
                lowest,
                scratch,
            )


@inlined
def margin_of(bodies, approach, begin, end):
    """Return the least way left until one of the bodies is due for walls [m]."""
    margin = math.inf
    for i in range(begin, end):
        reading = bodies.displacement[i] + approach
        margin = min(margin, bodies.wall_check[i] - reading)
    return margin


@kernel
def update_walls(bodies, flat, curved, clumps, walls, counts, parts, lowest, scratch):
    """Find new contacts with planes, cones, tubes and rings.

    A body once below `lowest` is searched on planes only. In a large simulation whose
    walls stand still, a tile of bodies is skipped until the paths of its fastest bodies
    may have used up its `wall_margin`.
    """
    n = counts[st.N_BODIES]
    if bodies.load.shape[0] == 1 or walls.approach[st.WALLS_MOVE] > 0.0:
        search_bodies(
            bodies, flat, curved, clumps, walls, counts, parts, lowest, scratch, 0, n
        )
        return
    for base in range(0, n, L):
        tile = base // L
        if bodies.wall_margin[tile] > st.ROUNDING:
            continue
        end = min(base + L, n)
        search_bodies(
            bodies,
            flat,
            curved,
            clumps,
            walls,
            counts,
            parts,
            lowest,
            scratch,
            base,
            end,
        )
        approach = walls.approach[st.WALL_PATH]
        bodies.wall_margin[tile] = margin_of(bodies, approach, base, end)


@inlined
def find_on_mesh(
    bodies, meshed, clumps, walls, meshes, counts, parts, mesh, i, scratch
):
    """Find new contacts of body i with a mesh.

    Returns how far the body may move before the next search [m].
    """
    geometry = scratch.geometry
    other_geometry = scratch.other_geometry
    local_row = scratch.local_row
    if len(clumps) == 0:
        return body_at_mesh(
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
    return spheres_at_mesh(
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
def update_meshes(bodies, meshed, clumps, walls, meshes, counts, parts, scratch):
    """Find new contacts with meshes, of all bodies that are due."""
    approach = walls.approach[st.WALL_PATH]
    for mesh in range(meshes.box.shape[0]):
        for i in range(counts[st.N_BODIES]):
            reading = bodies.displacement[i] + approach
            if reading < meshed.limit[mesh, i] or bodies.presence[i] != st.PRESENT:
                continue
            free_distance = find_on_mesh(
                bodies, meshed, clumps, walls, meshes, counts, parts, mesh, i, scratch
            )
            meshed.limit[mesh, i] = reading + free_distance
