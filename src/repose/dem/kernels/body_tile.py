"""Rows of the scratch tile in which one tile of bodies is moved."""

from . import state as st
from .rows import L

# The columns of `rows` and of `load` (see `state`), then the results of the step.
ROWS = 0
OMEGA = ROWS + st.ANGULAR_VELOCITY * L
INVERSE_INERTIA = ROWS + st.INVERSE_INERTIA * L
LOAD = 40 * L
PATH = 48 * L  # how far the farthest point of the body may have moved
BEFORE = 49 * L  # height before the step
MORE = 50 * L  # another share of the loads
TILE_ROWS = 58
