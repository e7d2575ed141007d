"""Names of the angle of repose, by its definitions, and of their responses."""

from typing import NamedTuple


class Definition(NamedTuple):
    """A definition of the angle: which line along the side of a pile has its slope."""

    # Whether the line follows the whole side. A line along a part of it is steeper,
    # because a pile has a rounded top and a tail at the foot.
    follows_whole_side: bool


# The properties of each definition, by its name. None has a default, so a new
# definition cannot lack one.
PROPERTIES = {
    "flank": Definition(follows_whole_side=False),
    "secant": Definition(follows_whole_side=True),
    "steepest": Definition(follows_whole_side=False),
    "whole": Definition(follows_whole_side=True),
    "straightest": Definition(follows_whole_side=False),
}
DEFINITIONS = tuple(PROPERTIES)

# Response of each definition: the mean over all views
MEAN_KEYS = {name: f"aor_{name}_deg" for name in DEFINITIONS}
# Response of each definition: the first view alone, as a camera sees it
VIEW_KEYS = {name: f"aor_{name}_view_deg" for name in DEFINITIONS}
# Response that repeats one of them: the definition named by `measure.response`
CALIBRATED_ANGLE = "aor_deg"
