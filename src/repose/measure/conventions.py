"""Units of length and names of directions in a file of particles."""

# Metres in a unit of length.
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
# Directions that may point up, by name.
DIRECTIONS = {
    "x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
