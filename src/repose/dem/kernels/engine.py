"""Advance a simulation by time steps: find contacts, add up forces, move bodies.

`advance` runs on one thread. `parallel.advance_shared` makes the same steps on several.

The arguments are the arrays of a simulation (see `state`). Every function changes most
of them in place. `flat`, `curved` and `meshed` are the contacts with planes, with
curved walls and with meshes. `contact_tile` and `body_tile` are scratch tiles for
contacts and bodies. `ghost` is the index of the absent body. `clumps` is an empty tuple
if all bodies are smooth (see `forces`), and `meshes` is an empty tuple if no wall is a
mesh. Code that is not needed for an empty tuple is not compiled.
"""

from . import state
from .forces import (
    add_curved_wall_forces,
    add_mesh_forces,
    add_pair_forces,
    add_plane_forces,
    fill_law_constants,
    write_still_wall,
)
from .frames import move_plane_contacts, move_walls
from .jit import inlined, kernel
from .neighbours import retire_pairs, update_near_pairs
from .renewal import drop_contacts_of_gone, renew_pairs
from .rigid import handle_events, integrate
from .sphere_search import retire_spheres, update_near_clumps
from .wall_search import find_new_mesh_contacts, find_new_wall_contacts


@inlined
def has_free_quarter(n_items, capacity):
    """Return whether a list of `n_items` items is at most three quarters full.

    `capacity` is the length of the list's arrays. A step adds fewer items than a
    quarter of this length.
    """
    return n_items * 4 <= capacity * 3


@inlined
def has_room(pairs, flat, curved, meshed, counts):
    """Return whether every list of pairs and contacts is at most three quarters full.

    Parameters
    ----------
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.

    Returns
    -------
    bool
        If False, Python has to make longer lists before the next step.
    """
    return (
        has_free_quarter(counts[state.N_PAIRS], pairs.first.shape[0])
        and has_free_quarter(counts[state.N_NEAR], pairs.near_limit.shape[0])
        and has_free_quarter(counts[state.N_PLANE], flat.body.shape[0])
        and has_free_quarter(counts[state.N_CURVED], curved.body.shape[0])
        and has_free_quarter(counts[state.N_MESHED], meshed.body.shape[0])
    )


