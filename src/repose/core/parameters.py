"""The six contact parameters that are calibrated, in the order every table uses."""

import math

PARAMETERS = ("e_gg", "mus_gg", "mur_gg", "e_gp", "mus_gp", "mur_gp")

LABELS = {
    "e_gg": "restitution, goji-goji",
    "mus_gg": "static friction, goji-goji",
    "mur_gg": "rolling friction, goji-goji",
    "e_gp": "restitution, goji-PVC",
    "mus_gp": "static friction, goji-PVC",
    "mur_gp": "rolling friction, goji-PVC",
}

SYMBOLS = {
    "e_gg": r"$e_{gg}$",
    "mus_gg": r"$\mu_{s,gg}$",
    "mur_gg": r"$\mu_{r,gg}$",
    "e_gp": r"$e_{gp}$",
    "mus_gp": r"$\mu_{s,gp}$",
    "mur_gp": r"$\mu_{r,gp}$",
}

# What the contact law itself can take; a study's ranges lie inside (Table 2).
PHYSICAL_LIMITS = {name: (0.01, 1.0) if name.startswith("e_") else (0.0, math.inf) for name in PARAMETERS}
