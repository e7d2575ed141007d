"""The search for new contacts with walls: which bodies are searched, and against which walls.

The next search is due when the body and the walls together may have moved by the free distance of the last. `clumps` is
empty in a simulation of smooth bodies, see `forces`.
"""

import math

from . import state as st
from .clump_walls import place_clump, spheres_at_mesh, spheres_at_wall
from .jit import inlined, kernel
from .meshes import body_at_mesh
from .rows import L
from .walls import search_curved, search_plane


@inlined
def find_on_plane(bodies, flat, clumps, walls, counts, parts, wall, i, scratch):
    """Find new contacts of body i with a plane; returns how far it may move before the next search."""
    if len(clumps) == 0:
        return search_plane(
            bodies, flat, counts, parts, walls.planes[wall], wall, i, scratch.out
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
        scratch.out,
    )


@inlined
def find_on_curved(
    bodies, curved, clumps, walls, counts, parts, wall, i, reading, scratch
):
    """Find new contacts of body i with a cone, tube or ring; returns how far it may move before the next search."""
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
        scratch.out,
    )


@kernel
def look_at_walls(
    bodies, flat, curved, clumps, walls, counts, parts, i, reading, lowest, scratch
):
    """Find new contacts of body i with walls; returns its displacement at the next search."""
    if len(clumps) > 0:
        place_clump(bodies, clumps, i, scratch.spheres)
    wall_check = math.inf
    for w in range(walls.planes.shape[0]):
        if reading >= flat.limit[w, i]:
            free = find_on_plane(
                bodies, flat, clumps, walls, counts, parts, w, i, scratch
            )
            flat.limit[w, i] = reading + free
        wall_check = min(wall_check, flat.limit[w, i])
    if bodies.rows[i, 2] + bodies.motion[i // L, st.RADIUS + i % L] < lowest:
        bodies.passed[i] = 1
    if bodies.passed[i]:
        return wall_check
    for w in range(walls.cones.shape[0] + walls.rings.shape[0]):
        if reading >= curved.limit[w, i]:
            free = find_on_curved(
                bodies, curved, clumps, walls, counts, parts, w, i, reading, scratch
            )
            curved.limit[w, i] = reading + free
        wall_check = min(wall_check, curved.limit[w, i])
    return wall_check


@inlined
def look_at_bodies(
    bodies, flat, curved, clumps, walls, counts, parts, lowest, scratch, begin, end
):
    """Search the walls for bodies begin to end that may have reached one."""
    approach = walls.approach[st.WALL_PATH]
    for i in range(begin, end):
        reading = bodies.displacement[i] + approach
        if reading >= bodies.wall_check[i]:
            bodies.wall_check[i] = look_at_walls(
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


@kernel
def update_walls(bodies, flat, curved, clumps, walls, counts, parts, lowest, scratch):
    """Find new contacts with planes, cones, tubes and rings; a body once below `lowest` is checked against planes only.

    In a large simulation whose walls stand still, a tile of bodies is skipped until the paths of its fastest bodies may
    have used up its wall_margin.
    """
    n = counts[st.N_BODIES]
    if bodies.load.shape[0] == 1 or walls.approach[st.WALLS_MOVE] > 0.0:
        look_at_bodies(
            bodies, flat, curved, clumps, walls, counts, parts, lowest, scratch, 0, n
        )
        return
    for base in range(0, n, L):
        tile = base // L
        if bodies.wall_margin[tile] > st.ROUNDING:
            continue
        last = min(base + L, n)
        look_at_bodies(
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
            last,
        )
        free = math.inf
        for i in range(base, last):
            free = min(
                free,
                bodies.wall_check[i]
                - (bodies.displacement[i] + walls.approach[st.WALL_PATH]),
            )
        bodies.wall_margin[tile] = free


@inlined
def find_on_mesh(
    bodies, meshed, clumps, walls, meshes, counts, parts, mesh, i, scratch
):
    """Find new contacts of body i with a mesh; returns how far it may move before the next search."""
    out, other, local = scratch.out, scratch.other, scratch.local
    if len(clumps) == 0:
        return body_at_mesh(
            bodies, meshed, walls, meshes, counts, parts, mesh, i, out, other, local
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
        out,
        other,
        local,
    )


@kernel
def update_meshes(bodies, meshed, clumps, walls, meshes, counts, parts, scratch):
    """Find new contacts with meshes."""
    approach = walls.approach[st.WALL_PATH]
    for mesh in range(meshes.box.shape[0]):
        for i in range(counts[st.N_BODIES]):
            reading = bodies.displacement[i] + approach
            if reading < meshed.limit[mesh, i] or bodies.presence[i] != st.PRESENT:
                continue
            free = find_on_mesh(
                bodies, meshed, clumps, walls, meshes, counts, parts, mesh, i, scratch
            )
            meshed.limit[mesh, i] = reading + free
