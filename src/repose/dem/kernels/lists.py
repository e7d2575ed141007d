"""Contacts in tiles: write a contact, or move it."""

from . import state as st
from .jit import inlined
from .rows import L, write_vector


@inlined
def put_contact(data, k, nx, ny, nz):
    """Begin contact k with a normal; all else that the geometry and the force laws keep is zero."""
    tile, lane = data[k // L], k % L
    write_vector(tile, st.NORMAL, lane, nx, ny, nz)
    for row in range(st.PAIR_STATE, data.shape[1], L):
        tile[row + lane] = 0.0


@inlined
def move_contact(data, source, target):
    """Copy a contact over another."""
    for c in range(data.shape[1] // L):
        data[target // L, c * L + target % L] = data[source // L, c * L + source % L]
