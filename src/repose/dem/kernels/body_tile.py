"""Rows of the scratch tile in which the bodies of a tile are moved."""

from . import state as st
from .state import LANES

L = LANES  # short, for the index arithmetic

# The columns of `rows` and of `load` (see `state`), then what the step finds.
ROWS = 0
OMEGA = ROWS + st.ANGULAR_VELOCITY * L
LOAD = 32 * L
PATH = 40 * L  # how far the farthest point of the body may have moved
BEFORE = 41 * L  # height before the step
INVERSE_INERTIA = 42 * L  # inverse inertia (world) as xx, xy, xz, yy, yz, zz
MORE = 48 * L  # another share of the loads
TILE_ROWS = 56
