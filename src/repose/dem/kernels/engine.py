"""One time step: find the contacts, add up their forces, move the bodies.

`advance` runs on one thread; `parallel.advance_shared` makes the same steps on several.

The arguments are the arrays of a simulation (see `state`), and every function writes to
most of them. `flat`, `curved` and `meshed` are the contacts with planes, with curved
walls and with meshes. `contact_tile` and `body_tile` are scratch tiles for contacts and
bodies, `numbers` is the array of a `Scratch`. `ghost` is the number of the absent body.
`clumps` is an empty tuple in a simulation of smooth bodies (see `forces`), and `meshes`
where no wall is a mesh; their code is not compiled then.
"""

from . import state as st
from .forces import (
    curved_forces,
    fill_laws,
    mesh_forces,
    pair_forces,
    plane_forces,
    still_wall,
)
from .frames import move_plane_contacts, move_walls
from .jit import inlined, kernel
from .neighbours import retire_pairs, update_near
from .renewal import drop_gone, renew
from .rigid import act_on_events, integrate
from .sphere_search import retire_spheres, update_near_clumps
from .wall_search import update_meshes, update_walls


@inlined
def is_roomy(count, room):
    """Return whether a list of `count` items is at most three quarters full."""
    return count * 4 <= room * 3


@inlined
def has_room(pairs, flat, curved, meshed, counts):
    """Return whether every list of contacts is at most three quarters full."""
    return (
        is_roomy(counts[st.N_PAIRS], pairs.first.shape[0])
        and is_roomy(counts[st.N_NEAR], pairs.near_limit.shape[0])
        and is_roomy(counts[st.N_PLANE], flat.body.shape[0])
        and is_roomy(counts[st.N_CURVED], curved.body.shape[0])
        and is_roomy(counts[st.N_MESHED], meshed.body.shape[0])
    )


@inlined
def begin_step(
    bodies, pairs, flat, curved, meshed, clumps, grid, walls, counts, physics, ghost
):
    """Drop the contacts of the bodies that are gone, and move the moving walls."""
    if counts[st.N_GONE] > 0:
        drop_gone(bodies, pairs, flat, curved, meshed, clumps, counts, grid, ghost)
    if walls.approach[st.WALLS_MOVE] > 0.0:
        move_walls(walls, physics.dt)
        move_plane_contacts(flat, walls, counts[st.N_PLANE])


@inlined
def wall_contacts_and_forces(
    bodies,
    flat,
    curved,
    meshed,
    clumps,
    walls,
    meshes,
    counts,
    physics,
    contact_tile,
    scratch,
    ghost,
):
    """Find the contacts with walls, and add their forces to the loads of the bodies."""
    geometry = scratch.geometry
    other_geometry = scratch.other_geometry
    local_row = scratch.local_row
    parts = physics.parts
    update_walls(
        bodies,
        flat,
        curved,
        clumps,
        walls,
        counts,
        parts,
        physics.curved_walls_above,
        scratch,
    )
    if len(meshes) > 0:
        update_meshes(bodies, meshed, clumps, walls, meshes, counts, parts, scratch)
    # Prepare the tile for walls that stand still and are all of one material, the last
    # one. Where walls move or have several materials, each tile of contacts writes its own.
    still_wall(contact_tile)
    fill_laws(contact_tile, physics, 0, physics.law_constants.shape[0] - 1)
    plane_forces(bodies, flat, clumps, walls, counts, physics, contact_tile, ghost)
    curved_forces(
        bodies,
        curved,
        clumps,
        walls,
        counts,
        physics,
        contact_tile,
        geometry,
        local_row,
        ghost,
    )
    if len(meshes) > 0:
        mesh_forces(
            bodies,
            meshed,
            clumps,
            walls,
            meshes,
            counts,
            physics,
            contact_tile,
            geometry,
            other_geometry,
            local_row,
            ghost,
        )


@inlined
def find_pair_contacts(bodies, pairs, clumps, counts, grid, physics, scratch, ghost):
    """Find the contacts of pairs: check near pairs, and renew the neighbour list."""
    parts = physics.parts
    if len(clumps) == 0:
        normal = scratch.normal
        update_near(bodies, pairs, counts, grid, parts, normal)
        renew(bodies, pairs, clumps, counts, grid, parts, normal, ghost)
    else:
        spheres = scratch.spheres
        update_near_clumps(bodies, pairs, counts, grid, clumps, spheres, ghost)
        renew(bodies, pairs, clumps, counts, grid, parts, spheres, ghost)


@inlined
def add_pair_forces(bodies, pairs, clumps, counts, grid, physics, contact_tile, ghost):
    """Add the forces of pairs to the loads, and retire the pairs that parted."""
    n_ended = pair_forces(
        bodies, pairs, clumps, counts, physics, contact_tile, 0, 0, counts[st.N_PAIRS]
    )
    if len(clumps) == 0:
        retire_pairs(bodies, pairs, counts, grid, 0, n_ended, ghost)
    else:
        retire_spheres(bodies, pairs, counts, clumps, n_ended, ghost)


@kernel
def advance(
    bodies,
    pairs,
    flat,
    curved,
    meshed,
    clumps,
    grid,
    walls,
    meshes,
    counts,
    physics,
    contact_tile,
    body_tile,
    numbers,
    steps,
):
    """Advance by a number of steps, or by fewer where a list may become too short.

    Returns the number of steps made.
    """
    ghost = grid.cell.shape[0]
    scratch = st.scratch_of(numbers)
    for step in range(steps):
        if not has_room(pairs, flat, curved, meshed, counts):
            return step
        begin_step(
            bodies,
            pairs,
            flat,
            curved,
            meshed,
            clumps,
            grid,
            walls,
            counts,
            physics,
            ghost,
        )
        # contacts and forces: the loads of all bodies
        find_pair_contacts(bodies, pairs, clumps, counts, grid, physics, scratch, ghost)
        add_pair_forces(
            bodies, pairs, clumps, counts, grid, physics, contact_tile, ghost
        )
        wall_contacts_and_forces(
            bodies,
            flat,
            curved,
            meshed,
            clumps,
            walls,
            meshes,
            counts,
            physics,
            contact_tile,
            scratch,
            ghost,
        )
        # the motion under these loads
        counts[st.STEPS] += 1
        n_events = integrate(bodies, counts, physics, body_tile, 0, counts[st.N_BODIES])
        time = counts[st.STEPS] * physics.dt
        act_on_events(bodies, grid, counts, 0, n_events, time)
    return steps


@kernel
def add_wall_loads(
    bodies,
    flat,
    curved,
    meshed,
    clumps,
    walls,
    meshes,
    counts,
    physics,
    contact_tile,
    numbers,
    ghost,
):
    """Add the forces of the present state to `walls.loads`.

    The other arrays change as in a step.
    """
    scratch = st.scratch_of(numbers)
    wall_contacts_and_forces(
        bodies,
        flat,
        curved,
        meshed,
        clumps,
        walls,
        meshes,
        counts,
        physics,
        contact_tile,
        scratch,
        ghost,
    )
