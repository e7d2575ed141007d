"""The discrete element engine: shapes, contacts, walls and time; it knows nothing of calibration."""

from .materials import Contact, Material
from .simulation import Simulation, rotation_matrix, walls_of

__all__ = ["Contact", "Material", "Simulation", "rotation_matrix", "walls_of"]