@inlined
def begin_step(
    bodies, pairs, flat, curved, meshed, clumps, grid, walls, counts, physics, ghost
):
    """Remove the contacts of bodies that are gone, and move the walls that move.

    A body is gone if it fell below the floor in the previous step. Contacts with planes
    keep a copy of their plane. These copies are updated.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    if counts[state.N_GONE] > 0:
        drop_contacts_of_gone(
            bodies, pairs, flat, curved, meshed, clumps, counts, grid, ghost
        )
    if walls.approach[state.WALLS_MOVE] > 0.0:
        move_walls(walls, physics.dt)
        move_plane_contacts(flat, walls, counts[state.N_PLANE])


@inlined
def process_wall_contacts(
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
    """Find the contacts with walls, and add their forces to the loads of the bodies.

    If the user requested the loads on the walls, the forces are added to these, too (in
    `walls.loads`). Contacts with planes (`flat`), curved walls (`curved`) and meshes
    (`meshed`) are in separate lists. `meshes` is an empty tuple if no wall is a mesh.
    The length of a tuple is part of its type, so the code for meshes is then not
    compiled.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes or ()
        The features of all meshes; an empty tuple if no wall is a mesh.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    contact_tile : array
        Scratch tile of LANES contacts (rows of `tile`); it is overwritten.
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    geometry = scratch.geometry
    other_geometry = scratch.other_geometry
    local_row = scratch.local_row
    parts = physics.parts
    # Find new contacts.
    find_new_wall_contacts(
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
        find_new_mesh_contacts(
            bodies, meshed, clumps, walls, meshes, counts, parts, scratch
        )
    # Prepare the tile for the simplest case: all walls stand still and have one
    # material, which is the last of all materials. In other cases,
    # `compute_wall_forces` overwrites this for each tile of contacts.
    write_still_wall(contact_tile)
    fill_law_constants(contact_tile, physics, 0, physics.law_constants.shape[0] - 1)
    # Add the forces, one kind of wall after another.
    add_plane_forces(bodies, flat, clumps, walls, counts, physics, contact_tile, ghost)
    add_curved_wall_forces(
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
        add_mesh_forces(
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
def update_pair_lists(bodies, pairs, clumps, counts, grid, physics, scratch, ghost):
    """Update the lists of pairs that touch and of pairs that are near.

    Near pairs are pairs whose gap was below the skin at the last search. They are
    checked if their bodies have moved enough to close the gap. Those that touch become
    contacts. Then new near pairs are found for bodies that have moved by half a skin.
    `clumps` is an empty tuple if the bodies are smooth; this is part of its type, so
    numba compiles only one of the branches.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : Scratch
        Working memory of this thread (`state.Scratch`); it is overwritten.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    parts = physics.parts
    if len(clumps) == 0:
        # Smooth bodies: the gap of a pair follows from a search for the contact normal.
        normal = scratch.normal
        update_near_pairs(bodies, pairs, counts, grid, parts, normal)
        renew_pairs(bodies, pairs, clumps, counts, grid, parts, normal, ghost)
    else:
        # Clumps: the gap of a pair is the smallest gap between spheres of the two.
        spheres = scratch.spheres
        update_near_clumps(bodies, pairs, counts, grid, clumps, spheres, ghost)
        renew_pairs(bodies, pairs, clumps, counts, grid, parts, spheres, ghost)


@inlined
def apply_pair_forces(
    bodies, pairs, clumps, counts, grid, physics, contact_tile, ghost
):
    """Add the forces of touching pairs to the loads, and remove pairs that have parted.

    A pair that has parted becomes a near pair again, with its present gap.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    contact_tile : array
        Scratch tile of LANES contacts (rows of `tile`); it is overwritten.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    # A single thread handles all pairs, so all their forces go to share 0 of the loads.
    n_ended = add_pair_forces(
        bodies,
        pairs,
        clumps,
        counts,
        physics,
        contact_tile,
        0,
        0,
        counts[state.N_PAIRS],
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
    scratch_numbers,
    n_steps,
):
    """Advance a simulation by a number of steps, or by fewer if a list is nearly full.

    In this case, the caller (`Simulation._advance`) lengthens the lists and calls this
    function again for the remaining steps. The order within a step is fixed: the pairs
    are updated before their forces are computed, and bodies move only after all forces
    have been added to their loads.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes or ()
        The features of all meshes; an empty tuple if no wall is a mesh.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    contact_tile, body_tile : array
        Scratch tiles of LANES contacts (rows of `tile`) and bodies (rows of
        `body_tile`).
    scratch_numbers : array (SCRATCH,)
        Memory of the other scratch arrays (`state.Scratch`).
    n_steps : int
        Number of steps.

    Returns
    -------
    int
        Number of steps made.
    """
    # `grid.cell` has an element for each body. The next index is the ghost: an absent
    # body without mass, which fills unused elements of the lists.
    ghost = grid.cell.shape[0]
    scratch = state.split_scratch(scratch_numbers)
    for step in range(n_steps):
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
        # Find the contacts, and add their forces to the loads of the bodies.
        update_pair_lists(bodies, pairs, clumps, counts, grid, physics, scratch, ghost)
        apply_pair_forces(
            bodies, pairs, clumps, counts, grid, physics, contact_tile, ghost
        )
        process_wall_contacts(
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
        # Move the bodies under these loads.
        counts[state.STEPS] += 1
        n_events = integrate(
            bodies, counts, physics, body_tile, 0, counts[state.N_BODIES]
        )
        time = counts[state.STEPS] * physics.dt
        handle_events(bodies, grid, counts, 0, n_events, time)
    return n_steps


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
    scratch_numbers,
    ghost,
):
    """Add the forces of the present state to `walls.loads`, without a time step.

    The other arrays change as they do in a step.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes or ()
        The features of all meshes; an empty tuple if no wall is a mesh.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    contact_tile : array
        Scratch tile of LANES contacts (rows of `tile`); it is overwritten.
    scratch_numbers : array (SCRATCH,)
        Memory of the other scratch arrays (`state.Scratch`).
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    scratch = state.split_scratch(scratch_numbers)
    process_wall_contacts(
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
