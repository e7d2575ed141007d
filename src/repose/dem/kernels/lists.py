"""Lists of contacts whose data lie in tiles: begin a contact, or move it in the list.

`data` is an array (tiles, rows * L), see `state.Pairs` and `state.WallContacts`. Contact
k of a list is lane k % L of tile k // L. The functions write `data` in place.
"""

from . import state as st
from .jit import inlined
from .rows import L, write_vector


@inlined
def put_contact(data, k, nx, ny, nz):
    """Begin contact k with a normal; set all other rows to zero."""
    tile = data[k // L]
    lane = k % L
    write_vector(tile, st.NORMAL, lane, nx, ny, nz)
    for row in range(st.PAIR_STATE, data.shape[1], L):
        tile[row + lane] = 0.0


@inlined
def move_contact(data, source, target):
    """Copy the numbers of contact `source` over those of contact `target`."""
    for row in range(data.shape[1] // L):
        data[target // L, row * L + target % L] = data[
            source // L, row * L + source % L
        ]
