"""Names of the angle of repose, by its definitions, and of their responses."""

DEFINITIONS = ("flank", "secant", "steepest", "whole", "straightest")

# Response of each definition: the mean over all views
MEAN_KEYS = {name: f"aor_{name}_deg" for name in DEFINITIONS}
# Response of each definition: the first view alone, as a camera sees it
VIEW_KEYS = {name: f"aor_{name}_view_deg" for name in DEFINITIONS}
# Response that repeats one of them: the definition named by `measure.response`
CALIBRATED_ANGLE = "aor_deg"
