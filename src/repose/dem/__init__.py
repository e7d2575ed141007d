"""The discrete element engine: shapes, contacts, walls and time; it knows nothing of calibration."""

from .materials import Contact, Material
from .recorder import Recorder
from .rotations import rotation_matrices, rotation_matrix
from .shapes import Clump, Shape
from .simulation import Simulation
from .surfaces import Cone, Cylinder, Mesh, Motion, Plane, RingEdge
from .vtk import VtkSeries, write_vtk

__all__ = [
    "Clump",
    "Cone",
    "Contact",
    "Cylinder",
    "Material",
    "Mesh",
    "Motion",
    "Plane",
    "Recorder",
    "RingEdge",
    "Shape",
    "Simulation",
    "VtkSeries",
    "rotation_matrices",
    "rotation_matrix",
    "write_vtk",
]
