"""One time step: find the contacts, add up their forces, move the bodies.

`clumps` is empty in a simulation of smooth bodies, see `forces`, and `meshes` where no wall is one: their code is then
not compiled.
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
def has_room(pairs, flat, curved, meshed, counts):
    """Whether every list is less than three quarters full."""
    return (
        counts[st.N_PAIRS] * 4 <= pairs.first.shape[0] * 3
        and counts[st.N_NEAR] * 4 <= pairs.near_limit.shape[0] * 3
        and counts[st.N_PLANE] * 4 <= flat.body.shape[0] * 3
        and counts[st.N_CURVED] * 4 <= curved.body.shape[0] * 3
        and counts[st.N_MESHED] * 4 <= meshed.body.shape[0] * 3
    )


@inlined
def begin_step(
    bodies, pairs, flat, curved, meshed, clumps, grid, walls, counts, physics, ghost
):
    """Before the search for contacts: drop the contacts of bodies that are gone, and move the walls."""
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
    t,
    scratch,
    ghost,
):
    """Find the contacts with walls and add their forces."""
    out, other, local = scratch.out, scratch.other, scratch.local
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
    still_wall(t)
    fill_laws(t, physics, 0, physics.law_constants.shape[0] - 1)
    plane_forces(bodies, flat, clumps, walls, counts, physics, t, ghost)
    curved_forces(bodies, curved, clumps, walls, counts, physics, t, out, local, ghost)
    if len(meshes) > 0:
        mesh_forces(
            bodies,
            meshed,
            clumps,
            walls,
            meshes,
            counts,
            physics,
            t,
            out,
            other,
            local,
            ghost,
        )


@kernel
def advance(
    bodies, pairs, flat, curved, meshed, clumps, grid, walls, meshes, counts, physics, t, bodies_tile, numbers, steps
):  # fmt: skip
    """Advance by a number of steps, or fewer where a list may become too short; returns the number of steps made."""
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
        if len(clumps) == 0:
            update_near(bodies, pairs, counts, grid, physics.parts, scratch.normal)
            renew(
                bodies,
                pairs,
                clumps,
                counts,
                grid,
                physics.parts,
                scratch.normal,
                ghost,
            )
        else:
            update_near_clumps(
                bodies, pairs, counts, grid, clumps, scratch.spheres, ghost
            )
            renew(
                bodies,
                pairs,
                clumps,
                counts,
                grid,
                physics.parts,
                scratch.spheres,
                ghost,
            )
        ended = pair_forces(
            bodies, pairs, clumps, counts, physics, t, 0, 0, counts[st.N_PAIRS]
        )
        if len(clumps) == 0:
            retire_pairs(bodies, pairs, counts, grid, 0, ended, ghost)
        else:
            retire_spheres(bodies, pairs, counts, clumps, ended, ghost)
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
            t,
            scratch,
            ghost,
        )
        counts[st.STEPS] += 1
        n = integrate(bodies, counts, physics, bodies_tile, 0, counts[st.N_BODIES])
        act_on_events(bodies, grid, counts, 0, n, counts[st.STEPS] * physics.dt)
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
    t,
    numbers,
    ghost,
):
    """Fill walls.loads with the forces of the present state; the other arrays change as in a step."""
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
        t,
        scratch,
        ghost,
    )
