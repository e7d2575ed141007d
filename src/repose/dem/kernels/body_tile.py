"""Rows of the scratch tile in which `rigid` moves 32 bodies by one step.

The first rows are copies of the columns of `Bodies.rows`. The rows of the loads follow,
then numbers that only this step needs. See `rows` for the layout of a tile.
"""

from . import state
from .rows import LANES

ROWS = 0  # one row for each column of `Bodies.rows`, see `state`
OMEGA = ROWS + state.ANGULAR_VELOCITY * LANES
INVERSE_INERTIA = ROWS + state.INVERSE_INERTIA * LANES
LOAD = 40 * LANES  # one row for each column of `Bodies.load`: the sum over all shares
TORQUE = LOAD + state.TORQUE * LANES
PATH = 48 * LANES  # upper bound of the path of any point of the body in this step [m]
HEIGHT_BEFORE = 49 * LANES  # height of the centre before the step [m]
SHARE_LOAD = 50 * LANES  # the loads of one share, before they are added to LOAD
TILE_ROWS = 58
