"""Renewal of the neighbour list: bodies that moved far get new pairs, bodies that are gone lose theirs.

`clumps` is empty in a simulation of smooth bodies, see `forces`.
"""

from . import state as st
from .clumps import chain_entries, drop_entries_of_gone
from .forces import drop_touch
from .jit import inlined, kernel
from .neighbours import (
    chain_contacts,
    drop_contact,
    drop_near_of_moved,
    link,
    list_pair,
    unlink,
)
from .rigid import take_away
from .sphere_search import list_clumps


@inlined
def list_bodies(bodies, pairs, clumps, counts, grid, parts, i, j, room):
    """List the pair of two bodies where they touch or are near; room: scratch for a normal, or the spheres of both."""
    if len(clumps) == 0:
        list_pair(bodies, pairs, counts, grid, parts, i, j, room)
    else:
        list_clumps(bodies, pairs, counts, grid, clumps, i, j, room)


@kernel
def find_partners(bodies, pairs, clumps, counts, grid, parts, i, room):
    """List the pairs of body i anew, except with bodies marked with i: these are listed already."""
    cell = grid.cell[i]
    kz = cell % grid.shape[2]
    ky = (cell // grid.shape[2]) % grid.shape[1]
    kx = cell // (grid.shape[2] * grid.shape[1])
    nx, ny, nz = grid.shape[0], grid.shape[1], grid.shape[2]
    # the cell before, its own and the next; of fewer than three cells each once
    for ax in range(min(nx, 3)):
        cx = (kx + ax - 1) % nx
        for ay in range(min(ny, 3)):
            cy = (ky + ay - 1) % ny
            for az in range(min(nz, 3)):
                cz = (kz + az - 1) % nz
                j = grid.head[(cx * ny + cy) * nz + cz]
                while j >= 0:
                    # two bodies that both moved find each other once
                    if (
                        j != i
                        and grid.mark[j] != i
                        and not (grid.moved[j] == 1 and j < i)
                    ):
                        list_bodies(
                            bodies,
                            pairs,
                            clumps,
                            counts,
                            grid,
                            parts,
                            min(i, j),
                            max(i, j),
                            room,
                        )
                    j = grid.following[j]


@inlined
def mark_partners(pairs, grid, i, mark):
    """Mark all bodies that are listed in a pair with body i with the number `mark`."""
    k = grid.chain[i]
    while k >= 0:
        grid.mark[pairs.partner[k]] = mark
        k = pairs.link[k]


@kernel
def renew(bodies, pairs, clumps, counts, grid, parts, room, ghost):
    """List anew the pairs of the bodies that moved far; touching pairs stay, and so do the entries of clumps."""
    n_moved = counts[st.N_MOVED]
    if n_moved == 0:
        return
    if len(clumps) == 0:
        drop_near_of_moved(pairs, counts, grid)
    for m in range(n_moved):
        i = grid.moved_list[m]
        unlink(grid, i)
        if bodies.presence[i] == st.PRESENT:
            link(grid, bodies, i)
    if len(clumps) == 0:
        chain_contacts(pairs, counts, grid)
    else:
        chain_entries(pairs, counts, grid, ghost)
    for m in range(n_moved):
        i = grid.moved_list[m]
        if bodies.presence[i] == st.PRESENT:
            mark_partners(pairs, grid, i, i)
            find_partners(bodies, pairs, clumps, counts, grid, parts, i, room)
            mark_partners(pairs, grid, i, -1)
    for m in range(n_moved):
        i = grid.moved_list[m]
        grid.moved[i] = 0
        grid.chain[i] = -1
    counts[st.N_MOVED] = 0


@inlined
def drop_pairs_of_gone(bodies, pairs, clumps, counts, grid, ghost):
    """Drop the pairs of bodies that are gone."""
    presence = bodies.presence
    if len(clumps) == 0:
        for k in range(counts[st.N_PAIRS] - 1, -1, -1):
            if (
                presence[pairs.first[k]] != st.PRESENT
                or presence[pairs.second[k]] != st.PRESENT
            ):
                drop_contact(pairs, counts, grid, k, ghost)
    else:
        drop_entries_of_gone(bodies, pairs, counts, grid, clumps, ghost)


@inlined
def drop_touches_of_gone(presence, contacts, clumps, counts, slot, ghost):
    """Drop the contacts of bodies that are gone with walls of one kind."""
    for k in range(counts[slot] - 1, -1, -1):
        if presence[contacts.body[k]] != st.PRESENT:
            drop_touch(contacts, clumps, counts, slot, k, ghost)


@kernel
def drop_gone(bodies, pairs, flat, curved, meshed, clumps, counts, grid, ghost):
    """Drop all contacts of the bodies that went below the floor in the last step."""
    presence = bodies.presence
    drop_pairs_of_gone(bodies, pairs, clumps, counts, grid, ghost)
    drop_touches_of_gone(presence, flat, clumps, counts, st.N_PLANE, ghost)
    drop_touches_of_gone(presence, curved, clumps, counts, st.N_CURVED, ghost)
    drop_touches_of_gone(presence, meshed, clumps, counts, st.N_MESHED, ghost)
    for m in range(counts[st.N_MOVED]):
        if presence[grid.moved_list[m]] != st.PRESENT:
            take_away(bodies, grid.moved_list[m])
    counts[st.N_GONE] = 0
