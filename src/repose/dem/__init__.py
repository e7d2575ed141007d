"""The discrete element engine: shapes, contacts, walls and time; it knows nothing of calibration."""

from .materials import Contact, Material
from .shapes import Shape
from .simulation import Simulation, rotation_matrix
from .surfaces import Cone, Cylinder, Mesh, Motion, Plane, RingEdge

__all__ = [
    "Cone",
    "Contact",
    "Cylinder",
    "Material",
    "Mesh",
    "Motion",
    "Plane",
    "RingEdge",
    "Shape",
    "Simulation",
    "rotation_matrix",
]
