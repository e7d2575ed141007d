"""Rows of the scratch tile `m` in which `rigid` moves 32 bodies by one step.

The first rows are copies of the columns of `Bodies.rows`, then come those of the loads,
then numbers that only this step needs. See `rows` for the layout of a tile.
"""

from . import state as st
from .rows import LANES

ROWS = 0  # one row for each column of `Bodies.rows`, see `state`
OMEGA = ROWS + st.ANGULAR_VELOCITY * LANES
INVERSE_INERTIA = ROWS + st.INVERSE_INERTIA * LANES
LOAD = 40 * LANES  # one row for each column of `Bodies.load`: the sum over all shares
TORQUE = LOAD + st.TORQUE * LANES
PATH = 48 * LANES  # bound of the motion of any point of the body in this step [m]
BEFORE = 49 * LANES  # height of the centre before the step [m]
MORE = 50 * LANES  # the loads of one share, before they are added to LOAD
TILE_ROWS = 58
